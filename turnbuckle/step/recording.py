"""Recording of a step: forces, predictions and constraints as launches of one `Program`."""

from collections.abc import Callable

import numpy as np
import warp as wp

from turnbuckle.bodies.bending import hinge_forces
from turnbuckle.bodies.corotational import corotational_forces
from turnbuckle.bodies.gather import gather_forces
from turnbuckle.bodies.springs import spring_forces
from turnbuckle.bodies.tetrahedra import tetrahedra_forces
from turnbuckle.compute import Program
from turnbuckle.constraints import rows as constraint_rows
from turnbuckle.constraints.activation import has_joint_rows
from turnbuckle.constraints.points import attach, nail, points_to_point, slide, slide_search, velocity
from turnbuckle.constraints.points.own import OwnConstraint
from turnbuckle.data.model import Model
from turnbuckle.data.state import ADD, D_OVER_C, INVERSE_C, INVERSE_H, MEMORY, PROJECT, H, Kinematics, State
from turnbuckle.data.tables import JOINT
from turnbuckle.integrators import SCHEMES
from turnbuckle.solvers.implicit import ImplicitSolver
from turnbuckle.solvers.joint import JointSolver
from turnbuckle.step.field_values import field_values
from turnbuckle.step.row_forces import write_row_forces


class Scratch:
    """What a step needs and can be thrown away between steps."""

    def __init__(self, model: Model) -> None:
        device, arrays = model.device, model.device_arrays
        self.vectors: dict[str, wp.array] = {}
        self._unused: dict[tuple, wp.array] = {}
        self.one = wp.ones(1, dtype=wp.float64, device=device)
        self.element_force = wp.zeros(max(arrays["slots_total"], 1), dtype=wp.vec3d, device=device)
        self.spring_energy = wp.zeros(max(len(model.springs.pairs), 1), dtype=wp.float64, device=device)
        self.spring_power = wp.zeros_like(self.spring_energy)
        # of all elements but springs: blocks of tetrahedra, hinges, corotational elements
        others = arrays["blocks"] + len(model.hinges.points) + len(model.corotational.corners)
        self.block_energy = wp.zeros(max(others, 1), dtype=wp.float64, device=device)
        self.block_power = wp.zeros_like(self.block_energy)
        self.field_power = 0.0  # of force fields at the state last evaluated [W]
        self.implicit = ImplicitSolver(model) if model.integrator in ("implicit_euler", "newmark") else None
        self.own: list[OwnConstraint] = []  # constraints that the user wrote
        self.surfaces: slide_search.Surfaces | None = None
        self.joint: JointSolver | None = None
        self.row_forces: Callable[[], None] | None = None
        self.settled = False  # Newton's method has, in this step
        self.newton_first = self.newton_last = 0.0  # how far its first and last iteration moved a point [m]

    def follow(self, model: Model, state: State) -> None:
        """Catch up with constraints that were added, or share points in another way."""
        self.joint = None
        domains = state.tables.domains
        if domains and (self.surfaces is None or self.surfaces.domains != len(domains)):
            self.surfaces = slide_search.upload(domains, state.now.x, model.device)

    def unused(self, like: wp.array) -> wp.array:
        """An array of the shape of ``like`` for results that nobody reads."""
        key = (like.dtype, like.shape[0])
        if key not in self._unused:
            self._unused[key] = wp.zeros_like(like)
        return self._unused[key]

    def zeros_like(self, like: wp.array) -> wp.array:
        """An array of zeros that stays alive with the scratch."""
        key = ("zero", like.shape[0])
        if key not in self._unused:
            self._unused[key] = wp.zeros_like(like)
        return self._unused[key]

    def vector(self, name: str, points: int, device: str) -> wp.array:
        """A vector for each point, by name."""
        if name not in self.vectors:
            self.vectors[name] = wp.zeros(points, dtype=wp.vec3d, device=device)
        return self.vectors[name]


