"""The linear system of an implicit step, ``A = M - a D - b K`` (Contact, (2), (3)), in 3 x 3 blocks.

Backward Euler has ``a = h, b = h^2``: ``A (v* - v) = h (F + h K v)`` is (3) in terms of the change of velocity, and
``v*`` ends the step with ``x + h v*``. Newmark has ``a = h / 2, b = h^2 / 4`` and Newton iterations with F at their iterate.
K and D are the positive semi-definite Jacobians (``-K``, ``-D``) of `spring_blocks`, `bending`, `corotational` and
`energy_blocks`, so A is positive definite at any step size.

Unknowns come in blocks of three: points, then velocity and angular velocity (world axes, about the centre of mass) of
each rigid body, the world first. Rows of what has no mass of its own (points of rigid bodies, of obstacles; bodies that
are not dynamic) are those of the identity. Gyroscopic terms are the caller's.
"""

import numpy as np
import scipy.sparse as sp
import warp as wp

from turnbuckle.bodies.bending import hinge_system, upload_hinges
from turnbuckle.bodies.corotational import upload_corotational
from turnbuckle.bodies.corotational_blocks import BLOCKS, corotational_system
from turnbuckle.bodies.energy_blocks import area_system, volume_system
from turnbuckle.bodies.spring_blocks import spring_system
from turnbuckle.compute import Program, host
from turnbuckle.compute.program import PARALLEL
from turnbuckle.data.model import Model, Springs
from turnbuckle.data.rigid import DYNAMIC
from turnbuckle.linalg.block_gather import PatternArrays, gather_diagonal, gather_pairs
from turnbuckle.linalg.block_pattern import BlockPattern, grouped, make_pattern
from turnbuckle.math.index import known
from turnbuckle.math.rotation import turned_inertia
from turnbuckle.math.types import real, vec3

wp.set_module_options({"enable_backward": False})

mat33 = wp.mat33d
HINGE_PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
AREA_PAIRS = ((0, 1), (0, 2), (1, 2))


@wp.kernel
def gather_motion(
    begin: int,
    mass: wp.array(dtype=real),
    offsets: wp.array(dtype=wp.int32),
    slots: wp.array(dtype=wp.int32),
    element_force: wp.array(dtype=vec3),
    element_push: wp.array(dtype=vec3),
    coefficients: wp.array(dtype=real),
    force_out: wp.array(dtype=vec3),
    push_out: wp.array(dtype=vec3),
):
    """``F_i = m_i g + sum +-element_force`` [N] and ``(K v)_i`` [N/s]; ``~s`` subtracts slot s. Zero without mass."""
    i = known(begin + wp.tid())
    m = mass[i]
    f = vec3(coefficients[2], coefficients[3], coefficients[4]) * m
    p = vec3()
    if m > real(0.0):
        for k in range(offsets[i], offsets[i + 1]):
            slot = slots[known(k)]
            if slot < 0:
                f -= element_force[known(-slot - 1)]
                p -= element_push[known(-slot - 1)]
            else:
                f += element_force[known(slot)]
                p += element_push[known(slot)]
    force_out[i] = f
    push_out[i] = p


