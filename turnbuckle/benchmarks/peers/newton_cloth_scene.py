"""A ready scene as a model of Newton (Warp), and its steps with VBD: the same points, masses, springs, hinges, tetrahedra.

Obstacles: what lies flat and still is a ground plane, boxes are boxes (kinematic), anything else is a mesh of points that
are moved along and touch the bodies as these touch themselves.
"""

from typing import Any

import numpy as np
import warp as wp

from turnbuckle.benchmarks.contact_referee import solid_surfaces
from turnbuckle.data.contact import Surfaces
from turnbuckle.data.model import Model, Scripted
from turnbuckle.data.state import State

GROUND, BOX, MESH = "ground", "box", "mesh"
VERTEX_PAIRS, EDGE_PAIRS = 64, 128  # room in Newton's lists; those that overflow drop pairs
RADIUS = 0.5  # of the distance that our surfaces keep: particles against planes and boxes


class NewtonScene:
    """One scene in Newton. ``stiffness`` [N/m] and ``damping`` [s] of its penalties, ``reach`` times our contact distance.

    Between two detections Newton lets a point go 0.43 of the distance that it looks in, ``1 + gap`` times that of contact:
    with the gap of its examples, 0.75, cloth falls at half the speed. ``interval`` 1 detects before each iteration.
    """

    def __init__(
        self,
        model: Model,
        state: State,
        iterations: int = 10,
        substeps: int = 1,
        stiffness: float = 1e3,
        damping: float = 1e-5,
        reach: float = 1.0,
        gap: float = 6.0,
        interval: int = 0,
    ) -> None:
        import newton

        assert model.surfaces is not None
        self.model, self.substeps, self.gap = model, substeps, gap
        solids = len(model.corotational.corners) > 0
        self.surfaces: Surfaces = solid_surfaces(model) if solids else model.surfaces
        self.x = state.positions().copy()
        self.radius = reach * float(self.surfaces.delta.mean())
        self.obstacles = {script.name: _kind(script) for script in model.scripted}
        held = np.concatenate([state.groups[g].points for g in state.groups]) if state.groups else np.zeros(0, int)
        self.goals = [g for g in state.groups.values() if g.goal is not None]
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=tuple(float(g) for g in state.gravity))
        self._particles(builder, held)
        self._elements(builder)
        mu = float(self.surfaces.friction[..., 1].max())
        self._shapes(builder, newton, stiffness, damping * stiffness, mu)
        builder.color(include_bending=True)
        self.newton = builder.finalize(device="cpu")
        self.newton.soft_contact_ke = stiffness
        self.newton.soft_contact_kd = damping * stiffness
        self.newton.soft_contact_mu = mu
        self.solver = newton.solvers.SolverVBD(
            self.newton,
            iterations=iterations,
            integrate_with_external_rigid_solver=True,
            particle_enable_self_contact=True,
            particle_self_contact_margin=self.radius,
            particle_self_contact_gap=gap * self.radius,
            particle_collision_detection_interval=interval or None,
            particle_vertex_contact_buffer_size=VERTEX_PAIRS,
            particle_edge_contact_buffer_size=EDGE_PAIRS,
            particle_enable_tile_solve=False,
        )
        self.states = [self.newton.state(), self.newton.state()]
        self.control = self.newton.control()
        touches = any(kind != MESH for kind in self.obstacles.values())
        self.pipeline = newton.CollisionPipeline(self.newton, soft_contact_gap=self.radius) if touches else None
        self.contacts = self.pipeline.contacts() if self.pipeline else None
        self.steps = 0

    def _particles(self, builder: Any, held: np.ndarray) -> None:
        """Free points, and those that are moved along: held ones, and the points of meshes."""
        model = self.model
        moved = np.zeros(model.points, bool)
        moved[held] = True
        kept = model.mass > 0.0
        for script in model.scripted:
            if self.obstacles[script.name] == MESH:
                kept[script.begin : script.end] = moved[script.begin : script.end] = True
        self.points = np.flatnonzero(kept)
        self.number = np.full(model.points, -1)
        self.number[self.points] = np.arange(len(self.points))
        self.moved = np.flatnonzero(moved[self.points])
        mass = np.where(moved, 0.0, model.mass)[self.points]
        x = self.x[self.points]
        zero = [wp.vec3(0.0)] * len(x)
        radius = [RADIUS * self.radius] * len(x)
        builder.add_particles(pos=[wp.vec3(*p) for p in x], vel=zero, mass=mass.tolist(), radius=radius)

    def _elements(self, builder: Any) -> None:
        model, number = self.model, self.number
        springs = model.springs
        ke, kd = springs.k / springs.length**2, springs.k_d / springs.length**2
        for (a, b), k, d in zip(number[springs.pairs].tolist(), ke.tolist(), kd.tolist(), strict=True):
            builder.add_spring(a, b, k, d, control=0.0)
        faces = self.surfaces.support[self.surfaces.faces][..., 0]
        faces = number[faces]
        faces = faces[(faces >= 0).all(axis=1)]
        if len(faces):
            none = [0.0] * len(faces)
            builder.add_triangles(*faces.T, tri_ke=none, tri_ka=none, tri_kd=none, tri_drag=none, tri_lift=none)
        hinges = model.hinges
        if len(hinges.points):
            first, second, left, right = number[hinges.points].T
            length = np.linalg.norm(self.x[hinges.points[:, 0]] - self.x[hinges.points[:, 1]], axis=1)
            builder.add_edges(
                left, right, first, second, edge_ke=(hinges.k / length).tolist(), edge_kd=(hinges.k_d / length).tolist()
            )
        solid = model.corotational
        e, nu = solid.youngs_modulus, solid.poissons_ratio
        mu, lam = e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        rows = zip(
            number[solid.corners].tolist(), mu.tolist(), lam.tolist(), (solid.damping * mu).tolist(), strict=True
        )
        for corners, k_mu, k_lambda, k_damp in rows:
            builder.add_tetrahedron(*corners, k_mu=k_mu, k_lambda=k_lambda, k_damp=k_damp)

    def _shapes(self, builder: Any, newton: Any, ke: float, kd: float, mu: float) -> None:
        config = newton.ModelBuilder.ShapeConfig(ke=ke, kd=kd, mu=mu)
        self.bodies: list[Scripted] = []
        for script in self.model.scripted:
            kind, x = self.obstacles[script.name], script.positions(0.0)
            if kind == GROUND:
                builder.add_ground_plane(height=float(x[:, 2].max()), cfg=config)
            elif kind == BOX:
                middle, half = 0.5 * (x.min(axis=0) + x.max(axis=0)), 0.5 * np.ptp(x, axis=0)
                place = wp.transform(wp.vec3(*middle), wp.quat_identity())
                body = builder.add_body(xform=place, is_kinematic=True) if script.moves else -1
                own = wp.transform_identity() if script.moves else place
                builder.add_shape_box(body, xform=own, hx=half[0], hy=half[1], hz=half[2], cfg=config)
                if script.moves:
                    self.bodies.append(script)

    def _move(self, t: float) -> None:
        """Put what is scripted where it is at time ``t`` [s], in both states."""
        if len(self.moved):
            x = self.positions(t)[self.points]
            for one in self.states:
                q = one.particle_q.numpy()
                q[self.moved] = x[self.moved]
                one.particle_q.assign(q)
        if self.bodies:
            places = [script.positions(t) for script in self.bodies]
            for one in self.states:
                q = one.body_q.numpy()
                q[:, :3] = [0.5 * (x.min(axis=0) + x.max(axis=0)) for x in places]
                one.body_q.assign(q)

    def _substep(self, old: Any, new: Any, dt: float) -> None:
        old.clear_forces()
        if self.pipeline is not None:
            self.pipeline.collide(old, self.contacts)
        self.solver.step(old, new, self.control, self.contacts, dt)

    def step(self, dt: float) -> None:
        """One step of ours, in substeps."""
        moves = len(self.moved) > 0 or len(self.bodies) > 0
        if not moves and self.steps % 10 == 0:
            self.solver.rebuild_bvh(self.states[0])
        for k in range(self.substeps):
            if moves:
                self._move((self.steps + (k + 1.0) / self.substeps) * dt)
                if k == 0 and self.steps % 10 == 0:
                    self.solver.rebuild_bvh(self.states[0])
            self._substep(*self.states, dt / self.substeps)
            self.states.reverse()
        self.steps += 1

    def positions(self, t: float) -> np.ndarray:
        """All points of the scene (points, 3) [m]: what is simulated, and what is scripted at time ``t`` [s]."""
        x = self.x.copy()
        x[self.points] = self.states[0].particle_q.numpy()
        for script in self.model.scripted:
            x[script.begin : script.end] = script.positions(t)
        for group in self.goals:
            x[group.points] = group.goal.position(t)
        return x


def _kind(script: Scripted) -> str:
    """How Newton has this obstacle."""
    x = script.positions(0.0)
    if not script.moves and np.ptp(x[:, 2]) == 0.0:
        return GROUND
    corners = (x == x.min(axis=0)) | (x == x.max(axis=0))
    return BOX if corners.all() and len(x) == 8 else MESH
