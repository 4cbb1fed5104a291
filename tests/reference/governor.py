"""Stiff flyball governor (A05 of the IFToMM collection) in its three coordinates: shaft angle, rods' angle, slider.

A vertical shaft turns freely; two rods of 1 m hang on hinges at its top and carry 5 kg at their ends; a slider on the shaft
is held to the middle of each rod by a spring and damper in place of a coupler. y = (theta, s, theta', s') with theta the
angle of the rods from the downward vertical, s the way of the slider below the top; the shaft's rate follows from its
angular momentum. Lagrange's equations, integrated by Radau's method.
"""

import numpy as np
from scipy.integrate import solve_ivp

LENGTH, THICK, SIDE, DENSITY, BALL = 1.0, 0.01, 0.1, 3000.0, 5.0
STIFFNESS, DAMPING, REST, GRAVITY = 8e5, 4e4, 0.5, 9.81
ROD = DENSITY * LENGTH * THICK**2
SLIDER = DENSITY * SIDE**3
AXIAL = ROD * THICK**2 / 6  # of a rod (and of the shaft) about its own axis
ACROSS = ROD * (LENGTH**2 + THICK**2) / 12
HINGED = ACROSS + ROD * LENGTH**2 / 4 + BALL * LENGTH**2  # of a rod with its ball about the hinge
START_ANGLE, START_SLIDER, START_RATE = np.pi / 3, 0.5, 2 * np.pi


def about_shaft(theta):
    """Moment of inertia of everything about the vertical [kg m^2]."""
    fixed = AXIAL + SLIDER * SIDE**2 / 6
    return fixed + 2 * (HINGED * np.sin(theta) ** 2 + AXIAL * np.cos(theta) ** 2)


MOMENTUM = about_shaft(START_ANGLE) * START_RATE


def spring(theta, s):
    """Length of a coupler and its derivatives along theta and s."""
    half = LENGTH / 2
    length = np.sqrt(half**2 + s**2 - 2 * half * s * np.cos(theta))
    return length, half * s * np.sin(theta) / length, (s - half * np.cos(theta)) / length


def derivative(t, y):
    theta, s, theta_rate, s_rate = y
    rate = MOMENTUM / about_shaft(theta)
    length, along_theta, along_s = spring(theta, s)
    force = -STIFFNESS * (length - REST) - DAMPING * (along_theta * theta_rate + along_s * s_rate)
    slope = 4 * (HINGED - AXIAL) * np.sin(theta) * np.cos(theta)  # d(about_shaft) / d(theta)
    weight = -2 * (ROD * LENGTH / 2 + BALL * LENGTH) * GRAVITY * np.sin(theta)
    angular = (0.5 * slope * rate**2 + weight + 2 * force * along_theta) / (2 * HINGED)
    return [theta_rate, s_rate, angular, GRAVITY + 2 * force * along_s / SLIDER]


def solve(end: float) -> tuple[np.ndarray, float]:
    """(theta, s, theta', s') and the rate of the shaft at time ``end`` [s]."""
    start = [START_ANGLE, START_SLIDER, 0.0, 0.0]
    out = solve_ivp(derivative, (0.0, end), start, "Radau", rtol=1e-10, atol=1e-12)
    assert out.success, out.message
    return out.y[:, -1], MOMENTUM / about_shaft(out.y[0, -1])