class StepRecorder:
    """Records one program for one scheme; what a scheme may use is `turnbuckle.integrators.scheme.Recorder`."""

    def __init__(self, model: Model, state: State, scratch: Scratch, now: Kinematics, ahead: Kinematics) -> None:
        self.model, self.state, self.work = model, state, scratch
        self.now, self.ahead = now, ahead
        self.mass = model.device_arrays["mass"]
        self.params = state.params
        self.paper = model.response == "paper"
        self.remembers_velocity = SCHEMES[model.integrator].velocity_memory
        self.program = Program(model.device)

    def launch(self, kernel: wp.Kernel, inputs: list) -> None:
        """Record a kernel over all points, and wait for it."""
        self.program.launch(kernel, self.model.points, inputs)
        self.program.barrier()

    def scratch(self, name: str) -> wp.array:
        """A vector for each point, by name."""
        return self.work.vector(name, self.model.points, self.model.device)

    def scratch_rows(self, name: str, like: wp.array) -> wp.array:
        """A vector for each row of a table, by name."""
        return self.work.vector(f"{name} {len(like)}", len(like), self.model.device)

    # Forces --------------------------------------------------------------------------------------------------------

    def forces(self, x: wp.array, v: wp.array, force_out: wp.array, time: float) -> None:
        """Record all forces at ``(x, v, t + time h)``: elements, gathered with gravity, then force fields."""
        p, arrays, work = self.program, self.model.device_arrays, self.work
        p.barrier()
        if len(self.model.springs.pairs):
            given = [arrays[k] for k in ("spring_pairs", "spring_inverse_length", "spring_k", "spring_k_d")]
            out = [work.element_force, work.spring_energy, work.spring_power]
            p.launch(spring_forces, len(self.model.springs.pairs), [*given, x, v, *out])
        if arrays["blocks"]:
            given = [arrays[k] for k in ("block_corners", "block_mask", "block_material", "materials", "block_rest")]
            out = [work.element_force, work.block_energy, work.block_power]
            kernel = tetrahedra_forces(arrays["lanes"])
            p.launch(kernel, arrays["blocks"], [*given, len(self.model.springs.pairs), x, v, *out])
        begin = arrays["blocks"]
        hinges, solid = len(self.model.hinges.points), len(self.model.corotational.corners)
        for n, kernel, name in ((hinges, hinge_forces, "hinges"), (solid, corotational_forces, "corotational")):
            if n:
                given = [arrays[name], arrays[f"first_{name}"]]
                out = [work.element_force, work.block_energy[begin : begin + n], work.block_power[begin : begin + n]]
                p.launch(kernel, n, [*given, x, v, *out], grain=4)
            begin += n
        p.barrier()
        given = [self.mass, arrays["slot_offsets"], arrays["slots"], work.element_force, self.params]
        p.launch(gather_forces, self.model.points, [*given, force_out])
        p.barrier()
        if self.model.fields:
            p.host(lambda: self._add_fields(x, v, force_out, time))

    def _add_fields(self, x: wp.array, v: wp.array, force_out: wp.array, time: float) -> None:
        positions, velocities, total = x.numpy(), v.numpy(), force_out.numpy()
        t = self.state.time + time * self.params.numpy()[H]
        power = 0.0
        for f in self.model.fields:
            points = f.points
            value = field_values(f.name, f.force, positions[points], velocities[points], t, self.model.mass[points])
            if not np.isfinite(value).all():
                first = points[int(np.argmin(np.isfinite(value).all(axis=1)))]
                where = ", ".join(f"{c:.6g}" for c in positions[first])
                raise FloatingPointError(
                    f"force '{f.name}' is not finite at t = {t:g} s on point {first} at ({where}) m"
                )
            total[points] += value
            power += float(np.einsum("nd,nd->", value, velocities[points]))
        self.work.field_power = power
        if not force_out.device.is_cpu:
            force_out.assign(total)

    # Constraints ---------------------------------------------------------------------------------------------------

    def constrain(self, acceleration: wp.array) -> None:
        """Record the projection of accelerations on all active constraints (nothing under ``response="paper"``)."""
        if self.paper:
            return
        p, t, mass = self.program, self.state.tables, self.mass
        if t.nail.rows:
            nail.project(p, t.nail, mass, acceleration, t.nail.acceleration, t.nail.force)
        if t.points_to_point.rows:
            joins = t.points_to_point
            points_to_point.project(p, joins, mass, acceleration, joins.force, joins.point_force)
        if t.attach.rows:
            attach.project(p, t.attach, mass, acceleration, t.attach.force)
        if t.velocity.rows:
            velocity.project(p, t.velocity, self.params, mass, acceleration, t.velocity.force)
        for own in self.work.own:
            own.project(p, mass, self.now, acceleration, "acceleration")
        p.barrier()
        if t.slide.rows:
            slide.project(p, t.slide, self.state.nailed, mass, acceleration, t.slide.force)
            p.barrier()
        if has_joint_rows(self.state):
            p.host(lambda: self._joint_project(acceleration, "acceleration"))

    def constrain_velocity(self, v: wp.array) -> None:
        """Record the projection of velocities on the rates of all active constraints; the forces stay as they are."""
        if self.paper:
            return
        p, t, mass, unused = self.program, self.state.tables, self.mass, self.work.unused
        if t.nail.rows:
            nail.project(p, t.nail, mass, v, t.nail.rate, unused(t.nail.force))
        if t.points_to_point.rows:
            joins = t.points_to_point
            points_to_point.project(p, joins, mass, v, unused(joins.force), unused(joins.point_force))
        if t.attach.rows:
            attach.project(p, t.attach, mass, v, unused(t.attach.force))
        if t.velocity.rows:
            goals = t.velocity
            zero = self.work.zeros_like(goals.goal)
            velocity.project_onto_goal(p, goals, zero, self.work.one, mass, v, unused(goals.force))
        for own in self.work.own:
            own.project(p, mass, self.ahead, v, "velocity")
        p.barrier()
        if t.slide.rows:
            slide.project(p, t.slide, self.state.nailed, mass, v, unused(t.slide.force))
            p.barrier()
        if has_joint_rows(self.state):
            p.host(lambda: self._joint_project(v, "rate"))

    def land(self, on: Kinematics) -> None:
        """Record the one exact pass over all constraints: positions, then velocities."""
        p, t, mass = self.program, self.state.tables, self.mass
        now = (
            self.ahead if SCHEMES[self.model.integrator].lands_later else self.now
        )  # where the interval landed on starts
        ramped = {g.kind for g in self.state.groups.values() if g.ramp_steps > 0}
        if t.nail.rows:
            moving = any(g.moving for g in self.state.groups.values() if g.kind == "nail")
            nail.land(p, t.nail, mass, self.params, now, on, "nail" in ramped, moving)
        if t.points_to_point.rows:
            points_to_point.land(p, t.points_to_point, mass, self.params, now, on, "points_to_point" in ramped)
        if t.attach.rows:
            inverse_mass = self.model.device_arrays["inverse_mass"]
            attach.land(p, t.attach, mass, inverse_mass, self.params, now, on, "attach" in ramped)
        if t.velocity.rows:
            velocity.land(p, t.velocity, mass, self.params, now, on)
        for own in self.work.own:
            own.land(p, mass, self.params, now, on)
        p.barrier()
        if t.slide.rows:
            slide_search.find(p, t.slide, self.work.surfaces, on.x)
            closing = self.scratch_rows("closing", t.slide.force)
            held = (self.state.nailed, t.nail.force, closing)
            slide.land(p, t.slide, self.work.surfaces, *held, mass, self.params, now, on, self.remembers_velocity)
            p.barrier()
        if has_joint_rows(self.state):
            p.host(lambda: self._joint_land(on))

    def find_places(self, x: wp.array) -> None:
        """Record the search for where sliding points are, at positions ``x``."""
        if self.state.tables.slide.rows:
            slide_search.find(self.program, self.state.tables.slide, self.work.surfaces, x)

    def _joint_solver(self, along: bool) -> tuple[JointSolver, constraint_rows.Rows]:
        """The rows that share points, and their solver; ``along``: slides hold their held directions only."""
        rows = constraint_rows.collect(self.state, float(self.params.numpy()[H]), JOINT, *self._landing())
        slides = rows.directions is not None
        if not along:
            rows.directions = None
        if self.work.joint is None or slides:
            self.work.joint = JointSolver(rows, self.model.mass)
        return self.work.joint, rows

    def _landing(self) -> tuple[np.ndarray, str]:
        """Where the interval that constraints land on starts, and how velocity goals drift in it."""
        scheme = SCHEMES[self.model.integrator]
        start = self.ahead.x if scheme.lands_later else self.now.x
        return start.numpy(), "end" if scheme.lands_later or scheme.goal_rate == "backward" else "mean"

    def _joint_project(self, y: wp.array, what: str) -> None:
        """Give the rates ``y`` of rows that share points what they want: "rate", "mean_rate" or "acceleration"."""
        solver, rows = self._joint_solver(along=True)
        values = y.numpy()
        dy, mu = solver.solve(getattr(rows, what) - rows.weights @ values)
        solver.spread(values, dy)
        y.assign(values)
        if what == "acceleration":
            write_row_forces(self.state, rows, mu, add=False)

    def _joint_land(self, on: Kinematics) -> None:
        solver, rows = self._joint_solver(along=False)
        params = self.params.numpy()
        x = on.x.numpy()
        dx, mu = solver.solve(rows.target - rows.weights @ x)
        solver.spread(x, dx)
        on.x.assign(x)
        write_row_forces(self.state, rows, mu * params[INVERSE_C], add=params[ADD] != 0.0)
        velocities = [on.v, on.memory] if params[MEMORY] != 0.0 else [on.v]
        if params[PROJECT] == 0.0:
            for velocity, factor in zip(velocities, (params[D_OVER_C], params[INVERSE_H]), strict=False):
                values = velocity.numpy()
                solver.spread(values, dx, factor)
                velocity.assign(values)
            return
        if self.work.surfaces is not None:  # the domains have moved
            table = self.state.tables.slide
            inputs = [0, *slide.moved_domain(table, self.work.surfaces, on.x)]
            wp.launch(slide.refresh_directions, len(table.phase), inputs=inputs, device=self.model.device)
        for velocity, what in zip(velocities, ("rate", "mean_rate"), strict=False):
            self._joint_project(velocity, what)

    # Implicit schemes ----------------------------------------------------------------------------------------------

    def solve(
        self,
        alpha: float,
        beta: float,
        push: float,
        at: tuple[wp.array, wp.array],
        free: wp.array,
        force: wp.array,
        a_out: wp.array,
        iteration: int,
        last: int | None,
    ) -> None:
        """Record one iteration of an implicit step (see `turnbuckle.integrators.scheme.Recorder`)."""
        self.find_places(free)

        def solve() -> None:
            work, h = self.work, float(self.params.numpy()[H])
            assert work.implicit is not None
            if iteration == 0:
                work.settled, work.row_forces = False, None
                a = np.zeros((self.model.points, 3))
            elif work.settled:
                return
            else:
                a = a_out.numpy().copy()
            rows = None if self.paper else constraint_rows.collect(self.state, h, None, *self._landing())
            rest = force.numpy() - self.mass.numpy()[:, None] * a
            where = (at[0].numpy(), at[1].numpy())
            da, f = work.implicit.solve(h, alpha, beta, push, where, rest, free.numpy(), rows)
            a_out.assign(a + da)
            if rows is not None:
                work.row_forces = lambda: write_row_forces(self.state, rows, f, add=False)
            moves = beta * h * h * float(np.abs(da).max(initial=0.0))
            work.settled = moves <= 1e-14 * self.model.size
            if iteration == 0:
                work.newton_first = moves
            work.newton_last = 0.0 if last is None else moves
            if iteration == last and not moves <= 0.1 * max(work.newton_first, 1e-8 * self.model.size):
                raise FloatingPointError(
                    f"Newton's method does not settle: after {last + 1} iterations it moves {moves:.1e} m"
                )

        self.program.host(solve)
