"""What is measured on the committed state. Shares no code with the solvers: distances are taken from positions alone.

Maxima and sums are made in tiles of fixed size, tile by tile in order, so they do not depend on the number of threads.
"""

import math

import numpy as np
import warp as wp

from turnbuckle.compute import Program, host
from turnbuckle.data.state import GRAVITY, INVERSE_H, State
from turnbuckle.data.tables import ENTRIES
from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

TILE = 256
MEASURES = 11  # per tile of points, see `measure_points`


@wp.kernel
def nail_residuals(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.int32),
    goal: wp.array(dtype=vec3),
    rate: wp.array(dtype=vec3),
    moving: int,
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    position_out: wp.array(dtype=real),
    rate_out: wp.array(dtype=real),
):
    """Squared distance to the goal [m^2], and of the velocity to the goal's rate [m^2/s^2]."""
    c = known(begin + wp.tid())
    p = real(0.0)
    r = real(0.0)
    if phase[c] == 0 or phase[c] <= -2:
        i = known(point[c])
        p = wp.length_sq(x[i] - goal[c])
        if moving != 0:
            r = wp.length_sq(v[i] - rate[c])
        else:
            r = wp.length_sq(v[i])
    position_out[c] = p
    rate_out[c] = r


@wp.kernel
def join_residuals(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    offsets: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.int32),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    position_out: wp.array(dtype=real),
    rate_out: wp.array(dtype=real),
):
    """The largest squared distance of a point from the one before it in the row, of positions and velocities."""
    c = known(begin + wp.tid())
    p = real(0.0)
    r = real(0.0)
    if phase[c] == 0 or phase[c] <= -2:
        for e in range(known(offsets[c]) + 1, offsets[c + 1]):
            i = known(points[known(e)])
            j = known(points[known(e - 1)])
            p = wp.max(p, wp.length_sq(x[i] - x[j]))
            r = wp.max(r, wp.length_sq(v[i] - v[j]))
    position_out[c] = p
    rate_out[c] = r


@wp.kernel
def place_residuals(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    position_out: wp.array(dtype=real),
    rate_out: wp.array(dtype=real),
):
    """Squared distance of a point from its place on a line, triangle or tetrahedron, ``|x_0 - sum alpha_k x_k|^2``.

    Entries that a row does not use have weight 0.
    """
    c = known(begin + wp.tid())
    place = vec3()
    drift = vec3()
    if phase[c] == 0 or phase[c] <= -2:
        for k in range(ENTRIES):
            i = known(points[c, k])
            place += weights[c, k] * x[i]
            drift += weights[c, k] * v[i]
    position_out[c] = wp.length_sq(place)
    rate_out[c] = wp.length_sq(drift)


@wp.kernel
def slide_residuals(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    points: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=real),
    directions: wp.array(dtype=wp.mat33d),
    with_rate: int,
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    position_out: wp.array(dtype=real),
    rate_out: wp.array(dtype=real),
):
    """Squared distance of a sliding point from its place on the domain, and of its velocity off the domain.

    Inside a face, off means along the normal of the triangle as it is; on a line, off its tangent as it is; on edges,
    corners and rims along the held directions.
    """
    c = known(begin + wp.tid())
    p = real(0.0)
    r = real(0.0)
    if phase[c] == 0 or phase[c] <= -2:
        place = vec3()
        drift = vec3()
        edge = int(0)
        for k in range(count[c]):
            place += weights[c, k] * x[points[c, k]]
            drift += weights[c, k] * v[points[c, k]]
            if weights[c, k] == real(0.0):
                edge += 1
        p = wp.length_sq(place)
        if with_rate != 0:
            off = directions[c] * drift
            a = x[points[c, 1]]
            if edge == 0 and count[c] == 4:
                n = wp.normalize(wp.cross(x[points[c, 2]] - a, x[points[c, 3]] - a))
                off = n * wp.dot(n, drift)
            if edge == 0 and count[c] == 3:
                t = wp.normalize(x[points[c, 2]] - a)
                off = drift - t * wp.dot(t, drift)
            r = wp.length_sq(off)
    position_out[c] = p
    rate_out[c] = r


@wp.kernel
def velocity_residuals(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.int32),
    goal: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    rate_out: wp.array(dtype=real),
):
    """Squared distance of the velocity to its goal [m^2/s^2]."""
    c = known(begin + wp.tid())
    r = real(0.0)
    if phase[c] == 0 or phase[c] <= -2:
        r = wp.length_sq(v[point[c]] - goal[c])
    rate_out[c] = r


@wp.kernel
def tile_maxima(
    begin: int, position: wp.array(dtype=real), rate: wp.array(dtype=real), tile_out: wp.array2d(dtype=real)
):
    """The largest squared residuals of each tile of constraints; what is not a number gets through."""
    t = known(begin + wp.tid())
    p = real(0.0)
    r = real(0.0)
    for n in range(t * TILE, wp.min((t + 1) * TILE, position.shape[0])):
        c = known(n)
        p = wp.where(position[c] <= p, p, position[c])
        r = wp.where(rate[c] <= r, r, rate[c])
    tile_out[t, 0] = p
    tile_out[t, 1] = r