@wp.kernel
def rigid_system(
    begin: int,
    points: int,
    dynamic: wp.array(dtype=wp.int32),
    mass: wp.array(dtype=real),
    inertia: wp.array(dtype=vec3),
    damping: wp.array(dtype=wp.vec2d),
    q: wp.array(dtype=wp.quatd),
    v: wp.array(dtype=vec3),
    w: wp.array(dtype=vec3),
    coefficients: wp.array(dtype=real),
    diagonal: wp.array(dtype=wp.int32),
    force_out: wp.array(dtype=vec3),
    data_out: wp.array(dtype=mat33),
):
    """Blocks ``m (1 + a d) I`` and ``R J R^T (1 + a d)`` of a body with damping d [1/s], its weight and what damps it."""
    b = known(begin + wp.tid())
    zero = real(0.0)
    one = real(1.0)
    row = points + 2 * b
    if dynamic[b] == 0:
        eye = mat33(one, zero, zero, zero, one, zero, zero, zero, one)
        data_out[known(diagonal[row])] = eye
        data_out[known(diagonal[row + 1])] = eye
        force_out[row] = vec3()
        force_out[row + 1] = vec3()
        return
    decay = damping[b]
    m = mass[b] * (one + coefficients[0] * decay[0])
    data_out[known(diagonal[row])] = mat33(m, zero, zero, zero, m, zero, zero, zero, m)
    turn = wp.quat_to_matrix(q[b])
    j = inertia[b] * (one + coefficients[0] * decay[1])
    c0 = vec3(turn[0, 0], turn[1, 0], turn[2, 0])
    c1 = vec3(turn[0, 1], turn[1, 1], turn[2, 1])
    c2 = vec3(turn[0, 2], turn[1, 2], turn[2, 2])
    data_out[known(diagonal[row + 1])] = wp.outer(c0, c0) * j[0] + wp.outer(c1, c1) * j[1] + wp.outer(c2, c2) * j[2]
    gravity = vec3(coefficients[2], coefficients[3], coefficients[4])
    force_out[row] = (gravity - v[b] * decay[0]) * mass[b]
    force_out[row + 1] = turned_inertia(q[b], inertia[b], w[b]) * (-decay[1])


