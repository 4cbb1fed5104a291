"""A simulation that runs in a thread of its own, commanded from any other. The thread alone touches the simulation.

`frame` is the newest moment to show, replaced as a whole and never changed; `next_frame` waits for one. All that changes
something is a command: it returns a future at once and is carried out between two steps.
"""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from turnbuckle.data.errors import InputError, TurnbuckleError
from turnbuckle.data.report import StepReport
from turnbuckle.data.shape import Shape
from turnbuckle.live.changes import changed_scene, contact_field, frictions_as, take_over
from turnbuckle.live.commands import Commands
from turnbuckle.live.frame import Arrows, Frame, Marks, Pull, Reading, no_arrows, no_marks
from turnbuckle.live.hand import Hand
from turnbuckle.live.history import History
from turnbuckle.live.picking import Pick
from turnbuckle.live.priority import give_way
from turnbuckle.live.readings import read_constraints, read_contacts, read_marks
from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation

T = TypeVar("T")
SHOWN = 1.0 / 60.0  # [s] of wall time between two frames at least
READ = 0.15  # [s] between two readings of the constraints
READ_PART = 0.1  # of the time that readings may take
BEHIND = 0.1  # [s] of wall time: what is further behind is given up
IDLE = 0.25  # [s] between two looks when nothing runs
REACH = 0.02  # of the scene's size: a click nearer to a pin than this means the pin
NOTES = 4  # kept
HARD, HARDER = 500.0, 10.0  # [ms], and times the usual: a step that takes longer than both makes the hand let go
PAUSED = "; it is paused, and moves when you run or step it"
Recorded = tuple[float, np.ndarray, np.ndarray]  # time [s], x [m] and v [m/s]