@wp.kernel
def tile_powers(
    begin: int,
    phase: wp.array(dtype=wp.int32),
    force: wp.array(dtype=vec3),
    goal: wp.array(dtype=vec3),
    goal_now: wp.array(dtype=vec3),
    speeds: int,
    params: wp.array(dtype=real),
    tile_out: wp.array(dtype=real),
):
    """The mean power over the step of nails (``speeds`` 0) or velocity goals (1) of each tile, force times the goal's way [W]."""
    t = known(begin + wp.tid())
    total = real(0.0)
    for c in range(t * TILE, wp.min((t + 1) * TILE, phase.shape[0])):
        if phase[c] != -1:
            if speeds != 0:
                total += real(0.5) * wp.dot(force[c], goal[c] + goal_now[c])
            else:
                total += wp.dot(force[c], goal[c] - goal_now[c]) * params[INVERSE_H]
    tile_out[t] = total


@wp.kernel
def internal_momentum(
    begin: int,
    mass: wp.array(dtype=real),
    external: wp.array(dtype=wp.uint8),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    tile_out: wp.array2d(dtype=real),
):
    """Linear and angular momentum of the points of each tile that no nail or velocity goal holds."""
    t = known(begin + wp.tid())
    px = real(0.0)  # numbers, not vectors: six sums stay in registers
    py = real(0.0)
    pz = real(0.0)
    lx = real(0.0)
    ly = real(0.0)
    lz = real(0.0)
    for n in range(t * TILE, wp.min((t + 1) * TILE, mass.shape[0])):
        i = known(n)
        m = wp.where(external[i] == wp.uint8(0), mass[i], real(0.0))
        mv = v[i] * m
        spin = wp.cross(x[i], mv)
        px += mv[0]
        py += mv[1]
        pz += mv[2]
        lx += spin[0]
        ly += spin[1]
        lz += spin[2]
    tile_out[t, 0] = px
    tile_out[t, 1] = py
    tile_out[t, 2] = pz
    tile_out[t, 3] = lx
    tile_out[t, 4] = ly
    tile_out[t, 5] = lz


@wp.kernel
def measure_points(
    begin: int,
    mass: wp.array(dtype=real),
    external: wp.array(dtype=wp.uint8),
    params: wp.array(dtype=real),
    x: wp.array(dtype=vec3),
    v: wp.array(dtype=vec3),
    tile_out: wp.array2d(dtype=real),
):
    """Kinetic energy, gravity energy, ``sum m|v|``, largest ``|x|^2`` and ``|v|^2`` of each tile, then what
    `internal_momentum` gives."""
    t = known(begin + wp.tid())
    g = vec3(params[GRAVITY], params[GRAVITY + 1], params[GRAVITY + 2])
    kinetic = real(0.0)
    potential = real(0.0)
    linear = real(0.0)
    farthest = real(0.0)
    fastest = real(0.0)
    px = real(0.0)
    py = real(0.0)
    pz = real(0.0)
    lx = real(0.0)
    ly = real(0.0)
    lz = real(0.0)
    for n in range(t * TILE, wp.min((t + 1) * TILE, mass.shape[0])):
        i = known(n)
        m = mass[i]
        xi = x[i]
        vi = v[i]
        v2 = wp.dot(vi, vi)
        x2 = wp.dot(xi, xi)
        kinetic += m * v2
        potential += m * wp.dot(g, xi)
        linear += m * wp.sqrt(v2)
        farthest = wp.where(x2 <= farthest, farthest, x2)  # a value that is not a number gets through
        fastest = wp.where(v2 <= fastest, fastest, v2)
        mv = vi * wp.where(external[i] == wp.uint8(0), m, real(0.0))
        spin = wp.cross(xi, mv)
        px += mv[0]
        py += mv[1]
        pz += mv[2]
        lx += spin[0]
        ly += spin[1]
        lz += spin[2]
    tile_out[t, 0] = real(0.5) * kinetic
    tile_out[t, 1] = -potential
    tile_out[t, 2] = linear
    tile_out[t, 3] = farthest
    tile_out[t, 4] = fastest
    tile_out[t, 5] = px
    tile_out[t, 6] = py
    tile_out[t, 7] = pz
    tile_out[t, 8] = lx
    tile_out[t, 9] = ly
    tile_out[t, 10] = lz


