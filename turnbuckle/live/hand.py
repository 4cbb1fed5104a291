"""The hand of the user: drags a point or a rigid body, and pins them. Called by the thread that owns the simulation.

A mass point is held by a nail, and the nail hangs on a critically damped spring at the mouse: exact at every moment, and
smooth however the mouse jumps. Its path from place g and speed v towards a target T is, in closed form,
``T + (e + (v + w e) t) exp(-w t)`` with ``e = g - T``, so the speed and acceleration that the schemes ask of a goal fit.
``exact`` lets the nail go where the mouse is within a few steps. A rigid body is pulled with a spring and damper at the
place that was taken, or, exactly and where contact is off, by a nail at its nearest point.
"""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError, TurnbuckleError
from turnbuckle.data.rigid import DYNAMIC
from turnbuckle.live.picking import Pick
from turnbuckle.step.simulation import Simulation

NAIL, PIN = "hand_nail", "hand_pin"
SPRING = 25.0  # [rad/s] of the nail's spring
PULL = 12.0  # [rad/s] of the spring at a rigid body, of all that hangs on it
RESOLVED = 0.3  # [rad] a step: the fastest spring that a step resolves
SPIN = 2.0  # [1/s] damping of the rotation of a body that is held
EXACT_STEPS = 4  # steps in which an exact nail reaches the mouse


class SpringPath:
    """A goal that follows the mouse; `value` may be asked at any time."""

    def __init__(self, place: np.ndarray, time: float) -> None:
        self.time, self.target = time, place
        self.offset, self.speed = np.zeros(3), np.zeros(3)

    def aim(self, target: np.ndarray, time: float) -> None:
        """From now on towards another target."""
        t = time - self.time
        decay = math.exp(-SPRING * t)
        slope = self.speed + SPRING * self.offset
        place = self.target + (self.offset + slope * t) * decay
        speed = (slope - SPRING * (self.offset + slope * t)) * decay
        self.time, self.target, self.offset, self.speed = time, target, place - target, speed

    def value(self, t: float) -> np.ndarray:
        """Place [m] at time t."""
        s = max(t - self.time, -1e-2)
        return self.target + (self.offset + (self.speed + SPRING * self.offset) * s) * math.exp(-SPRING * s)


class ExactPath:
    """A goal that is where the mouse is, after a straight way of a few steps."""

    def __init__(self, place: np.ndarray, time: float, dt: float) -> None:
        self.time, self.target, self.start, self.span = time, place, place, EXACT_STEPS * dt

    def aim(self, target: np.ndarray, time: float) -> None:
        """From now on towards another target."""
        self.start, self.time, self.target = self.value(time), time, target

    def value(self, t: float) -> np.ndarray:
        """Place [m] at time t."""
        s = min(max((t - self.time) / self.span, 0.0), 1.0)
        return self.start + s * s * (3.0 - 2.0 * s) * (self.target - self.start)


