"""The displacement solver: schemes, weights, momenta, angles, twists, user parameters, mass points (sections 3, 4)."""

import numpy as np
import pytest
from joints_by_hand import Mechanism, along, ball, rods
from scipy.spatial.transform import Rotation

from turnbuckle.data import rigid
from turnbuckle.data.rigid import IMMOBILE
from turnbuckle.geometry.curve_domain import Curve
from turnbuckle.geometry.quaternions import exponential, logarithm, multiply, rotate, twists
from turnbuckle.solvers.displacement.displace import displace
from turnbuckle.solvers.displacement.options import DisplacementOptions, DisplacementResult
from turnbuckle.solvers.displacement.speeds import reached_speeds
from turnbuckle.solvers.displacement.ties import PointTies


def solve(m: Mechanism, more: dict | None = None, **options) -> DisplacementResult:
    options = DisplacementOptions(**{"stop": "gaps", **options})
    return displace(m.bodies(), m.parts(), m.joints, *m.poses(), options, **(more or {}))


def pair(gap=(0.02, -0.01, 0.03), heavy: float = 3.0) -> Mechanism:
    """Two lopsided bodies, free to fly, whose points are ``gap`` apart."""
    m = Mechanism()
    m.body((0.0, 0, 0), (0.3, -0.2, 0.5), 1.0, (0.02, 0.05, 0.06))
    m.body((1.0, 0.2, 0.0), (-0.4, 0.1, 0.9), heavy, (0.3, 0.2, 0.15))
    x, q = m.poses()
    r1, r2 = Rotation.from_quat(q[1]), Rotation.from_quat(q[2])
    place = np.array([0.5, 0.1, 0.1])
    m.joint(1, 2, ball(r1.inv().apply(place - x[1]), r2.inv().apply(place + gap - x[2])))
    return m


def momenta(m: Mechanism, result: DisplacementResult) -> tuple[np.ndarray, np.ndarray, float]:
    """Sums of m dx and of x m dx + J dR (about the start), and the sum of m |dx|."""
    (x, q), mass = m.poses(), np.array(m.mass)
    v, w = reached_speeds(x, q, result.x, result.q, 1.0)
    turned = np.einsum("nij,nj->ni", m.inertias(q), w)
    return mass @ v, (np.cross(x, mass[:, None] * v) + turned).sum(axis=0), float(mass @ np.linalg.norm(v, axis=1))


@pytest.mark.parametrize("heavy", [1.0, 3.0, 400.0])
def test_scheme_two_closes_one_joint_in_one_iteration(heavy: float) -> None:
    for alpha in (1.0, None):
        result = solve(pair(heavy=heavy), scheme=2, alpha=alpha)
        assert result.converged and result.iterations == 1 and result.gap.max() < 1e-15


def test_scheme_one_is_the_rubber_of_the_paper() -> None:
    """One iteration is (14) and (15), computed here from the printed formulas."""
    m = pair()
    (x, q), alpha = m.poses(), 0.3
    mu = alpha * m.mass[1] * m.mass[2] / (m.mass[1] + m.mass[2])
    p1 = m.place(x, q, 1, m.rows[0]["p_a"])
    p2 = m.place(x, q, 2, m.rows[0]["p_b"])
    inverse = [np.linalg.inv(j) if j.any() else j for j in m.inertias(q)]
    result = solve(m, scheme=1, alpha=alpha, max_iterations=1)
    v, w = reached_speeds(x, q, result.x, result.q, 1.0)
    np.testing.assert_allclose(w[1], mu * inverse[1] @ np.cross(p1 - x[1], p2 - p1), atol=1e-12)
    np.testing.assert_allclose(w[2], mu * inverse[2] @ np.cross(p2 - x[2], p1 - p2), atol=1e-12)
    np.testing.assert_allclose(v[1], mu / m.mass[1] * (p2 - p1), atol=1e-15)
    np.testing.assert_allclose(v[2], mu / m.mass[2] * (p1 - p2), atol=1e-15)
    again = solve(m, scheme=1, alpha=alpha, max_iterations=500)
    assert again.converged and 3 < again.iterations < 200


