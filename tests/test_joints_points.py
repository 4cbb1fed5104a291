"""Point constraints take points of rigid bodies wherever they take mass points: exact, and two-way."""

import itertools

import numpy as np
import pytest
from laboratory import attach, join, nail, rope
from mechanism import ZERO, Mechanism, X, Y, Z, run
from reference.multibody import matrix_of

import turnbuckle

CORNER = np.array([0.1, -0.05, 0.15])
FULL = np.array([[0.05, 0.01, -0.004], [0.01, 0.07, 0.006], [-0.004, 0.006, 0.04]])


def box(name="box", position=ZERO, **more) -> dict:
    fields = {"box": [0.2, 0.2, 0.2], "mass": 1.5, "inertia": FULL, "markers": [CORNER], "position": position, **more}
    return {"type": "rigid", "name": name, **fields}


def scene(bodies, constraints, gravity=(0.0, 0.0, -9.81), **fields) -> turnbuckle.Simulation:
    return turnbuckle.Simulation(
        turnbuckle.Scene("mixed", gravity=list(gravity), bodies=bodies, constraints=constraints, **fields)
    )


def marker(simulation, name="box", local=CORNER) -> np.ndarray:
    position, q = simulation.pose(name)
    return position + matrix_of(q) @ local


def test_nailed_marker_is_a_ball_joint():
    """Same path as a ball joint at that place in the reference, second order, and its reaction."""
    mechanism = Mechanism()
    mechanism.body("box", ZERO, mass=1.5, inertia=FULL, w=[1.0, 2.0, 0.5])
    mechanism.joint("ball", "pivot", "box", at=CORNER)
    system = mechanism.system()
    end = 0.4
    truth = system.simulate([end], 1e-11, 1e-12)[-1]
    reaction = system.reactions(truth, end)["pivot"][0]
    part = mechanism.parts[0]
    errors, forces = [], []
    for n in (40, 80, 160):
        bodies = [box(velocity=part.v, angular_velocity=part.w)]
        simulation = scene(bodies, [nail("pin", "box", 0)])

        def held(report):
            assert report.position_residual["nail"] < 1e-10 and report.rate_residual["nail"] < 1e-10

        run(simulation, end, n, held)
        assert marker(simulation) == pytest.approx(CORNER, abs=1e-10)
        x, r, v, w = system.unpack(truth)
        errors.append(np.linalg.norm(simulation.pose("box")[0] - x[0]))
        forces.append(np.linalg.norm(simulation.forces("pin")[0] - reaction))
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.8) and errors[1] / errors[2] == pytest.approx(4.0, abs=0.8)
    assert forces[2] < 0.02 * np.linalg.norm(reaction) and forces[2] < 0.7 * forces[0]


def momentum(simulation, names, v, speeds) -> tuple[np.ndarray, float]:
    """Linear momentum of mass points with velocities ``v`` and boxes with ``speeds``, and the sum of m |v|."""
    model = simulation.model
    m = np.array(model.mass)
    for name in names:
        shape = model.shape(name)
        m[shape.begin : shape.end] = 0.0
    p = m[:, None] * v
    q = 1.5 * np.asarray(speeds)
    return p.sum(0) + q.sum(0), np.linalg.norm(p, axis=1).sum() + np.linalg.norm(q, axis=1).sum()


