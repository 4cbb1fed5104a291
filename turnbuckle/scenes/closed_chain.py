"""A chain of boxes on ball joints, held by the world at both ends: one loop of any length."""

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene


def hanging_slopes(n: int, span: float) -> tuple[np.ndarray, float]:
    """Slopes of n equal rods that hang at rest between two points, and the pull along the chord over a rod's weight.

    With weight w, joint k bears the vertical force w (k - n/2) and all bear the same horizontal force H. Moments about
    the middle of rod i between joints i and i + 1 vanish when tan(slope) = w/H (i + 1/2 - n/2). H follows from the
    span, `span` times the length of all rods. Returns slopes (n,) [rad] and H / w.
    """
    middle = np.arange(n) + 0.5 - 0.5 * n

    def excess(log_pull: float) -> float:
        return float(np.cos(np.arctan(middle * np.exp(-log_pull))).mean()) - span

    pull = float(np.exp(brentq(excess, np.log(n) - 30.0, np.log(n) + 30.0, xtol=1e-13)))
    return np.arctan(middle / pull), pull


def chain_shape(n: int, length: float, span: float, tilt: float) -> tuple[np.ndarray, Rotation]:
    """Ends of the boxes (n + 1, 3) [m] and their orientations (n); boxes lie along their x axes, z is up."""
    slope, _ = hanging_slopes(n, span)
    turn = Rotation.from_rotvec([tilt, 0.0, 0.0])
    along = turn.apply(length * np.stack([np.cos(slope), np.zeros(n), np.sin(slope)], axis=1))
    ends = np.concatenate([np.zeros((1, 3)), np.cumsum(along, axis=0)])
    return ends - [0.5 * ends[-1, 0], 0.0, 0.0], turn * Rotation.from_rotvec(np.outer(slope, [0.0, -1.0, 0.0]))


def closed_chain(
    n: int = 100,
    length: float = 0.2,
    thickness: float = 0.05,
    mass: float = 1.0,
    span: float = 0.7,
    tilt: float = 0.6,
    dt: float = 1.0 / 240.0,
    duration: float = 4.0,
) -> Scene:
    """A chain of `n` boxes on n + 1 ball joints swings between two points of the world: a closed loop.

    Boxes are `length` [m] long, `thickness` [m] thick and of `mass` [kg]; the ends are `span` times the length of the
    chain apart. It starts in the shape in which it would hang at rest, turned by `tilt` [rad] about the line through its
    ends, so that it swings; with tilt = 0 it stays as it is, and the pull in every joint is known in closed form.
    Such chains, open or closed, are what the solvers of articulated bodies are timed on; the paper has none.
    """
    if n < 2:
        raise InputError(f"closed_chain: n = {n}; at least 2 boxes are needed")
    if not 0.0 < span < 1.0:
        raise InputError(f"closed_chain: span = {span:g} must be between 0 and 1")
    ends, orientations = chain_shape(n, length, span, tilt)
    turns = orientations.as_rotvec()
    left, right = [-0.5 * length, 0.0, 0.0], [0.5 * length, 0.0, 0.0]
    boxes = [
        {
            "type": "rigid",
            "name": f"box_{i}",
            "box": [length, thickness, thickness],
            "mass": mass,
            "position": 0.5 * (ends[i] + ends[i + 1]),
            "rotation": turns[i],
            "color": [0.20, 0.40, 0.62] if i % 2 == 0 else [0.85, 0.60, 0.25],
        }
        for i in range(n)
    ]
    joints: list[dict] = [
        {"type": "ball", "name": "joint_0", "body1": "box_0", "local_pos0": ends[0], "local_pos1": left}
    ]
    joints += [
        {
            "type": "ball",
            "name": f"joint_{i}",
            "body0": f"box_{i - 1}",
            "body1": f"box_{i}",
            "local_pos0": right,
            "local_pos1": left,
        }
        for i in range(1, n)
    ]
    last = {"body1": f"box_{n - 1}", "local_pos0": ends[-1], "local_pos1": right}
    joints.append({"type": "ball", "name": f"joint_{n}", **last})
    return Scene("closed_chain", dt=dt, duration=duration, bodies=boxes, constraints=joints)