class Session:
    """Owns one simulation. Make it, then `start` it; `close` ends the thread."""

    def __init__(self, scene: Scene, device: str = "cpu") -> None:
        """Build ``scene``. Raises `InputError`."""
        self.scene, self.device = scene, device
        self._commands = Commands()
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._published = threading.Condition()
        self.history = History()
        self.running = False
        self.speed = 1.0  # simulated seconds a second
        self.recording: list[Recorded] | None = None  # frames kept while the user records
        self._notes: tuple[str, ...] = ()
        self._simulation = Simulation(scene, device)
        self.contact = self._simulation.model.surfaces is not None
        self.frame = Frame(np.zeros((0, 3)))
        self._begin()

    # Read by any thread ----------------------------------------------------------------------------------------------

    @property
    def shapes(self) -> list[Shape]:
        """The bodies; the same for the whole session."""
        return list(self._simulation.model.shapes)

    @property
    def up_axis(self) -> str:
        """ "Y" or "Z"."""
        return self._simulation.model.up_axis

    @property
    def size(self) -> float:
        """Of the scene [m]."""
        return self._simulation.model.size

    @property
    def notes(self) -> tuple[str, ...]:
        """What there was to say, newest last."""
        return self._notes

    def next_frame(self, after: int, timeout: float) -> Frame:
        """The newest frame, once its number is greater than ``after`` or the time [s] is over."""
        with self._published:
            self._published.wait_for(lambda: self.frame.number > after, timeout)
            return self.frame

    # Life ------------------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._live, name="turnbuckle simulation", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread; waits for the step that runs."""
        self._ended.set()
        self.do(lambda simulation: None)
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=60.0)

    def do(self, action: Callable[[Simulation], T], key: str | None = None) -> "Future[T]":
        """Carry out ``action(simulation)`` between two steps. Of several with one ``key`` that wait, only the last."""
        return self._commands.put(lambda: self._act(action), key)

    # Commands --------------------------------------------------------------------------------------------------------

    def run(self) -> "Future[None]":
        """Step on and on."""
        return self.do(lambda _: self._set_running(True))

    def pause(self) -> "Future[None]":
        """Stop after the step that runs."""
        return self.do(lambda _: self._set_running(False))

    def step(self, count: int = 1) -> "Future[StepReport]":
        """Pause, and take some steps."""
        return self.do(lambda _: self._steps(count))

    def reset(self) -> "Future[None]":
        """Back to the start of the scene, with all that was changed in it, paused."""
        return self.do(lambda _: self._renew(self.scene, keep=False))

    def set_speed(self, speed: float) -> "Future[None]":
        """Simulated seconds a second, at most."""
        return self.do(lambda _: self._set_speed(speed))

    def switch(self, name: str, on: bool) -> "Future[None]":
        """Switch a constraint or joint."""
        return self.do(lambda simulation: simulation.switch(name, on))

    def set_dt(self, dt: float) -> "Future[None]":
        """Another time step [s]."""
        return self.do(lambda simulation: self._set_dt(simulation, dt))

    def set_gravity(self, gravity: Any) -> "Future[None]":
        """Other gravity (3,) [m/s^2]; stays after a reset."""
        return self.do(lambda simulation: self._set_gravity(simulation, [float(g) for g in gravity]))

    def set_friction(self, mu: float) -> "Future[None]":
        """One coefficient of friction for all pairs of bodies."""
        return self.do(lambda _: self._renew(changed_scene(self.scene, **frictions_as(self.scene, mu))))

    def set_contact(self, name: str, value: Any) -> "Future[None]":
        """Another option of contact, such as its solver."""
        return self.do(lambda _: self._renew(changed_scene(self.scene, **contact_field(self.scene, name, value))))

    def set_field(self, name: str, value: Any) -> "Future[None]":
        """Another value of a field of the scene, such as its integrator or solver; goes on from this moment."""
        return self.do(lambda _: self._renew(changed_scene(self.scene, **{name: value})))

    def grab(self, pick: Pick, exact: bool = False) -> "Future[str]":
        """Take hold of a place."""
        return self.do(lambda _: self.note(self._hand.grab(pick, exact) + ("" if self.running else PAUSED)))

    def drag(self, target: Any) -> "Future[None]":
        """The mouse is there [m]."""
        return self.do(lambda _: self._hand.move(target), key="drag")

    def let_go(self) -> "Future[None]":
        """Hold nothing any more."""
        return self.do(lambda _: self._hand.let_go())

    def toggle_pin(self, pick: Pick) -> "Future[str]":
        """Pin a place, or take its pin away."""
        return self.do(lambda _: self.note(self._hand.toggle_pin(pick, REACH * self.size)))

    def unpin_all(self) -> "Future[None]":
        """Take all pins away."""
        return self.do(lambda _: self._hand.unpin_all())

    def renew(self, make: Callable[[Scene, Simulation], Scene], keep: bool = False) -> "Future[None]":
        """Go on with another scene of the same bodies; ``keep``: from this moment, else from its start, paused."""
        return self.do(lambda simulation: self._renew(make(self.scene, simulation), keep=keep))

    def become(self, scene: Scene) -> None:
        """For actions given to `do`: be at the start of another scene of the same bodies, paused."""
        self._renew(scene, keep=False)

    def record(self, on: bool) -> "Future[list[Recorded]]":
        """Begin to keep frames at the scene's rate, or end; the frames kept."""
        return self.do(lambda _: self._record(on))

    # In the thread ---------------------------------------------------------------------------------------------------

    def _live(self) -> None:
        give_way()
        while not self._ended.is_set():
            wait = 0.0
            if not self.running:
                wait = IDLE
            else:
                due = self._anchor[0] + (self._simulation.time - self._anchor[1]) / self.speed
                wait = max(due - time.perf_counter(), 0.0)
            if self._commands.carry_out(wait) and not self.running:
                self._publish()
            if self.running and not self._ended.is_set() and self._due():
                self._step()
                if time.perf_counter() - self._shown >= SHOWN:
                    self._publish()

    def _due(self) -> bool:
        now = time.perf_counter()
        ahead = (self._simulation.time - self._anchor[1]) / self.speed - (now - self._anchor[0])
        if ahead < -BEHIND:
            self._anchor = (now, self._simulation.time)
        return ahead <= 1e-4

    def _act(self, action: Callable[[Simulation], T]) -> T:
        """An action of the user; what it did wrong is told on the page, and to who waits for its future."""
        try:
            return action(self._simulation)
        except TurnbuckleError as error:
            self.note(str(error))
            raise
        except Exception as error:  # a fault of ours must not go unseen
            self.note(f"{type(error).__name__}: {error}")
            raise

    def note(self, text: str) -> str:
        """Tell the user something."""
        self._notes = (*self._notes, text)[-NOTES:]
        return text

    def _begin(self) -> None:
        """A new simulation: nothing is held, nothing read."""
        self._hand = Hand(self._simulation)
        self._layout = -1  # of the state after the last step
        self._report: StepReport | None = None
        self._readings: tuple[Reading, ...] = ()
        self._marks: Marks = no_marks()
        self._contacts: Arrows = no_arrows()
        self._read_at, self._rest, self._shown = 0.0, READ, 0.0
        self._ms, self._rates = 0.0, [(time.perf_counter(), self._simulation.time)]
        self._anchor = (time.perf_counter(), self._simulation.time)
        self._publish()

    def _set_running(self, on: bool) -> None:
        self.running = on
        self._anchor = (time.perf_counter(), self._simulation.time)
        self._rates = [self._anchor]

    def _set_speed(self, speed: float) -> None:
        if not (np.isfinite(speed) and speed > 0.0):
            raise InputError(f"speed: expected a number greater than 0, got {speed}")
        self.speed = speed
        self._set_running(self.running)

    def _set_dt(self, simulation: Simulation, dt: float) -> None:
        if not (np.isfinite(dt) and dt > 0.0):
            raise InputError(f"dt: expected a number greater than 0 [s], got {dt}")
        simulation.dt = float(dt)
        self.scene = changed_scene(self.scene, dt=float(dt))

    def _set_gravity(self, simulation: Simulation, gravity: list[float]) -> None:
        self.scene = changed_scene(self.scene, gravity=gravity)
        simulation.state.set_gravity(np.array(gravity))

    def _steps(self, count: int) -> StepReport:
        self.running = False
        report = StepReport()
        for _ in range(count):
            report = self._step()
        self._publish()
        return report

    def _step(self) -> StepReport:
        simulation = self._simulation
        began = time.perf_counter()
        self._hand.before_step(simulation.dt)
        try:
            report = simulation.step()
        except TurnbuckleError as error:
            report = StepReport(status="failed", messages=[str(error)], time=simulation.time)
        except Exception as error:  # the thread must live: the user can go back to the start
            report = StepReport(status="failed", messages=[f"{type(error).__name__}: {error}"], time=simulation.time)
        took = 1e3 * (time.perf_counter() - began)
        if self._hand.holds and self._ms > 0.0 and took > max(HARD, HARDER * self._ms):
            self._hand.let_go()
            self.note("the hand has let go: what it asked for made the step too hard")
        self._ms = took if self._ms == 0.0 else self._ms + 0.1 * (min(took, HARDER * self._ms) - self._ms)
        self._report, self._layout = report, simulation.state.layout
        if report.status == "failed":
            self.running = False
            self._hand.let_go()
            self._publish()
            return report
        self.history.add(report)
        if self.recording is not None:
            self._keep()
        self._rates = [*self._rates, (time.perf_counter(), simulation.time)][-200:]
        return report

    def _renew(self, scene: Scene, keep: bool = True) -> None:
        """Another simulation; where it cannot be built the old one goes on. Raises `InputError`."""
        old = self._simulation
        new = Simulation(scene, self.device)
        if keep:
            self._hand.let_go()
            pins = self._hand.pins()
            take_over(new, old)
        self.scene, self._simulation = scene, new
        if keep:
            running = self.running
            held = [(old, name, place) for name, place in pins.items()]
            self._begin()
            for source, name, place in held:
                self._pin_again(source, name, place)
            self.running = running
        else:
            self.running = False
            self.history.clear()
            self._begin()

    def _pin_again(self, old: Simulation, name: str, place: np.ndarray) -> None:
        if name in old.state.joints:
            body = old.model.rigid.names[old.state.joints[name].a]
            point = int(old.model.shape(body).begin)
        else:
            point = int(old.state.groups[name].points[0])
        shape = next(i for i, s in enumerate(old.model.shapes) if s.begin <= point < s.end)
        self._hand.toggle_pin(Pick(shape, point, place), 0.0)

    def _record(self, on: bool) -> list[Recorded]:
        kept = self.recording or []
        self.recording = [] if on else None
        if on:
            self._keep()
        return kept

    def _keep(self) -> None:
        """Keep a frame when one is due."""
        assert self.recording is not None
        state = self._simulation.state
        due = self.recording[-1][0] + 1.0 / self.scene.definition.frames_per_second if self.recording else -np.inf
        if state.time >= due - 1e-6:
            self.recording.append((state.time, np.array(state.positions()), np.array(state.velocities())))

    def _publish(self) -> None:
        simulation, state, report = self._simulation, self._simulation.state, self._report
        now = time.perf_counter()
        if now - self._read_at >= self._rest or not self.running:
            changed = state.layout != self._layout
            self._readings = read_constraints(simulation, self._readings, changed)
            self._rest = max(READ, (time.perf_counter() - now) / READ_PART)
            self._read_at = now
        self._marks = read_marks(simulation, self._readings)
        self._contacts = read_contacts(simulation)
        pins = self._hand.pins()
        (w0, s0), (w1, s1) = self._rates[0], self._rates[-1]
        frame = Frame(
            x=np.array(state.positions()), time=state.time, steps=state.steps, running=self.running,
            status=report.status if report else "", messages=tuple(report.messages[:3]) if report else (),
            notes=self._notes, dt=simulation.dt, ms=self._ms, rate=(s1 - s0) / (w1 - w0) if w1 > w0 and self.running else 0.0,
            readings=self._readings, marks=self._marks, contacts=self._contacts,
            touching=report.touching if report else 0,
            pull=Pull(self._hand.place(), self._hand.target) if self._hand.holds else None,
            pins=np.array(list(pins.values())).reshape(-1, 3),
        )  # fmt: skip
        with self._published:
            self.frame = replace(frame, number=self.frame.number + 1)
            self._published.notify_all()
        self._shown = time.perf_counter()
