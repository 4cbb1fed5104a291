"""Continuous collision detection: pairs a second beside ipc-toolkit, and what the paper's cubic test misses.

The scene is four layers of cloth that wrinkle and slide over each other; the pairs are those of ipc-toolkit's broad
phase, the same for all. Both sides tell whether and when the step must stop, the other side for its smallest time of
all pairs alone.
"""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
from rich.console import Console

from turnbuckle.benchmarks.machine import load
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.contact.ccd_bulk import time_of_impact
from turnbuckle.contact.ccd_pairs import Ccd
from turnbuckle.data.contact import EDGE_EDGE, VERTEX_FACE, Pairs, Surfaces
from turnbuckle.data.errors import InputError

SIDE = 72  # vertices along a side of each sheet
LAYERS = 4
THREADS = 2
ROUNDS = 9  # of each measurement, in turn; the best counts
QUERIES = 200_000


def sheets(rng: np.random.Generator, motion: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3) at the start and at the end of the step [m], faces (f, 3). Sheets meet with a ``motion`` of 1."""
    line = np.linspace(0.0, 1.0, SIDE)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line, indexing="ij"))
    number = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    a, b, c, d = (number[i, j].ravel() for i, j in _corners())
    faces = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    height = [0.5 * layer / SIDE + 0.3 / SIDE * np.sin(9.0 * x) * np.cos(7.0 * y) for layer in range(LAYERS)]
    start = np.concatenate([np.c_[x, y, z] for z in height])
    slide = np.array([0.5, 0.2, 0.0]) / SIDE * np.sin(400.0 * start[:, 2:])
    end = start + slide + 0.12 * motion / SIDE * rng.normal(size=start.shape)
    faces = np.concatenate([faces + layer * SIDE * SIDE for layer in range(LAYERS)]).astype(np.int32)
    return start, end, faces


def _corners() -> list[tuple[slice, slice]]:
    low, high = slice(None, -1), slice(1, None)
    return [(low, low), (high, low), (high, high), (low, high)]


def best_times(calls: list[Callable[[], object]]) -> list[float]:
    """Shortest wall time of each [s], measured in turn so that a busy moment hits all."""
    best = [np.inf] * len(calls)
    for _ in range(ROUNDS + 1):
        for k, call in enumerate(calls):
            before = time.perf_counter()
            call()
            best[k] = min(best[k], time.perf_counter() - before)
    return best


def throughput(ipctk: ModuleType) -> Table:
    """Pairs a second on two threads."""
    ipctk.set_num_threads(THREADS)
    table = Table(
        f"Additive CCD, {THREADS} threads",
        ["step", "pairs", "separation [m]", "million pairs a second", "ipctk", "ratio", "hits", "impact", "ipctk's"],
        notes=[
            "Turnbuckle gives hit, time and certified gap of every pair; ipctk's AdditiveCCD the smallest time of all, "
            "so it may skip what comes later.",
            "To reach: 9 million pairs a second.",
        ],
    )
    theirs = ipctk.AdditiveCCD()
    for name, motion in (("sliding, free", 0.3), ("sliding, with impacts", 1.0)):
        x0, x1, faces = sheets(np.random.default_rng(0), motion)
        edges = ipctk.edges(faces)
        mesh = ipctk.CollisionMesh(x0, edges, faces)
        candidates = ipctk.Candidates()
        candidates.build(mesh, x0, x1, 0.2 / SIDE, ipctk.LBVH())
        pairs = pairs_of(candidates)
        ours = Ccd(surfaces_of(len(x0), faces, edges), threads=THREADS)
        for separation in (0.0, 0.02 / SIDE):
            walk = partial(ours.walk, pairs, x0, x1, separation)
            step = partial(candidates.compute_collision_free_stepsize, mesh, x0, x1, separation, theirs)
            rates = [1e-6 * pairs.count / seconds for seconds in best_times([walk, step])]
            walked = walk()
            found = [int(walked.hit.sum()), float(walked.time.min()), float(step())]
            table.add(name, pairs.count, separation, *rates, rates[0] / rates[1], *found)
    return table


def pairs_of(candidates: object) -> Pairs:
    """The pairs of ipctk's broad phase."""
    vf = np.array([[c.vertex_id, c.face_id] for c in candidates.fv_candidates], np.int32)
    ee = np.array([[c.edge0_id, c.edge1_id] for c in candidates.ee_candidates], np.int32)
    kind = np.repeat([VERTEX_FACE, EDGE_EDGE], [len(vf), len(ee)]).astype(np.int32)
    a, b = np.concatenate([vf, ee]).T
    return Pairs(kind, np.ascontiguousarray(a), np.ascontiguousarray(b))


