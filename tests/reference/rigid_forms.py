"""Closed forms of rigid bodies and simple mechanisms. SI units."""

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk, ellipkinc


def pendulum(t, amplitude: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle [rad] from the lowest place and its rate, for angle'' = -rate^2 sin(angle), released at ``amplitude``.

    sin(angle / 2) = k sn(K + rate t | k^2), k = sin(amplitude / 2).
    """
    k = np.sin(amplitude / 2)
    sn, cn, dn, _ = ellipj(rate * np.asarray(t) + ellipk(k * k), k * k)
    return 2 * np.arcsin(k * sn), 2 * k * rate * cn


def pendulum_over_the_top(t, lowest_speed: float, rate: float, start: float = 0.0) -> np.ndarray:
    """Angle [rad] of a pendulum that goes round, from the lowest place, where its rate is ``lowest_speed`` > 2 rate.

    angle / 2 = am(lowest_speed t / 2 + u0 | m), m = (2 rate / lowest_speed)^2; ``start``: angle at t = 0.
    """
    m = (2 * rate / lowest_speed) ** 2
    u = lowest_speed / 2 * np.asarray(t) + ellipkinc(start / 2, m)
    return 2 * ellipj(u, m)[3]


def physical_pendulum_rate(mass: float, arm: float, inertia: float, gravity: float) -> float:
    """sqrt(m g d / (I + m d^2)) [1/s]; ``inertia`` about the centre of mass."""
    return float(np.sqrt(mass * gravity * arm / (inertia + mass * arm**2)))


def physical_pendulum_reaction(
    angle: float, speed: float, mass: float, arm: float, inertia: float, gravity: float
) -> np.ndarray:
    """Force of the pivot on the body along x (horizontal, towards growing angle) and z (up) [N]."""
    acceleration = -(physical_pendulum_rate(mass, arm, inertia, gravity) ** 2) * np.sin(angle)
    along, inward = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    return mass * (arm * acceleration * along + arm * speed**2 * inward) + mass * gravity * np.array([0.0, 1.0])


def conical_rate(length: float, angle: float, gravity: float) -> float:
    """Rate [rad/s] about the vertical of a point pendulum at a constant angle from it: w^2 = g / (l cos a)."""
    return float(np.sqrt(gravity / (length * np.cos(angle))))


def steady_precession(
    spin: float, angle: float, axial: float, across: float, mass: float, arm: float, gravity: float
) -> tuple[float, float]:
    """Slow and fast precession [rad/s] of a heavy symmetric top with its point fixed.

    ``spin``: component w3 of the angular velocity along the axis; ``across`` about the fixed point. From
    across p^2 cos(a) - axial w3 p + m g d = 0.
    """
    a, b, c = across * np.cos(angle), -axial * spin, mass * gravity * arm
    root = np.sqrt(b * b - 4 * a * c)
    return tuple(sorted([(-b - root) / (2 * a), (-b + root) / (2 * a)], key=abs))


def slider_crank(angle, crank: float, rod: float) -> np.ndarray:
    """Place of the slider along its line through the crank's axis."""
    return crank * np.cos(angle) + np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2)


def four_bar(angle: float, ground: float, crank: float, coupler: float, rocker: float, guess: float) -> float:
    """Angle of the rocker [rad] by the closure of the loop; ``guess`` picks the branch."""
    tip = crank * np.array([np.cos(angle), np.sin(angle)])

    def closure(b):
        end = np.array([ground + rocker * np.cos(b), rocker * np.sin(b)])
        return (end - tip) @ (end - tip) - coupler**2

    return float(brentq(closure, guess - 0.4, guess + 0.4, xtol=1e-15))


def oscillator(t, x0: float, v0: float, mass: float, stiffness: float, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """x [m] and v [m/s] of m x'' + c x' + k x = 0, weakly damped."""
    t = np.asarray(t)
    decay = damping / (2 * mass)
    rate = np.sqrt(stiffness / mass - decay**2)
    b = (v0 + decay * x0) / rate
    c, s, e = np.cos(rate * t), np.sin(rate * t), np.exp(-decay * t)
    return e * (x0 * c + b * s), e * ((-decay * x0 + rate * b) * c + (-decay * b - rate * x0) * s)


def rolling_acceleration(slope: float, share: float, gravity: float) -> float:
    """Down a slope [m/s^2]: g sin(a) / (1 + k), ``share`` k = I / (m r^2): 2/5 a ball, 1/2 a cylinder."""
    return gravity * np.sin(slope) / (1 + share)
