"""What a step says of joints, by name, from what they miss by: arrays (4, parts) of [m], [rad], [m/s], [rad/s]."""

import numpy as np

from turnbuckle.data.state import State

SHOWN = 3  # joints named
APART = 1e-3  # of the scene's size: joints that speeds open by more in a step are told
TURNING = 0.05  # [rad], of their rotations


def open_joints(state: State, values: np.ndarray, allowed: float) -> str:
    """Joints that miss by more than ``allowed``, the worst first, each once."""
    told = []
    for p, name in _worst(state, values.max(axis=0), allowed):
        m, rad, rate, spin = values[:, p]
        told.append(f"'{name}' by {m:.2e} m and {rad:.2e} rad (rates {rate:.1e} m/s, {spin:.1e} rad/s)")
    return f"joints that cannot be closed: {', '.join(told)}"


def lost_joints(state: State, values: np.ndarray, allowed: float) -> str:
    """What a step that was lost has opened; gaps say nothing then."""
    names = [name for _, name in _worst(state, values[:2].max(axis=0), allowed)]
    return ", ".join(f"'{name}'" for name in names) or "ties of rigid bodies"


def fast_joints(state: State, values: np.ndarray, dt: float, size: float) -> str:
    """Speeds that the displacement solver has left and that open joints anew; empty where they are small."""
    opens = np.maximum(values[2] * dt / (APART * size), values[3] * dt / TURNING)
    told = [f"'{name}' at {values[2, p]:.2g} m/s and {values[3, p]:.2g} rad/s" for p, name in _worst(state, opens, 1.0)]
    if not told:
        return ""
    return (
        f"joints move apart: {', '.join(told)}, speeds that large corrections in a step of {dt:g} s have left; close the joints "
        "with assemble before the run, take a smaller dt, or the equality solver"
    )


def _worst(state: State, score: np.ndarray, allowed: float) -> list[tuple[int, str]]:
    """Part and name of the joints that act with the largest scores above ``allowed``, each joint once."""
    names = {int(p): j.name for j in state.joints.values() if j.acting for p in j.parts}
    score = np.nan_to_num(score, nan=np.inf)
    found: dict[str, int] = {}
    for p in np.argsort(-score, kind="stable"):
        if not score[p] > allowed or len(found) == SHOWN:
            break
        if int(p) in names:
            found.setdefault(names[int(p)], int(p))
    return [(p, name) for name, p in found.items()]