def test_scheme_two_is_printed_18_and_19() -> None:
    m = pair()
    x, q = m.poses()
    mu = m.mass[1] * m.mass[2] / (m.mass[1] + m.mass[2])
    p1, p2 = m.place(x, q, 1, m.rows[0]["p_a"]), m.place(x, q, 2, m.rows[0]["p_b"])
    inverse = [np.linalg.inv(j) if j.any() else j for j in m.inertias(q)]
    result = solve(m, scheme=2, alpha=1.0, max_iterations=1)
    for body, arm, gap in ((1, p1 - x[1], p2 - p1), (2, p2 - x[2], p1 - p2)):
        turn = Rotation.from_rotvec(mu * inverse[body] @ np.cross(arm, gap)) * Rotation.from_quat(q[body])
        np.testing.assert_allclose(Rotation.from_quat(result.q[body]).as_matrix(), turn.as_matrix(), atol=1e-12)
    after = m.place(x, result.q, 2, m.rows[0]["p_b"]) - m.place(x, result.q, 1, m.rows[0]["p_a"])
    np.testing.assert_allclose(result.x[1] - x[1], m.mass[2] / (m.mass[1] + m.mass[2]) * after, atol=1e-15)


@pytest.mark.parametrize("scheme", [1, 2])
@pytest.mark.parametrize("weights", ["max", "sum"])
def test_linear_momentum_is_kept_by_internal_joints(scheme: int, weights: str) -> None:
    m = rods(5, gap=0.01)
    m.joints, m.rows = m.joints[1:], m.rows[1:]  # nothing holds it
    for number, row in enumerate(m.rows):
        row["joint"] = number
    m.joint(5, 1, {"kind": rigid.ANGLE, "lo": 0.0, "hi": 0.1, "q_a": along((1, 1, 0)), "q_b": along((1, 0, 0))})
    result = solve(m, scheme=scheme, weights=weights, alpha=0.2, max_iterations=12)
    linear, _, size = momenta(m, result)
    assert size > 1e-3
    assert np.abs(linear).max() < 1e-12 * size


def test_angular_momentum_to_the_order_of_the_correction() -> None:
    """Scheme one and the found alpha keep it to first order; the part that is lost falls with the gap."""
    for scheme, alpha in ((1, 0.3), (1, None), (2, None)):
        lost = []
        for size in (1.0, 0.1):
            m = pair(size * np.array([0.02, -0.01, 0.03]))
            _, angular, moved = momenta(m, solve(m, scheme=scheme, alpha=alpha, max_iterations=1))
            lost.append(np.linalg.norm(angular) / moved)
        assert lost[1] < 0.15 * lost[0] + 1e-12 and lost[0] < 0.05, (scheme, alpha, lost)


def star(mass: float = 0.5) -> Mechanism:
    """Figure 2: S1, S2 and S3 in one place, each tied to S0, which has half their mass."""
    m = Mechanism()
    centre = m.body((0.0, 0, 0), mass=mass)
    for _ in range(3):
        m.joint(m.body((1.0, 0, 0), mass=1.0), centre, ball())
    return m


def test_star_of_figure_2() -> None:
    """Summing moves them farther and farther apart, by 4/3 an iteration; weighting converges, by 2/9."""
    summed = solve(star(), weights="sum", alpha=1.0, max_iterations=30)
    assert not summed.converged
    np.testing.assert_allclose(np.divide(summed.history[1:], summed.history[:-1]), 4.0 / 3.0, rtol=1e-9)
    weighted = solve(star(), weights="max", alpha=1.0)
    assert weighted.converged and weighted.iterations < 12
    ratio = np.divide(weighted.history[1:], weighted.history[:-1])
    np.testing.assert_allclose(ratio, 2.0 / 9.0, rtol=1e-6)
    assert "'j0' by" in summed.warning() and weighted.warning() == ""


