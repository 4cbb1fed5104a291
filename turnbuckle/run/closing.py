"""The search for valid poses: iterations in displacements to come near, then Newton steps on all joints at once."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from turnbuckle.data.rigid import DYNAMIC, RigidBodies
from turnbuckle.geometry.quaternions import exponential, multiply
from turnbuckle.run.assembly_bodies import Clumps, acting
from turnbuckle.solvers.assembly.newton import close
from turnbuckle.solvers.assembly.rows import Linearised
from turnbuckle.solvers.displacement.conditions import Poses
from turnbuckle.solvers.displacement.displace import Displacement
from turnbuckle.solvers.displacement.mobility import Mobility
from turnbuckle.solvers.displacement.options import DisplacementOptions, DisplacementResult

NEAR = 0.02  # of the size of the bodies: gaps of less are left to Newton
COARSE = 12  # iterations in displacements at first
FINE = 100  # and when that did not do
ATTEMPTS = 4  # the second with even masses, later ones from poses that are turned a little
SHAKEN = 0.3  # [rad]
EVENED = 0.2  # power of the ratios of masses in later attempts
ROUND = 0.1  # of the largest moment of a body: the least in later attempts
SAME = 1e-3  # an attempt that ends this near to the one before says that there is nothing more to find
MARGIN = 1e-2  # of the tolerance: where Newton stops
Watch = Callable[[Poses, float], None]


@dataclass
class Search:
    """Where it ended."""

    result: DisplacementResult  # poses, and what each joint has left
    first: DisplacementResult  # the same at the start
    iterations: int
    steps: int
    attempts: int

    @property
    def poses(self) -> Poses:
        """Poses found."""
        return Poses(self.result.x, self.result.q)


class Closer:
    """All joints and ties of a scene that act at the start."""

    def __init__(self, made: Clumps, *, max_rotation: float, user_parameter: bool = False) -> None:
        self._made, self._max_rotation = made, max_rotation
        self._mode = "user_parameter" if user_parameter else "physical"
        self._near = self._displacement(made.bodies, 0.0, 0)
        self.system = self._linearised(self._near)

    def _displacement(self, bodies: RigidBodies, tolerance: float, iterations: int) -> Displacement:
        made = self._made
        options = DisplacementOptions(
            tolerance=tolerance,
            stop="gaps",
            max_iterations=iterations,
            max_rotation=self._max_rotation,
            mobility=self._mode,
        )  # type: ignore[arg-type]
        return Displacement(
            bodies, made.parts, made.joints, options, acting=acting(made.joints), domains=made.domains, ties=made.ties
        )

    def _linearised(self, solver: Displacement) -> Linearised:
        return Linearised(solver.conditions, solver.mobility, solver.ties, self._made.bodies.count)

    @property
    def mobility(self) -> Mobility:
        """What moves, and how easily."""
        return self._near.mobility

    def measure(self, poses: Poses) -> DisplacementResult:
        """What each joint and tie has left."""
        return self._near.solve(poses.x, poses.q)

    def search(
        self,
        tolerance: float,
        max_iterations: int | None = None,
        watch: Watch | None = None,
        *,
        start: Poses | None = None,
    ) -> Search:
        """Poses that close all joints, or as near as was found. The same input gives the same poses."""
        start = self._made.poses if start is None else start
        first = self.measure(start)
        best, done = first, Search(first, first, 0, 0, 0)
        if worst(first) <= tolerance:
            return done
        random = np.random.default_rng(0)
        before: float | None = None
        bodies, system = self._made.bodies, self.system
        for attempt in range(ATTEMPTS):
            limit = COARSE if attempt == 0 else FINE
            limit = limit if max_iterations is None else min(limit, max_iterations - done.iterations)
            poses = start if attempt == 0 else best.poses if attempt == 1 else self.shaken(best.poses, random)
            if attempt == 1:
                bodies = evened(bodies)
                system = self._linearised(self._displacement(bodies, 0.0, 0))
            solver = self._displacement(bodies, NEAR * system.size, max(limit, 0))
            near = solver.solve(poses.x, poses.q, watch=watch)
            closed = close(
                system,
                near.poses,
                tolerance=MARGIN * tolerance,
                max_steps=200,
                max_rotation=self._max_rotation,
                watch=watch,
            )
            found = self.measure(closed.poses)
            done.iterations += near.iterations
            done.steps += closed.steps
            done.attempts += 1
            if worst(found) < worst(best):
                best = found
            if worst(best) <= tolerance or (before is not None and abs(worst(found) - before) <= SAME * before):
                break
            if max_iterations is not None and done.iterations >= max_iterations:
                break
            before = worst(found)
        done.result = best
        return done

    def shaken(self, poses: Poses, random: np.random.Generator) -> Poses:
        """Poses with every body turned a little."""
        moving = self._near.mobility.dynamic
        turn = np.where(moving[:, None], random.normal(0.0, SHAKEN, (len(moving), 3)), 0.0)
        return Poses(poses.x, multiply(exponential(turn), poses.q))


def evened(bodies: RigidBodies) -> RigidBodies:
    """Bodies of masses that differ less, and of rounder shape.

    Where a wisp and a block are to meet, masses stand in the way of every step; that they meet matters more then.
    """
    moving = bodies.motion == DYNAMIC
    middle = float(np.median(bodies.mass[moving])) if moving.any() else 1.0
    mass = middle * (bodies.mass / middle) ** EVENED
    gyration = bodies.inertia / bodies.mass[:, None]
    gyration = np.maximum(gyration, ROUND * gyration.max(axis=1, keepdims=True))
    return replace(bodies, mass=mass, inertia=mass[:, None] * gyration)


def worst(result: DisplacementResult) -> float:
    """The largest gap of a translation [m] or rotation [rad]."""
    largest = float(max(result.gap.max(initial=0.0), result.angle.max(initial=0.0)))
    return largest if np.isfinite(largest) else np.inf
