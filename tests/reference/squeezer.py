"""Andrews' squeezer: seven planar bodies driven by a constant torque (Hairer and Wanner, Solving ODE II, chapter VII.7;
"andrews" of the Test Set for Initial Value Problem Solvers; A03 of the IFToMM collection). SI units, no gravity.

Angles q = (beta, Theta, gamma, Phi, delta, Omega, epsilon). The published data are those below; how the bodies lie follows
from the published constraints: P is the point where bodies 2, 3, 4 and 6 meet.
"""

import numpy as np

MASS = np.array([0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498])
INERTIA = np.array([2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5])
A, B, C = np.array([-0.06934, -0.00227]), np.array([-0.03635, 0.03273]), np.array([0.014, 0.072])
D, DA, E, EA = 28e-3, 115e-4, 2e-2, 1421e-5
RR, RA = 7e-3, 92e-5
SS, SA, SB, SC, SD = 35e-3, 1874e-5, 1043e-5, 18e-3, 2e-2
TA, TB, U, UA, UB = 2308e-5, 916e-5, 4e-2, 1228e-5, 449e-5
ZF, ZT, FA = 2e-2, 4e-2, 1421e-5
TORQUE, STIFFNESS, REST = 0.033, 4530.0, 0.07785
START = np.array(
    [-0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550, -0.222668390165885885,
     1.23054744454982119]
)  # fmt: skip
END = 0.03  # [s]
PUBLISHED = np.array(
    [15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304,
     0.5347301163226948, 1.048080741042263]
)  # fmt: skip


def _c(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


def _s(angle: float) -> np.ndarray:
    return np.array([np.sin(angle), -np.cos(angle)])


def bodies(q) -> list[tuple[np.ndarray, float]]:
    """Centre of mass (2,) and angle of each of the seven bodies."""
    beta, theta, gamma, phi, delta, omega, epsilon = q
    crank = RR * _c(beta)
    # Bodies 3, 5, 7 turn about fixed points: only the distance of their centre enters the motion.
    return [
        (RA * _c(beta), beta),
        (crank - DA * _c(beta + theta), beta + theta),
        (B + SA * _c(gamma) + SB * _s(gamma), gamma),
        (A + ZT * _c(delta) + (E - EA) * _s(phi + delta), phi + delta),
        (A + TA * _c(delta) + TB * _s(delta), delta),
        (A + U * _s(epsilon) + (ZF - FA) * _c(omega + epsilon), omega + epsilon),
        (A + UA * _s(epsilon) + UB * _c(epsilon), epsilon),
    ]


def hinges(q) -> list[tuple[int, int | None, np.ndarray]]:
    """(body, other body or None for the ground, place (2,)) of each hinge, bodies counted from 0."""
    beta, theta, gamma, _, delta, _, epsilon = q
    origin, crank = np.zeros(2), RR * _c(beta)
    p = crank - D * _c(beta + theta)
    return [
        (0, None, origin),
        (1, 0, crank),
        (2, None, B),
        (2, 1, p),
        (4, None, A),
        (3, 4, A + ZT * _c(delta)),
        (3, 1, p),
        (6, None, A),
        (5, 6, A + U * _s(epsilon)),
        (5, 1, p),
    ]


def spring_place(q) -> np.ndarray:
    """Where the spring holds body 3 (2,)."""
    return B + SD * _c(q[2]) + SC * _s(q[2])


def angles(turns) -> np.ndarray:
    """q from the angles of the seven bodies."""
    a = np.asarray(turns)
    return np.array([a[0], a[1] - a[0], a[2], a[3] - a[4], a[4], a[5] - a[6], a[6]])
