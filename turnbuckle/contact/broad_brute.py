"""All queries against all targets: the slow and obvious reference of the other methods."""

import warp as wp

from turnbuckle.contact.broad_boxes import Features
from turnbuckle.contact.broad_lists import F32, I32, U8, Filter, Lists, copy_chunk, search_source

wp.set_module_options({"enable_backward": False})


@wp.func_native(
    search_source("""
        for (int b = ordered ? a + 1 : 0; b < targets; ++b) {
            const float *other = t_box.data + 6 * b;
            if (box[0] <= other[3] && box[1] <= other[4] && box[2] <= other[5] && other[0] <= box[3]
                && other[1] <= box[4] && other[2] <= box[5])
                take(b);
        }
""")
)
def _search(
    q_corners: I32, q_sides: int, q_shape: I32, q_moves: U8, q_box: F32, q_ends: F32,
    t_corners: I32, t_sides: int, t_shape: I32, t_moves: U8, t_ends: F32, t_box: F32, targets: int,
    collides: U8, shapes: int, ordered: int,
    first: int, end: int, found: I32, place: int, room: int, count: I32, write_count: int,
) -> int: ...  # fmt: skip


@wp.func
def _chunk(
    q: Features, t: Features, f: Filter, n: int, size: int, found: I32, place: int, room: int, count: I32, w: int
):
    """Search for the partners of the queries of chunk n."""
    first = n * size
    end = wp.min(first + size, q.count)
    return _search(q.corners, q.sides, q.shape, q.moves, q.box, q.ends, t.corners, t.sides, t.shape, t.moves, t.ends, t.box, t.count,
                   f.collides, f.shapes, f.ordered, first, end, found, place, room, count, w)  # fmt: skip


@wp.kernel
def find_brute(begin: int, queries: Features, targets: Features, wanted: Filter, lists: Lists):
    """Partners of the queries of a chunk."""
    c = int((wp.int64(begin + wp.tid()) * wp.int64(lists.stride)) % wp.int64(lists.chunks))
    lists.total[c] = _chunk(
        queries, targets, wanted, c, lists.chunk, lists.found, c * lists.room, lists.room, lists.count, 1
    )


@wp.kernel
def fill_brute(
    begin: int, queries: Features, targets: Features, wanted: Filter, lists: Lists, offset: I32, a_out: I32, b_out: I32
):
    """The partners of a chunk into their place."""
    c = begin + wp.tid()
    again = copy_chunk(
        lists.found, lists.count, lists.total, offset, c, lists.chunk, lists.room, queries.count, a_out, b_out
    )
    if again >= 0:
        _chunk(queries, targets, wanted, c, lists.chunk, b_out, again, lists.total[c], lists.count, 0)