def surfaces_of(n: int, faces: np.ndarray, edges: np.ndarray) -> Surfaces:
    """Surfaces of one body whose vertices are points of the state."""
    return Surfaces(
        support=np.repeat(np.arange(n, dtype=np.int32)[:, None], 4, axis=1),
        weights=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        faces=faces,
        edges=np.ascontiguousarray(edges, np.int32),
        edge_faces=np.full((len(edges), 2), -1, np.int32),
        shape=np.zeros(n, np.int32),
        delta=np.full(n, 0.04 / SIDE),
        collides=np.ones((1, 1), bool),
        friction=np.zeros((1, 1, 2)),
    )


def built_to_meet(rng: np.random.Generator, kind: int, planar: bool) -> np.ndarray:
    """Queries that meet at a time k / 48: on a corner, on a side or inside, exactly, on a grid of dyadic numbers."""
    n = QUERIES
    k = rng.integers(0, 49, n)[:, None, None]
    place, u, v = rng.integers(-99, 100, (3, n, 1, 3))
    if kind == EDGE_EDGE:  # at s / 4 along edge a and t / 4 along edge b
        s, t = rng.integers(0, 5, (2, n, 1, 1))
        moment = place + np.concatenate([-s * u, (4 - s) * u, -t * v, (4 - t) * v], axis=1)
    else:  # at weights of the face's corners over their sum
        w0, w1, w2 = rng.integers(0, 3, (3, n, 1, 1))
        first, total = place - w1 * u - w2 * v, w0 + w1 + w2
        moment = np.concatenate([place, first, first + total * u, first + total * v], axis=1)
    speed = rng.integers(-99, 100, (n, 4, 3))
    if planar:
        moment[..., 2] = speed[..., 2] = 0
    return np.concatenate([48 * moment - k * speed, 48 * moment + (48 - k) * speed], axis=1) / 64.0


def misses() -> Table:
    """Meetings that the methods miss."""
    table = Table(
        f"{QUERIES:,} queries that meet exactly",
        ["queries", "additive misses", "cubic misses", "additive, million a second", "cubic"],
        notes=["Cubic: Provot 1997, as the paper has it. In a plane the cubic is zero at all times."],
    )
    for kind, name in ((VERTEX_FACE, "vertex-face"), (EDGE_EDGE, "edge-edge")):
        for planar, place in ((False, "in space"), (True, "in a plane")):
            queries = built_to_meet(np.random.default_rng(kind), kind, planar)
            calls = [
                partial(time_of_impact, queries, kind, method=method, threads=THREADS)
                for method in ("additive", "cubic")
            ]
            rates = [1e-6 * QUERIES / seconds for seconds in best_times(calls)]
            missed = [int((~call()[0]).sum()) for call in calls]
            table.add(f"{name}, {place}", *missed, *rates)
    return table


def measure(console: Console | None = None, folder: Path | None = None) -> list[Table]:
    """Throughput and misses; writes `ccd.json` and `ccd.md`."""
    try:
        import ipctk
    except ImportError:
        raise InputError("the benchmark ccd compares with ipctk, which is not installed; pip install ipctk") from None
    busy = load()
    tables = [throughput(ipctk), misses()]
    publish("ccd", tables, console, folder, busy)
    return tables