@pytest.mark.parametrize("integrator", ["verlet", "velocity_verlet", "rk4"])
def test_rope_between_two_floating_boxes(integrator):
    """Joined to a marker of each: closed to 1e-10; linear momentum to round-off under every scheme, by the way travelled.

    (The velocities that the Verlet scheme reports lag behind by their definition, so that their sum is not constant.)
    """
    away, names, h = np.array([0.0, 0.6, 0.0]), ("one", "two"), 1e-3
    bodies = [
        box("one", velocity=[1.0, 0.0, 0.5], angular_velocity=[0.0, 1.0, 2.0]),
        box("two", away, velocity=[-1.0, 0.0, 0.3]),
        rope("rope", np.linspace(CORNER, CORNER + away, 6), 0.4, 300.0, 0.2),
    ]
    held = [join("first", ("one", 0), ("rope", 0)), join("last", ("two", 0), ("rope", 5))]
    simulation = scene(bodies, held, ZERO, integrator=integrator)
    simulation.step(h)
    steps = []
    for _ in range(100):
        x, centers = simulation.positions().copy(), [np.array(simulation.center(n)) for n in names]
        report = simulation.step(h)
        assert report.status == "ok", report.messages
        assert report.position_residual["points_to_point"] < 1e-10
        assert report.momentum_error[0] < 1e-12
        ways = [(simulation.center(n) - c) / h for n, c in zip(names, centers, strict=True)]
        steps.append(momentum(simulation, names, (simulation.positions() - x) / h, ways))
    for (before, size), (after, _) in itertools.pairwise(steps):
        assert np.linalg.norm(after - before) < 1e-12 * size + 1e-15 / h  # and the round-off of places
    ends = simulation.positions("rope")
    assert marker(simulation, "one") == pytest.approx(ends[0], abs=1e-10)
    assert marker(simulation, "two") == pytest.approx(ends[-1], abs=1e-10)
    assert np.abs(simulation.velocity("two")[0] - [-1.0, 0.0, 0.3]).max() > 1e-2  # the rope has pulled


@pytest.mark.parametrize("integrator", ["velocity_verlet", "rk4"])
def test_rope_between_two_boxes_keeps_the_momentum_of_velocities(integrator):
    bodies = [
        box("one", velocity=[1.0, 0.0, 0.5], angular_velocity=[0.0, 1.0, 2.0]),
        rope("rope", np.linspace(CORNER, CORNER + 0.6 * Y, 6), 0.4, 300.0, 0.2),
    ]
    simulation = scene(bodies, [join("first", ("one", 0), ("rope", 0))], ZERO, integrator=integrator)
    before = None
    for _ in range(50):
        simulation.step(1e-3)
        after, size = momentum(simulation, ("one",), simulation.velocities(), [simulation.velocity("one")[0]])
        assert before is None or np.linalg.norm(after - before) < 1e-12 * size
        before = after


@pytest.mark.parametrize("integrator", ["verlet", "velocity_verlet", "midpoint"])
def test_box_hangs_on_a_rope_with_its_weight(integrator):
    """Nail, rope, box by its top: at rest the nail carries all, the joint the box alone, and nothing moves."""
    top = np.array([0.0, 0.0, 0.1])
    bodies = [
        box("box", markers=[top], linear_damping=12.0, angular_damping=12.0),
        rope("rope", np.linspace([0, 0, 0.5], top, 5), 0.2, 2e3, 2.0),
    ]
    simulation = scene(bodies, [nail("pin", "rope", 0), join("hook", ("rope", 4), ("box", 0))], integrator=integrator)
    run(simulation, 2.5, 2500)
    assert simulation.forces("pin")[0] == pytest.approx([0, 0, 1.7 * 9.81], abs=1e-3)
    pulls = simulation.forces("hook")
    assert pulls.sum(0) == pytest.approx(ZERO, abs=1e-9)
    assert pulls[1] == pytest.approx([0, 0, 1.5 * 9.81], abs=1e-3)
    assert marker(simulation, "box", top) == pytest.approx(simulation.positions("rope")[-1], abs=1e-10)
    before = simulation.pose("box")[0].copy()
    run(simulation, 0.1, 100)
    assert simulation.pose("box")[0] == pytest.approx(before, abs=1e-6)
    # Under midpoint the stage in the middle sees the tied point without its constraint: a false speed of order h^2.
    still = 1e-2 if integrator == "midpoint" else 1e-4
    assert np.abs(simulation.velocity("box")[0]).max() < still
    assert np.abs(simulation.velocities("rope")).max() < still


def test_beam_on_a_joint_and_a_nail():
    """Each end carries half of the weight, whatever kind of constraint is there."""
    ends = np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    ball = {"type": "ball", "name": "ball", "body1": "box", "anchor": ends[0]}
    simulation = scene([box(markers=ends)], [ball, nail("nail", "box", 1)])
    run(simulation, 0.1, 50)
    half = 0.5 * 1.5 * 9.81
    assert simulation.forces("nail")[0][1:] == pytest.approx([0.0, half], abs=1e-6)
    assert simulation.reaction("ball")[0][1:] == pytest.approx([0.0, half], abs=1e-6)


