"""The references hold on their own: derivatives, orders and closed forms, without the library."""

import itertools
import math

import numpy as np
import pytest
from reference import closed_forms, constraints, energies, oscillator, schemes

TETRAHEDRA = [(0, 1, 2, 3), (1, 2, 3, 4)]


def two_tetrahedra(rng: np.random.Generator) -> tuple[np.ndarray, list[energies.Element]]:
    rest = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
    rest += 0.1 * rng.standard_normal(rest.shape)
    return rest, energies.solid(rest, TETRAHEDRA, (3.0, 2.0, 5.0), (0.06, 0.04, 0.1))


def test_a_solid_has_one_energy_an_edge_a_face_and_a_tetrahedron():
    _, elements = two_tetrahedra(np.random.default_rng(0))
    counts = {kind: sum(e.kind == kind for e in elements) for kind in ("distance", "area", "volume")}
    assert counts == {"distance": 9, "area": 7, "volume": 2}  # 12 and 8 less what the two share


@pytest.mark.parametrize("kind, count", [("distance", 2), ("area", 3), ("volume", 4)])
def test_gradients_by_complex_step_and_differences(kind, count):
    rng = np.random.default_rng(1)
    for _ in range(20):
        p = rng.standard_normal((count, 3))
        exact = energies.measure_gradient(kind, p)
        for i in range(count):
            for axis in range(3):
                shift = np.zeros((count, 3), dtype=complex)
                shift[i, axis] = 1j * energies.STEP
                by_complex_step = np.imag(energies.measure(kind, p + shift)) / energies.STEP
                assert exact[i, axis] == pytest.approx(by_complex_step, rel=1e-12, abs=1e-13)
                shift = np.imag(shift) * (1e-6 / energies.STEP)
                change = energies.measure(kind, p + shift) - energies.measure(kind, p - shift)
                assert exact[i, axis] == pytest.approx(change / 2e-6, abs=1e-8)


def test_elastic_force_is_the_slope_of_the_energy_and_damping_takes_power():
    rng = np.random.default_rng(2)
    rest, elements = two_tetrahedra(rng)
    x = rest + 0.2 * rng.standard_normal(rest.shape)
    v = rng.standard_normal(rest.shape)
    still = energies.forces(elements, x, 0 * v)
    for i in range(5):
        for axis in range(3):
            shift = np.zeros(x.shape, dtype=complex)
            shift[i, axis] = 1j * energies.STEP
            slope = np.imag(energies.energy(elements, x + shift)) / energies.STEP
            assert still[i, axis] == pytest.approx(-slope, rel=1e-11, abs=1e-12)
    damping = energies.forces(elements, x, v) - still
    rates = []
    for e in elements:
        points = list(e.points)
        rates.append(np.sum(energies.measure_gradient(e.kind, x[points]) / e.rest * v[points]))
    power = -sum(e.k_d * rate**2 for e, rate in zip(elements, rates, strict=True))
    assert np.sum(damping * v) == pytest.approx(power, rel=1e-11)
    assert power < 0
    total = energies.forces(elements, x, v)
    assert np.abs(total.sum(0)).max() < 1e-13
    assert np.abs(np.cross(x, total).sum(0)).max() < 1e-13


def test_jacobians_by_both_ways_and_symmetric():
    rng = np.random.default_rng(3)
    rest, elements = two_tetrahedra(rng)
    x, v = rest + 0.2 * rng.standard_normal(rest.shape), rng.standard_normal(rest.shape)

    def force(x, v, t):
        return energies.forces(elements, x, v)

    k, d = energies.jacobians(force, x, v, 0.0)
    k2, d2 = energies.jacobians_by_differences(force, x, v, 0.0)
    assert np.abs(k - k2).max() < 1e-7 * np.abs(k).max()
    assert np.abs(d - d2).max() < 1e-7 * np.abs(d).max()
    assert np.abs(d - d.T).max() < 1e-13 * np.abs(d).max()
    k_still, _ = energies.jacobians(force, x, 0 * v, 0.0)
    assert np.abs(k_still - k_still.T).max() < 1e-12 * np.abs(k_still).max()