class ImplicitSystem:
    """Assembles A, F and K v of a model; see the top of this file.

    After :meth:`assemble`: `matrix` (scipy BSR, 3 x 3 blocks; on the CPU its data is a view that the next call changes),
    `force` and `push` (n, 3): F [N, N m] with gravity, and K v [N/s] (zero for rigid bodies).
    """

    def __init__(
        self, model: Model, threads: int | None = None, stretched: bool = True, parallel_from: int = PARALLEL
    ) -> None:
        """``stretched``: corotational elements get the tension part of their stiffness (`bodies.corotational_blocks`);
        ``threads``, ``parallel_from`` as in `turnbuckle.compute.Program`."""
        self.model = model
        self.bodies = model.rigid.count
        self.n = model.points + 2 * self.bodies
        self._device = model.device
        own = np.zeros(self.n)
        own[: model.points] = np.maximum(model.mass, 0.0)
        self.x, self.v = (wp.zeros(max(model.points, 1), dtype=wp.vec3d, device=self._device) for _ in range(2))
        self.rigid_v, self.rigid_w = (wp.zeros(self.bodies, dtype=wp.vec3d, device=self._device) for _ in range(2))
        self.q = wp.array(np.tile([0.0, 0.0, 0.0, 1.0], (self.bodies, 1)), dtype=wp.quatd, device=self._device)
        self.coefficients = wp.zeros(5, dtype=wp.float64, device=self._device)
        self._mass = self._put(own, wp.float64)
        self._program = Program(self._device, threads)
        self._assembled = False
        self._energies: list[wp.array] = []
        self._powers: list[wp.array] = []
        self._record(own, stretched)
        self.threads = self._program.finish(parallel_from).threads

    # Set-up --------------------------------------------------------------------------------------------------------

    def _put(self, values: np.ndarray, kind: object) -> wp.array:
        return wp.array(np.ascontiguousarray(values), dtype=kind, device=self._device)

    def _zeros(self, n: int, kind: object) -> wp.array:
        return wp.zeros(max(int(n), 1), dtype=kind, device=self._device)

    def _record(self, own: np.ndarray, stretched: bool) -> None:
        model, n = self.model, self.n
        springs, tets = _distances(model), model.tetrahedra
        hinges, solid = model.hinges, model.corotational
        of_area, of_volume = tets.materials[tets.triangle_material], tets.materials[tets.material]
        # Slots of forces: one a spring (on its second point), one a corner else.
        counts = [len(springs.pairs), 4 * len(hinges.points), 4 * len(solid.corners), 3 * len(tets.triangles)]
        first = np.cumsum([0, *counts, 4 * len(tets.corners)])
        corners = [hinges.points, solid.corners, tets.triangles, tets.corners]
        owners = np.concatenate([springs.pairs[:, 1], *(c.ravel() for c in corners), springs.pairs[:, 0]])
        slots = np.r_[np.arange(first[-1]), ~np.arange(counts[0])]
        offsets, order = grouped(owners, n)
        blocks, outer, outer_slots, first_vector = _couplings(springs, model)
        pattern = make_pattern(n, blocks, outer, outer_slots, own == 0.0)
        self.pattern: BlockPattern = pattern
        lists = self._lists(pattern)
        force, push = (self._zeros(first[-1], wp.vec3d) for _ in range(2))
        block, vector = self._zeros(len(blocks), wp.mat33d), self._zeros(first_vector[-1], wp.vec3d)
        self._data = self._zeros(pattern.stored, wp.mat33d)
        self._force, self._push = (self._zeros(n, wp.vec3d) for _ in range(2))
        p, x, v, c = self._program, self.x, self.v, self.coefficients

        def measures(m: int) -> list[wp.array]:
            self._energies.append(self._zeros(m, wp.float64))
            self._powers.append(self._zeros(m, wp.float64))
            return [self._energies[-1], self._powers[-1]]

        if len(solid.corners):
            given = [upload_corotational(solid, self._device), int(first[2]), len(springs.pairs), int(stretched)]
            out = [force, push, block, *measures(len(solid.corners))]
            p.launch(corotational_system, len(solid.corners), [*given, x, v, c, *out], grain=16)
        if len(springs.pairs):
            kinds = [
                (springs.pairs, wp.vec2i),
                *((a, wp.float64) for a in (1.0 / springs.length, springs.k, springs.k_d)),
            ]
            given = [self._put(a, kind) for a, kind in kinds]
            out = [force, push, block, *measures(len(springs.pairs))]
            p.launch(spring_system, len(springs.pairs), [*given, x, v, c, *out], grain=2)
        if len(hinges.points):
            given = [upload_hinges(hinges, model.rest, self._device), int(first[1]), int(first_vector[0])]
            out = [force, push, vector, *measures(len(hinges.points))]
            p.launch(hinge_system, len(hinges.points), [*given, x, v, c, *out], grain=4)
        for kernel, corner, kind, rest, k, k_d, slot, at in (
            (area_system, tets.triangles, wp.vec3i, tets.triangle_area, of_area[:, 1], of_area[:, 4], 3, 1),
            (volume_system, tets.corners, wp.vec4i, tets.volume, of_volume[:, 2], of_volume[:, 5], 4, 2),
        ):
            if len(corner):
                given = [self._put(corner, kind), *(self._put(a, wp.float64) for a in (rest, k, k_d))]
                out = [force, push, vector, *measures(len(corner))]
                given += [int(first[slot]), int(first_vector[at])]
                p.launch(kernel, len(corner), [*given, x, v, c, *out], grain=4)
        p.barrier()
        p.launch(gather_pairs, len(pattern.upper), [lists, block, vector, self._data], grain=2)
        given = [self._mass, self._put(offsets, wp.int32), self._put(slots[order].astype(np.int32), wp.int32)]
        p.launch(gather_motion, model.points, [*given, force, push, c, self._force, self._push], grain=2)
        p.barrier()
        p.launch(gather_diagonal, model.points, [lists, self._mass, self._data], grain=2)
        self._record_rigid(lists)
        self.matrix = sp.bsr_array(
            (host(self._data)[: pattern.nnz], pattern.indices, pattern.indptr), shape=(3 * n, 3 * n), copy=False
        )

    def _lists(self, pattern: BlockPattern) -> PatternArrays:
        lists = PatternArrays()
        for name in ("diagonal", "upper", "lower", "block_offsets", "block_slots", "row_offsets", "row_places"):
            setattr(lists, name, self._put(getattr(pattern, name), wp.int32))
        lists.outer_offsets = self._put(pattern.outer_offsets, wp.int32)
        lists.outer_slots = self._put(pattern.outer_slots, wp.vec2i)
        return lists

    def _record_rigid(self, lists: PatternArrays) -> None:
        rigid = self.model.rigid
        dynamic = self._put((rigid.motion == DYNAMIC).astype(np.int32), wp.int32)
        given = [dynamic, self._put(rigid.mass, wp.float64), self._put(rigid.inertia, wp.vec3d)]
        given += [self._put(rigid.damping, wp.vec2d), self.q, self.rigid_v, self.rigid_w, self.coefficients]
        out = [lists.diagonal, self._force, self._data]
        self._program.launch(rigid_system, self.bodies, [self.model.points, *given, *out])

    # Use -----------------------------------------------------------------------------------------------------------

    def assemble(
        self,
        x: np.ndarray,
        v: np.ndarray,
        h: float,
        alpha: float = 1.0,
        beta: float = 1.0,
        gravity: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0),
        rigid_q: np.ndarray | None = None,
        rigid_v: np.ndarray | None = None,
        rigid_w: np.ndarray | None = None,
    ) -> sp.bsr_array:
        """``A = M - alpha h D - beta h^2 K`` at positions ``x`` [m] and velocities ``v`` [m/s], (points, 3) each.

        ``rigid_q`` (bodies, 4) xyzw turns inertial frames into the world, ``rigid_v``, ``rigid_w`` (bodies, 3) are
        velocities [m/s], [rad/s]; those not given stay as they were. Returns `matrix`. Asked for once more with equal
        numbers it answers at once: a step that ends with a call at its committed state, for `elastic_energy` and
        `dissipation_power`, has the next one's matrix.
        """
        given = [
            (self.coefficients, np.array([alpha * h, beta * h * h, *gravity])),
            *((self.x, x), (self.v, v), (self.q, rigid_q), (self.rigid_v, rigid_v), (self.rigid_w, rigid_w)),
        ]
        changed = [(a, values) for a, values in given if values is not None and len(values) and not _same(a, values)]
        if self._assembled and not changed:
            return self.matrix
        for array, values in changed:
            array.assign(np.ascontiguousarray(values, dtype=np.float64))
        self._program.run()
        self._assembled = True
        if not self._data.device.is_cpu:
            self.matrix.data = self._data.numpy()[: self.pattern.nnz]
        return self.matrix

    @property
    def force(self) -> np.ndarray:
        """F (n, 3) of the last `assemble` [N], [N m] for rotations."""
        return host(self._force)

    @property
    def push(self) -> np.ndarray:
        """K v (n, 3) of the last `assemble` [N/s]."""
        return host(self._push)

    def right_side(self, h: float) -> np.ndarray:
        """``h (F + h K v)`` (3 n,) [N s], of backward Euler: ``A (v* - v)`` equals it."""
        return (h * self.force + (h * h) * self.push).ravel()

    def elastic_energy(self) -> float:
        """Of springs, bending and solids at the last `assemble` [J]."""
        return float(sum(host(e).sum() for e in self._energies))

    def dissipation_power(self) -> float:
        """What their damping takes at the last `assemble` [W]."""
        return float(sum(host(e).sum() for e in self._powers))


