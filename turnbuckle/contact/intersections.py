"""Edges that cross faces: the check of a start, and of every committed state.

Orientations are decided in float64 where the error bound of Shewchuk 1997 allows, and in integers (`exact`) where it does
not, so the answer is that of exact arithmetic for the coordinates as given.
"""

import numpy as np
import warp as wp

from turnbuckle.compute.host import host
from turnbuckle.compute.program import Program
from turnbuckle.contact.broad import BroadPhase
from turnbuckle.contact.exact import edge_meets_triangle, to_integers
from turnbuckle.data.contact import Surfaces
from turnbuckle.math.types import vec3

wp.set_module_options({"enable_backward": False})

I32 = wp.array(dtype=wp.int32)
WORKERS = 64  # items of a launch on the CPU
RUN = 32  # pairs taken together
SMALL = 4096  # pairs below which one thread does it all

APART, MEET, DOUBT = 0, 1, 2


@wp.func_native(
    """
    const double *base = (const double *)x.data;
    const double *p = base + 3 * e0, *q = base + 3 * e1;
    const double *t[3] = {base + 3 * f0, base + 3 * f1, base + 3 * f2};
    // sign of the volume of (a, b, c) seen from d; 2: in doubt
    auto orient = [](const double *a, const double *b, const double *c, const double *d) {
        double u[3], v[3], w[3];
        for (int k = 0; k < 3; ++k) { u[k] = a[k] - d[k]; v[k] = b[k] - d[k]; w[k] = c[k] - d[k]; }
        for (int k = 0; k < 3; ++k)
            if (u[k] == 0.0 && v[k] == 0.0 && w[k] == 0.0) return 0;
        auto size = [](double s) { return s < 0.0 ? -s : s; };
        const double vw = v[0] * w[1], wv = w[0] * v[1], wu = w[0] * u[1], uw = u[0] * w[1], uv = u[0] * v[1],
                     vu = v[0] * u[1];
        const double volume = u[2] * (vw - wv) + v[2] * (wu - uw) + w[2] * (uv - vu);
        const double bound = 7.7715611723761e-16 * 1.0000001
            * ((size(vw) + size(wv)) * size(u[2]) + (size(wu) + size(uw)) * size(v[2]) + (size(uv) + size(vu)) * size(w[2]));
        if (!(bound > 1e-270)) return 2;  // products may have vanished
        return volume > bound ? 1 : -volume > bound ? -1 : 2;
    };
    const int sp = orient(t[0], t[1], t[2], p), sq = orient(t[0], t[1], t[2], q);
    if (sp != 2 && sp != 0 && sp == sq) return 0;
    if (!touching && (sp == 0 || sq == 0)) return 0;
    bool positive = false, negative = false, sure = sp != 2 && sq != 2 && sp != 0 && sq != 0;
    for (int k = 0; k < 3; ++k) {
        const int s = orient(t[k], t[k == 2 ? 0 : k + 1], p, q);
        positive = positive || s == 1;
        negative = negative || s == -1;
        sure = sure && s != 2 && s != 0;
    }
    if (positive && negative) return 0;
    if (sure) return 1;
    // in doubt: apart for sure if their shadows on a plane of coordinates are, along a line through two of the corners
    for (int i = 0; i < 3; ++i) {
        const int j = i == 2 ? 0 : i + 1;
        auto turn = [&](const double *a, const double *b, const double *c) {
            const double l = (a[i] - c[i]) * (b[j] - c[j]), r = (a[j] - c[j]) * (b[i] - c[i]);
            const double bound = 3.33066907387547e-16 * 1.0000001 * ((l < 0.0 ? -l : l) + (r < 0.0 ? -r : r));
            if (!(bound > 1e-270)) return 0;
            return l - r > bound ? 1 : r - l > bound ? -1 : 0;
        };
        const int s0 = turn(p, q, t[0]), s1 = turn(p, q, t[1]), s2 = turn(p, q, t[2]);
        if (s0 != 0 && s0 == s1 && s0 == s2) return 0;
        for (int k = 0; k < 3; ++k) {
            const double *a = t[k], *b = t[(k + 1) % 3], *c = t[(k + 2) % 3];
            const int in = turn(a, b, c);
            if (in != 0 && turn(a, b, p) == -in && turn(a, b, q) == -in) return 0;
        }
    }
    return 2;
"""
)
def _judge(
    x: wp.array(dtype=vec3), e0: int, e1: int, f0: int, f1: int, f2: int, touching: int
) -> int: ...  # fmt: skip