def test_spring_is_hookes_law():
    x = np.array([[0, 0, 0], [0.7, 0, 0]])
    v = np.array([[0, 0, 0], [2.0, 5.0, 0]])
    f = energies.forces([energies.spring(0, 1, 0.5, stiffness=100.0, damping=3.0)], x, v)
    assert f[0] == pytest.approx([100.0 * 0.2 + 3.0 * 2.0, 0, 0], rel=1e-13)
    assert f[1] == pytest.approx(-f[0], rel=1e-15)


@pytest.mark.parametrize("gamma", [0.0, 0.8])
@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_schemes_give_the_exact_discrete_oscillator(name, gamma):
    omega2, steps = 30.0, [(0.01, 60), (0.004, 41), (0.02, 50)]
    x, v = np.array([[0.8, -0.2, 0.0]]), np.array([[-1.0, 2.0, 0.5]])
    sizes = [h for h, count in steps for _ in range(count)]
    m = np.array([2.5])
    got = schemes.run(name, x, v, lambda x, v, t: -2.5 * (omega2 * x + gamma * v), m, sizes)
    want = np.array([oscillator.states(name, x[0, i], v[0, i], omega2, gamma, steps) for i in range(3)]).T
    assert got[0][0] == pytest.approx(want[0], abs=2e-13)
    assert got[1][0] == pytest.approx(want[1], abs=5e-12)


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_exact_discrete_oscillator_has_the_order_of_the_scheme(name):
    omega2, gamma, end = 9.0, 0.5, 1.6
    want = np.array(closed_forms.damped_oscillator(1.0, 0.3, omega2, gamma, end))
    states = [oscillator.states(name, 1.0, 0.3, omega2, gamma, [(end / n, n)]) for n in (256, 512, 1024)]
    errors = [np.hypot(*((np.array(state) - want) / [1.0, 3.0])) for state in states]
    order = schemes.ORDER[name] if name != "verlet" else 1  # the velocity lags by a step
    for coarse, fine in itertools.pairwise(errors):
        assert math.log2(coarse / fine) == pytest.approx(order, abs=0.1)
    if name == "verlet":
        want = closed_forms.damped_oscillator(1.0, 0.3, omega2, 0.0, end)[0]
        errors = [abs(oscillator.states(name, 1.0, 0.3, omega2, 0.0, [(end / n, n)])[0] - want) for n in (64, 128)]
        assert math.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)


def swing(damping: float = 0.2) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, energies.Force]:
    """Two soft links hang from a nail; a third hangs on them by points to point and by an attached point."""
    x = np.array([[0, 0, 0], [0.4, 0, -0.1], [0.8, 0.1, -0.2], [0.8, 0.1, -0.2], [1.0, 0.2, -0.4], [0.2, 0, -0.05]])
    m = np.array([1.0, 0.5, 0.7, 2.0, 0.9, 1.3])
    pairs = [(0, 1), (1, 2), (3, 4)]
    springs = [energies.spring(i, j, float(np.linalg.norm(x[j] - x[i])), 60.0, damping) for i, j in pairs]
    gravity = np.array([0, 0, -9.81])
    rows = np.concatenate(
        [
            constraints.nail_row(6, 0),
            constraints.points_to_point_rows(6, [2, 3]),
            constraints.attach_row(6, 5, [0, 1], np.array([0.5, 0.5])),
        ]
    )
    # the nail holds point 0, on which the attached point also acts: rows are solved together
    return x, np.zeros_like(x), m, rows, lambda x, v, t: energies.forces(springs, x, v) + m[:, None] * gravity


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_order_is_kept_with_constraints_active(name):
    x, v, m, rows, force = swing(damping=0.0 if name == "verlet" else 0.2)  # its damping takes the lagged velocity
    end = 0.32
    fine, _ = schemes.run("rk4", x, v, force, m, [end / 320] * 320, rows)
    counts = (24, 48, 96)
    errors = []
    for n in counts:
        got, speed = schemes.run(name, x, v, force, m, [end / n] * n, rows)
        assert np.abs(rows @ got - rows @ x).max() < 1e-12
        assert np.abs(rows @ speed).max() < 1e-11
        errors.append(np.abs(got - fine).max())
    order = schemes.ORDER[name]
    for coarse, less in itertools.pairwise(errors):
        assert math.log2(coarse / less) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("name", schemes.EXPLICIT)
