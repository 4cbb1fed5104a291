"""A curve as a domain: a polyline, or the cubic spline with continuous curvature through the same points (4.1.3)."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from turnbuckle.geometry.domains import AT_LIMIT, Domain, Held, basis

SAMPLES = 16  # of each piece of a spline, where the search for the nearest point begins
CANDIDATES = 4  # samples from which it begins
NEWTON = 40  # steps of it at most
SHARP = 0.2  # half the sum of both tangents at a corner; below, the corner holds all directions


class Curve(Domain):
    """A curve through ``points`` (k, 3) [m]; ``closed`` joins the last to the first.

    Held are both normals, at an open end also the tangent, on one side. At a corner of a polyline the tangent is the
    mean of both sides, so that a point can pass.
    """

    def __init__(self, points: np.ndarray, *, closed: bool = False, spline: bool = False) -> None:
        points = np.asarray(points, dtype=float)
        self.closed = closed
        self.points = np.concatenate([points, points[:1]]) if closed else points
        lengths = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        if closed and lengths[-1] == 0.0:  # the user repeated the first point
            self.points, lengths = self.points[:-1], lengths[:-1]
        self.knots = np.r_[0.0, np.cumsum(lengths)]  # parameter: the length of the polyline so far
        self.length = float(self.knots[-1])
        self.spline: CubicSpline | None = None
        if spline and len(self.points) > 2:
            kind = "periodic" if closed else "not-a-knot"
            points = self.points.copy()
            points[-1] = points[0] if closed else points[-1]
            self.spline = CubicSpline(self.knots, points, bc_type=kind)
            self._first, self._second = self.spline.derivative(1), self.spline.derivative(2)
            parts = np.arange(SAMPLES) / SAMPLES
            self._samples = np.r_[(self.knots[:-1, None] + parts * lengths[:, None]).ravel(), self.length]
            self._tree = cKDTree(self.spline(self._samples))

    def at(self, s: np.ndarray) -> np.ndarray:
        """Places (n, 3) at parameters s (n,)."""
        if self.spline is not None:
            return self.spline(s)
        k = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, len(self.knots) - 2)
        part = (s - self.knots[k]) / (self.knots[k + 1] - self.knots[k])
        return self.points[k] + part[:, None] * (self.points[k + 1] - self.points[k])

    def polyline(self) -> np.ndarray:
        """Points along the curve for drawing, (m, 3)."""
        return self.points if self.spline is None else self.spline(self._samples)

    def parameter(self, p: np.ndarray) -> np.ndarray:
        """Parameters (n,) of the nearest places; the first of them where several are as near."""
        p = np.asarray(p, dtype=float)
        return self._on_polyline(p) if self.spline is None else self._on_spline(p)

    def _on_polyline(self, p: np.ndarray) -> np.ndarray:
        a, d = self.points[:-1], np.diff(self.points, axis=0)
        rel = p[:, None] - a
        part = np.clip(np.einsum("nkd,kd->nk", rel, d) / np.einsum("kd,kd->k", d, d), 0.0, 1.0)
        gap = rel - part[:, :, None] * d
        k = np.argmin(np.einsum("nkd,nkd->nk", gap, gap), axis=1)
        return self.knots[k] + part[np.arange(len(p)), k] * np.diff(self.knots)[k]

    def _on_spline(self, p: np.ndarray) -> np.ndarray:
        """Newton on f' = (c - p) . c', kept within the two pieces about each of the best samples."""
        assert self.spline is not None
        count = min(CANDIDATES, len(self._samples))
        _, near = self._tree.query(p, k=count)
        near = near.reshape(len(p), count)
        s = self._samples[near]
        low = np.where(near > 0, self._samples[np.maximum(near - 1, 0)], self._samples[0])
        high = self._samples[np.minimum(near + 1, len(self._samples) - 1)]
        low, high = low.ravel(), high.ravel()
        best, target = s.ravel().copy(), np.repeat(p, count, axis=0)
        s = best.copy()
        for _ in range(NEWTON):
            c1 = self._first(s)
            gap = self.spline(s) - target
            g = np.einsum("nd,nd->n", gap, c1)
            h = np.einsum("nd,nd->n", c1, c1) + np.einsum("nd,nd->n", gap, self._second(s))
            step = np.where(h > 0.0, -g / np.where(h > 0.0, h, 1.0), -0.25 * np.sign(g) * (high - low))
            new = np.clip(s + step, low, high)
            if np.abs(new - s).max(initial=0.0) <= 1e-15 * self.length:
                break
            s = new
        worse = np.linalg.norm(self.spline(s) - target, axis=1) > np.linalg.norm(self.spline(best) - target, axis=1)
        s = np.where(worse, best, s).reshape(len(p), count)
        distance = np.linalg.norm(self.spline(s.ravel()) - target, axis=1).reshape(s.shape)
        return s[np.arange(len(p)), np.argmin(distance, axis=1)]

    def nearest(self, p: np.ndarray) -> np.ndarray:
        return self.at(self.parameter(p))

    def held(self, p: np.ndarray) -> Held:
        s = self.parameter(p)
        tangent, sharp = self._tangent(s)
        slack = AT_LIMIT * max(1.0, self.length)
        start, stop = (s <= slack) & (not self.closed), (s >= self.length - slack) & (not self.closed)
        frames = basis(np.where(stop[:, None], -tangent, tangent))
        end = start | stop
        one_sided = np.zeros((len(s), 3), bool)
        one_sided[:, 2] = end
        return Held(self.at(s), np.roll(frames, -1, axis=1), 2 + (end | sharp), one_sided)

    def _tangent(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit tangents (n, 3), and where a corner is too sharp to have one."""
        if self.spline is not None:
            t = self._first(s)
            return t / np.linalg.norm(t, axis=1, keepdims=True), np.zeros(len(s), bool)
        d = np.diff(self.points, axis=0)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        last, slack = len(d) - 1, AT_LIMIT * max(1.0, self.length)
        after = np.clip(np.searchsorted(self.knots, s + slack, side="right") - 1, 0, last)
        before = np.clip(np.searchsorted(self.knots, s - slack, side="right") - 1, 0, last)
        if self.closed:
            before = np.where(s <= slack, last, before)
            after = np.where(s >= self.length - slack, 0, after)
        mean = 0.5 * (d[after] + d[before])
        size = np.linalg.norm(mean, axis=1)
        sharp = size < SHARP
        return np.where(sharp[:, None], d[after], mean / np.where(sharp, 1.0, size)[:, None]), sharp
