"""What can be said of rigid bodies and joints before a scene runs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from turnbuckle.data import rigid
from turnbuckle.data.model import Model
from turnbuckle.data.state import State
from turnbuckle.scene.freedom import freedom
from turnbuckle.scene.joint_rows import acting_at_start, joint_rows
from turnbuckle.solvers.displacement.displace import Displacement
from turnbuckle.solvers.displacement.options import DisplacementOptions

OPEN = 1e-6  # of the scene's size, or [rad]: a joint that starts open by more is worth a warning
FAST = 1e-6  # of the largest speed: velocities that open a joint faster are
SHOWN = 5  # joints named
MOTIONS = {rigid.DYNAMIC: "dynamic", rigid.IMMOBILE: "immobile", rigid.TRAJECTORY: "on a trajectory"}


def moving_mass(model: Model) -> float:
    """Mass of all mass points and dynamic rigid bodies [kg]."""
    bodies = model.rigid
    return float(np.sum(model.mass)) + float(np.sum(bodies.mass[bodies.motion == rigid.DYNAMIC]))


def rigid_counts(model: Model, state: State) -> Iterator[tuple[str, str]]:
    """Rigid bodies, joints by kind, and what the mechanism can do, as (label, text)."""
    bodies = model.rigid
    if bodies.count == 1:
        return
    own = bodies.motion[1:]
    kinds = ", ".join(f"{int((own == k).sum())} {word}" for k, word in MOTIONS.items() if (own == k).any())
    yield "rigid bodies", f"{len(own)} ({kinds})"
    for kind in dict.fromkeys(joint.kind for joint in state.joints.values()):
        yield f"joints: {kind}", str(sum(joint.kind == kind for joint in state.joints.values()))
    if not state.joints:
        yield "joints", "0"
    joints, acting = acting_at_start(state)
    found = freedom(joint_rows(state, joints, acting), own_motion(model), max(model.size, 1e-12))
    yield "degrees of freedom", f"{found.degrees} (6 a dynamic body, less what joints hold at the start)"
    if found.repeated:
        rows = f"{found.repeated} of {found.rows} rows"
        yield "redundant", f"{rows} of joints, among {_names([joints[j].name for j in found.joints])}"


def own_motion(model: Model) -> np.ndarray:
    """Which bodies are dynamic (n,) bool."""
    return model.rigid.motion == rigid.DYNAMIC


def rigid_warnings(model: Model, state: State) -> Iterator[str]:
    """Joints that start open, and velocities that open them."""
    joints, acting = acting_at_start(state)
    if not acting.any():
        return
    options = DisplacementOptions(tolerance=0.0, max_iterations=0)
    solver = Displacement(model.rigid, state.parts, joints, options, acting=acting, domains=state.domains)
    start = solver.solve(state.rigid.x.numpy(), state.rigid.q.numpy())
    wide = [
        (max(gap / model.size, angle), f"{name!r} by {_size(gap, 'm', angle, 'rad')}")
        for name, gap, angle in zip(start.names, start.gap, start.angle, strict=True)
        if gap > OPEN * model.size or angle > OPEN
    ]
    if wide:
        yield (
            f"{_count(len(wide), 'joint starts', 'joints start')} open: {_worst(wide)}; closing in the first step is like "
            "a blow: move the bodies together with turnbuckle assemble"
        )
    rows = joint_rows(state, joints, acting)
    v, w = state.rigid.v.numpy(), state.rigid.w.numpy()
    rates = np.abs(rows.rates(v, w))
    limit = FAST * max(float(np.abs(v).max()), float(np.abs(w).max()) * model.size)
    fast = []
    for j in np.unique(rows.joint[rates > np.where(rows.turning, limit / max(model.size, 1e-12), limit)]):
        mine = rows.joint == j
        speed = float(np.linalg.norm(rates[mine & ~rows.turning]))
        spin = float(np.linalg.norm(rates[mine & rows.turning]))
        fast.append((max(speed, spin * model.size), f"{joints[j].name!r} by {_size(speed, 'm/s', spin, 'rad/s')}"))
    if fast:
        yield (
            f"initial velocities open {_count(len(fast), 'joint', 'joints')}: {_worst(fast)}; the first step changes them, "
            "like a blow: give the bodies velocities that agree"
        )


def _count(n: int, one: str, many: str) -> str:
    return f"{n} {one if n == 1 else many}"


def _size(a: float, unit_a: str, b: float, unit_b: str) -> str:
    told = [f"{value:.3g} {unit}" for value, unit in ((a, unit_a), (b, unit_b)) if value > 1e-12]
    return " and ".join(told)


def _worst(found: list[tuple[float, str]]) -> str:
    ordered = [text for _, text in sorted(found, key=lambda item: -item[0])]
    more = [f"and {len(ordered) - SHOWN} more"] if len(ordered) > SHOWN else []
    return ", ".join([*ordered[:SHOWN], *more])


def _names(names: list[str]) -> str:
    shown = [repr(name) for name in names[: 2 * SHOWN]]
    return ", ".join([*shown, *([f"and {len(names) - len(shown)} more"] if len(names) > len(shown) else [])])