def _same(array: wp.array, values: np.ndarray) -> bool:
    """Whether an array on the device has these values."""
    return np.array_equal(host(array), values)


def _distances(model: Model) -> Springs:
    """Springs, and the edges of Teschner's solids, which are springs."""
    s, t = model.springs, model.tetrahedra
    of_edge = t.materials[t.edge_material]
    return Springs(
        np.concatenate([s.pairs, t.edges]),
        np.r_[s.length, t.edge_length],
        np.r_[s.k, of_edge[:, 0]],
        np.r_[s.k_d, of_edge[:, 3]],
    )


def _couplings(springs: Springs, model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points of stored blocks, of outer products, slots of their vectors, and where each kind's vectors begin."""
    tets = model.tetrahedra
    blocks = [springs.pairs, model.corotational.corners[:, BLOCKS].reshape(-1, 2)]
    kinds = ((model.hinges.points, HINGE_PAIRS, 1), (tets.triangles, AREA_PAIRS, 3), (tets.corners, HINGE_PAIRS, 1))
    outer, slots, first = [], [], [0]
    for corners, pairs, vectors in kinds:
        m, size = corners.shape
        place = first[-1] + np.arange(m * vectors * size).reshape(m, vectors, size)
        outer.append(np.repeat(corners[:, None, pairs], vectors, axis=1).reshape(-1, 2))
        slots.append(place[:, :, pairs].reshape(-1, 2))
        first.append(first[-1] + m * vectors * size)
    return np.concatenate(blocks), np.concatenate(outer), np.concatenate(slots), np.array(first)