def test_slender_chains_need_another_alpha_than_the_printed_one() -> None:
    assert not solve(rods(6, gap=0.01), alpha=1.0, max_iterations=300).converged
    result = solve(rods(6, gap=0.01), max_iterations=1000)
    assert result.converged and result.gap.max() <= 1e-6


def test_alpha_of_a_joint_counts_more_than_the_scene() -> None:
    m = pair()
    m.joints[0].alpha = 0.1
    slow, fast = solve(m, alpha=1.0, max_iterations=1), solve(pair(), alpha=1.0, max_iterations=1)
    assert slow.gap[0] > 0.5 * slow.history[0] and fast.gap[0] < 1e-12
    assert slow.x[1] == pytest.approx(solve(pair(), alpha=0.1, max_iterations=1).x[1])


def hinged(*parts: dict, turn=(0.4, 0.3, -0.6), gap: float = 0.0) -> Mechanism:
    """A body turned by ``turn`` against another, tied by a ball and ``parts``; both fly."""
    m = Mechanism()
    m.body((0.0, 0, 0), (0.1, 0.2, 0.3), 2.0, (0.2, 0.3, 0.25))
    base = Rotation.from_rotvec((0.1, 0.2, 0.3))
    m.body((1.0, 0, 0), (base * Rotation.from_rotvec(turn)).as_rotvec(), 1.0, (0.05, 0.11, 0.09))
    x, q = m.poses()
    place = np.array([0.5, 0.0, 0.0])
    p_b = base.inv().apply(place)
    p_a = Rotation.from_quat(q[2]).inv().apply(place + [0, 0, gap] - x[2])
    m.joint(2, 1, ball(p_a, p_b), *parts)
    return m


def relative(result: DisplacementResult) -> np.ndarray:
    return multiply(result.q[1:2] * [-1, -1, -1, 1], result.q[2:3])


@pytest.mark.parametrize(
    ("lo", "hi", "expected"), [(0.0, 0.0, 0.0), (0.2, 0.3, 0.3), (1.2, 2.0, 1.2), (0.5, 0.5, 0.5), (0.0, 3.0, None)]
)
def test_angle(lo: float, hi: float, expected: float | None) -> None:
    q = along((0, 0, 1))
    m = hinged({"kind": rigid.ANGLE, "lo": lo, "hi": hi, "q_a": q, "q_b": q})
    result = solve(m, tolerance=1e-10)
    z = np.array([[0.0, 0.0, 1.0]])
    angle = np.arccos(np.clip(rotate(relative(result), z)[0, 2], -1, 1))
    if expected is None:
        assert result.iterations == 0
        return
    assert result.converged and lo - 1e-9 < angle < hi + 1e-7 and angle == pytest.approx(expected, abs=1e-4)
    if hi > 0.0:
        assert result.iterations <= 20


def test_one_aligned_axis_is_exact_in_one_iteration_and_leaves_the_twist_alone() -> None:
    q = along((0, 0, 1))
    m = hinged({"kind": rigid.ANGLE, "lo": 0.0, "hi": 0.0, "q_a": q, "q_b": q}, turn=(0.02, 0.01, -0.6))
    result = solve(m, max_iterations=3, tolerance=1e-12)
    assert result.angle[0] < 1e-5
    x, q0 = m.poses()
    _, w = reached_speeds(x, q0, result.x, result.q, 1.0)
    spin = np.einsum("nij,nj->ni", m.inertias(q0), w)
    assert np.linalg.norm(spin[1] + spin[2]) < 0.05 * np.linalg.norm(spin[1])