@wp.kernel
def judge(
    begin: int,
    count: I32,
    edge: I32,
    face: I32,
    x: wp.array(dtype=vec3),
    edges: I32,
    faces: I32,
    touching: I32,
    workers: int,
    run: int,
    verdict_out: wp.array(dtype=wp.uint8),
):
    """Whether pairs meet: 0 no, 1 yes, 2 in doubt."""
    n = count[0]
    i = (begin + wp.tid()) * run
    while i < n:
        for j in range(i, wp.min(i + run, n)):
            e = edge[j]
            f = face[j]
            verdict_out[j] = wp.uint8(
                _judge(x, edges[2 * e], edges[2 * e + 1], faces[3 * f], faces[3 * f + 1], faces[3 * f + 2], touching[0])
            )
        i += workers * run


class Intersections:
    """Finds crossings on one device; keeps its buffers between calls. ``moves`` as for `BroadPhase`."""

    def __init__(
        self, surfaces: Surfaces, device: str = "cpu", moves: np.ndarray | None = None, threads: int | None = None
    ) -> None:
        self.surfaces, self.device, self.threads = surfaces, device, threads
        self.broad = BroadPhase(surfaces, device, "bvh", moves, threads, edge_face=True)
        self._x = wp.zeros(surfaces.vertices, dtype=vec3, device=device)
        self._count = wp.zeros(1, dtype=wp.int32, device=device)
        self._touching = wp.zeros(1, dtype=wp.int32, device=device)
        self._capacity = 0
        self._programs: list[Program] = []

    def find(self, x: np.ndarray, touching: bool = True) -> np.ndarray:
        """Edges and faces that meet at positions ``x`` (s, 3) [m]: (k, 2) int32, sorted by edge, then face.

        Left out: those that share a vertex, those of bodies that do not collide, those of which neither moves. With
        ``touching`` a single common point counts, otherwise the ends of the edge must lie on different sides of the
        face, neither in its plane.
        """
        x = np.asarray(x, dtype=np.float64)
        edge, face = self.broad.edges_near_faces(x)
        n = len(edge)
        if n == 0:
            return np.zeros((0, 2), dtype=np.int32)
        if n > self._capacity:
            self._record(max(4096, n + n // 2))
        puts = (
            (self._x, x),
            (self._count, [n]),
            (self._touching, [int(touching)]),
            (self._edge, edge),
            (self._face, face),
        )
        for array, value in puts:
            if array.device.is_cpu:
                host(array)[: len(value)] = value
            else:
                wp.copy(array, wp.array(value, dtype=array.dtype, device="cpu"), count=len(value))
        self._programs[n >= SMALL].run()
        verdict = host(self._verdict)[:n].copy()
        s = self.surfaces
        for k in np.flatnonzero(verdict == DOUBT):  # rare: touching, or apart by round-off
            points = to_integers(x[np.concatenate([s.edges[edge[k]], s.faces[face[k]]])])
            verdict[k] = edge_meets_triangle(points, touching)
        met = verdict == MEET
        return np.column_stack([edge[met], face[met]])

    def _record(self, capacity: int) -> None:
        """Buffers for so many pairs, and the programs on them: for few pairs on one thread, for many on all."""
        self._capacity = capacity
        workers, run = (capacity, 1) if wp.get_device(self.device).is_cuda else (WORKERS, RUN)
        self._edge = wp.zeros(capacity, dtype=wp.int32, device=self.device)
        self._face = wp.zeros(capacity, dtype=wp.int32, device=self.device)
        self._verdict = wp.zeros(capacity, dtype=wp.uint8, device=self.device)
        inputs = [
            self._count, self._edge, self._face, self._x, self.broad.edges.features.corners,
            self.broad.faces.features.corners, self._touching, workers, run, self._verdict,
        ]  # fmt: skip
        self._programs = []
        for threads in (1, self.threads):
            program = Program(self.device, threads)
            program.launch(judge, workers, inputs, 1000)
            self._programs.append(program.finish(0))


def intersections(
    surfaces: Surfaces,
    x: np.ndarray,
    moves: np.ndarray | None = None,
    touching: bool = True,
    device: str = "cpu",
) -> np.ndarray:
    """`Intersections` for a single call: (k, 2) edges and faces that meet."""
    return Intersections(surfaces, device, moves).find(x, touching)
