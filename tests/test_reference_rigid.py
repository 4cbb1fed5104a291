"""The references of rigid bodies and joints hold on their own: against closed forms, published values and each other."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, X, Y, Z
from mechanisms_known import bricard_mechanism, four_bar_windows, governor_mechanism, squeezer_mechanism
from reference import governor, joint_rows, paper_rigid, rigid_forms, squeezer
from reference.free_top import FreeTop
from reference.multibody import Body, System, angle_between, turn


def rod(name="rod", mass=2.0, inertia=(0.11, 0.13, 0.05), **more) -> dict:
    return {"name": name, "mass": mass, "inertia": np.array(inertia), **more}


@pytest.mark.parametrize("inertia", [(1, 2, 2.5), (2.5, 1, 2), (2, 2.5, 1), (1, 2.5, 2)])
@pytest.mark.parametrize("w", [(0.1, 3, 0.2), (3, 0.2, 0.4), (-0.3, 0.1, -4), (0.5, -2, 1)])
def test_free_top_by_elliptic_functions_and_by_integration(inertia, w):
    start = turn(np.array([0.3, 0.4, 0.5]))
    top = FreeTop(inertia, w, start)
    body = Body(1.0, np.diag(np.array(inertia, dtype=float)), ZERO, start, ZERO, start @ np.array(w, dtype=float))
    system = System([body], gravity=ZERO)
    times = [0.3, 3.7]
    for t, y in zip(times, system.simulate(times), strict=True):
        _, r, _, spin = system.unpack(y)
        assert angle_between(r[0], top.attitude(t)) < 1e-9
        assert np.abs(r[0].T @ spin[0] - top.rates(t)).max() < 1e-9
    assert np.abs(top.rates(top.period) - top.rates(0.0)).max() < 1e-12
    momentum = [top.attitude(t) @ (np.array(inertia) * top.rates(t)) for t in (0.0, 2.0, 5e3)]
    assert np.abs(momentum - momentum[0]).max() < 1e-10


def test_pendulum_and_its_reaction():
    # a rod in the plane of x and z hangs on a hinge along y, from 1.2 rad; its hinge is 0.4 m from the centre of mass
    mechanism = Mechanism()
    arm, inertia, mass, start = 0.4, 0.13, 2.0, 1.2
    place = arm * np.array([np.sin(start), 0.0, -np.cos(start)])
    mechanism.body(position=place, rotation=-start * Y, **rod())
    mechanism.joint("revolute", "hinge", "rod", at=ZERO, axis=Y)
    system = mechanism.system()
    rate = rigid_forms.physical_pendulum_rate(mass, arm, inertia, 9.81)
    times = np.array([0.2, 0.9, 2.3])
    for t, y in zip(times, system.simulate(times), strict=True):
        angle, speed = rigid_forms.pendulum(t, start, rate)
        x, _, _, w = system.unpack(y)
        assert x[0] == pytest.approx(arm * np.array([np.sin(angle), 0.0, -np.cos(angle)]), abs=1e-10)
        assert w[0] == pytest.approx([0.0, -speed, 0.0], abs=1e-9)
        force, torque = system.reactions(y, t)["hinge"]
        closed = rigid_forms.physical_pendulum_reaction(angle, speed, mass, arm, inertia, 9.81)
        assert force == pytest.approx([closed[0], 0.0, closed[1]], abs=1e-8)
        assert torque == pytest.approx([0, 0, 0], abs=1e-8)


def test_pendulum_over_the_top_obeys_its_equation():
    rate, fastest, h = 3.0, 7.0, 1e-4
    t = np.array([0.0, 0.3, 1.4])
    angle = rigid_forms.pendulum_over_the_top(t, fastest, rate, start=np.pi)
    assert angle[0] == pytest.approx(np.pi)
    ahead, behind = (rigid_forms.pendulum_over_the_top(t + s, fastest, rate, start=np.pi) for s in (h, -h))
    assert (ahead - 2 * angle + behind) / h**2 == pytest.approx(-(rate**2) * np.sin(angle), abs=1e-5)
    speed = (ahead - behind) / (2 * h)
    assert speed**2 == pytest.approx(fastest**2 - 4 * rate**2 * np.sin(angle / 2) ** 2, abs=1e-5)


def test_steady_precession_of_a_heavy_top():
    mass, arm, axial, across, spin, lean = 1.5, 0.2, 0.01, 0.006, 120.0, 0.7
    about_point = across + mass * arm**2
    for rate in rigid_forms.steady_precession(spin, lean, axial, about_point, mass, arm, 9.81):
        axis = np.array([np.sin(lean), 0.0, np.cos(lean)])
        # w = rate Z + s axis with w . axis = spin
        w = rate * Z + (spin - rate * np.cos(lean)) * axis
        mechanism = Mechanism()
        mechanism.body("top", arm * axis, lean * Y, mass, (across, across, axial), w=w, v=np.cross(w, arm * axis))
        mechanism.joint("ball", "point", "top")
        system = mechanism.system()
        t = 0.2
        x, r, _, _ = system.unpack(system.simulate([t], 1e-10, 1e-11)[-1])
        turned = turn(rate * t * Z)
        assert x[0] == pytest.approx(turned @ (arm * axis), abs=1e-7)
        assert r[0][:, 2] == pytest.approx(turned @ axis, abs=1e-7)


def test_slider_crank_and_four_bar_close():
    crank, coupler = 0.3, 0.8
    mechanism = Mechanism(ZERO)
    mechanism.body("crank", 0.5 * crank * X, w=2.0 * Z)
    mechanism.body("rod", (crank + 0.5 * coupler) * X)
    mechanism.body("slider", (crank + coupler) * X)
    mechanism.joint("revolute", "axle", "crank", at=ZERO)
    mechanism.joint("revolute", "pin", "rod", "crank", crank * X)
    mechanism.joint("revolute", "wrist", "slider", "rod", (crank + coupler) * X)
    mechanism.joint("prismatic", "guide", "slider", at=(crank + coupler) * X, axis=X)
    system = mechanism.system()
    y = system.simulate([0.7, 1.9], 1e-10, 1e-11)
    for state in y:
        x, r, _, _ = system.unpack(state)
        angle = np.arctan2(r[0][1, 0], r[0][0, 0])
        assert x[2] == pytest.approx([rigid_forms.slider_crank(angle, crank, coupler), 0, 0], abs=1e-8)
    rocker = rigid_forms.four_bar(np.pi / 2, 1.0, 1.0, 1.0, 1.0, np.pi / 2)
    assert rocker == pytest.approx(np.pi / 2)


def test_rolling_ball_and_cylinder_on_a_slope():
    slope, radius, mass = 0.3, 0.2, 1.7
    down = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    for share, rows in ((0.4, joint_rows.rolling_ball(radius)), (0.5, joint_rows.rolling_wheel(radius))):
        mechanism = Mechanism()
        inertia = share * mass * radius**2 * np.ones(3)
        mechanism.body("wheel", radius * normal, mass=mass, inertia=inertia)
        mechanism.joint(
            "rolling", "floor", "wheel", at=radius * normal, at_b=ZERO, rows=rows, axis=normal, axis_a=Y, rolling=True
        )
        system = mechanism.system()
        t = 0.8
        y = system.simulate([t])[-1]
        x = system.unpack(y)[0]
        way = 0.5 * rigid_forms.rolling_acceleration(slope, share, 9.81) * t**2
        assert x[0] == pytest.approx(radius * normal + way * down, abs=1e-9)


def test_squeezer_against_the_published_solution():
    system = squeezer_mechanism().system()
    a = system.solve(0.0, *system.unpack(system.pack()))[0]
    assert a[0, 5] == pytest.approx(14222.4439199541138706, rel=1e-12)
    assert a[1, 5] - a[0, 5] == pytest.approx(-10666.8329399655854029, rel=1e-12)


@pytest.mark.slow
def test_squeezer_at_the_published_time():
    system = squeezer_mechanism().system()
    _, r, _, _ = system.unpack(system.simulate([squeezer.END], 1e-9, 1e-9)[-1])
    q = squeezer.angles(np.arctan2(r[:, 1, 0], r[:, 0, 0]))
    away = (q - squeezer.PUBLISHED + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(away).max() < 5e-9


def test_bricard_moves_though_its_count_says_no():
    system = bricard_mechanism().system(rank=1e-5)
    values = np.linalg.svd(system.rows(*system.unpack(system.pack()))[1], compute_uv=False)
    assert values[-1] < 1e-12 and values[-2] > 0.1  # one redundant row
    y = system.simulate([1.0], 1e-9, 1e-10)[-1]
    assert abs(system.energy(y) - system.energy(system.pack())) < 1e-7
    assert system.residual(y)[0] < 1e-7
    assert np.linalg.norm(y[:15] - system.pack()[:15]) > 1.0


def test_windows_fall_like_one_pendulum():
    n = 2
    system = four_bar_windows(n).system(rank=1e-6)
    rate = np.sqrt(9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n))
    t = 0.7
    x = system.unpack(system.simulate([t], 1e-9, 1e-10)[-1])[0]
    angle = rigid_forms.pendulum_over_the_top(t, np.sqrt(1.0 + 4.0 * rate**2), rate, start=np.pi)
    assert x[0] == pytest.approx([-0.5 * np.sin(angle), -0.5 * np.cos(angle), 0.0], abs=1e-7)


def test_printed_scheme_is_of_first_order():
    inertia = np.array([1.0, 2.0, 2.5])
    top = FreeTop(inertia, (0.3, 2.0, 0.4))
    errors = []
    for n in (400, 800):
        x, r, v, w = ZERO, np.eye(3), ZERO, np.array([0.3, 2.0, 0.4])
        for _ in range(n):
            x, r, v, w = paper_rigid.step(x, r, v, w, ZERO, ZERO, 1.0, np.diag(inertia), 2.0 / n)
        errors.append(angle_between(r, top.attitude(2.0)))
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.15)


def test_reactions_of_a_driven_body_carry_its_passenger():
    # the passenger is welded to a body that turns at a constant rate: the weld gives the centripetal force and the weight
    rate, arm = 3.0, 0.5

    def drive(t):
        r = turn(rate * t * Z)
        return ZERO, r, ZERO, rate * Z, ZERO, ZERO

    mechanism = Mechanism()
    mechanism.body("table", ZERO, drive=drive, w=rate * Z)
    mechanism.body("guest", arm * X, mass=2.0)
    mechanism.joint("weld", "seat", "guest", "table", at=arm * X)
    system = mechanism.system()
    t = 0.4
    y = system.simulate([t])[-1]
    force, torque = system.reactions(y, t)["seat"]
    radial = turn(rate * t * Z) @ X
    assert force == pytest.approx(-2.0 * rate**2 * arm * radial + 2.0 * 9.81 * Z, abs=1e-8)
    assert torque == pytest.approx([0, 0, 0], abs=1e-8)


def test_governor_in_its_coordinates_and_as_bodies():
    system = governor_mechanism().system()
    t = 0.004
    x, r, _, w = system.unpack(system.simulate([t], 1e-7, 1e-9)[-1])
    (theta, s, *_), rate = governor.solve(t)
    assert -x[3][2] == pytest.approx(s, abs=1e-8)
    assert np.arccos(r[1][2, 2]) == pytest.approx(theta, abs=1e-7)
    assert w[0][2] == pytest.approx(rate, abs=1e-6)