@pytest.mark.parametrize(
    ("lo", "hi", "expected"), [(-0.1, 0.2, -0.1), (0.0, 0.0, 0.0), (0.3, 1.0, 0.3), (-1.0, 1.0, -0.6)]
)
def test_twist_about_agreeing_axes(lo: float, hi: float, expected: float) -> None:
    """Where the median plane of the paper does not exist."""
    q = along((0, 0, 1))
    m = hinged({"kind": rigid.TWIST, "lo": lo, "hi": hi, "q_a": q, "q_b": q}, turn=(0.0, 0.0, -0.6))
    result = solve(m, tolerance=1e-10)
    assert result.converged
    frames = multiply(multiply(q[None] * [-1, -1, -1, 1], relative(result)), q[None])
    assert twists(frames)[0] == pytest.approx(expected, abs=1e-8)


def test_twist_goes_the_shorter_way_and_open_limits_stay_open() -> None:
    for turn, lo, hi, expected in ((3.0, -2.9, 0.5, -2.9), (3.0, -rigid.FREE, 0.5, 0.5), (-3.0, 0.5, rigid.FREE, 0.5)):
        m = hinged({"kind": rigid.TWIST, "lo": lo, "hi": hi}, turn=(0.0, 0.0, turn))
        result = solve(m, tolerance=1e-9, max_iterations=400)
        assert result.converged and twists(relative(result))[0] == pytest.approx(expected, abs=1e-8)


def test_angle_and_twist_and_translation_together_converge() -> None:
    q = along((0, 0, 1))
    cone, roll = (
        {"kind": rigid.ANGLE, "lo": 0.0, "hi": 0.2, "q_a": q, "q_b": q},
        {"kind": rigid.TWIST, "lo": -0.1, "hi": 0.1},
    )
    result = solve(hinged(cone, {**roll, "q_a": q, "q_b": q}, gap=0.1), tolerance=1e-9)
    assert result.converged and result.iterations < 40


def test_weld_is_exact_in_one_iteration_without_a_gap() -> None:
    result = solve(hinged({"kind": rigid.FIXED}), tolerance=1e-12)
    assert result.converged and result.angle.max() < 1e-12
    assert np.linalg.norm(logarithm(relative(result))) < 1e-12


def test_world_does_not_move_and_does_not_count() -> None:
    """However many joints hang on the world, each closes in one iteration."""
    m = Mechanism()
    for i in range(20):
        m.body((float(i), 0.1, 0.0))
        m.joint(i + 1, 0, ball((0.0, 0.2, 0.0), (float(i), 0.0, 0.0)))
    result = solve(m)
    assert result.converged and result.iterations == 1
    assert not result.x[0].any() and result.q[0, 3] == 1.0


def test_immobile_partner_takes_nothing() -> None:
    m = pair()
    m.motion[2] = IMMOBILE
    result = solve(m)
    np.testing.assert_array_equal(result.x[2], m.poses()[0][2])
    assert result.converged and result.iterations == 1


def test_user_parameters_replace_mass_and_inertia() -> None:
    m = pair(heavy=1000.0)
    m.ability = [np.nan, 2.0, 0.5]
    m.joints[0].mu = 0.25
    x, q = m.poses()
    result = solve(m, mobility="user_parameter", alpha=1.0, max_iterations=1)
    p1, p2 = m.place(x, q, 1, m.rows[0]["p_a"]), m.place(x, q, 2, m.rows[0]["p_b"])
    _, w = reached_speeds(x, q, result.x, result.q, 1.0)
    np.testing.assert_allclose(w[1], 0.25 * 2.0 * np.cross(p1 - x[1], p2 - p1), atol=1e-12)
    np.testing.assert_allclose(w[2], 0.75 * 0.5 * np.cross(p2 - x[2], p1 - p2), atol=1e-12)
    moved = result.x - x
    np.testing.assert_allclose(moved[1] / 0.25, -moved[2] / 0.75, atol=1e-14)
    assert solve(pair(heavy=1000.0), alpha=1.0, max_iterations=1).x[2] != pytest.approx(result.x[2])


