"""What friction does: slopes, sliding in any direction, redundant contacts, momentum; and edges of the problem."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from reference.contact_problem import World, add_cloth, add_cube, cloth_on_plane, rigid_pile
from reference.contact_qp import solve_frictionless

from turnbuckle.data.contact import ContactProblem
from turnbuckle.solvers.contact import friction_shapes
from turnbuckle.solvers.contact.anticipation import solve_anticipation
from turnbuckle.solvers.contact.ica import solve_ica
from turnbuckle.solvers.contact.residuals import contact_residuals

SOLVERS: dict[str, Callable] = {"ica": solve_ica, "anticipation": solve_anticipation}
G, H = 9.81, 0.01


def body_on_plane(kind: str, mu: float, gravity: np.ndarray, speed: np.ndarray = (0.0, 0.0, 0.0)) -> ContactProblem:
    """A rigid box or a cloth that rests on the plane z = 0 under the given gravity, with a velocity along the plane."""
    world = World(H, np.random.default_rng(5))
    if kind == "rigid":
        half = np.array([0.2, 0.2, 0.02])
        inertia = 3.0 / 3.0 * np.diag([half @ half - a * a for a in half])
        body = world.add_rigid(np.zeros(3), 3.0, inertia, np.array(speed), np.zeros(3))
        for corner in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            at = half * [*corner, -1]
            world.touch(world.place(body, at), {}, [0.0, 0.0, 1.0], 0.0, mu)
    else:
        for i in add_cloth(world, 6, np.zeros(3), stiffness=0.2).ravel():
            world.velocity[i] = np.array(speed)
            world.touch(world.place({i: 1.0}), {}, [0.0, 0.0, 1.0], 0.0, mu)
    masses = dict(world.inertia)
    world.force = [np.trace(masses[i]) / 3.0 * gravity if np.any(f) else f for i, f in enumerate(world.force)]
    return world.problem()


def slope(angle: float, direction: float) -> np.ndarray:
    """Gravity on a slope of the given angle that falls in the given direction of the plane."""
    return G * np.array([np.sin(angle) * np.cos(direction), np.sin(angle) * np.sin(direction), -np.cos(angle)])


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["rigid", "cloth"])
def test_slope_holds_below_the_friction_angle_and_slides_above(solver: str, kind: str) -> None:
    mu = 0.5
    for direction in (0.0, 0.7, 2.3, 4.1):
        below = SOLVERS[solver](body_on_plane(kind, mu, slope(np.arctan(0.99 * mu), direction)), tolerance=1e-11)
        assert below.converged and np.abs(below.velocity).max() < 1e-9
        angle = np.arctan(1.01 * mu)
        above = SOLVERS[solver](body_on_plane(kind, mu, slope(angle, direction)), tolerance=1e-11)
        gain = H * G * (np.sin(angle) - mu * np.cos(angle))
        expected = gain * np.array([np.cos(direction), np.sin(direction), 0.0])
        assert above.converged and np.abs(above.velocity[:3] - expected).max() < 1e-8


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("shape", ["cone", "pyramid4", "pyramid8", "pyramid16"])
def test_sliding_slows_alike_in_every_direction(solver: str, shape: str) -> None:
    """Pyramids are aligned to the motion, so that one contact at a time they are exact."""
    for direction in np.linspace(0.1, 5.1, 5):
        way = np.array([np.cos(direction), np.sin(direction), 0.0])
        problem = body_on_plane("cloth", 0.5, slope(0.0, 0.0), way)
        found = SOLVERS[solver](problem, tolerance=1e-11, friction_shape=shape)
        assert found.converged and np.abs(found.velocity.reshape(-1, 3) - (1.0 - 0.5 * G * H) * way).max() < 1e-8


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("sides", [4, 8, 16])
def test_corners_of_pyramids_hold_more(solver: str, sides: int) -> None:
    """A point pushed towards a corner: friction is mu / cos(pi / sides), 1.414 times for the paper's pyramid."""
    world = World(H, np.random.default_rng(0))
    block = int(world.add_points(np.zeros((1, 3)), np.ones(1), np.array([[1.0, 0.0, 0.0]]))[0])
    world.touch(world.place({block: 1.0}), {}, [0.0, 0.0, 1.0], 0.0, 0.5)
    problem = world.problem()
    way = friction_shapes.aligned_axes(problem)[0]
    turn = np.pi / sides
    axes = np.array([[np.cos(turn) * way[0] - np.sin(turn) * way[1], np.sin(turn) * way[0] + np.cos(turn) * way[1]]])
    found = SOLVERS[solver](problem, tolerance=1e-12, friction_shape=f"pyramid{sides}", axes=axes)
    assert found.converged
    slowed = np.hypot(*(found.velocity[:2] - [1.0, 0.0]))
    assert slowed == pytest.approx(0.5 * G * H / np.cos(np.pi / sides), rel=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_contacts_given_three_times_change_nothing(solver: str) -> None:
    problem = cloth_on_plane(n=5, mu=0.3, stiffness=2.0)
    once = SOLVERS[solver](problem, tolerance=1e-10)
    thrice = ContactProblem(
        a=problem.a,
        free=problem.free,
        j=sp.bsr_array(sp.vstack([problem.j] * 3), blocksize=(3, 3)),
        floor=np.tile(problem.floor, 3),
        friction=np.tile(problem.friction, 3),
    )
    found = SOLVERS[solver](thrice, tolerance=1e-10)
    assert found.converged and np.abs(found.velocity - once.velocity).max() < 1e-7


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_contacts_and_nothing_that_moves(solver: str) -> None:
    problem = rigid_pile(mu=0.4)
    empty = ContactProblem(
        a=problem.a, free=problem.free, j=sp.bsr_array((0, len(problem.free)), blocksize=(3, 3)), floor=np.zeros(0),
        friction=np.zeros(0), pairs=problem.pairs,
    )  # fmt: skip
    found = SOLVERS[solver](empty)
    assert found.converged and found.impulse.shape == (0, 3) and np.array_equal(found.velocity, problem.free)
    problem.fixed = np.zeros(len(problem.free) // 3, bool)
    problem.fixed[:2] = True  # the lowest box: its contacts with the ground can do nothing, and their gaps close
    problem.floor[:4] = -10.0
    found = SOLVERS[solver](problem, tolerance=1e-9)
    assert found.converged and np.array_equal(found.velocity[:6], problem.free[:6])
    assert not found.impulse[:4].any() and found.impulse[4:, 0].sum() > 0.0


def test_heavy_on_light_and_light_on_heavy() -> None:
    for ratio in (1e3, 1e-3):
        problem = rigid_pile(mu=0.0, ratio=ratio)
        full = solve_anticipation(problem)
        assert full.converged and np.abs(full.velocity - solve_frictionless(problem)).max() < 1e-6
    problem = rigid_pile(mu=0.5, ratio=1e-3)
    found = solve_ica(problem, tolerance=1e-8)
    assert found.converged and np.abs(found.velocity - solve_anticipation(problem).velocity).max() < 1e-6


@pytest.mark.parametrize("solver", SOLVERS)
def test_contacts_of_two_bodies_keep_both_momenta(solver: str) -> None:
    world = World(H, np.random.default_rng(2))
    half = np.array([0.2, 0.15, 0.1])
    bodies = []
    for x, v in ((np.zeros(3), np.zeros(3)), (np.array([0.05, 0.02, 0.2]), np.array([1.0, 0.5, -1.0]))):
        inertia = 2.0 / 3.0 * np.diag([half @ half - a * a for a in half])
        bodies.append(world.add_rigid(x, 2.0, inertia, v, world.rng.normal(size=3)))
    for corner in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        at = np.array([0.1 * corner[0], 0.1 * corner[1], 0.1])
        world.touch(world.place(bodies[1], at), world.place(bodies[0], at), [0.05, 0.0, 1.0], 0.0, 0.6)
    problem = world.problem()
    found = SOLVERS[solver](problem, tolerance=1e-12)
    change = (problem.a @ (found.velocity - problem.free)).reshape(-1, 3)
    assert found.converged and np.abs(change).max() > 0.1
    assert np.abs(change[::2].sum(axis=0)).max() < 1e-11
    places = np.array(world.position[::2])
    assert np.abs(change[1::2].sum(axis=0) + np.cross(places, change[::2]).sum(axis=0)).max() < 1e-11


@pytest.mark.parametrize("solver", SOLVERS)
def test_contact_never_adds_energy(solver: str) -> None:
    """With floors at zero, what contact does to the kinetic energy of A is never positive."""
    world = World(H, np.random.default_rng(4))
    grid = add_cube(world, 2, 0.2, np.zeros(3), 1e5)
    for i in grid[:, :, 0].ravel():
        world.touch(world.place({int(i): 1.0}), {}, [0.0, 0.0, 1.0], 0.0, 0.4)
    problem = world.problem()
    found = SOLVERS[solver](problem, tolerance=1e-10)
    energy = [0.5 * v @ (problem.a @ v) for v in (problem.free, found.velocity)]
    assert found.converged and energy[1] < energy[0]
    total = found.impulse.sum(axis=0)
    assert np.hypot(*total[1:]) <= 0.4 * total[0]


def test_residuals_name_what_is_wrong() -> None:
    problem = rigid_pile(mu=0.4)
    good = solve_anticipation(problem)
    v, r = good.velocity, good.impulse
    assert contact_residuals(problem, v, r).worst <= 1e-10
    moved, pulled, strong, turned = v.copy(), r.copy(), r.copy(), r.copy()
    moved[0] += 1e-3
    pulled[0, 0] = -1.0
    sliding = int(np.argmax(np.hypot(r[:, 1], r[:, 2])))
    strong[sliding, 1:] *= 3.0
    turned[sliding, 1:] *= -1.0
    assert contact_residuals(problem, moved, r).dynamics == pytest.approx(1e-3, rel=1e-6)
    assert contact_residuals(problem, v, pulled).complementarity > 1e-2
    assert contact_residuals(problem, v, strong).cone > 1e-3
    assert contact_residuals(problem, v, turned).cone < 1e-12 < 1e-3 < contact_residuals(problem, v, turned).direction
    problem.floor = problem.floor + 0.1
    assert contact_residuals(problem, v, r).gap == pytest.approx(0.1)
    assert contact_residuals(problem, v * np.nan, r).worst == np.inf


def test_projection_is_the_nearest_point() -> None:
    """Against brute force over the rim of each section."""
    rng = np.random.default_rng(1)
    p, radius = rng.normal(size=(40, 2)), rng.uniform(0.1, 1.0, 40)
    angle = rng.uniform(0.0, 2.0 * np.pi, 40)
    axes = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    around = np.linspace(0.0, 2.0 * np.pi, 20001)
    for count in (0, 4, 8, 16):
        got = friction_shapes.project(p, radius, count, axes)
        sector = 2.0 * np.pi / count if count else 1.0
        rim = 1.0 / np.cos((around + 0.5 * sector) % sector - 0.5 * sector) if count else np.ones_like(around)
        assert friction_shapes.project(got, radius * (1.0 + 1e-12), count, axes) == pytest.approx(got, abs=1e-12)
        for k in range(len(p)):
            ring = radius[k] * rim[:, None] * np.stack([np.cos(around + angle[k]), np.sin(around + angle[k])], axis=1)
            inside = np.allclose(got[k], p[k])
            nearest = np.linalg.norm(ring - p[k], axis=1).min()
            assert inside or np.linalg.norm(got[k] - p[k]) == pytest.approx(nearest, abs=1e-6)