def tiles(n: int) -> int:
    """Number of tiles over n values."""
    return max(-(-n // TILE), 1)


class Certificate:
    """Records the measurements of a step and reads them out."""

    def __init__(self, state: State, points: int, device: str, finishes: bool) -> None:
        self.state = state
        self.device = device
        self.finishes = finishes  # the scheme completes its velocities after landing
        self.points = wp.zeros((tiles(points), MEASURES), dtype=real, device=device)
        self.before, self.landed, self.finished = (
            wp.zeros((tiles(points), 6), dtype=real, device=device) for _ in range(3)
        )
        self.maxima: dict[str, wp.array] = {}
        self.powers: dict[str, wp.array] = {}
        self.moving: set[str] = set()
        self._change = np.zeros(6)
        for kind, table in state.tables.by_kind().items():
            n = tiles(len(table.phase))
            self.maxima[kind] = wp.zeros((n, 2), dtype=real, device=device)
            self.powers[kind] = wp.zeros(n, dtype=real, device=device)

    def record_momentum(self, p: Program, mass: wp.array, x: wp.array, v: wp.array, when: str) -> None:
        """Record the momentum of points without external constraints: "before" constraints are met.

        A scheme that completes its velocities in between (velocity Verlet) also has "landed" and "finished"; `record` takes
        it at the end. What constraints change is ``(landed - before) + (end - finished)``.
        """
        p.launch(internal_momentum, self.before.shape[0], [mass, self.state.external, x, v, getattr(self, when)], TILE)

    def record(self, p: Program, mass: wp.array, x: wp.array, v: wp.array, lands_later: bool) -> None:
        """Record all measurements of the state ``(x, v)``."""
        given = [mass, self.state.external, self.state.params, x, v]
        p.launch(measure_points, self.points.shape[0], [*given, self.points], TILE)
        self.record_constraints(p, x, v, lands_later)
        p.barrier()
        for kind, table in self.state.tables.by_kind().items():
            if table.rows:
                out = self.maxima[kind]
                p.launch(tile_maxima, out.shape[0], [table.position_residual, table.rate_residual, out], TILE)

    def record_constraints(self, p: Program, x: wp.array, v: wp.array, lands_later: bool) -> None:
        """Record the residuals of all constraints, and the power of those that move."""
        tables = self.state.tables
        self.moving = moving = {g.kind for g in self.state.groups.values() if g.moving or g.kind == "velocity"}
        t = tables.nail
        if t.rows:
            goal = t.goal_now if lands_later else t.goal
            given = [t.phase, t.point, goal, t.rate, int("nail" in moving), x, v]
            p.launch(nail_residuals, len(t.phase), [*given, t.position_residual, t.rate_residual])
        if "nail" in moving:
            given = [t.phase, t.force, t.goal, t.goal_now, 0, self.state.params]
            p.launch(tile_powers, tiles(len(t.phase)), [*given, self.powers["nail"]], TILE)
        t = tables.points_to_point
        if t.rows:
            given = [t.phase, t.offsets, t.points, x, v]
            size = int(t.offsets.numpy()[t.rows]) // t.rows
            p.launch(join_residuals, len(t.phase), [*given, t.position_residual, t.rate_residual], size)
        t = tables.attach
        if t.rows:
            given = [t.phase, t.points, t.weights, x, v]
            p.launch(place_residuals, len(t.phase), [*given, t.position_residual, t.rate_residual])
        t = tables.slide
        if t.rows:
            given = [t.phase, t.count, t.points, t.weights, t.directions, int(not lands_later), x, v]
            p.launch(slide_residuals, len(t.phase), [*given, t.position_residual, t.rate_residual])
        t = tables.velocity
        if t.rows:
            p.launch(velocity_residuals, len(t.phase), [t.phase, t.point, t.goal, v, t.rate_residual])
            given = [t.phase, t.force, t.goal, t.goal_now, 1, self.state.params]
            p.launch(tile_powers, tiles(len(t.phase)), [*given, self.powers["velocity"]], TILE)

    def residuals(self, kind: str) -> tuple[float, float]:
        """Largest position residual [m] and rate residual [m/s] of fully active rows of a kind."""
        position, rate = np.sqrt(host(self.maxima[kind]).max(axis=0))
        return float(position), float(rate)

    def power(self) -> float:
        """Power of nails and velocity goals [W]."""
        return float(host(self.powers["nail"]).sum() + host(self.powers["velocity"]).sum()) if self.moving else 0.0

    def totals(self) -> tuple[float, float, float, float, float]:
        """Kinetic energy [J], gravity energy [J], sum m|v|, largest |x| and |v|; also keeps the momenta."""
        values = host(self.points)
        sums = values.sum(axis=0)
        between = (host(self.landed) - host(self.finished)).sum(axis=0) if self.finishes else 0.0
        self._change = sums[5:] - host(self.before).sum(axis=0) + between
        farthest, fastest = np.sqrt(values[:, 3:5].max(axis=0)).tolist()
        return (*sums[:3].tolist(), farthest, fastest)

    def momentum_error(self, linear: float, farthest: float) -> tuple[float, float]:
        """Change of momentum by internal constraints (after `totals`): over ``sum m|v|``, and angular over that times the
        largest |x|."""
        if linear <= 0.0 or farthest <= 0.0:
            return 0.0, 0.0
        px, py, pz, lx, ly, lz = self._change.tolist()
        return math.hypot(px, py, pz) / linear, math.hypot(lx, ly, lz) / (linear * farthest)
