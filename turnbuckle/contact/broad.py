"""The broad phase: all pairs of features whose boxes overlap (Contact, 3.2), sorted, the same by every method.

>>> broad = BroadPhase(surfaces)
>>> pairs = broad.candidates(x0, x1, inflation)
"""

import numpy as np
import warp as wp

from turnbuckle.compute.host import host, write
from turnbuckle.compute.program import Program
from turnbuckle.contact.broad_boxes import Features, feature_boxes, make_features, vertex_boxes
from turnbuckle.contact.broad_brute import fill_brute, find_brute
from turnbuckle.contact.broad_bvh import deal_leaves, fill_bvh, find_bvh, make_tree, mark_moves, refit
from turnbuckle.contact.broad_hash import HashTable, fill_hash, find_hash, side_of_cubes
from turnbuckle.contact.broad_lists import CHUNK, Filter, Lists, make_lists
from turnbuckle.data.contact import EDGE_EDGE, VERTEX_FACE, Pairs, Surfaces
from turnbuckle.data.errors import InputError
from turnbuckle.math.types import vec3

METHODS = ("bvh", "hash", "brute")
SMALL = 2000  # features below which one thread does it all
LOOK = 16  # calls between two looks at the order of the tree
GROWN = 1.3  # by how much it may have fallen into disorder before leaves are dealt out anew


