"""Mechanisms that float freely keep linear and angular momentum to round-off, step by step, loops and limits included."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z
from reference import joint_rows

INERTIA = np.array([0.02, 0.03, 0.04])


def chain(kinds) -> Mechanism:
    """Bodies in a zigzag, each on the one before by the next kind of joint, thrown and spinning."""
    rng = np.random.default_rng(5)
    mechanism = Mechanism(gravity=ZERO)
    for i in range(len(kinds) + 1):
        mechanism.body(
            f"b{i}", [0.4 * i, 0.1 * (i % 2), 0.0], rng.normal(size=3), 0.5 + rng.random(), INERTIA * (1 + rng.random()),
            center=0.05 * rng.normal(size=3), v=rng.normal(size=3), w=3 * rng.normal(size=3),
        )  # fmt: skip
    for i, kind in enumerate(kinds):
        axis = rng.normal(size=3)
        across = np.cross(axis, rng.normal(size=3))
        mechanism.joint(kind, f"j{i}", f"b{i + 1}", f"b{i}", [0.4 * i + 0.2, 0.05, 0.0], axis=axis, axis_a=across if kind
                        == "universal" else None)  # fmt: skip
    return mechanism


def drift(mechanism: Mechanism, steps: int, h: float) -> None:
    """Every step changes p and L by no more than 1e-12 of sum m |v| and of the sum of all moments."""
    system = mechanism.system()
    simulation = mechanism.simulation()
    before = system.momentum(mechanism.state_of(simulation))
    for _ in range(steps):
        report = simulation.step(h)
        assert report.status == "ok", report.messages
        state = mechanism.state_of(simulation)
        after = system.momentum(state)
        x, r, v, w = system.unpack(state)
        speeds = system.mass * np.linalg.norm(v, axis=1)
        turns = np.linalg.norm(np.einsum("nij,njk,nlk,nl->ni", r, system.inertia, r, w), axis=1)
        assert np.linalg.norm(after[0] - before[0]) <= 1e-12 * speeds.sum()
        moments = speeds @ np.linalg.norm(x, axis=1) + turns.sum()
        assert np.linalg.norm(after[1] - before[1]) <= 1e-12 * moments
        assert report.momentum_error[0] <= 1e-12 and report.momentum_error[1] <= 1e-12
        before = after


@pytest.mark.parametrize(
    "kinds",
    [
        ("ball", "ball", "ball", "ball"),
        ("revolute", "universal", "revolute", "weld"),
        ("prismatic", "cylindrical", "planar", "ball"),
    ],
)
def test_floating_chains(kinds):
    drift(chain(kinds), 60, 4e-3)


def test_floating_loop():
    """Six bodies, six balls: a closed ring."""
    rng = np.random.default_rng(8)
    mechanism = Mechanism(gravity=ZERO)
    corners = [np.array([np.cos(a), np.sin(a), 0.2 * np.sin(2 * a)]) for a in np.arange(6) * np.pi / 3]
    for i in range(6):
        middle = 0.5 * (corners[i] + corners[(i + 1) % 6])
        mechanism.body(f"b{i}", middle, v=rng.normal(size=3), w=rng.normal(size=3), inertia=INERTIA)
    for i in range(6):
        mechanism.joint("ball", f"j{i}", f"b{i}", f"b{i - 1 if i else 5}", corners[i])
    drift(mechanism, 60, 4e-3)


def test_limits_springs_and_motors_are_internal_too():
    mechanism = Mechanism(gravity=ZERO)
    for i in range(4):
        mechanism.body(
            f"b{i}", 0.4 * i * X, mass=1.0 + i, inertia=INERTIA, v=(-1) ** i * Y, w=[0.0, 1.0, (-1) ** i * 3.0]
        )
    limits = {"lower_limit": -0.1, "upper_limit": 0.1}
    motor = {"on": "twist", "target_velocity": 4.0, "max_force": 0.4}
    mechanism.joint("revolute", "door", "b1", "b0", 0.2 * X, axis=Z, **limits)
    mechanism.joint("revolute", "drive", "b2", "b1", 0.6 * X, axis=Y, motor=motor)
    mechanism.joint(
        "distance", "spring", "b3", "b2", 1.1 * X, at_b=0.9 * X, rows=joint_rows.distance(0.2), known=False, min=0.3, max=0.3,
        stiffness=50.0, damping=0.2,
    )  # fmt: skip
    drift(mechanism, 80, 3e-3)
