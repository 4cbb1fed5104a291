"""From pairs to contacts: those nearer than a reach, each place once, ghosts left out (Contact, 3.2 (i)).

>>> near = Proximity(surfaces)
>>> contacts = near.contacts(pairs, x, reach)
"""

import numpy as np
import warp as wp

from turnbuckle.compute.host import host
from turnbuckle.compute.program import Program
from turnbuckle.contact.closest import SLOT, closest_edge_edge, closest_vertex_face
from turnbuckle.contact.manifold import no_contacts
from turnbuckle.contact.neighbourhood import Neighbourhood, make_neighbourhood
from turnbuckle.contact.normal_cone import edges_meet, vertex_meets_edge, vertex_meets_face, vertices_meet
from turnbuckle.contact.repeats import first_of_each
from turnbuckle.contact.touching import touching_normals
from turnbuckle.data.contact import Contacts, Pairs, Surfaces
from turnbuckle.data.errors import InputError
from turnbuckle.math.types import vec3

wp.set_module_options({"enable_backward": False})

F64 = wp.array(dtype=wp.float64)
I32 = wp.array(dtype=wp.int32)

WORKERS = 64  # items of a launch on the CPU, each takes every 64th run of pairs; on CUDA one thread a pair
RUN = 32  # pairs taken together
SMALL = 4096  # pairs below which one thread does it all


@wp.func_native(
    """
    // boxes of the two sides apart by more than the reach: not a contact
    const double *base = (const double *)x.data;
    const double *p[4] = {base + 3 * v0, base + 3 * v1, base + 3 * v2, base + 3 * v3};
    for (int i = 0; i < 3; ++i) {
        double la = p[0][i], ua = la, lb = p[3][i], ub = lb;
        if (first == 2) {
            la = p[1][i] < la ? p[1][i] : la;
            ua = p[1][i] > ua ? p[1][i] : ua;
        } else {
            lb = p[1][i] < lb ? p[1][i] : lb;
            ub = p[1][i] > ub ? p[1][i] : ub;
        }
        lb = p[2][i] < lb ? p[2][i] : lb;
        ub = p[2][i] > ub ? p[2][i] : ub;
        if (la - ub > far || lb - ua > far) return 1;
    }
    return 0;
"""
)
def _apart(x: wp.array(dtype=vec3), far: wp.float64, v0: int, v1: int, v2: int, v3: int, first: int) -> int: ...


@wp.func
def _face_place(x: wp.array(dtype=vec3), near: Neighbourhood, scratch: F64, slot: int, v: int, f: int, mask: int):
    """Whether a vertex and a place on the border of a face are a contact."""
    corner = mask >> 1
    if corner == 1 or corner == 2 or corner == 4:
        return vertices_meet(x, near, scratch, slot, v, near.faces[3 * f + (corner >> 1)], wp.float64(1.0))
    side = 0  # from corner `side` to the next: 3, 6 and 5 in turn
    if corner == 6:
        side = 1
    if corner == 5:
        side = 2
    e = near.face_edges[3 * f + side]
    if e < 0:
        return True
    return vertex_meets_edge(x, near, scratch, slot, v, e, wp.float64(1.0))


@wp.func
def _edge_place(x: wp.array(dtype=vec3), near: Neighbourhood, scratch: F64, slot: int, a: int, b: int, mask: int):
    """Whether places on two edges, not both inside, are a contact."""
    on_a = mask & 3
    on_b = mask >> 2
    if on_a == 3:
        return vertex_meets_edge(x, near, scratch, slot, near.edges[2 * b + (on_b >> 1)], a, wp.float64(-1.0))
    v = near.edges[2 * a + (on_a >> 1)]
    if on_b == 3:
        return vertex_meets_edge(x, near, scratch, slot, v, b, wp.float64(1.0))
    return vertices_meet(x, near, scratch, slot, v, near.edges[2 * b + (on_b >> 1)], wp.float64(1.0))