def test_position_response_is_what_a_force_does(name):
    h, m = 0.013, np.array([0.3, 7.0])
    x, v = np.array([[0.1, 0.2, 0.3], [1.0, 0.0, 0.0]]), np.array([[1.0, 2.0, 3.0], [0.0, -1.0, 0.0]])
    push = np.array([[3.0, 0.0, 1.0], [0.0, 2.0, 5.0]])
    field = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, -70.0]])
    # a force of this step alone: it enters the first evaluation in full and, in Runge-Kutta schemes, every stage
    memory = None
    if name in ("verlet", "beeman"):
        x0 = x
        x, v, memory = schemes.SCHEMES[name](x, v, None, 0.0, h, lambda x, v, t: field, m)
        assert not np.allclose(x, x0)
    free = schemes.SCHEMES[name](x, v, memory, h, h, lambda x, v, t: field, m)
    pushed = schemes.SCHEMES[name](x, v, memory, h, h, lambda x, v, t: field + push, m)
    shift = pushed[0] - free[0]
    if name == "explicit_euler":
        shift = shift + h * (pushed[1] - free[1])
    assert shift == pytest.approx(constraints.position_response(name, m, h)[:, None] * push, rel=1e-9, abs=1e-15)


def test_literal_systems_agree_with_the_global_solve_and_keep_momentum():
    rng = np.random.default_rng(5)
    for _ in range(50):
        n = int(rng.integers(5, 9))
        x, c = rng.standard_normal((n, 3)), 10.0 ** rng.uniform(-6, 0, n)
        points = [int(i) for i in rng.permutation(n)]
        f = constraints.points_to_point_forces(x, c, points)
        landed, reaction = constraints.land(x, c, constraints.points_to_point_rows(n, points), np.zeros((n - 1, 3)))
        assert np.abs(landed - landed[0]).max() < 1e-10
        assert landed[0] == pytest.approx((x / c[:, None]).sum(0) / (1 / c).sum(), abs=1e-9)  # (25)
        assert np.abs(f - reaction[points]).max() < 1e-9 * np.abs(f).max()
        assert np.abs(f.sum(0)).max() < 1e-9 * np.abs(f).max()

        weights = rng.dirichlet(np.ones(4))
        f = constraints.attach_forces(x, c, points[0], points[1:5], weights)
        row = constraints.attach_row(n, points[0], points[1:5], weights)
        landed, reaction = constraints.land(x, c, row, np.zeros((1, 3)))
        assert np.abs(row @ landed).max() < 1e-12
        assert np.abs(f - reaction[points[:5]]).max() < 1e-9 * np.abs(f).max()
        anticipated = weights @ x[points[1:5]] - x[points[0]]
        assert f[0] == pytest.approx(anticipated / (c[points[0]] + c[points[1:5]] @ weights**2), rel=1e-9)  # (28)

        goal = rng.standard_normal(3)
        assert x[0] + c[0] * constraints.nail_force(x, c, 0, goal) == pytest.approx(goal, abs=1e-12)


def test_implicit_step_by_null_space_agrees_with_kkt():
    x, v, m, rows, force = swing()
    rng = np.random.default_rng(6)
    v = constraints.project_velocity(rng.standard_normal(v.shape), m, rows, np.zeros((len(rows), 3)))
    assert np.abs(rows @ v).max() < 1e-13
    k, d = energies.jacobians(force, x, v, 0.0)
    h = 0.03
    got = constraints.implicit_euler_step(x, v, force(x, v, 0.0), k, d, m, h, rows, rows @ x)
    want = schemes.implicit_euler(x, v, None, 0.0, h, force, m, rows)
    assert got[0] == pytest.approx(want[0], abs=1e-12)
    assert got[1] == pytest.approx(want[1], abs=1e-11)
    null = np.eye(6) - np.linalg.pinv(rows) @ rows
    assert np.abs(null @ got[2]).max() < 1e-9  # the reaction lies in the rows


