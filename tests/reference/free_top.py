"""Torque-free rotation of an asymmetric body, exactly: body rates by Jacobi's functions, attitude by one quadrature.

With I1 < I2 < I3 (numbered so here, mapped back to the caller's axes) and L^2 > 2 E I2 the rates are
w1 = a1 cn, w2 = a2 sn, w3 = a3 dn of (p t + u0 | m); with L^2 < 2 E I2 axes 1 and 3 change their parts. In a frame with
L along Z the zxz Euler angles are cos(theta) = I3 w3 / L, tan(psi) = I1 w1 / (I2 w2), and phi is an integral:
phi' = L (I1 w1^2 + I2 w2^2) / (I1^2 w1^2 + I2^2 w2^2) (Landau and Lifshitz, Mechanics, section 37).
"""

import numpy as np
from scipy.special import ellipj, ellipk, ellipkinc

from reference.multibody import turn

NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)
PIECES = 16


class FreeTop:
    """Principal moments ``inertia`` (3,) [kg m^2], body rates ``w`` (3,) [rad/s] and attitude ``R`` (3, 3) at time 0."""

    def __init__(self, inertia, w, R=None):
        inertia, w = np.asarray(inertia, dtype=float), np.asarray(w, dtype=float)
        self.R0 = np.eye(3) if R is None else np.asarray(R)
        twice_energy, square = float(inertia @ w**2), float((inertia * w) @ (inertia * w))
        order = np.argsort(inertia)
        if square < twice_energy * inertia[order[1]]:
            order = order[::-1]
        # a right-handed frame of axes 1, 2, 3: columns of Q in the caller's axes
        self.Q = np.eye(3)[:, order]
        self.Q[:, 0] *= np.linalg.det(self.Q)
        i1, i2, i3 = self.I = inertia[order]
        self.L = np.sqrt(square)
        w1, w2, w3 = self.Q.T @ w
        self.a1 = np.sqrt((twice_energy * i3 - square) / (i1 * (i3 - i1)))
        self.a2 = np.sqrt((twice_energy * i3 - square) / (i2 * (i3 - i2)))
        self.a3 = np.sqrt((square - twice_energy * i1) / (i3 * (i3 - i1)))
        # i3 - i2 and i2 - i1 have one sign in both orders, so that the rate and the parameter are real
        self.p = np.sqrt((i3 - i2) * (square - twice_energy * i1) / (i1 * i2 * i3))
        self.m = (i2 - i1) * (twice_energy * i3 - square) / ((i3 - i2) * (square - twice_energy * i1))
        # w1' = (i2 - i3) / i1 w2 w3 must be -a1 p sn dn: the product of the signs of w2 and w3 is that of i3 - i2
        self.s3 = 1.0 if w3 >= 0 else -1.0
        self.s2 = self.s3 * (1.0 if i3 > i2 else -1.0)
        self.u0 = float(ellipkinc(np.arctan2(self.s2 * w2 / self.a2, w1 / self.a1), self.m))
        self.period = 4.0 * float(ellipk(self.m)) / self.p
        self._turn_of_period = self._integral(0.0, self.period)

    def _rates(self, t) -> np.ndarray:
        """(..., 3) along axes 1, 2, 3."""
        sn, cn, dn, _ = ellipj(self.p * (np.asarray(t) % self.period) + self.u0, self.m)
        return np.stack([self.a1 * cn, self.s2 * self.a2 * sn, self.s3 * self.a3 * dn], axis=-1)

    def rates(self, t) -> np.ndarray:
        """Body rates [rad/s] in the caller's axes, (..., 3)."""
        return self._rates(t) @ self.Q.T

    def _integral(self, begin: float, end: float) -> float:
        edges = np.linspace(begin, end, PIECES + 1)
        half = 0.5 * np.diff(edges)[:, None]
        t = 0.5 * (edges[1:] + edges[:-1])[:, None] + half * NODES
        w = self._rates(t)
        i1, i2, _ = self.I
        rate = self.L * (i1 * w[..., 0] ** 2 + i2 * w[..., 1] ** 2)
        rate = rate / ((i1 * w[..., 0]) ** 2 + (i2 * w[..., 1]) ** 2)
        return float((half * WEIGHTS * rate).sum())

    def _euler(self, t: float) -> np.ndarray:
        """Attitude of axes 1, 2, 3 in the frame of L."""
        whole, rest = divmod(t, self.period)
        phi = whole * self._turn_of_period + self._integral(0.0, rest)
        w = self._rates(rest)
        i1, i2, i3 = self.I
        theta = np.arccos(np.clip(i3 * w[2] / self.L, -1.0, 1.0))
        psi = np.arctan2(i1 * w[0], i2 * w[1])
        z = np.array([0.0, 0.0, 1.0])
        return turn(phi * z) @ turn(theta * np.array([1.0, 0.0, 0.0])) @ turn(psi * z)

    def attitude(self, t: float) -> np.ndarray:
        """Rotation matrix (3, 3), body to world."""
        return self.R0 @ self.Q @ self._euler(0.0).T @ self._euler(t) @ self.Q.T