class _Search:
    """One kind of query against one kind of target."""

    def __init__(self, broad: "BroadPhase", queries: Features, targets: "_Targets", ordered: bool) -> None:
        self.queries, self.targets = queries, targets
        self.wanted = Filter()
        self.wanted.collides = broad.collides
        self.wanted.shapes = broad.shapes
        self.wanted.ordered = int(ordered)
        self.lists: Lists = make_lists(queries.count, broad.chunk, broad.device)
        self.offset = wp.zeros(max(self.lists.chunks, 1), dtype=wp.int32, device=broad.device)
        self.count = 0
        self.capacity = -1

    @property
    def idle(self) -> bool:
        """Whether there is nothing to search."""
        return self.queries.count == 0 or self.targets.features.count == 0

    def reserve(self, total: int, device: str) -> bool:
        """Make room for so many pairs; whether arrays were made anew."""
        if total <= self.capacity:
            return False
        self.capacity = max(1024, total + total // 2)
        self.a = wp.zeros(self.capacity, dtype=wp.int32, device=device)
        self.b = wp.zeros(self.capacity, dtype=wp.int32, device=device)
        return True

    def found(self) -> tuple[np.ndarray, np.ndarray]:
        """Copies of both sides of the pairs."""
        if self.a.device.is_cpu or not self.count:
            return host(self.a)[: self.count].copy(), host(self.b)[: self.count].copy()
        return self.a[: self.count].numpy(), self.b[: self.count].numpy()


class _Targets:
    """Features that are searched, and the tree over them."""

    def __init__(self, broad: "BroadPhase", corners: np.ndarray, tree: bool) -> None:
        self.features, self.numbers = make_features(corners, broad.surfaces.shape, broad.moves, broad.device)
        self.tree, self.levels = make_tree(len(corners), broad.device) if tree else (None, None)
        self.table = HashTable(self.features, broad.device) if broad.method == "hash" else None

    def deal(self, x: np.ndarray) -> None:
        """Deal out the leaves anew for vertices ``x`` (s, 3)."""
        most, tag = deal_leaves(x[self.numbers.corners].mean(axis=1), self.numbers, self.levels)
        self.tree.most.assign(most)
        self.tree.tag.assign(tag)

    def restrict(self, only: np.ndarray) -> None:
        """Take features as moving that move and have a vertex among ``only`` (s,) bool."""
        moves = self.numbers.moves & only[self.numbers.corners].any(axis=1)
        write(self.features.moves, moves.astype(np.uint8))
        if self.tree is not None and len(moves):
            write(self.tree.tag, mark_moves(host(self.tree.most), host(self.tree.tag), moves, self.levels))

    def disorder(self) -> float:
        """Lengths of the boxes of nodes, in those of the features': what a search costs, however fast all moves."""
        leaves = 48 * int(self.levels.count[0])
        box = host(self.tree.box).reshape(-1, 2, 3, 8).astype(np.float64)
        length = np.maximum(box[:, 1] - box[:, 0], 0.0).sum(axis=(1, 2))
        return float(length[leaves // 48 :].sum() / max(length[: leaves // 48].sum(), 1e-300))


class BroadPhase:
    """Finds candidates on one device; keeps its buffers, and what it learned of the motion, between calls.

    ``moves`` (s,) tells which vertices ever move: pairs with both sides at rest are left out (all move by default).
    ``kinds`` are what to search for; "edge_face" is for intersections and is asked for alone.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        device: str = "cpu",
        method: str = "bvh",
        moves: np.ndarray | None = None,
        threads: int | None = None,
        edge_face: bool = False,
    ) -> None:
        if method not in METHODS:
            raise InputError(f"broad phase: there is no method '{method}'; choose one of {', '.join(METHODS)}")
        self.surfaces, self.device, self.method = surfaces, device, method
        self.threads = threads
        n = surfaces.vertices
        self.moves = np.ones(n, dtype=bool) if moves is None else np.asarray(moves, dtype=bool)
        self.shapes = max(len(surfaces.collides), 1)
        self.collides = wp.array(surfaces.collides.reshape(-1).astype(np.uint8), dtype=wp.uint8, device=device)
        self.chunk = 1 if wp.get_device(device).is_cuda else CHUNK
        self._x0 = wp.zeros(n, dtype=vec3, device=device)
        self._x1 = wp.zeros(n, dtype=vec3, device=device)
        self._inflation = wp.zeros(n, dtype=wp.float64, device=device)
        self._origin = wp.zeros(1, dtype=vec3, device=device)
        self.vertices, self._numbers = make_features(np.arange(n).reshape(-1, 1), surfaces.shape, self.moves, device)
        tree = method == "bvh"
        self.faces = _Targets(self, surfaces.faces, tree)
        self.edges = _Targets(self, surfaces.edges, tree and not edge_face)
        if edge_face:
            self.searches = [_Search(self, self.edges.features, self.faces, False)]
        else:
            self.searches = [_Search(self, self.vertices, self.faces, False),
                             _Search(self, self.edges.features, self.edges, True)]  # fmt: skip
        self._boxes: Program | None = None
        self._find: Program | None = None
        self._fill: Program | None = None
        self._calls = 0
        self._disorder: list[float] = []
        self._restricted = False
        self._targets = [t for t in (self.faces, self.edges) if t.tree is not None and t.features.count]

    def candidates(
        self, x0: np.ndarray, x1: np.ndarray, inflation: float | np.ndarray = 0.0, only: np.ndarray | None = None
    ) -> Pairs:
        """Pairs whose boxes may meet on the straight way from ``x0`` to ``x1`` (s, 3) [m]: no axis keeps them apart, the same
        way at both ends.

        ``inflation`` [m], one or (s,): two features that come nearer than the mean of theirs are always found.
        ``only`` (s,) bool: pairs that have one of these vertices, all by default.
        """
        lists = self._search(x0, x1, inflation, only)
        kinds = (VERTEX_FACE, EDGE_EDGE)
        kind = np.repeat(np.array(kinds, dtype=np.int32), [len(a) for a, _ in lists])
        return Pairs(kind, np.concatenate([a for a, _ in lists]), np.concatenate([b for _, b in lists]))

    def _restrict(self, only: np.ndarray) -> None:
        """Pairs of which neither side moves are left out: so let nothing move but ``only``."""
        write(self.vertices.moves, (self._numbers.moves & only).astype(np.uint8))
        for targets in (self.faces, self.edges):
            targets.restrict(only)

    def edges_near_faces(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Edges and faces whose boxes overlap; for a broad phase made with ``edge_face``."""
        return self._search(x, x, 0.0)[0]

    def _search(
        self, x0: np.ndarray, x1: np.ndarray, inflation: float | np.ndarray, only: np.ndarray | None = None
    ) -> list:
        x0, x1 = np.asarray(x0, dtype=np.float64), np.asarray(x1, dtype=np.float64)
        for name, x in (("start", x0), ("end", x1)):
            if x.shape != (self.surfaces.vertices, 3):
                raise InputError(
                    f"broad phase: positions at the {name} have shape {x.shape}; give ({self.surfaces.vertices}, 3)"
                )
            if not np.isfinite(x).all():
                v = int(np.flatnonzero(~np.isfinite(x).all(axis=1))[0])
                raise InputError(f"broad phase: vertex {v} is not finite at the {name} of the step; halve the step")
        nothing = np.zeros(0, dtype=np.int32)
        if all(search.idle for search in self.searches):
            return [(nothing, nothing) for _ in self.searches]
        self._put(x0, x1, inflation)
        if self._find is None:
            self._deal(x0)
        if only is not None or self._restricted:
            self._restrict(np.ones(len(self.moves), dtype=bool) if only is None else only)
        self._restricted = only is not None
        if self._find is None:
            self._boxes = self._record_boxes() if self.method == "hash" else None
        anew = False
        if self._boxes is not None:
            self._boxes.run()
            side = side_of_cubes(x0, x1, self.surfaces.edges, np.asarray(inflation))
            anew = any([search.targets.table.arrange(side) for search in self.searches if not search.idle])
        if self._find is None or anew:
            self._find = self._record_find()
        self._find.run()
        for search in self.searches:
            if not search.idle:
                total = host(search.lists.total)
                ends = np.cumsum(total, dtype=np.int64)
                search.count = int(ends[-1])
                if search.count >= 2**31:
                    raise InputError("broad phase: more than 2^31 pairs; make the step or the tolerance smaller")
                write(search.offset, (ends - total).astype(np.int32))
                anew |= search.reserve(search.count, self.device)
        if anew or self._fill is None:
            self._fill = self._record_fill()
        self._fill.run()
        self._look(x0)
        return [(nothing, nothing) if search.idle else search.found() for search in self.searches]

    def _put(self, x0: np.ndarray, x1: np.ndarray, inflation: float | np.ndarray) -> None:
        """Hand the positions to the device."""
        origin = 0.5 * (x0.min(axis=0) + x0.max(axis=0))
        wide = np.broadcast_to(np.asarray(inflation, dtype=np.float64), len(x0))
        for array, value in ((self._x0, x0), (self._x1, x1), (self._inflation, wide), (self._origin, origin[None])):
            write(array, value)

    def _deal(self, x: np.ndarray) -> None:
        for targets in self._targets:
            targets.deal(x)
        self._disorder = []
        self._calls = 0

    def _look(self, x: np.ndarray) -> None:
        """Deal out the leaves anew, for the calls to come, when the trees have fallen into disorder since."""
        if self._restricted:
            return
        if self._calls % LOOK == 0 and self._targets:
            now = [targets.disorder() for targets in self._targets]
            if not self._disorder:
                self._disorder = now
            elif any(new > GROWN * old for new, old in zip(now, self._disorder, strict=True)):
                self._deal(x)
                return
        self._calls += 1

    def _program(self) -> Program:
        few = self.faces.features.count + self.edges.features.count < SMALL
        return Program(self.device, 1 if few else self.threads)

    def _launch_boxes(self, program: Program) -> None:
        """Boxes of all features."""
        positions = [self._x0, self._x1, self._inflation, self._origin]
        program.launch(vertex_boxes, self.vertices.count, [*positions, self.vertices])
        program.barrier()
        for targets in (self.faces, self.edges):
            program.launch(feature_boxes, targets.features.count, [self.vertices, targets.features])
        program.barrier()

    def _record_boxes(self) -> Program:
        """Boxes alone: what is hashed needs the host in between."""
        program = self._program()
        self._launch_boxes(program)
        return program.finish(0)

    def _record_find(self) -> Program:
        """Boxes and trees, where they are not there yet; the search."""
        program = self._program()
        if self.method != "hash":
            self._launch_boxes(program)
        for level in range(max((t.tree.levels for t in self._targets), default=0)):
            for targets in self._targets:
                if level < targets.tree.levels:
                    nodes = int(targets.levels.count[level])
                    program.launch(refit, nodes, [targets.tree, targets.features, level], 8)
            program.barrier()
        kernel = {"bvh": find_bvh, "hash": find_hash, "brute": find_brute}[self.method]
        for search in self.searches:
            if not search.idle:
                program.launch(kernel, search.lists.chunks, [*self._inputs(search), search.lists], 1000)
        return program.finish(0)

    def _record_fill(self) -> Program:
        """The lists into their places."""
        program = self._program()
        kernel = {"bvh": fill_bvh, "hash": fill_hash, "brute": fill_brute}[self.method]
        for search in self.searches:
            if not search.idle:
                outputs = [search.lists, search.offset, search.a, search.b]
                program.launch(kernel, search.lists.chunks, [*self._inputs(search), *outputs], 1000)
        return program.finish(0)

    def _inputs(self, search: _Search) -> list:
        """What the kernels of this method start with."""
        targets = search.targets
        structure = {"bvh": [targets.tree], "hash": [targets.table and targets.table.table], "brute": []}[self.method]
        return [search.queries, targets.features, *structure, search.wanted]


def candidates(
    surfaces: Surfaces,
    x0: np.ndarray,
    x1: np.ndarray,
    inflation: float | np.ndarray = 0.0,
    method: str = "bvh",
    moves: np.ndarray | None = None,
    device: str = "cpu",
) -> Pairs:
    """`BroadPhase` for a single call."""
    return BroadPhase(surfaces, device, method, moves).candidates(x0, x1, inflation)