@wp.func
def _keep(
    x: wp.array(dtype=vec3), reach: wp.float64, near: Neighbourhood, kind: int, a: int, b: int, scratch: F64, slot: int
):
    """0: not a contact; 1: a contact that no other pair can be; 2: one that others may be as well."""
    v0 = a
    v1 = int(0)
    v2 = int(0)
    v3 = int(0)
    first = int(1)
    if kind == 0:
        v1 = near.faces[3 * b]
        v2 = near.faces[3 * b + 1]
        v3 = near.faces[3 * b + 2]
    else:
        first = 2
        v0 = near.edges[2 * a]
        v1 = near.edges[2 * a + 1]
        v2 = near.edges[2 * b]
        v3 = near.edges[2 * b + 1]
    if _apart(x, reach, v0, v1, v2, v3, first) != 0:
        return 0
    mask = int(0)
    if kind == 0:
        mask = closest_vertex_face(x, v0, v1, v2, v3, scratch, slot)
    else:
        mask = closest_edge_edge(x, v0, v1, v2, v3, scratch, slot)
    s = SLOT * slot
    if scratch[s + 7] >= reach:
        return 0
    unique = wp.where(mask == 15, 1, 2)
    if scratch[s + 7] <= wp.float64(1e-14) * scratch[s + 8]:
        return unique + 2  # touching: there is no direction yet
    kept = True
    if kind == 0:
        if mask != 15:
            kept = _face_place(x, near, scratch, slot, a, b, mask)
        else:
            kept = vertex_meets_face(x, near, scratch, slot, a)
    elif mask == 15:
        kept = edges_meet(x, near, scratch, slot, a, b)
    else:
        kept = _edge_place(x, near, scratch, slot, a, b, mask)
    if kept:
        return unique
    return 0


@wp.kernel
def find_contacts(
    begin: int,
    count: I32,
    kind: I32,
    a: I32,
    b: I32,
    x: wp.array(dtype=vec3),
    reach: F64,
    delta: F64,
    of_delta: F64,
    near: Neighbourhood,
    workers: int,
    run: int,
    scratch: F64,
    keep_out: wp.array(dtype=wp.uint8),
    place_out: wp.array2d(dtype=wp.float64),
):
    """Which pairs are contacts, and their coefficients, normal and distance (n, 8).

    They must be nearer than ``of_delta`` of the mean delta of their sides, or, where that is 0, than their ``reach``.
    """
    worker = begin + wp.tid()
    n = count[0]
    i = worker * run
    while i < n:
        for j in range(i, wp.min(i + run, n)):
            within = reach[j]
            if of_delta[0] > wp.float64(0.0):
                other = near.faces[3 * b[j]]
                own = a[j]
                if kind[j] == 1:
                    other = near.edges[2 * b[j]]
                    own = near.edges[2 * a[j]]
                within = of_delta[0] * wp.float64(0.5) * (delta[own] + delta[other])
            keep = _keep(x, within, near, kind[j], a[j], b[j], scratch, worker)
            keep_out[j] = wp.uint8(keep)
            if keep > 0:
                for k in range(8):
                    place_out[j, k] = scratch[SLOT * worker + k]
        i += workers * run


