"""In which order to eliminate the nodes of a constraint graph, and what fills in.

The system is symmetric and indefinite, in blocks: a node is a body (a positive definite block: its mass) or a part of a
joint (a block that is zero or negative: its flexibility), and every other block is a Jacobian between both,

    [ M  J^T ] [ dv ]
    [ J  -C  ] [  y ].

Without pivoting a part may be eliminated once its pivot ``-(C + J M^-1 J^T)`` has the rank that it has in the end. Two
orders guarantee that:

* *bodies first*, then parts by least degree: the classic Schur complement. Each body makes a clique of its parts.
* *tree*: the depth-first order of a spanning tree of the graph, leaves first; a part follows the bodies it hangs on its
  parent, a part that closes a loop comes just before the body where the loop's two ways meet, and a part of a single
  body, which closes a loop through the world, comes last of all. Bodies with many parts make no clique then. (Right
  after its body it would hold that body before the part above it has seen its parent: a ball joint on a body that is
  held by another has two of its three rows' rank.)

Both are linear for chains and trees (Baraff 1996 for the latter); the cheaper one is taken.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.sparse.csgraph import connected_components

TREE_GAIN = 3.0  # the tree's order is taken where it is cheaper by this factor: the other one keeps accuracy best
CROWD = 6  # parts on one body from which the tree's order is tried


@dataclass
class Elimination:
    """The order and the fill. Nodes are numbered as eliminated; `number[i]` is that of node i of the graph."""

    number: np.ndarray  # (n,)
    island: np.ndarray  # (islands + 1,) first node of each island
    rows: list[np.ndarray]  # rows[k]: later nodes in column k, increasing


def eliminate(body_count: int, parts: list[np.ndarray]) -> Elimination:
    """Plan for bodies 0 .. body_count - 1 and parts, given as the bodies of each; part p is node ``body_count + p``."""
    n = body_count + len(parts)
    degree = np.array([len(p) for p in parts], dtype=np.int64)
    rows = np.repeat(np.arange(len(parts)), degree)
    columns = np.concatenate(parts).astype(np.int64) if len(parts) else np.zeros(0, np.int64)
    incidence = sp.csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(parts), body_count))
    graph = (
        sp.block_array([[None, incidence.T], [incidence, None]], format="csr") if len(parts) else sp.csr_array((n, n))
    )
    count, label = connected_components(graph, directed=False)
    of_body = incidence.tocsc()
    body_parts = [of_body.indices[of_body.indptr[b] : of_body.indptr[b + 1]] for b in range(body_count)]
    crowded = max((len(p) for p in body_parts), default=0) > CROWD

    def plan(order: np.ndarray, limit: float) -> tuple[Elimination, float] | None:
        order = order[np.argsort(label[order], kind="stable")]
        number = np.empty(n, dtype=np.int64)
        number[order] = np.arange(n)
        rows = _fill(order, number, body_count, parts, body_parts, limit)
        if rows is None:
            return None
        island = np.searchsorted(label[order], np.arange(count + 1))
        return Elimination(number, island, rows), _cost(rows)

    tree = plan(_tree(body_count, parts, body_parts), np.inf) if crowded else None
    best = plan(_bodies_first(incidence, body_count), np.inf if tree is None else TREE_GAIN * tree[1]) or tree
    assert best is not None
    return best[0]


def _cost(rows: list[np.ndarray]) -> float:
    return float(sum((len(r) + 1.0) ** 2 for r in rows))


def _bodies_first(incidence: sp.csr_array, body_count: int) -> np.ndarray:
    m = incidence.shape[0]
    if m == 0:
        return np.arange(body_count)
    shared = (incidence @ incidence.T).tocsc()
    shared.data[:] = -1.0
    matrix = (shared + sp.diags_array(np.full(m, 2.0 * m + 2.0))).tocsc()
    by_degree = spla.splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)
    return np.concatenate([np.arange(body_count), body_count + np.argsort(by_degree.perm_c)])


def _tree(body_count: int, parts: list[np.ndarray], body_parts: list[np.ndarray]) -> np.ndarray:
    """Depth-first order, leaves first, of breadth-first spanning trees."""
    parent = np.full(body_count + len(parts), -2, dtype=np.int64)  # node above; -1: a root, -2: not reached
    depth = np.zeros(len(parent), dtype=np.int64)
    reached: list[int] = []
    queue: deque[int] = deque()

    def visit(node: int, above: int) -> None:
        parent[node] = above
        depth[node] = 0 if above < 0 else depth[above] + 1
        reached.append(node)
        queue.append(node)

    def flood() -> None:
        while queue:
            node = queue.popleft()
            if node < body_count:
                for p in body_parts[node]:
                    if parent[body_count + p] == -2:
                        visit(body_count + int(p), node)
            else:
                for b in parts[node - body_count]:
                    if parent[b] == -2:
                        visit(int(b), node)

    crowd = np.argsort([-len(p) for p in body_parts], kind="stable")
    for b in crowd:
        if parent[b] == -2:
            visit(int(b), -1)
            flood()
    # A part without a child closes a loop: it goes below the body where the ways of its bodies to the root meet.
    children: list[list[int]] = [[] for _ in parent]
    has_child = np.zeros(len(parent), dtype=bool)
    for node in reached:
        if parent[node] >= 0:
            has_child[parent[node]] = True
    late: list[list[int]] = [[] for _ in parent]
    after: list[list[int]] = [[] for _ in parent]  # parts of one body, by the root above it
    root_of = np.full(len(parent), -1, dtype=np.int64)
    for node in reached:
        root_of[node] = node if parent[node] == -1 else root_of[parent[node]]
        if node >= body_count and len(parts[node - body_count]) == 1:
            after[root_of[node]].append(node)
        elif node >= body_count and not has_child[node]:
            meeting = _meeting(parts[node - body_count], parent, depth)
            while meeting >= body_count:
                meeting = int(parent[meeting])
            late[meeting].append(node)
        elif parent[node] >= 0:
            children[parent[node]].append(node)
    order: list[int] = []
    for root in (node for node in reached if parent[node] == -1):
        stack = [(root, False)]
        while stack:
            node, done = stack.pop()
            if done:
                order.extend(late[node])
                order.append(node)
                order.extend(after[node])
            else:
                stack.append((node, True))
                stack.extend((c, False) for c in children[node])
    return np.array(order, dtype=np.int64)


def _meeting(bodies: np.ndarray, parent: np.ndarray, depth: np.ndarray) -> int:
    """The lowest node above all of ``bodies`` (or one of them)."""
    ways = [int(b) for b in bodies]
    while len(set(ways)) > 1:
        deepest = max(range(len(ways)), key=lambda i: depth[ways[i]])
        ways[deepest] = int(parent[ways[deepest]])
    return ways[0]


def _fill(
    order: np.ndarray,
    number: np.ndarray,
    body_count: int,
    parts: list[np.ndarray],
    body_parts: list[np.ndarray],
    limit: float,
) -> list[np.ndarray] | None:
    """Later nodes in each column after elimination; None when the cost passes ``limit``."""
    below: list[set[int]] = [set() for _ in order]
    out: list[np.ndarray] = []
    cost = 0.0
    for k, node in enumerate(order):
        near = body_parts[node] + body_count if node < body_count else parts[node - body_count]
        own = below[k]
        own.update(int(i) for i in number[near] if i > k)
        column = np.array(sorted(own), dtype=np.int64)
        if len(column):
            first = int(column[0])
            below[first] |= own
            below[first].discard(first)
        below[k] = set()
        cost += (len(column) + 1.0) ** 2
        if cost > limit:
            return None
        out.append(column)
    return out