def test_gradual_force_overshoots_and_arrives_after_about_twice_the_cube_root():
    for n in (100, 1000, 10000):
        y = np.array(constraints.gradual_approach(n, n))
        arrival = 1 + int(np.argmax(y < 0))
        assert 0.8 < arrival / (2 * n ** (1 / 3)) < 1.5
        assert 0.2 < -y.min() < 0.8
        assert abs(y[-1]) < 1e-12  # the full force lands


def test_chain_by_statics_and_by_energy():
    masses = np.array([1.0, 0.2, 0.5, 0.3, 0.9, 0.2, 1.0])
    rests, stiffness = np.full(6, 0.3), np.array([500.0, 2000.0, 300.0, 900.0, 500.0, 700.0])
    chain = closed_forms.hanging_chain(np.array([1.2, 0.3]), masses, rests, stiffness, 9.81)
    assert chain[-1] == pytest.approx([1.2, 0.3], abs=1e-12)
    start = np.linspace([0, 0], [1.2, 0.3], 7) - np.array([[0, 1.0]]) * np.sin(np.linspace(0, np.pi, 7))[:, None]
    start[-1] = [1.2, 0.3]
    weights = np.stack([0 * masses, -9.81 * masses], axis=1)
    rest = closed_forms.equilibrium(start, [0, 6], [(i, i + 1) for i in range(6)], rests, stiffness, weights)
    assert rest == pytest.approx(chain, abs=1e-9)


def test_rope_by_statics_and_by_energy():
    masses, rests = np.array([5.0, 0.2, 0.5, 0.3]), np.array([0.3, 0.2, 0.4])
    stiffness = np.array([500.0, 2000.0, 300.0])
    depth = closed_forms.hanging_rope(masses, rests, stiffness, 9.81)
    start = np.stack([0.0 * depth, -np.concatenate([[0], np.cumsum(rests)])], axis=1)
    weights = np.stack([0 * masses, -9.81 * masses], axis=1)
    rest = closed_forms.equilibrium(start, [0], [(0, 1), (1, 2), (2, 3)], rests, stiffness, weights)
    assert rest[:, 1] == pytest.approx(-depth, abs=1e-10)


def test_pendulum_period_and_energy():
    # angle'' = -(g / L) sin angle from rest at 2 rad, by a fine classical Runge-Kutta of its own
    length, gravity, amplitude = 0.7, 9.81, 2.0
    period = closed_forms.pendulum_period(length, gravity, amplitude)
    small = 2 * math.pi * math.sqrt(length / gravity)
    assert closed_forms.pendulum_period(length, gravity, 1e-4) == pytest.approx(small, rel=1e-8)
    angle, speed, n = amplitude, 0.0, 4000
    h = period / n

    def rate(q, u):
        return u, -gravity / length * math.sin(q)

    for _ in range(n):
        a1, b1 = rate(angle, speed)
        a2, b2 = rate(angle + h / 2 * a1, speed + h / 2 * b1)
        a3, b3 = rate(angle + h / 2 * a2, speed + h / 2 * b2)
        a4, b4 = rate(angle + h * a3, speed + h * b3)
        angle, speed = angle + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), speed + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
    assert (angle, speed) == pytest.approx((amplitude, 0.0), abs=1e-9)


def test_closed_oscillator_obeys_its_equation():
    for t in (0.0, 0.4, 2.0):
        h = 1e-4
        x, v = closed_forms.damped_oscillator(1.0, -0.5, 12.0, 0.9, t)
        ahead, behind = (closed_forms.damped_oscillator(1.0, -0.5, 12.0, 0.9, t + s) for s in (h, -h))
        assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(v, abs=1e-6)
        assert (ahead[1] - behind[1]) / (2 * h) == pytest.approx(-12.0 * x - 0.9 * v, abs=1e-5)