class Proximity:
    """Makes contacts of pairs on one device; keeps its buffers between calls."""

    def __init__(self, surfaces: Surfaces, device: str = "cpu", threads: int | None = None) -> None:
        self.surfaces, self.device, self.threads = surfaces, device, threads
        self.near = make_neighbourhood(surfaces, device)
        n = surfaces.vertices
        self._x = wp.zeros(n, dtype=vec3, device=device)
        self._count = wp.zeros(1, dtype=wp.int32, device=device)
        self._delta = wp.array(surfaces.delta, dtype=wp.float64, device=device)
        self._of_delta = wp.zeros(1, dtype=wp.float64, device=device)
        self._capacity = 0
        self._programs: list[Program] = []

    def contacts(self, pairs: Pairs, x: np.ndarray, reach: float | np.ndarray = 0.0, of_delta: float = 0.0) -> Contacts:
        """Contacts among ``pairs`` at positions ``x`` (s, 3) [m].

        ``reach`` [m], one or one a pair: what they must be nearer than; or ``of_delta``, a part of the mean delta of both
        sides. The order is that of the pairs. Contacts that several pairs share (at an edge or a vertex) are kept once,
        with the first pair. `normal_cone` says which are left out.
        """
        x = np.asarray(x, dtype=np.float64)
        if x.shape != (self.surfaces.vertices, 3):
            raise InputError(f"proximity: positions have shape {x.shape}; give ({self.surfaces.vertices}, 3)")
        n = pairs.count
        if n == 0:
            return no_contacts()
        if n > self._capacity:
            self._record(max(4096, n + n // 2))
        if np.ndim(reach) and np.shape(reach) != (n,):
            raise InputError(
                f"proximity: 'reach' has shape {np.shape(reach)}; give one number or one for each of {n} pairs"
            )
        self._put(self._x, x)
        self._put(self._of_delta, np.array([of_delta]))
        if of_delta == 0.0:
            self._put(self._reach, np.broadcast_to(np.asarray(reach, dtype=np.float64), n))
        self._put(self._count, np.array([n], dtype=np.int32))
        for array, value in zip(self._pairs, (pairs.kind, pairs.a, pairs.b), strict=True):
            self._put(array, value)
        self._programs[n >= SMALL].run()
        keep = host(self._keep)[:n]
        chosen = np.flatnonzero(keep)
        keep = keep[chosen]
        place = host(self._place)[chosen]
        kind, a, b = pairs.kind[chosen], pairs.a[chosen], pairs.b[chosen]
        vertices = self._vertices(kind, a, b)
        first = first_of_each(vertices, place[:, :4], (keep & 1) == 0)
        if not first.all():
            keep, place, kind, a, b, vertices = (v[first] for v in (keep, place, kind, a, b, vertices))
        normal = np.ascontiguousarray(place[:, 4:7])
        touching = np.flatnonzero(keep >= 3)
        if len(touching):
            normal[touching] = touching_normals(
                self.surfaces, x, kind[touching], a[touching], b[touching], vertices[touching], place[touching]
            )
        coefficients = np.ascontiguousarray(place[:, :4])
        return Contacts(kind, a, b, vertices, coefficients, normal, place[:, 7].copy(), np.zeros(len(kind)))

    def _vertices(self, kind: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The four vertices of each pair."""
        out = np.empty((len(kind), 4), dtype=np.int32)
        split = int(np.searchsorted(kind, 1)) if (np.diff(kind) >= 0).all() else None
        face = slice(0, split) if split is not None else kind == 0
        edge = slice(split, None) if split is not None else kind == 1
        out[face, 0] = a[face]
        out[face, 1:] = self.surfaces.faces[b[face]]
        out[edge, :2] = self.surfaces.edges[a[edge]]
        out[edge, 2:] = self.surfaces.edges[b[edge]]
        return out

    @staticmethod
    def _put(array: wp.array, value: np.ndarray) -> None:
        if array.device.is_cpu:
            host(array)[: len(value)] = value
        else:
            value = np.ascontiguousarray(value)
            wp.copy(array, wp.array(value, dtype=array.dtype, device="cpu"), count=len(value))

    def _record(self, capacity: int) -> None:
        """Buffers for so many pairs, and the programs on them: for few pairs on one thread, for many on all."""
        self._capacity = capacity
        on_gpu = wp.get_device(self.device).is_cuda
        workers, run = (capacity, 1) if on_gpu else (WORKERS, RUN)
        self._pairs = [wp.zeros(capacity, dtype=wp.int32, device=self.device) for _ in range(3)]
        self._reach = wp.zeros(capacity, dtype=wp.float64, device=self.device)
        self._keep = wp.zeros(capacity, dtype=wp.uint8, device=self.device)
        self._place = wp.zeros((capacity, 8), dtype=wp.float64, device=self.device)
        scratch = wp.zeros(workers * SLOT, dtype=wp.float64, device=self.device)
        inputs = [
            self._count, *self._pairs, self._x, self._reach, self._delta, self._of_delta, self.near, workers, run, scratch,
            self._keep, self._place,
        ]  # fmt: skip
        self._programs = []
        for threads in (1, self.threads):
            program = Program(self.device, threads)
            program.launch(find_contacts, workers, inputs, 1000)
            self._programs.append(program.finish(0))


def proximity(
    surfaces: Surfaces, pairs: Pairs, x: np.ndarray, reach: float | np.ndarray, device: str = "cpu"
) -> Contacts:
    """`Proximity` for a single call."""
    return Proximity(surfaces, device).contacts(pairs, x, reach)


def pair_delta(surfaces: Surfaces, contacts: Contacts) -> np.ndarray:
    """Distance that each contact keeps (n,) [m]: the mean of its two sides, each at the closest place."""
    return 0.5 * np.einsum("nk,nk->n", np.abs(contacts.coefficients), surfaces.delta[contacts.vertices])