class Hand:
    """What is held of one simulation."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self._path: SpringPath | ExactPath | None = None
        self._held = ""  # the constraint that holds, if one does
        self._point = -1  # the point of the state that is held
        self._body = -1  # the rigid body that is pulled
        self._local = np.zeros(3)  # where, in its own frame
        self._target = np.zeros(3)
        self._share = 0.0  # mass that hangs on it [kg]

    # Holding ---------------------------------------------------------------------------------------------------------

    @property
    def holds(self) -> bool:
        """Whether something is held."""
        return bool(self._held) or self._body >= 0

    def grab(self, pick: Pick, exact: bool = False) -> str:
        """Take hold; says what is held. Raises `InputError` for what cannot be moved."""
        self.let_go()
        model, state = self.simulation.model, self.simulation.state
        body = int(model.body_of[pick.point])
        shape = _owner(model.shapes, pick.point)
        if any(s.begin <= pick.point < s.end for s in model.scripted):
            raise InputError(f"'{shape.name}' goes where its script says and cannot be dragged")
        if body >= 0 and model.rigid.motion[body] != DYNAMIC:
            raise InputError(f"'{shape.name}' is not dynamic and cannot be dragged")
        self._target = np.array(pick.place)
        if body >= 0 and (not exact or model.surfaces is not None):  # a nail would press it through what it touches
            self._body = body
            origin, turn = self.simulation.pose(model.rigid.names[body])
            self._local = Rotation.from_quat(turn).inv().apply(pick.place - origin)
            self._share = float(model.rigid.mass[_joined(self.simulation, body)].sum())
            return f"pulling '{shape.name}'"
        point = pick.point
        owner = self._pin_at(point)
        if owner is None and body < 0 and model.conflicts == "error":
            point = self._free(shape, point, pick.place)
        place = np.array(state.positions()[point])
        self._point = point
        self._path = ExactPath(place, state.time, self.simulation.dt) if exact else SpringPath(place, state.time)
        if owner is not None:
            self._held = owner
            self.simulation.retarget(owner, self._path_value)
        else:
            points = {"body": shape.name, "index": point - shape.begin}
            self.simulation.add_constraint("nail", NAIL, points=points, goal=self._path_value)
            self._held = NAIL
        self.move(self._target)
        return f"holding point {point - shape.begin} of '{shape.name}'"

    def move(self, target: np.ndarray) -> None:
        """The mouse is there now [m]."""
        self._target = np.array(target, dtype=np.float64)
        if self._path is not None:
            self._path.aim(self._target, self.simulation.state.time)

    def let_go(self) -> None:
        """Hold nothing; a pin that was dragged stays where it is."""
        simulation = self.simulation
        if self._body >= 0:
            self._push(np.zeros(3), np.zeros(3))
        if self._held == NAIL:
            simulation.remove_constraint(NAIL)
        elif self._held and self._path is not None:
            simulation.retarget(self._held, self._path.value(simulation.state.time))
        self._path, self._held, self._body, self._point = None, "", -1, -1

    def before_step(self, dt: float) -> None:
        """Pull for the step that starts now."""
        if self._body < 0:
            return
        model, rigid = self.simulation.model, self.simulation.state.rigid
        b = self._body
        place, centre = self.place(), rigid.x.numpy()[b]
        v, w = rigid.v.numpy()[b], rigid.w.numpy()[b]
        arm = place - centre
        speed = v + np.cross(w, arm)
        # The stiffest spring for which the place alone, with the inertia that it has, is resolved by a step.
        lightest = 1.0 / (1.0 / model.rigid.mass[b] + float(arm @ arm) / model.rigid.inertia[b].min())
        k = min(self._share * PULL**2, lightest * (RESOLVED / dt) ** 2)
        c = 2.0 * math.sqrt(k * lightest)
        force = k * (self._target - place) - c * speed
        self._push(force, -SPIN * float(model.rigid.inertia[b].mean()) * w)

    def _push(self, force: np.ndarray, torque: np.ndarray) -> None:
        state = self.simulation.state
        stale = state.stale
        self.simulation.push(self.simulation.model.rigid.names[self._body], force, torque, self._local)
        state.stale = stale  # the scheme keeps what it remembers: a pull that changes each step is no new start

    def place(self) -> np.ndarray:
        """Where it holds [m]."""
        if self._body >= 0:
            origin, turn = self.simulation.pose(self.simulation.model.rigid.names[self._body])
            return origin + Rotation.from_quat(turn).apply(self._local)
        return np.array(self.simulation.state.positions()[self._point])

    @property
    def target(self) -> np.ndarray:
        """Where the mouse is [m]."""
        return self._target

    def _path_value(self, t: float) -> np.ndarray:
        assert self._path is not None
        return self._path.value(t)

    # Pins ------------------------------------------------------------------------------------------------------------

    def pins(self) -> dict[str, np.ndarray]:
        """Pins by name, and where they are (3,) [m]."""
        state = self.simulation.state
        x = state.positions()
        found = {n: np.array(x[g.points[0]]) for n, g in state.groups.items() if _is_pin(n)}
        for name, joint in state.joints.items():
            if _is_pin(name):
                q = Rotation.from_quat(state.rigid.q.numpy()[joint.a])
                found[name] = state.rigid.x.numpy()[joint.a] + q.apply(state.parts.p_a[joint.parts[0]])
        return found

    def toggle_pin(self, pick: Pick, reach: float) -> str:
        """Pin the place, or take the pin within ``reach`` [m] of it away; says what was done. Raises `InputError`."""
        simulation = self.simulation
        model, state = simulation.model, simulation.state
        body = int(model.body_of[pick.point])
        for name, at in self.pins().items():
            mine = self._body_of_pin(name)
            if mine == body and np.linalg.norm(at - pick.place) < reach or name == self._pin_at(pick.point):
                simulation.remove_constraint(name)
                return f"unpinned '{name}'"
        shape = _owner(model.shapes, pick.point)
        name = next(f"{PIN}_{i}" for i in range(1, 10**6) if not self._taken(f"{PIN}_{i}"))
        if any(s.begin <= pick.point < s.end for s in model.scripted):
            raise InputError(f"'{shape.name}' goes where its script says and cannot be pinned")
        if body >= 0:
            if model.rigid.motion[body] != DYNAMIC:
                raise InputError(f"'{shape.name}' is not dynamic and cannot be pinned")
            origin, turn = simulation.pose(model.rigid.names[body])
            local = Rotation.from_quat(turn).inv().apply(pick.place - origin)
            simulation.add_constraint(
                "ball", name, body1=model.rigid.names[body], local_pos0=list(pick.place), local_pos1=list(local)
            )
        else:
            if model.conflicts == "error" and state.owner[pick.point, 0] >= 0:
                raise InputError(f"point {pick.point - shape.begin} of '{shape.name}' is held by a constraint already")
            points = {"body": shape.name, "index": pick.point - shape.begin}
            simulation.add_constraint("nail", name, points=points, goal=list(state.positions()[pick.point]))
        return f"pinned '{shape.name}' as '{name}'"

    def unpin_all(self) -> None:
        """Take all pins away."""
        self.let_go()
        for name in list(self.pins()):
            self.simulation.remove_constraint(name)

    def _taken(self, name: str) -> bool:
        return name in self.simulation.state.groups or name in self.simulation.state.joints

    def _pin_at(self, point: int) -> str | None:
        """The pin that holds a mass point."""
        groups = self.simulation.state.groups
        return next((n for n, g in groups.items() if _is_pin(n) and point in g.points), None)

    def _body_of_pin(self, name: str) -> int:
        state = self.simulation.state
        if name in state.joints:
            return int(state.joints[name].a)
        return int(self.simulation.model.body_of[state.groups[name].points[0]])

    def _free(self, shape, point: int, place: np.ndarray) -> int:
        """The point of a body that no constraint holds nearest to a place. Raises `InputError` without one."""
        state = self.simulation.state
        inside = slice(shape.begin, shape.end)
        taken = state.owner[inside, 0] >= 0
        if len(state.domain_use) == len(state.owner):
            taken = taken | (state.domain_use[inside] > 0) & (np.arange(shape.begin, shape.end) != point)
        if not taken[point - shape.begin]:
            return point
        if taken.all():
            raise InputError(f"all points of '{shape.name}' are held by constraints; switch one off first")
        away = np.where(taken, np.inf, ((state.positions()[inside] - place) ** 2).sum(axis=1))
        return shape.begin + int(np.argmin(away))


def _is_pin(name: str) -> bool:
    return name.startswith(f"{PIN}_") and name[len(PIN) + 1 :].isdigit()


def _owner(shapes, point: int):
    """The body that a point belongs to."""
    for shape in shapes:
        if shape.begin <= point < shape.end:
            return shape
    raise TurnbuckleError(f"point {point} belongs to no body")


def _joined(simulation: Simulation, body: int) -> np.ndarray:
    """Dynamic bodies that joints connect with one, itself included (k,)."""
    model, state = simulation.model, simulation.state
    links = [(j.a, j.b) for j in state.joints.values() if j.acting and not j.broken]
    found, border = {body}, [body]
    while border:
        b = border.pop()
        for pair in links:
            if b in pair:
                other = pair[0] if pair[1] == b else pair[1]
                if other not in found and model.rigid.motion[other] == DYNAMIC:
                    found.add(other)
                    border.append(other)
    return np.array(sorted(found))
