"""The tab "Physics": time step, gravity, friction, scheme and solvers."""

from concurrent.futures import Future
from typing import Any

from turnbuckle.live.frame import Frame
from turnbuckle.live.session import Session
from turnbuckle.scene.definitions import INTEGRATORS
from turnbuckle.scene.scene import Scene

SMALLEST, LARGEST = 1e-6, 1.0  # [s]
STANDARD = 9.81  # [m/s^2]
CONTACT_SOLVERS = ("newton", "ica", "anticipation")
SHAPES = ("cone", "pyramid4", "pyramid8", "pyramid16")


class PhysicsPanel:
    """Controls that change the simulation; what it refuses goes back to what it was."""

    def __init__(self, gui: Any, session: Session) -> None:
        self._session = session
        d = session.scene.definition
        self.dt = gui.add_number("Time step [ms]", 1e3 * d.dt, min=1e3 * SMALLEST, max=1e3 * LARGEST, step=1e-3)
        g = self._given = d.gravity_vector()
        self.gravity = gui.add_vector3("Gravity [m/s²]", tuple(float(c) for c in g), step=0.01)
        self.zero = gui.add_button_group("Gravity", ("none", "down", "up", "as in the scene"))
        self.integrator = gui.add_dropdown(
            "Integrator", INTEGRATORS, initial_value=d.integrator, hint="Goes on from this moment with another scheme"
        )
        self.response = gui.add_dropdown("Response", ("exact", "paper"), initial_value=d.response)
        self.solver = gui.add_dropdown("Joints", ("equality", "displacement"), initial_value=d.solver)
        self.conflicts = gui.add_dropdown(
            "Shared points", ("error", "solve"), initial_value=d.conflicts,
            hint="Constraints that share a point: refused, or solved together",
        )  # fmt: skip
        c = d.contact
        there = c is not None
        self.friction = gui.add_slider(
            "Friction", min=0.0, max=2.0, step=0.01, initial_value=min(c.friction, 2.0) if c else 0.3, visible=there,
            hint="One coefficient for all pairs of bodies, when you move it",
        )  # fmt: skip
        self.contact_solver = gui.add_dropdown(
            "Contact", CONTACT_SOLVERS, initial_value=c.solver if c else "newton", visible=there
        )
        self.friction_shape = gui.add_dropdown(
            "Friction cone", SHAPES, initial_value=c.friction_shape if c else "cone", visible=there
        )
        self.dt.on_update(lambda e: self._do(e, lambda: session.set_dt(1e-3 * float(self.dt.value))))
        self.gravity.on_update(lambda e: self._do(e, lambda: session.set_gravity(self.gravity.value)))
        self.zero.on_click(lambda e: self._preset(str(self.zero.value)))
        for name in ("integrator", "response", "solver", "conflicts"):
            control = getattr(self, name)
            control.on_update(lambda e, n=name, c=control: self._do(e, lambda: session.set_field(n, c.value)))
        self.friction.on_update(lambda e: self._do(e, lambda: session.set_friction(float(self.friction.value))))
        self.contact_solver.on_update(
            lambda e: self._do(e, lambda: session.set_contact("solver", self.contact_solver.value))
        )
        self.friction_shape.on_update(
            lambda e: self._do(e, lambda: session.set_contact("friction_shape", self.friction_shape.value))
        )

    def _do(self, event: Any, command: Any) -> None:
        if event.client is not None:
            command().add_done_callback(self._done)

    def _done(self, done: "Future[None]") -> None:
        """What was refused must not stay on the page."""
        if not done.cancelled() and done.exception() is not None:
            self.read(self._session.scene)

    def read(self, scene: Scene) -> None:
        """Show what the scene says."""
        d = scene.definition
        self.dt.value = 1e3 * d.dt
        x, y, z = (float(c) for c in d.gravity_vector())
        self.gravity.value = (x, y, z)
        for name in ("integrator", "response", "solver", "conflicts"):
            getattr(self, name).value = getattr(d, name)
        if d.contact is not None:
            self.contact_solver.value, self.friction_shape.value = d.contact.solver, d.contact.friction_shape
            self.friction.value = min(d.contact.friction, 2.0)

    def _preset(self, word: str) -> None:
        session = self._session
        axis = 1 if session.up_axis == "Y" else 2
        g = [0.0, 0.0, 0.0]
        if word == "as in the scene":
            g = [float(c) for c in self._given]
        elif word != "none":
            g[axis] = -STANDARD if word == "down" else STANDARD
        self.gravity.value = (g[0], g[1], g[2])
        session.set_gravity(g)

    def update(self, frame: Frame) -> None:
        """Nothing here changes by itself."""
