"""A hierarchy of boxes with eight children a node, complete and implicit: node k of a level has nodes 8k to 8k + 7 of
the level below. Features keep their leaves while their boxes move (a refit); leaves are dealt out anew, along a
space-filling curve, when the boxes have grown. One comparison takes the eight boxes of a node.

Every child carries the largest number, the shape and whether anything moves below it, so that halves of edge-edge pairs,
bodies that do not collide and pairs of immovables are left out high up.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from turnbuckle.contact.broad_boxes import FeatureNumbers, Features
from turnbuckle.contact.broad_lists import F32, I32, U8, Filter, Lists, copy_chunk, search_source
from turnbuckle.contact.curve import curve_order

wp.set_module_options({"enable_backward": False})

WIDTH = 8  # children of a node


@wp.struct
class Tree:
    """Nodes level by level, leaves first. At the leaves, `most` is the feature itself, -1 for none."""

    box: wp.array(dtype=wp.float32)  # (nodes * 48,): lower x of eight children, lower y, z, upper x, y, z
    most: wp.array(dtype=wp.int32)  # (nodes * 8,) largest number of a feature below the child, -1 for none
    tag: wp.array(dtype=wp.int32)  # (nodes * 8,) 2 (shape + 1), or 0 for several; + 1 if something moves
    first: wp.array(dtype=wp.int32)  # (levels,) first node of each level
    levels: int


@dataclass
class TreeLevels:
    """Where the levels of a tree over ``n`` features are."""

    first: np.ndarray  # (levels,)
    count: np.ndarray  # (levels,) nodes

    @classmethod
    def over(cls, n: int) -> "TreeLevels":
        count = [max(-(-n // WIDTH), 1)]
        while count[-1] > 1:
            count.append(-(-count[-1] // WIDTH))
        return cls(np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int32), np.array(count, dtype=np.int32))

    @property
    def nodes(self) -> int:
        return int(self.count.sum())


def make_tree(n: int, device: str) -> tuple[Tree, TreeLevels]:
    """A tree over n features that no feature is in yet."""
    levels = TreeLevels.over(n)
    tree = Tree()
    tree.box = wp.zeros(levels.nodes * 48, dtype=wp.float32, device=device)
    tree.most = wp.full(levels.nodes * WIDTH, -1, dtype=wp.int32, device=device)
    tree.tag = wp.zeros(levels.nodes * WIDTH, dtype=wp.int32, device=device)
    tree.first = wp.array(levels.first, dtype=wp.int32, device=device)
    tree.levels = len(levels.first)
    return tree, levels


def deal_leaves(centre: np.ndarray, features: FeatureNumbers, levels: TreeLevels) -> tuple[np.ndarray, np.ndarray]:
    """`most` and `tag` of a tree whose leaves follow the curve through ``centre`` (n, 3)."""
    order = curve_order(centre)
    most = np.full(levels.nodes * WIDTH, -1, dtype=np.int32)
    tag = np.zeros(levels.nodes * WIDTH, dtype=np.int32)
    most[: len(order)] = order
    shape = np.full(levels.count[0] * WIDTH, -1, dtype=np.int64)
    shape[: len(order)] = features.shape[order]
    moves = np.zeros(len(shape), dtype=bool)
    moves[: len(order)] = features.moves[order]
    largest = most[: len(shape)]
    for first, count in zip(levels.first, levels.count, strict=True):
        slots = slice(first * WIDTH, (first + count) * WIDTH)
        pad = count * WIDTH - len(shape)
        if pad:
            shape, moves = np.append(shape, np.full(pad, -1)), np.append(moves, np.zeros(pad, dtype=bool))
            largest = np.append(largest, np.full(pad, -1, dtype=np.int32))
        most[slots], tag[slots] = largest, np.where(shape < -1, 0, 2 * (shape + 1)) + moves
        low = np.where(shape == -1, np.iinfo(np.int64).max, shape).reshape(-1, WIDTH).min(axis=1)
        high = shape.reshape(-1, WIDTH).max(axis=1)
        shape = np.where(low == high, high, np.where(high == -1, -1, -2))  # -1: empty, -2: several
        moves, largest = moves.reshape(-1, WIDTH).any(axis=1), largest.reshape(-1, WIDTH).max(axis=1)
    return most, tag


def mark_moves(most: np.ndarray, tag: np.ndarray, moves: np.ndarray, levels: TreeLevels) -> np.ndarray:
    """The tags of a tree with other features moving, ``moves`` (n,) bool."""
    out = tag & ~1
    leaves = most[: levels.count[0] * WIDTH]
    below = (leaves >= 0) & moves[leaves]
    for first, count in zip(levels.first, levels.count, strict=True):
        below = np.append(below, np.zeros(count * WIDTH - len(below), dtype=bool))
        out[first * WIDTH : (first + count) * WIDTH] |= below
        below = below.reshape(-1, WIDTH).any(axis=1)
    return out


@wp.func_native(
    """
    float *node = box.data + 48 * k;
    for (int j = 0; j < 8; ++j) {
        float lower[3] = {3e38f, 3e38f, 3e38f}, upper[3] = {-3e38f, -3e38f, -3e38f};
        const int i = most.data[8 * k + j];
        if (i >= 0 && leaf) {
            for (int c = 0; c < 3; ++c) {
                lower[c] = feature.data[6 * i + c];
                upper[c] = feature.data[6 * i + 3 + c];
            }
        } else if (i >= 0) {
            const float *below = box.data + 48 * (child + j);
            for (int c = 0; c < 3; ++c)
                for (int m = 0; m < 8; ++m) {
                    const float l = below[8 * c + m], u = below[24 + 8 * c + m];
                    lower[c] = l < lower[c] ? l : lower[c];
                    upper[c] = u > upper[c] ? u : upper[c];
                }
        }
        for (int c = 0; c < 3; ++c) {
            node[8 * c + j] = lower[c];
            node[24 + 8 * c + j] = upper[c];
        }
    }