def test_physical_and_non_physical_bodies_mix() -> None:
    m = rods(4, gap=0.02)
    m.ability[2] = 3.0
    m.joints[2].mu = 0.3
    result = solve(m, mobility="user_parameter", max_iterations=2000)
    assert result.converged


def test_contradiction_ends_and_is_named() -> None:
    m = Mechanism()
    m.body((0.0, 0, 0))
    m.joint(1, 0, ball((0.0, 0, 0), (-1.0, 0, 0)))
    m.joint(1, 0, ball((0.0, 0, 0), (1.0, 0, 0)))
    result = solve(m, max_iterations=100)
    assert not result.converged and np.isfinite(result.x).all() and result.iterations < 100
    assert "'j0' by 1 m" in result.warning() and "'j1' by 1 m" in result.warning()


def test_domains_are_reached() -> None:
    m = Mechanism()
    q = along((0, 0, 1), (1, 0, 0))
    curve = Curve(np.array([[0.0, 0, 0], [1, 1, 0], [2, 0, 1]]), spline=True)
    kinds = [
        {"kind": rigid.SEGMENT, "lo": -0.2, "hi": 0.4}, {"kind": rigid.RING, "lo": 0.2, "hi": 0.5},
        {"kind": rigid.SPHERE, "lo": 1.0, "hi": 1.0}, {"kind": rigid.CURVE, "domain": 0},
    ]  # fmt: skip
    for i, part in enumerate(kinds):
        m.body((0.3 + i, 0.2, 0.9), (0.2, 0.1, 0.4), 1.0, (0.1, 0.2, 0.15))
        m.body((float(i), 0.1, 0.0), (0.1, 0.3, 0.0), 2.0, (0.2, 0.2, 0.3))
        m.joint(2 * i + 1, 2 * i + 2, {**part, "p_a": (0.0, 0.1, 0.0), "p_b": (0.0, 0.0, 0.1), "q_b": q})
    result = solve(m, {"domains": [curve]}, tolerance=1e-10)
    assert result.converged
    for i in range(4):
        a, b = 2 * i + 1, 2 * i + 2
        p = m.place(result.x, result.q, a, (0.0, 0.1, 0.0)) - result.x[b]
        local = Rotation.from_quat(result.q[b]).inv().apply(p) - [0.0, 0.0, 0.1]
        if i == 0:
            assert np.hypot(*local[:2]) < 1e-9 and -0.2 - 1e-9 < local[2] < 0.4 + 1e-9
        if i == 1:
            assert abs(local[2]) < 1e-9 and 0.2 - 1e-9 < np.hypot(*local[:2]) < 0.5 + 1e-9
        if i == 2:
            assert np.linalg.norm(local) == pytest.approx(1.0, abs=1e-9)
        if i == 3:
            assert np.linalg.norm(curve.nearest(local[None])[0] - local) < 1e-9


def test_rolling_turns_the_wheel_by_the_way_it_goes() -> None:
    m = Mechanism()
    m.body((0.0, 0.0, 0.5), mass=2.0, inertia=(0.3, 0.5, 0.3))
    m.joint(1, 0, {"kind": rigid.ROLLING, "hi": 0.5, "lo": 0.0, "q_a": along((0, 1, 0)), "q_b": along((0, 0, 1))})
    x0, q0 = m.poses()
    x1 = x0 + [[0, 0, 0], [0.1, 0.0, -0.02]]
    result = displace(
        m.bodies(), m.parts(), m.joints, x1, q0, DisplacementOptions(tolerance=1e-12, stop="gaps"), start=(x0, q0)
    )
    assert result.converged
    way, turn = result.x[1] - x0[1], logarithm(result.q[1:2])[0]
    assert way[2] == pytest.approx(0.0, abs=1e-11) and 0.0 < way[0] < 0.1
    np.testing.assert_allclose(turn, [0.0, way[0] / 0.5, 0.0], atol=1e-10)
    # An impulse at the rim: m dx = J / m share of a wheel that was pushed at its centre.
    assert way[0] == pytest.approx(0.1 * 2.0 / (2.0 + 0.5 / 0.25), rel=1e-3)


