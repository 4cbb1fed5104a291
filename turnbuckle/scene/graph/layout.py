"""Where the nodes of a graph go: distances on the page like numbers of edges between (stress majorisation)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, shortest_path

MAX_ITERATIONS = 400
MAX_WORK = 6e6  # pairs of nodes times iterations: a second or two
TOLERANCE = 1e-5
GAP = 1.0  # between parts that are not connected, in lengths of an edge


def layout(count: int, edges: list[tuple[int, int]], ground: int | None = None) -> np.ndarray:
    """Places of `count` nodes, shape (count, 2), an edge about 1 long, y down; the node `ground` lies low.

    The same graph always gets the same places.
    """
    if count == 0:
        return np.zeros((0, 2))
    a, b = np.array(edges, dtype=int).reshape(-1, 2).T
    matrix = coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    parts, part_of = connected_components(matrix, directed=False)
    places = np.zeros((count, 2))
    right = 0.0
    for part in range(parts):
        members = np.flatnonzero(part_of == part)
        own = matrix.tocsr()[members][:, members]
        distances = shortest_path(own, directed=False, unweighted=True)
        x = _turned(_majorised(distances), _index(members, ground))
        x += [right - x[:, 0].min(), -0.5 * (x[:, 1].min() + x[:, 1].max())]
        right = x[:, 0].max() + GAP
        places[members] = x
    return places


def _index(members: np.ndarray, node: int | None) -> int | None:
    if node is None or node not in members:
        return None
    return int(np.flatnonzero(members == node)[0])


def _majorised(d: np.ndarray) -> np.ndarray:
    """Places that minimise sum (|x_i - x_j| - d_ij)^2 / d_ij^2, from the classical scaling of d (Gansner et al. 2004)."""
    n = len(d)
    if n == 1:
        return np.zeros((1, 2))
    centred = -0.5 * (d**2 - (d**2).mean(0) - (d**2).mean(1)[:, None] + (d**2).mean())
    values, vectors = np.linalg.eigh(centred)
    x = vectors[:, -2:] * np.sqrt(np.maximum(values[-2:], 0.0))
    x = x[:, ::-1] * np.where(vectors[np.abs(vectors[:, -2:]).argmax(0), [-2, -1]][::-1] < 0, -1.0, 1.0)
    # Nodes that play the same part coincide there; a small spiral sets them apart.
    k = np.arange(n)
    x += 0.05 * np.sqrt(k / n)[:, None] * np.stack([np.cos(2.4 * k), np.sin(2.4 * k)], axis=1)
    w = 1.0 / (d + np.eye(n)) ** 2 - np.eye(n)
    laplacian = np.diag(w.sum(1)) - w
    inverse = np.linalg.inv(laplacian + 1.0 / n) - 1.0 / n  # the mean is kept at the origin
    for _ in range(min(MAX_ITERATIONS, max(10, int(MAX_WORK / n**2)))):
        length = np.linalg.norm(x[:, None] - x[None], axis=2)
        b = -w * d / np.maximum(length, 1e-9)
        np.fill_diagonal(b, 0.0)
        np.fill_diagonal(b, -b.sum(1))
        new = inverse @ (b @ x)
        done = np.abs(new - x).max() < TOLERANCE
        x = new
        if done:
            break
    return x


def _turned(x: np.ndarray, ground: int | None) -> np.ndarray:
    """Turned so that the ground lies below the middle; without one, the long way lies flat."""
    x = x - x.mean(0)
    if ground is not None and np.linalg.norm(x[ground]) > 0.2:
        down = x[ground] / np.linalg.norm(x[ground])
        return x @ np.array([[down[1], down[0]], [-down[0], down[1]]])
    _, vectors = np.linalg.eigh(x.T @ x)
    return x @ vectors[:, ::-1]