"""
)
def _node_box(box: F32, most: I32, feature: F32, k: int, child: int, leaf: int): ...


@wp.kernel
def refit(begin: int, tree: Tree, features: Features, level: int):
    """Boxes of the children of the nodes of a level."""
    k = begin + wp.tid()
    below = 0
    if level > 0:
        below = tree.first[level - 1] + 8 * k
    _node_box(tree.box, tree.most, features.box, tree.first[level] + k, below, wp.where(level == 0, 1, 0))


# Children of a node whose boxes meet a box, as bits; those with features above a number only.
_MEET = """
#if defined(__CUDA_ARCH__)
    auto lowest = [](unsigned bits) { return __ffs((int)bits) - 1; };
#else
    typedef float floats __attribute__((ext_vector_type(8)));
    typedef int ints __attribute__((ext_vector_type(8)));
    typedef bool bools __attribute__((ext_vector_type(8)));
    auto lowest = [](unsigned bits) { return __builtin_ctz(bits); };
#endif
    auto meet = [&](int node, const float *box, int above) {
        const float *f = node_box.data + 48 * node;
        const int *most = node_most.data + 8 * node;
#if defined(__CUDA_ARCH__)
        unsigned near = 0;
        for (int j = 0; j < 8; ++j)
            near |= (unsigned)(f[j] <= box[3] && f[8 + j] <= box[4] && f[16 + j] <= box[5] && f[24 + j] >= box[0]
                               && f[32 + j] >= box[1] && f[40 + j] >= box[2] && most[j] > above) << j;
        return near;
#else
        floats l[6];
        ints top;
        memcpy(l, f, 192);
        memcpy(&top, most, 32);
        const ints x = (l[0] <= (floats)box[3]) & (l[3] >= (floats)box[0]);
        const ints y = (l[1] <= (floats)box[4]) & (l[4] >= (floats)box[1]);
        const ints z = (l[2] <= (floats)box[5]) & (l[5] >= (floats)box[2]);
        const bools hit = __builtin_convertvector((x & y) & (z & (top > (ints)above)), bools);
        unsigned char near;
        memcpy(&near, &hit, 1);
        return (unsigned)near;
#endif
    };
    int stack[96];
