"""A scene built through the public API, with its state as arrays, and residuals measured from arrays alone."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

import turnbuckle


class Run:
    """One simulation. ``x``, ``v``: copies of the state, (points, 3) [m], [m/s]; ``m``: (points,) [kg]."""

    def __init__(self, scene: dict, x: np.ndarray | None = None, v: np.ndarray | None = None):
        fields = {"gravity": [0.0, 0.0, 0.0], **scene}
        self.simulation = turnbuckle.Simulation(turnbuckle.Scene("laboratory", **fields))
        self.model, self.state = self.simulation.model, self.simulation.state
        if x is not None:
            self.state.set_positions(x)
        if v is not None:
            self.state.set_velocities(v)
        self.report = turnbuckle.StepReport()

    @property
    def x(self) -> np.ndarray:
        return np.array(self.state.positions())

    @property
    def v(self) -> np.ndarray:
        return np.array(self.state.velocities())

    @property
    def m(self) -> np.ndarray:
        return np.array(self.model.mass)

    def at(self, body: str, *points: int) -> list[int]:
        """Indices into the arrays of points of a body."""
        return [self.model.shape(body).begin + p for p in points]

    def step(self, h: float) -> None:
        self.report = self.simulation.step(h)
        assert self.report.status != "failed", self.report.messages

    def steps(self, sizes: Iterable[float]) -> None:
        for h in sizes:
            self.step(h)

    def force(self, name: str) -> np.ndarray:
        """Forces of a constraint on its points [N], (rows, 3)."""
        return self.simulation.forces(name)


def rope(name: str, points: np.ndarray, mass: float, stiffness: float = 0.0, damping: float = 0.0, **more) -> dict:
    """A rope of springs between given points."""
    springs = {"stretch_stiffness": stiffness, "damping": damping}
    return {"type": "rope", "name": name, "points": np.asarray(points), "mass": mass, **springs, **more}


def nail(name: str, body: str, *indices: int, **more) -> dict:
    return {"type": "nail", "name": name, "points": [{"body": body, "indices": list(indices)}], **more}


def join(name: str, *points: tuple[str, int], **more) -> dict:
    group = [{"body": body, "index": index} for body, index in points]
    return {"type": "points_to_point", "name": name, "groups": [group], **more}


def attach(name: str, point: tuple[str, int], body: str, element: list[int], weights: np.ndarray, **more) -> dict:
    return {
        "type": "attach",
        "name": name,
        "points": [{"body": point[0], "index": point[1]}],
        "to": {"body": body, "elements": [element]},
        "weights": np.array([weights]),
        **more,
    }


@dataclass(frozen=True)
class Held:
    """A constraint as this file sees it: ``kind`` nail, join, attach, line, plane or velocity."""

    kind: str
    points: list[int]  # of the state; attach, line and plane: the point first, then its hosts
    goal: np.ndarray | None = None  # nail [m], velocity [m/s]
    weights: np.ndarray | None = None  # attach
    rate: np.ndarray | None = None  # nail: velocity of the goal [m/s]

    def residual(self, x: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Largest gap [m] and largest rate of it [m/s]."""
        y, u = x[self.points], v[self.points]
        if self.kind == "nail":
            rate = np.zeros(3) if self.rate is None else self.rate
            return float(np.abs(y[0] - self.goal).max()), float(np.abs(u[0] - rate).max())
        if self.kind == "join":
            return float(np.abs(y - y[0]).max()), float(np.abs(u - u[0]).max())
        if self.kind == "attach":
            return float(np.abs(y[0] - self.weights @ y[1:]).max()), float(np.abs(u[0] - self.weights @ u[1:]).max())
        if self.kind == "velocity":
            return 0.0, float(np.abs(u[0] - self.goal).max())
        if self.kind == "line":
            along = y[2] - y[1]
            share = np.dot(y[0] - y[1], along) / np.dot(along, along)
            along = along / np.linalg.norm(along)
            gap = y[0] - y[1] - along * np.dot(along, y[0] - y[1])
            drift = u[0] - (1.0 - share) * u[1] - share * u[2]
            return float(np.linalg.norm(gap)), float(np.linalg.norm(drift - along * np.dot(along, drift)))
        a, b = y[2] - y[1], y[3] - y[1]
        normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
        share = np.linalg.lstsq(np.stack([a, b], axis=1), y[0] - y[1], rcond=None)[0]
        drift = u[0] - (1.0 - share.sum()) * u[1] - share[0] * u[2] - share[1] * u[3]
        return abs(float(normal @ (y[0] - y[1]))), abs(float(normal @ drift))


def size(x: np.ndarray) -> float:
    """Diagonal of the box around the points [m]."""
    return float(np.linalg.norm(x.max(0) - x.min(0)))
