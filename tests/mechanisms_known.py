"""Mechanisms of the benchmark collections, as `Mechanism` has them: squeezer, Bricard, four-bar windows, governor."""

import numpy as np
from mechanism import ZERO, Mechanism, X, Y, Z
from reference import governor, squeezer


def at(place) -> np.ndarray:
    """A place of the plane z = 0."""
    return np.array([place[0], place[1], 0.0])


def squeezer_mechanism() -> Mechanism:
    """Andrews' squeezer with revolute joints in space; in each of its loops three conditions are redundant."""
    q = squeezer.START
    local = {}

    def loads(t, x, r, v, w):
        force, torque = np.zeros_like(x), np.zeros_like(x)
        torque[0, 2] = squeezer.TORQUE
        arm = r[2] @ local["spring"]
        way = x[2] + arm - at(squeezer.C)
        length = np.linalg.norm(way)
        force[2] = -squeezer.STIFFNESS * (length - squeezer.REST) * way / length
        torque[2] = np.cross(arm, force[2])
        return force, torque

    mechanism = Mechanism(ZERO, loads)
    for i, (place, angle) in enumerate(squeezer.bodies(q)):
        inertia = squeezer.INERTIA[i] * np.array([0.6, 0.6, 1.0])
        mechanism.body(f"k{i + 1}", at(place), angle * Z, squeezer.MASS[i], inertia, box=[0.01, 0.01, 0.01])
    for k, (i, j, place) in enumerate(squeezer.hinges(q)):
        other = None if j is None else f"k{j + 1}"
        mechanism.joint("revolute", f"hinge{k}", f"k{i + 1}", other, at(place))
    local["spring"] = mechanism.local("k3", at(squeezer.spring_place(q)))
    return mechanism


CUBE = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float)


def bricard_mechanism() -> Mechanism:
    """Five rods (1 m, 1 kg) and the ground on six edges of a cube; the axes of the hinges are at right angles to both."""
    mechanism = Mechanism(gravity=[0.0, -9.81, 0.0])
    for i in range(5):
        along = CUBE[i + 1] - CUBE[i]
        inertia = np.where(along != 0.0, 1.0 / 600.0, 1.0 / 12.0 + 1.0 / 1200.0)  # a square section of 0.1 m
        mechanism.body(f"rod{i}", 0.5 * (CUBE[i] + CUBE[i + 1]), inertia=inertia)
    for k in range(6):
        axis = np.cross(CUBE[k] - CUBE[k - 1], CUBE[(k + 1) % 6] - CUBE[k])
        a, b = (f"rod{k}" if k < 5 else "rod4"), (f"rod{k - 1}" if 0 < k < 5 else None)
        mechanism.joint("revolute", f"hinge{k}", a, b, CUBE[k], axis=axis)
    return mechanism


def four_bar_windows(n: int, speed: float = 1.0) -> Mechanism:
    """``n`` windows of rods (1 m, 1 kg), uprights on the ground; they fall through the flat position."""
    mechanism = Mechanism(gravity=[0.0, -9.81, 0.0])
    rod = np.array([1 / 12, 1 / 1200, 1 / 12])
    for i in range(n + 1):
        mechanism.body(f"up{i}", [i, 0.5, 0], inertia=rod, v=[0.5 * speed, 0, 0], w=[0, 0, -speed])
    for i in range(n):
        mechanism.body(f"level{i}", [i + 0.5, 1, 0], inertia=rod[[1, 0, 2]], v=[speed, 0, 0])
    for i in range(n + 1):
        mechanism.joint("revolute", f"foot{i}", f"up{i}", None, i * X)
    for i in range(n):
        mechanism.joint("revolute", f"left{i}", f"level{i}", f"up{i}", i * X + Y)
        mechanism.joint("revolute", f"right{i}", f"level{i}", f"up{i + 1}", (i + 1) * X + Y)
    return mechanism


def governor_mechanism() -> Mechanism:
    """Shaft along z with its top at the origin, two rods with a ball each, a slider; springs are loads of the reference."""
    g = governor

    def loads(t, x, r, v, w):
        force, torque = np.zeros_like(x), np.zeros_like(x)
        for i, local in COUPLED:
            arm = r[i] @ local
            way, speed = x[i] + arm - x[3], v[i] + np.cross(w[i], arm) - v[3]
            length = np.linalg.norm(way)
            pull = -(g.STIFFNESS * (length - g.REST) + g.DAMPING * way @ speed / length) * way / length
            force[i] += pull
            torque[i] += np.cross(arm, pull)
            force[3] -= pull
        return force, torque

    mechanism = Mechanism(loads=loads)
    spin = g.START_RATE * Z
    square = np.array([g.ACROSS, g.ACROSS, g.AXIAL])
    mechanism.body("shaft", -0.5 * g.LENGTH * Z, mass=g.ROD, inertia=square, w=spin)
    # a rod with its ball is one body: its centre and its moments about it
    mass = g.ROD + g.BALL
    center = (g.ROD * 0.5 + g.BALL) * g.LENGTH / mass
    across = g.HINGED - mass * center**2
    for i in (1, 2):
        lean = g.START_ANGLE if i == 1 else -g.START_ANGLE
        way = np.array([np.sin(lean), 0.0, -np.cos(lean)])
        mechanism.body(
            f"rod{i}", 0.5 * g.LENGTH * way, -lean * Y, mass, (across, across, g.AXIAL),
            center=-(center - 0.5 * g.LENGTH) * Z, w=spin, v=np.cross(spin, center * way),
        )  # fmt: skip
    mechanism.body("slider", -g.START_SLIDER * Z, mass=g.SLIDER, inertia=np.full(3, g.SLIDER * g.SIDE**2 / 6), w=spin)
    mechanism.joint("revolute", "bearing", "shaft")
    for i in (1, 2):
        mechanism.joint("revolute", f"hinge{i}", f"rod{i}", "shaft", axis=Y)
    mechanism.joint("prismatic", "guide", "slider", "shaft", -g.START_SLIDER * Z)
    return mechanism


# Body and place, from its centre of mass, where each coupler holds a rod.
COUPLED = tuple(
    (i, (governor.BALL * governor.LENGTH / 2 / (governor.ROD + governor.BALL)) * np.array([0.0, 0.0, 1.0]))
    for i in (1, 2)
)