def test_cloth_point_attached_to_a_face_of_a_box():
    """A cloth whose corner is attached to a triangle of a box's surface turns with the box, and pulls at it."""
    cloth = {"type": "cloth", "name": "cloth", "size": [0.3, 0.3], "cells": [3, 3], "density": 0.5,
             "structural_stiffness": 20.0, "shear_stiffness": 5.0,
             "position": [0.1, 0.0, 0.0]}  # fmt: skip
    simulation = scene([box(), cloth], [], ZERO)
    count = len(simulation.positions("box"))
    assert count >= 9
    corner = int(np.argmin(np.linalg.norm(simulation.positions("cloth") - [0.1, 0.0, 0.0], axis=1)))
    points = simulation.positions("box")
    face = [i for i in range(1, count) if points[i][0] > 0.09][:3]
    place = simulation.positions("cloth")[corner]
    weights = np.linalg.lstsq(np.vstack([points[face].T, np.ones(3)]), np.append(place, 1.0), rcond=None)[0]
    bodies = [box(angular_velocity=[0.0, 0.0, 3.0]), cloth]
    hook = attach("hook", ("cloth", corner), "box", face, weights)
    simulation = scene(bodies, [hook], ZERO)
    offset = weights @ points[face] - place
    assert np.linalg.norm(offset) < 0.11
    for _ in range(100):
        report = simulation.step(2e-3)
        assert report.status in ("ok", "degraded")
    surface = simulation.positions("box")
    assert simulation.positions("cloth")[corner] == pytest.approx(weights @ surface[face], abs=1e-10)
    assert np.linalg.norm(simulation.velocity("box")[1] - [0.0, 0.0, 3.0]) > 1e-2


def test_two_boxes_joined_at_their_markers_are_a_ball_joint():
    mechanism = Mechanism(gravity=ZERO)
    mechanism.body("one", ZERO, mass=1.5, inertia=FULL, w=[1.0, 2.0, 0.5])
    mechanism.body("two", CORNER + [0.2, 0.1, 0.0], mass=1.5, inertia=FULL, v=[0.0, 0.0, 0.7])
    mechanism.joint("ball", "ball", "two", "one", CORNER)
    system = mechanism.system()
    end = 0.3
    truth = system.simulate([end], 1e-11, 1e-12)[-1]
    one, two = mechanism.parts
    bodies = [
        box("one", velocity=one.v, angular_velocity=one.w),
        box("two", two.position, velocity=two.v, angular_velocity=two.w, markers=[[-0.2, -0.1, 0.0]]),
    ]
    errors = []
    for n in (40, 80):
        simulation = scene(bodies, [join("pin", ("one", 0), ("two", 0))], ZERO)
        run(simulation, end, n)
        x = system.unpack(truth)[0]
        errors.append(np.linalg.norm(np.array([simulation.pose(b)[0] for b in ("one", "two")]) - x))
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.8), errors


def test_surface_points_are_slaves_of_the_pose():
    simulation = scene([box(angular_velocity=[1.0, 2.0, 3.0], velocity=X + Y)], [], ZERO)
    local = simulation.positions("box").copy()
    run(simulation, 0.2, 50)
    position, q = simulation.pose("box")
    r = matrix_of(q)
    v, w = simulation.velocity("box")
    assert simulation.positions("box") == pytest.approx(position + local @ r.T, abs=1e-12)
    assert simulation.velocities("box") == pytest.approx(v + np.cross(w, local @ r.T), abs=1e-11)


def test_nail_that_moves_drags_a_box():
    """A marker led along x at constant speed, from rest to rest with gravity: in the end the box hangs below it."""
    keys = {"times": [0.0, 1.0], "positions": [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], "interpolation": "smooth"}
    top = np.array([0.0, 0.0, 0.1])
    body = box(position=-top, markers=[top], angular_damping=4.0)
    simulation = scene([body], [nail("hand", "box", 0, goal=keys)])
    for _ in range(10):
        run(simulation, 0.1, 50)
        s = min(simulation.time, 1.0)
        assert marker(simulation, "box", top) == pytest.approx([0.5 * s * s * (3 - 2 * s), 0, 0], abs=1e-9)
    run(simulation, 2.5, 500)
    assert simulation.forces("hand")[0] == pytest.approx(1.5 * 9.81 * Z, rel=2e-3, abs=2e-2)