def test_mass_points_are_moved_with_rigid_bodies() -> None:
    """A point of a body on the weighted place of three mass points, and one mass point nailed."""
    m = Mechanism()
    m.body((0.0, 0, 0), (0.1, 0.0, 0.2), 2.0, (0.1, 0.1, 0.1))
    points = np.array([[0.6, 0, 0], [0.6, 1, 0], [0.6, 0, 1], [3.0, 0, 0]])
    weight = np.array([1.0, -0.5, -0.3, -0.2, 1.0])
    ties = PointTies(
        np.array([0, 4, 5]), weight, np.array([1, -1, -1, -1, -1]), np.array([0, 0, 1, 2, 3]),
        np.array([[0.5, 0, 0], *np.zeros((4, 3))]), np.array([[0.0, 0, 0], [3.0, 0.5, 0]]), names=["hold", "nail"],
    )  # fmt: skip
    mass = np.array([0.5, 0.25, 1.0, 1.0])
    m.joint(1, 0, {"kind": rigid.ANGLE, "lo": 0.0, "hi": 3.0})
    result = solve(m, {"ties": ties, "points": points, "point_mass": mass}, tolerance=1e-12)
    assert result.converged and result.names == ["j0", "hold", "nail"]
    place = m.place(result.x, result.q, 1, (0.5, 0, 0))
    np.testing.assert_allclose(place, -weight[1:4] @ result.points[:3], atol=1e-11)
    np.testing.assert_allclose(result.points[3], [3.0, 0.5, 0.0], atol=1e-12)
    assert (np.linalg.norm(result.points - points, axis=1) > 1e-3).all()
    moved = 2.0 * result.x[1] + mass[:3] @ (result.points - points)[:3]
    assert np.abs(moved).max() < 1e-14


def test_speeds() -> None:
    turn = np.array([[0.0, 0.0, 0.3]])
    q0 = exponential(np.array([[0.5, -0.2, 0.1]]))
    q1 = multiply(exponential(turn), q0)
    v, w = reached_speeds(np.zeros((1, 3)), q0, np.array([[0.1, 0, 0]]), q1, 0.1)
    np.testing.assert_allclose(v, [[1.0, 0, 0]])
    np.testing.assert_allclose(w, turn / 0.1, atol=1e-12)
    _, printed = reached_speeds(np.zeros((1, 3)), q0, np.zeros((1, 3)), q1, 0.1, "paper")
    np.testing.assert_allclose(printed, [[0, 0, np.sin(0.3) / 0.1]], atol=1e-12)


def test_rotation_of_an_iteration_is_limited() -> None:
    m = Mechanism()
    m.body((0.0, 0, 0), inertia=(1e-3, 1e-3, 1e-3))
    m.joint(1, 0, ball((0.5, 0, 0), (0.5, 3.0, 0)))
    result = solve(m, max_iterations=1, max_rotation=0.2, alpha=1.0)
    assert np.linalg.norm(logarithm(result.q[1:2])) == pytest.approx(0.2, abs=1e-12)


def test_it_stops_by_the_corrections_of_each_joint() -> None:
    """The letter of 2.2: a star of many arms is left open by more than its weighted corrections."""
    m = Mechanism()
    hub = m.body((0.0, 0, 0), mass=50.0)
    for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        m.joint(m.body((np.cos(angle), np.sin(angle), 0.1)), hub, ball())
    result = solve(m, stop="corrections", tolerance=1e-3)
    assert result.converged and 2e-3 < result.gap.max() < 1.3e-2
    opposite = Mechanism()
    opposite.body((0.0, 0, 0))
    opposite.joint(1, 0, ball((0.0, 0, 0), (-1.0, 0, 0)))
    opposite.joint(1, 0, ball((0.0, 0, 0), (1.0, 0, 0)))
    assert not solve(opposite, stop="corrections", max_iterations=50).converged
