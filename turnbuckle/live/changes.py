"""Changing a scene while it runs: another scheme, solver or friction needs another model, which takes over the state."""

from typing import Any

import numpy as np

from turnbuckle.constraints.activation import deactivate
from turnbuckle.data.state import State
from turnbuckle.scene.definitions import SceneDef
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.validation import given_data, validate
from turnbuckle.step.simulation import Simulation


def changed_scene(scene: Scene, **fields: Any) -> Scene:
    """A scene with some fields of its definition anew. Raises `InputError`; the old one is unchanged."""
    data = given_data(scene.definition)
    definition = validate(SceneDef, {**data, **fields}, "", {"folder": scene.folder})
    return Scene.from_definition(definition, scene.folder)


def contact_field(scene: Scene, name: str, value: Any) -> dict[str, Any]:
    """The field `contact` of a scene with one option anew, for `changed_scene`."""
    options = scene.definition.contact
    return {"contact": {**(given_data(options) if options is not None else {}), name: value}}


def frictions_as(scene: Scene, mu: float) -> dict[str, Any]:
    """Fields that give every pair of bodies the friction ``mu``, for `changed_scene`."""
    fields = contact_field(scene, "friction", mu)
    fields["contact"].pop("dynamic_friction", None)
    bodies = []
    for body in scene.definition.bodies:
        data = given_data(body)
        for name in ("static_friction", "dynamic_friction", "friction"):
            data.pop(name, None)
        bodies.append(data)
    return {**fields, "bodies": bodies, "frictions": []}


def take_over(new: Simulation, old: Simulation) -> None:
    """Give ``new`` the moment at which ``old`` is: places, velocities, time, switches, gravity, what broke.

    Both are of scenes with the same bodies; constraints that were added live are not carried over.
    """
    a, b = new.state, old.state
    for mine, other in ((a.now.x, b.now.x), (a.now.v, b.now.v)):
        mine.assign(other.numpy())
    for name in "xqvw":
        getattr(a.rigid, name).assign(getattr(b.rigid, name).numpy())
    for name in ("force", "torque", "at"):
        getattr(a.loads, name)[:] = getattr(b.loads, name)
    a.time, a.steps, a.dt = b.time, b.steps, 0.0
    a.work, a.dissipation = b.work, b.dissipation
    a.set_gravity(b.gravity)
    new.dt = old.dt
    _switches(new, a, b)
    new.stepper.articulated.place_points()
    a.stale = True


def _switches(new: Simulation, a: State, b: State) -> None:
    for name in [n for n, g in a.groups.items() if n in b.groups and not b.groups[n].enabled and g.enabled]:
        new.switch(name, False)
    for name, group in a.groups.items():
        other = b.groups.get(name)
        if other is None:
            continue
        if other.enabled and not group.enabled:
            new.switch(name, True)
        if len(other.broken) == len(group.broken) and other.broken.any():
            if group.acting:
                deactivate(new.model, a, group, np.array(other.broken))
            group.broken = np.array(other.broken)
    for name, joint in a.joints.items():
        if name in b.joints:
            joint.enabled, joint.broken = b.joints[name].enabled, b.joints[name].broken