"""

# Queries that follow each other are mostly neighbours: one descent finds the leaves that any of them may meet. Where that
# are too many, each query descends by itself.
_LEAVES = """
    int leaf[64], leaves = end - first > 1 ? 0 : -1;
    if (leaves == 0) {
        float all[6];
        int depth = 0, moving = 0;
        for (int a = first; a < end; ++a) moving |= q_moves.data[a];
        for (int k = 0; k < 6; ++k) all[k] = q_box.data[6 * first + k];
        for (int a = first + 1; a < end; ++a)
            for (int k = 0; k < 3; ++k) {
                const float l = q_box.data[6 * a + k], u = q_box.data[6 * a + 3 + k];
                all[k] = l < all[k] ? l : all[k];
                all[3 + k] = u > all[3 + k] ? u : all[3 + k];
            }
        stack[depth++] = levels - 1;
        stack[depth++] = 0;
        while (depth > 0) {
            const int k = stack[--depth], level = stack[--depth];
            if (level == 0) {
                if (leaves == 64) {
                    leaves = -1;
                    break;
                }
                leaf[leaves++] = k;
                continue;
            }
            const int node = level_first.data[level] + k;
            for (unsigned near = meet(node, all, ordered ? first : -1); near; near &= near - 1u) {
                const int j = lowest(near);
                if (!moving && !(node_tag.data[8 * node + j] & 1)) continue;
                stack[depth++] = level - 1;
                stack[depth++] = 8 * k + j;
            }
        }
    }
"""

_WALK = """
        const int above = ordered ? a : -1;
        auto barred = [&](int tag) { return (still && !(tag & 1)) || (tag >= 2 && !allowed[(tag >> 1) - 1]); };
        for (int n = 0; n < leaves; ++n)
            for (unsigned near = meet(leaf[n], box, above); near; near &= near - 1u) {
                const int slot = 8 * leaf[n] + lowest(near);
                if (!barred(node_tag.data[slot])) take(node_most.data[slot]);
            }
        int depth = 0;
        if (leaves < 0) {
            stack[depth++] = levels - 1;
            stack[depth++] = 0;
        }
        while (depth > 0) {
            const int k = stack[--depth], level = stack[--depth];
            const int node = level_first.data[level] + k;
            for (unsigned near = meet(node, box, above); near; near &= near - 1u) {
                const int j = lowest(near);
                if (barred(node_tag.data[8 * node + j])) continue;
                if (level == 0) {
                    take(node_most.data[8 * node + j]);
                } else {
                    stack[depth++] = level - 1;
                    stack[depth++] = 8 * k + j;
                }
            }
        }
"""


@wp.func_native(search_source(_WALK, judged=True, prepare=_MEET + _LEAVES))
def _search(
    q_corners: I32, q_sides: int, q_shape: I32, q_moves: U8, q_box: F32, q_ends: F32,
    t_corners: I32, t_sides: int, t_shape: I32, t_moves: U8, t_ends: F32,
    node_box: F32, node_most: I32, node_tag: I32, level_first: I32, levels: int,
    collides: U8, shapes: int, ordered: int,
    first: int, end: int, found: I32, place: int, room: int, count: I32, write_count: int,
) -> int: ...  # fmt: skip


@wp.func
def _chunk(
    q: Features,
    t: Features,
    tree: Tree,
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
    return _search(q.corners, q.sides, q.shape, q.moves, q.box, q.ends, t.corners, t.sides, t.shape, t.moves, t.ends,
                   tree.box, tree.most, tree.tag, tree.first, tree.levels,
                   f.collides, f.shapes, f.ordered, first, end, found, place, room, count, w)  # fmt: skip


@wp.kernel
def find_bvh(begin: int, queries: Features, targets: Features, tree: Tree, wanted: Filter, lists: Lists):
    """Partners of the queries of a chunk."""
    c = int((wp.int64(begin + wp.tid()) * wp.int64(lists.stride)) % wp.int64(lists.chunks))
    lists.total[c] = _chunk(
        queries, targets, tree, wanted, c, lists.chunk, lists.found, c * lists.room, lists.room, lists.count, 1
    )


@wp.kernel
def fill_bvh(
    begin: int, queries: Features, targets: Features, tree: Tree, wanted: Filter, lists: Lists, offset: I32, a_out: I32,
    b_out: I32,
):  # fmt: skip
    """The partners of a chunk into their place."""
    c = begin + wp.tid()
    again = copy_chunk(
        lists.found, lists.count, lists.total, offset, c, lists.chunk, lists.room, queries.count, a_out, b_out
    )
    if again >= 0:
        _chunk(queries, targets, tree, wanted, c, lists.chunk, b_out, again, lists.total[c], lists.count, 0)
