"""A hanging net of cubes whose joints are exchanged in the run, so that it becomes a bridge: Local, Figure 4."""

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene
from turnbuckle.scenes.curtain_geometry import CUBE_CORNERS, CUBE_TETRAHEDRA

# Corners of a cube: x = bit 0, y = bit 1, z = bit 2. Edges along y, as the numbers of their two ends.
LEFT_LOW, RIGHT_LOW, LEFT_HIGH, RIGHT_HIGH = (np.array([k, k + 2]) for k in (0, 1, 4, 5))
# Edges along x at the lower side.
FRONT_LOW, BACK_LOW = np.array([0, 1]), np.array([2, 3])


def net_to_bridge(
    columns: int = 46,
    lanes: int = 12,
    edge: float = 0.1,
    change_at: float = 1.2,
    closing: float = 1.2,
    span: float = 0.95,
    stiffness: float = 200.0,
    density: float = 200.0,
    air: float = 1.0,
    dt: float = 2e-4,
    duration: float = 4.0,
) -> Scene:
    """A net hangs from four nails; at `change_at` its joints end and others draw the cubes into a bridge (Figure 4).

    Net: `columns` columns of `lanes` cubes of length `edge` [m] stand like the black squares of a chessboard. Where they
    touch, an edge of two corners joins them: every cube to the next along its lane, and neighbouring lanes at every
    second column, staggered, which leaves the meshes. Bridge: each lane becomes a chain of cubes that lie face to face,
    hinged at its upper side; neighbouring lanes are tied, staggered; the ends of all lanes are nailed at two banks that
    stand `span` of the chain's length apart. The change takes `closing` [s] and closes every gap at a steady rate.

    Counts: 2760 tetrahedra as in the paper (552 cubes of five). Net: 1576 points to point and 8 nails, 1584 as in the
    paper. Bridge: 1224 points to point and 96 nails, 1320 as in the paper. The paper prints only the sums; this layout
    is ours.
    """
    if columns < 4 or lanes < 2:
        raise InputError(f"net_to_bridge: columns = {columns}, lanes = {lanes}; at least 4 and 2 are needed")
    if not 0.0 < change_at:
        raise InputError(f"net_to_bridge: change_at = {change_at:g} s must be positive")
    column, lane = (a.ravel() for a in np.indices((columns, lanes)))
    first = 8 * np.arange(columns * lanes).reshape(columns, lanes)  # the first corner of cube (column, lane)
    low = np.stack([column, np.zeros_like(column), -2 * lane - column % 2 - 1], axis=1)
    vertices = edge * (low[:, None, :] + CUBE_CORNERS - [columns / 2.0, 0.5, 0.0]).reshape(-1, 3)
    cells = (first.ravel()[:, None, None] + CUBE_TETRAHEDRA).reshape(-1, 4)

    scene = Scene("net_to_bridge", dt=dt, duration=duration)
    scene.add_solid(
        "cubes",
        vertices=vertices,
        tetrahedra=cells,
        density=density,
        color=[0.55, 0.40, 0.25],
        k_distance=stiffness,
        k_area=stiffness,
        k_volume=stiffness,
        damping_distance=2e-5 * stiffness,
        damping_area=2e-5 * stiffness,
        damping_volume=2e-5 * stiffness,
    )
    if air > 0.0:
        scene.add_force("air", expression=[f"-{air!r} * m * {v}" for v in ("vx", "vy", "vz")])

    net = {"end": change_at}
    held = _net_nails(first)
    scene.add_constraint("nail", "net_nails", points={"body": "cubes", "indices": held}, **net)
    scene.add_constraint("points_to_point", "net_joints", zip=_sides(_net_joints(first)), **net)

    ramp = {"steps": max(round(closing / dt), 1)}
    bridge = {"start": change_at, "ramp": ramp}
    banks, goals = _banks(first, edge, 0.5 * span * columns * edge, -lanes * edge)
    scene.add_constraint("nail", "banks", points={"body": "cubes", "indices": banks}, goal=goals, **bridge)
    scene.add_constraint("points_to_point", "bridge_joints", zip=_sides(_bridge_joints(first)), **bridge)
    return scene


def _pairs(a: np.ndarray, edge_a: np.ndarray, b: np.ndarray, edge_b: np.ndarray) -> np.ndarray:
    """Both corners of an edge of the cubes at `a`, each with that of the cubes at `b` (first corners), (n, 2)."""
    return np.stack([(a.reshape(-1, 1) + edge_a).ravel(), (b.reshape(-1, 1) + edge_b).ravel()], axis=1)


def _sides(pairs: np.ndarray) -> list[dict]:
    return [{"body": "cubes", "indices": side} for side in pairs.T]


def _net_joints(first: np.ndarray) -> np.ndarray:
    """Joints of the net. Cubes of odd columns stand one edge lower than those of even ones."""
    even, odd = first[0:-1:2], first[1::2]  # columns 0, 2, ... and those to the right of them
    right = first[2::2]  # even columns to the right of an odd one
    left = odd[: len(right)]
    along = [_pairs(even, RIGHT_LOW, odd, LEFT_HIGH), _pairs(left, RIGHT_HIGH, right, LEFT_LOW)]
    # Lanes j and j + 1 meet at every column; they are joined to the right of even columns for even j, of odd for odd j.
    across = [
        _pairs(even[:, 1::2], RIGHT_HIGH, odd[:, 0:-1:2], LEFT_LOW),
        _pairs(left[:, 1:-1:2], RIGHT_LOW, right[:, 2::2], LEFT_HIGH),
    ]
    return np.concatenate([*along, *across])


def _net_nails(first: np.ndarray) -> np.ndarray:
    """Four upper edges of the first lane, at even columns, evenly apart."""
    last = (len(first) - 1) // 2 * 2
    inner = round(0.3 * last / 2) * 2
    return np.concatenate(
        [
            first[0, 0] + LEFT_HIGH,
            first[inner, 0] + LEFT_HIGH,
            first[last - inner, 0] + RIGHT_HIGH,
            first[last, 0] + RIGHT_HIGH,
        ]
    )


def _bridge_joints(first: np.ndarray) -> np.ndarray:
    """Hinges along the lanes, and ties of neighbouring lanes at every seventh column, staggered."""
    columns = len(first)
    along = _pairs(first[:-1], RIGHT_HIGH, first[1:], LEFT_HIGH)
    even, odd = np.arange(1, columns - 1, 7), np.arange(4, columns - 4, 7)
    across = []
    for rows, start in ((even, 0), (odd, 1)):
        near = first[rows][:, start:-1:2]
        far = first[rows][:, start + 1 :: 2]
        across.append(_pairs(near, BACK_LOW, far, FRONT_LOW))
    return np.concatenate([along, *across])


def _banks(first: np.ndarray, edge: float, reach: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Outer faces of the first and the last cube of each lane, and where they go: side by side along y [m]."""
    lanes = first.shape[1]
    points, goals = [], []
    for cubes, corners, x in ((first[0], [0, 2, 4, 6], -reach), (first[-1], [1, 3, 5, 7], reach)):
        offset = CUBE_CORNERS[corners] * [0.0, edge, edge]
        y = edge * (np.arange(lanes) - 0.5 * lanes)
        base = np.stack([np.full(lanes, x), y, np.full(lanes, height)], axis=1)
        points.append((cubes[:, None] + corners).ravel())
        goals.append((base[:, None, :] + offset).reshape(-1, 3))
    return np.concatenate(points), np.concatenate(goals)
