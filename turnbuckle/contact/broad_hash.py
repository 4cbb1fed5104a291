"""Spatial hashing (Teschner, Heidelberger, Mueller, Pomeranets, Gross 2003), which the paper's broad phase uses.

Space is cut into cubes; a cube's three numbers are hashed into a table of lists, and every target is entered in the lists
of all cubes that its box meets. A query looks through the lists of its own cubes. A pair is taken at one cube only, the
first that both boxes meet, and only from the entry made for that cube (others in the list have the same hash by chance).
What meets more than `MOST` cubes, a floor of two triangles say, is compared with everything.
"""

import numpy as np
import warp as wp

from turnbuckle.compute.host import host
from turnbuckle.contact.broad_boxes import Features
from turnbuckle.contact.broad_lists import F32, I32, U8, Filter, Lists, copy_chunk, search_source

wp.set_module_options({"enable_backward": False})

MOST = wp.constant(64)  # cubes of one target
SIDE = 2.0  # of a cube, in mean extents of an edge's box (measured: 1 makes twice as many entries, 3 longer lists)


@wp.struct
class Table:
    """Entries of targets in lists by hash."""

    inverse: wp.array(dtype=wp.float64)  # (1,) 1 / side of a cube [1/m]
    cubes: wp.array(dtype=wp.int32)  # (n,) cubes that each target meets, -1 for more than `MOST`
    offset: wp.array(dtype=wp.int32)  # (n,) first entry of each target
    target: wp.array(dtype=wp.int32)  # (capacity,) whose entry it is
    hash: wp.array(dtype=wp.int32)  # (2 capacity,) of entries, sorted
    entry: wp.array(dtype=wp.int32)  # (2 capacity,) entries in that order
    start: wp.array(dtype=wp.int32)  # (size,) where each list starts in `entry`
    stop: wp.array(dtype=wp.int32)  # (size,) and ends
    size: int  # a power of two
    large: wp.array(dtype=wp.int32)  # targets that meet too many cubes
    large_count: wp.array(dtype=wp.int32)  # (1,)


# Numbers of the cubes at a box's corners. Far away all fall into the last cube: right, if slow.
_CUBES = """
    auto cube = [&](float v) {
        const double c = floor((double)v * inverse.data[0]);
        return c < -1e8 ? -100000000 : c > 1e8 ? 100000000 : (int)c;
    };
    auto hashed = [&](int i, int j, int k) {
        return (int)(((unsigned)i * 73856093u ^ (unsigned)j * 19349663u ^ (unsigned)k * 83492791u) & (unsigned)(size - 1));
    };
"""


@wp.func_native(
    _CUBES
    + """
    const float *b = box.data + 6 * i;
    long long n = 1;
    for (int k = 0; k < 3; ++k) n *= (long long)(cube(b[3 + k]) - cube(b[k]) + 1) < most ? cube(b[3 + k]) - cube(b[k]) + 1 : most + 1;
    return n <= most ? (int)n : -1;
"""
)
def _cubes_met(box: F32, inverse: wp.array(dtype=wp.float64), size: int, i: int, most: int) -> int: ...


@wp.func_native(
    _CUBES
    + """
    const float *b = box.data + 6 * t;
    int e = offset.data[t];
    for (int i = cube(b[0]); i <= cube(b[3]); ++i)
        for (int j = cube(b[1]); j <= cube(b[4]); ++j)
            for (int k = cube(b[2]); k <= cube(b[5]); ++k, ++e) {
                target.data[e] = t;
                hash.data[e] = hashed(i, j, k);
                entry.data[e] = e;
            }
"""
)
def _enter(
    box: F32, inverse: wp.array(dtype=wp.float64), size: int, t: int, offset: I32, target: I32, hash: I32, entry: I32
): ...  # fmt: skip


@wp.kernel
def count_cubes(begin: int, targets: Features, table: Table):
    """How many cubes each target meets."""
    i = begin + wp.tid()
    table.cubes[i] = _cubes_met(targets.box, table.inverse, table.size, i, MOST)


