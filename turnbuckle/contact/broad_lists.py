"""Lists of pairs of varying length: find, count, scan, fill.

Queries (vertices, or edges) are worked on in chunks of a few. A chunk has room for the partners of its queries; what
does not fit is only counted, and searched again when the lists are filled into their places. The partners of a query
are sorted, queries keep their order: so the whole list is sorted whatever the method and the number of threads.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

CHUNK = 16  # queries on the CPU; 1 on CUDA
ROOM = 48  # partners a query that a chunk has room for

I32 = wp.array(dtype=wp.int32)
U8 = wp.array(dtype=wp.uint8)
F32 = wp.array(dtype=wp.float32)


@wp.struct
class Filter:
    """Which pairs are wanted."""

    collides: wp.array(dtype=wp.uint8)  # (shapes * shapes,)
    shapes: int
    ordered: int  # 1: only partners with a higher number (edges with edges)


@wp.struct
class Lists:
    """Partners found by a kind of query."""

    chunk: int  # queries in a chunk
    chunks: int
    stride: int  # prime to `chunks`: in which order chunks are taken, so that each thread gets a share of all places
    room: int  # partners for which a chunk has room
    found: wp.array(dtype=wp.int32)  # (chunks * room,)
    count: wp.array(dtype=wp.int32)  # (n,) partners of each query
    total: wp.array(dtype=wp.int32)  # (chunks,) their sums


def make_lists(queries: int, chunk: int, device: str) -> Lists:
    """Empty lists for so many queries."""
    out = Lists()
    out.chunk = chunk
    out.chunks = -(-queries // chunk)
    out.stride = next((p for p in (7919, 104729, 1299709) if out.chunks % p), 1)
    out.room = ROOM * chunk
    out.found = wp.zeros(out.chunks * out.room, dtype=wp.int32, device=device)
    out.count = wp.zeros(queries, dtype=wp.int32, device=device)
    out.total = wp.zeros(out.chunks, dtype=wp.int32, device=device)
    return out


def search_source(walk: str, judged: bool = False, prepare: str = "") -> str:
    """C code that searches for the partners of queries ``first`` to ``end`` and stores at most ``room`` at ``place``.

    ``walk`` calls ``take(b)`` for every target b whose box meets that of query a (``box``); it may do so more than once
    and for targets that are not wanted, and must skip no other; ``judged``: it leaves out bodies that do not collide, and
    pairs of immovables, itself. ``prepare`` is what it does for all queries together, before.
    """
    return (
        """
    auto sort = [](int *v, int n) {
#if !defined(__CUDA_ARCH__)
        if (n <= 16) {  // by rank: no branches to guess
            typedef int ints __attribute__((ext_vector_type(16)));
            const ints place = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
            ints all = 0x7fffffff, rank = 0;
            for (int i = 0; i < n; ++i) all[i] = v[i];
            for (int j = 0; j < n; ++j) rank -= ((ints)all[j] < all) | (((ints)all[j] == all) & ((ints)j < place));
            for (int i = 0; i < n; ++i) v[rank[i]] = all[i];
            return;
        }
#endif
        for (int heap = n / 2 - 1, end = n; end > 1;) {  // heap sort: no memory, no worst case
            int key;
            if (heap >= 0) key = v[heap];
            else { key = v[--end]; v[end] = v[0]; }
            int i = heap >= 0 ? heap : 0;
            for (int c = 2 * i + 1; c < end; i = c, c = 2 * i + 1) {
                if (c + 1 < end && v[c + 1] > v[c]) ++c;
                if (v[c] <= key) break;
                v[i] = v[c];
            }
            v[i] = key;
            if (heap >= 0) --heap;
        }
    };
    int total = 0;
    """
        + prepare
        + """
    for (int a = first; a < end; ++a) {
        const float *box = q_box.data + 6 * a, *ends = q_ends.data + 12 * a;
        const unsigned char *allowed = collides.data + q_shape.data[a] * shapes;
        const int still = !q_moves.data[a];
        const int c0 = q_corners.data[a * q_sides], c1 = q_corners.data[a * q_sides + q_sides - 1];
        const int before = total;
        auto take = [&](int b) {
            if (ordered && b <= a) return;
"""
        + (
            ""
            if judged
            else """
            if (!allowed[t_shape.data[b]] || (still && !t_moves.data[b])) return;"""
        )
        + """
            // on each axis the space between two features is concave in time: apart at both ends is apart all the way
            const float *end = t_ends.data + 12 * b;
            bool apart = false;
            for (int k = 0; k < 3; ++k) {
                apart = apart || (ends[k] > end[3 + k] && ends[6 + k] > end[9 + k]);
                apart = apart || (end[k] > ends[3 + k] && end[6 + k] > ends[9 + k]);
            }
            if (apart) return;
            const int *corner = t_corners.data + b * t_sides;
            for (int k = 0; k < t_sides; ++k)
                if (corner[k] == c0 || corner[k] == c1) return;
            if (total < room) found.data[place + total] = b;
            ++total;
        };
        """
        + walk
        + """
        int n = total - before;
        if (total <= room && n > 1) sort(found.data + place + before, n);
        if (write_count) count.data[a] = n;
    }
    return total;
"""
    )


@wp.func_native(
    """
    const int first = chunk * per_chunk, end = first + per_chunk < queries ? first + per_chunk : queries;
    const int *from = found.data + chunk * room;
    int at = offset.data[chunk];
    const int copy = total.data[chunk] <= room;
    for (int a = first; a < end; ++a)
        for (int k = 0; k < count.data[a]; ++k, ++at) {
            a_out.data[at] = a;
            if (copy) b_out.data[at] = *from++;
        }
    return copy ? -1 : offset.data[chunk];
"""
)
def copy_chunk(
    found: I32,
    count: I32,
    total: I32,
    offset: I32,
    chunk: int,
    per_chunk: int,
    room: int,
    queries: int,
    a_out: I32,
    b_out: I32,
) -> int:
    """Copy a chunk into its place; the place, if its partners must be searched again, else -1."""
    ...  # fmt: skip
