"""Measures of contact for tests: where bodies are, what pushes them, what they carry."""

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.rigid import DYNAMIC
from turnbuckle.step.simulation import Simulation

G = 9.81


def centre(sim: Simulation, body: str) -> np.ndarray:
    """Centre of mass (3,) [m] of any body."""
    if body in sim.model.rigid.names:
        return sim.center(body)
    shape = sim.model.shape(body)
    m = np.maximum(sim.model.mass[shape.begin : shape.end], 0.0)
    return m @ sim.positions(body) / m.sum()


def speed(sim: Simulation, body: str) -> np.ndarray:
    """Velocity (3,) [m/s] of the centre of mass of any body."""
    if body in sim.model.rigid.names:
        return sim.velocity(body)[0]
    shape = sim.model.shape(body)
    m = np.maximum(sim.model.mass[shape.begin : shape.end], 0.0)
    return m @ sim.velocities(body) / m.sum()


def mass(sim: Simulation, body: str) -> float:
    """Mass of any dynamic body [kg]."""
    if body in sim.model.rigid.names:
        return float(sim.model.rigid.mass[sim.model.rigid.names.index(body)])
    shape = sim.model.shape(body)
    return float(np.maximum(sim.model.mass[shape.begin : shape.end], 0.0).sum())


def pushes(sim: Simulation) -> dict[tuple[str, str], np.ndarray]:
    """Force (3,) [N] on the second of two bodies by the first, over the last step, for all that touch."""
    state, surfaces = sim.state, sim.model.surfaces
    assert surfaces is not None
    span = max(len(surfaces.faces), len(surfaces.edges), surfaces.vertices, 1)
    kind, rest = np.divmod(state.contact_keys, span * span)
    a, b = np.divmod(rest, span)
    edge = kind == 1
    side_a = surfaces.shape[np.where(edge, surfaces.edges[np.where(edge, a, 0), 0], a)]
    faces = surfaces.faces[np.where(edge, 0, b), 0]
    side_b = surfaces.shape[np.where(edge, surfaces.edges[np.where(edge, b, 0), 0], faces)]
    names = [shape.name for shape in sim.model.shapes]
    out: dict[tuple[str, str], np.ndarray] = {}
    for i, j, impulse in zip(side_a, side_b, state.contact_impulse, strict=True):
        for pair, sign in (((names[j], names[i]), 1.0), ((names[i], names[j]), -1.0)):
            out[pair] = out.get(pair, np.zeros(3)) + sign * impulse / state.dt
    return out


def momentum(sim: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Linear and angular momentum about the origin of all that moves freely."""
    m, x, v = np.maximum(sim.model.mass, 0.0), sim.state.positions(), sim.state.velocities()
    linear, angular = m @ v, (m[:, None] * np.cross(x, v)).sum(axis=0)
    rigid, now = sim.model.rigid, sim.state.rigid
    place, speeds, spin, q = (getattr(now, name).numpy() for name in ("x", "v", "w", "q"))
    for b in np.flatnonzero(rigid.motion == DYNAMIC):
        turn = Rotation.from_quat(q[b])
        linear = linear + rigid.mass[b] * speeds[b]
        angular = angular + rigid.mass[b] * np.cross(place[b], speeds[b])
        angular = angular + turn.apply(rigid.inertia[b] * turn.inv().apply(spin[b]))
    return linear, angular


def step_well(sim: Simulation, count: int) -> list:
    """So many steps, none of which fails; their reports."""
    reports = []
    for _ in range(count):
        reports.append(sim.step())
        assert reports[-1].status != "failed", reports[-1].messages
    return reports
