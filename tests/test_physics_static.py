"""At rest, constraint forces carry the weight, and the shape does not depend on the step."""

import numpy as np
import pytest
from laboratory import Run, attach, join, nail, rope
from reference import closed_forms, schemes

G = 9.81


def hanging(name: str, **more) -> tuple[Run, np.ndarray]:
    """Two ropes, the lower joined to the upper, and a third attached to the lower's last spring; at rest.

    The rest state comes from statics alone: springs (stiffness s) stretched by what hangs below.
    """
    stiffness, damping = 500.0, 3.0
    upper = np.stack([np.zeros(4), np.zeros(4), -0.2 * np.arange(4)], axis=1)
    lower = upper + [0.0, 0.0, -0.6]
    bodies = [rope("upper", upper, 0.9, stiffness, damping), rope("lower", lower, 1.2, stiffness, damping)]
    side = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -0.3]])
    weights = np.array([0.5, 0.5])
    hung = weights @ lower[2:]
    bodies.append(rope("side", side + hung, 0.4, stiffness, damping))
    held = [
        nail("nail", "upper", 0),
        join("joint", ("upper", 3), ("lower", 0)),
        attach("hook", ("side", 0), "lower", [2, 3], weights),
    ]
    run = Run({"integrator": name, "gravity": [0, 0, -G], "bodies": bodies, "constraints": held, **more})
    m = run.m
    m_upper, m_lower, m_side = m[:4], m[4:8], m[8:]
    # the side rope's weight rests on lower 2 and 3 as the weights say; upper 3 and lower 0 are one point
    loaded = m_lower + np.array([0.0, 0.0, *(weights * m_side.sum())])
    chain = np.concatenate([m_upper[:3], [m_upper[3] + loaded[0]], loaded[1:]])
    depth = closed_forms.hanging_rope(chain, np.full(6, 0.2), np.full(6, stiffness), G)
    z_hook = -(weights @ depth[5:7])
    z_side = [z_hook, z_hook - 0.3 - m_side[1] * G / stiffness]
    x = np.zeros((10, 3))
    x[:, 2] = np.concatenate([-depth[:4], -depth[3:], z_side])
    return run, x


@pytest.mark.parametrize("h", [1e-3, 4e-3])
@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_reaction_is_weight_and_the_shape_is_that_of_statics(name, h):
    run, x = hanging(name)
    run.state.set_positions(x)
    weight = run.m.sum() * G
    run.steps([h] * 10)
    for _ in range(30):  # in every step: no zigzag
        run.step(h)
        assert np.abs(run.force("nail").sum(0) - [0, 0, weight]).max() < 1e-6 * weight
    assert np.abs(run.x - x).max() < 1e-10
    assert np.abs(run.v).max() < 1e-9
    side = run.m[8:].sum() * G
    assert np.abs(run.force("hook")[0] - [0, 0, side]).max() < 1e-6 * weight


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_comes_to_rest_in_the_static_shape(name):
    """From the unstretched ropes, in air that takes the speed away, at two steps."""
    for h in (0.04, 0.08) if name in schemes.IMPLICIT else (3e-3, 6e-3):
        run, x = hanging(name, forces=[{"expression": ["-2 * m * vx", "-2 * m * vy", "-8 * m * vz"]}])
        assert np.abs(run.x - x).max() > 0.02
        weight = run.m.sum() * G
        run.steps([h] * int((6.0 if name == "newmark" else 4.0) / h))  # Newmark has no damping of its own
        assert np.abs(run.force("nail").sum(0) - [0, 0, weight]).max() < 1e-6 * weight
        assert np.abs(run.x - x).max() < 1e-7


@pytest.mark.parametrize("h", [1e-3, 3e-2])
def test_a_stiff_rope_under_implicit_euler_stretches_as_statics_say(h):
    """100 points, 1e5 N/m: solved point by point its first spring would stretch by more than a metre at 30 ms."""
    n, stiffness = 100, 1e5
    points = np.stack([np.zeros(n), np.zeros(n), -0.05 * np.arange(n)], axis=1)
    scene = {
        "integrator": "implicit_euler",
        "gravity": [0, 0, -G],
        "bodies": [rope("rope", points, 1.0, stiffness)],
        "constraints": [nail("nail", "rope", 0)],
    }
    run = Run(scene)
    depth = closed_forms.hanging_rope(run.m, np.full(n - 1, 0.05), np.full(n - 1, stiffness), G)
    run.state.set_positions(np.stack([np.zeros(n), np.zeros(n), -depth], axis=1))
    run.steps([h] * 60)
    assert np.abs(run.x[:, 2] + depth).max() < 1e-9
    assert run.force("nail").sum(0) == pytest.approx([0, 0, run.m.sum() * G], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("name", ["verlet", "implicit_euler", "rk4", "beeman"])
def test_discrete_catenary(name):
    n, span, stiffness = 12, np.array([1.0, 0.2]), 800.0
    rests = np.full(n - 1, 0.14)
    line = np.linspace([0.0, 0.0, 0.0], [span[0], 0.0, span[1]], n)
    along = np.concatenate([[0.0], np.cumsum(rests)])
    rope_points = np.stack([along, 0 * along, 0 * along], axis=1)
    goals = np.array([line[0], line[-1]])
    scene = {
        "integrator": name,
        "gravity": [0, 0, -G],
        "bodies": [rope("chain", rope_points, 1.3, stiffness)],
        "constraints": [nail("ends", "chain", 0, n - 1, goal=goals)],
    }
    run = Run(scene)
    chain = closed_forms.hanging_chain(span, run.m, rests, np.full(n - 1, stiffness), G)
    x = np.stack([chain[:, 0], np.zeros(n), chain[:, 1]], axis=1)
    run.state.set_positions(x)
    run.steps([1e-3] * 200)
    assert np.abs(run.x - x).max() < 1e-9
    assert np.abs(run.force("ends").sum(0) - [0, 0, run.m.sum() * G]).max() < 1e-6 * run.m.sum() * G