@wp.kernel
def enter(begin: int, targets: Features, table: Table):
    """Entries of each target, in its own place."""
    i = begin + wp.tid()
    if table.cubes[i] > 0:
        _enter(targets.box, table.inverse, table.size, i, table.offset, table.target, table.hash, table.entry)


@wp.kernel
def bound_lists(begin: int, table: Table, entries: int):
    """Where the list of each hash starts and ends, among sorted entries."""
    i = begin + wp.tid()
    own = table.hash[i]
    if i == 0 or table.hash[wp.max(i - 1, 0)] != own:
        table.start[own] = i
    if i == entries - 1 or table.hash[wp.min(i + 1, entries - 1)] != own:
        table.stop[own] = i + 1


class HashTable:
    """The table over some targets on one device."""

    def __init__(self, targets: Features, device: str) -> None:
        self.targets, self.device = targets, device
        n = targets.count
        self.table = Table()
        self.table.inverse = wp.zeros(1, dtype=wp.float64, device=device)
        self.table.cubes = wp.zeros(n, dtype=wp.int32, device=device)
        self.table.offset = wp.zeros(n, dtype=wp.int32, device=device)
        self.table.size = 1 << max(int(2 * n - 1).bit_length(), 4)
        self.table.start = wp.zeros(self.table.size, dtype=wp.int32, device=device)
        self.table.stop = wp.zeros(self.table.size, dtype=wp.int32, device=device)
        self.table.large = wp.zeros(n, dtype=wp.int32, device=device)
        self.table.large_count = wp.zeros(1, dtype=wp.int32, device=device)
        self._capacity = -1

    def arrange(self, side: float) -> bool:
        """Enter all targets, whose boxes are there, in cubes of so long a side [m]; whether arrays were made anew."""
        table, n = self.table, self.targets.count
        table.inverse.fill_(1.0 / side)
        wp.launch(count_cubes, n, inputs=[0, self.targets, table], device=self.device)
        cubes = host(table.cubes)
        entered = np.maximum(cubes, 0)
        ends = np.cumsum(entered)
        entries, large = int(ends[-1]), np.flatnonzero(cubes < 0).astype(np.int32)
        table.offset.assign((ends - entered).astype(np.int32))
        if len(large):
            wp.copy(table.large, wp.array(large, device="cpu"), count=len(large))
        table.large_count.fill_(len(large))
        anew = entries > self._capacity
        if anew:
            self._capacity = max(1024, entries + entries // 2)
            table.target = wp.zeros(self._capacity, dtype=wp.int32, device=self.device)
            table.hash = wp.zeros(2 * self._capacity, dtype=wp.int32, device=self.device)
            table.entry = wp.zeros(2 * self._capacity, dtype=wp.int32, device=self.device)
        table.start.zero_()
        table.stop.zero_()
        if entries:
            wp.launch(enter, n, inputs=[0, self.targets, table], device=self.device)
            wp.utils.radix_sort_pairs(table.hash, table.entry, entries)
            wp.launch(bound_lists, entries, inputs=[0, table, entries], device=self.device)
        return anew


def side_of_cubes(x0: np.ndarray, x1: np.ndarray, edges: np.ndarray, inflation: np.ndarray) -> float:
    """Side of the cubes [m] for a motion: twice the mean extent of the box of an edge."""
    still = np.abs(x0[edges[:, 1]] - x0[edges[:, 0]]).max(axis=1) if len(edges) else np.zeros(1)
    side = SIDE * float(still.mean() + np.abs(x1 - x0).max(axis=1).mean() + np.mean(inflation))
    return side if side > 1e-290 else 1.0


@wp.func_native(
    search_source(
        _CUBES
        + """
        auto meets = [&](int b) {
            const float *o = t_box.data + 6 * b;
            return box[0] <= o[3] && box[1] <= o[4] && box[2] <= o[5] && o[0] <= box[3] && o[1] <= box[4] && o[2] <= box[5];
        };
        int low[3], high[3];
        long long own = 1;
        for (int k = 0; k < 3; ++k) {
            low[k] = cube(box[k]);
            high[k] = cube(box[3 + k]);
            own *= high[k] - low[k] < most ? high[k] - low[k] + 1 : most + 1;
        }
        if (own > most) {
            for (int b = ordered ? a + 1 : 0; b < targets; ++b)
                if (meets(b)) take(b);
        } else {
            for (int n = 0; n < large_count.data[0]; ++n)
                if (meets(large.data[n])) take(large.data[n]);
            for (int i = low[0]; i <= high[0]; ++i)
                for (int j = low[1]; j <= high[1]; ++j)
                    for (int k = low[2]; k <= high[2]; ++k) {
                        const int h = hashed(i, j, k);
                        for (int at = start.data[h]; at < stop.data[h]; ++at) {
                            const int e = entry.data[at], b = target.data[e];
                            if ((ordered && b <= a) || !meets(b)) continue;
                            const float *o = t_box.data + 6 * b;
                            const int oi = cube(o[0]), oj = cube(o[1]), ok = cube(o[2]);
                            if (i != (oi > low[0] ? oi : low[0]) || j != (oj > low[1] ? oj : low[1])
                                || k != (ok > low[2] ? ok : low[2]))
                                continue;
                            const int ny = cube(o[4]) - oj + 1, nz = cube(o[5]) - ok + 1;
                            if (e == offset.data[b] + ((i - oi) * ny + j - oj) * nz + k - ok) take(b);
                        }
                    }
        }
"""
    )
)
def _search(
    q_corners: I32, q_sides: int, q_shape: I32, q_moves: U8, q_box: F32, q_ends: F32,
    t_corners: I32, t_sides: int, t_shape: I32, t_moves: U8, t_ends: F32, t_box: F32, targets: int,
    inverse: wp.array(dtype=wp.float64), size: int, offset: I32, target: I32, entry: I32, start: I32, stop: I32,
    large: I32, large_count: I32, most: int,
    collides: U8, shapes: int, ordered: int,
    first: int, end: int, found: I32, place: int, room: int, count: I32, write_count: int,
) -> int: ...  # fmt: skip


@wp.func
def _chunk(
    q: Features,
    t: Features,
    h: Table,
    f: Filter,
    n: int,
    size: int,
    found: I32,
    place: int,
    room: int,
    count: I32,
    w: int,
):
    """Search for the partners of the queries of chunk n."""
    first = n * size
    end = wp.min(first + size, q.count)
    return _search(q.corners, q.sides, q.shape, q.moves, q.box, q.ends, t.corners, t.sides, t.shape, t.moves, t.ends, t.box, t.count,
                   h.inverse, h.size, h.offset, h.target, h.entry, h.start, h.stop, h.large, h.large_count, MOST,
                   f.collides, f.shapes, f.ordered, first, end, found, place, room, count, w)  # fmt: skip


@wp.kernel
def find_hash(begin: int, queries: Features, targets: Features, table: Table, wanted: Filter, lists: Lists):
    """Partners of the queries of a chunk."""
    c = int((wp.int64(begin + wp.tid()) * wp.int64(lists.stride)) % wp.int64(lists.chunks))
    lists.total[c] = _chunk(
        queries, targets, table, wanted, c, lists.chunk, lists.found, c * lists.room, lists.room, lists.count, 1
    )


@wp.kernel
def fill_hash(
    begin: int, queries: Features, targets: Features, table: Table, wanted: Filter, lists: Lists, offset: I32, a_out: I32,
    b_out: I32,
):  # fmt: skip
    """The partners of a chunk into their place."""
    c = begin + wp.tid()
    again = copy_chunk(
        lists.found, lists.count, lists.total, offset, c, lists.chunk, lists.room, queries.count, a_out, b_out
    )
    if again >= 0:
        _chunk(queries, targets, table, wanted, c, lists.chunk, b_out, again, lists.total[c], lists.count, 0)
