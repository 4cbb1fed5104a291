"""What tells one model from another, so that a checkpoint of another scene is refused."""

import hashlib
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from turnbuckle.data.model import Model
from turnbuckle.data.rigid import RigidBodies


def fingerprint(model: Model) -> dict[str, Any]:
    """Counts and settings as they are, arrays by their SHA-256. Names and the device do not count."""
    elements = (model.springs, model.tetrahedra, model.hinges, model.corotational, model.strain_limits)
    springs, solids, hinges, corotational, limits = ([getattr(part, f.name) for f in fields(part)] for part in elements)
    return {
        "points": model.points,
        "rigid bodies": model.rigid.count - 1,
        "springs": len(model.springs.pairs),
        "tetrahedra": len(model.tetrahedra.corners),
        "hinges": len(model.hinges.points),
        "corotational tetrahedra": len(model.corotational.corners),
        "strain limits": len(model.strain_limits.pairs),
        "scripted bodies": [[int(s.begin), int(s.end), bool(s.moves)] for s in model.scripted],
        "integrator": model.integrator,
        "response": model.response,
        "conflicts": model.conflicts,
        "solver of joints": model.solver,
        "rigid motion": model.rigid_motion,
        "forces": [f.name for f in model.fields],
        "forces on rigid bodies": [f.name for f in model.rigid_fields],
        "expressions of forces": [_text(f.force) for f in model.fields],
        "expressions of forces and torques on rigid bodies": [
            [_text(f.force), _text(f.torque)] for f in model.rigid_fields
        ],
        **_contact(model),
        "masses": _digest([model.mass]),
        "rest positions": _digest([model.rest]),
        "spring data": _digest(springs),
        "tetrahedron data": _digest(solids),
        "hinge data": _digest(hinges),
        "data of corotational tetrahedra": _digest(corotational),
        "data of strain limits": _digest(limits),
        "motions of scripted bodies": _digest(a for s in model.scripted for a in getattr(s.positions, "keys", ())),
        "points under forces": _digest([f.points for f in model.fields]),
        "data of rigid bodies": _digest(_rigid(model.rigid)),
        "places of forces on rigid bodies": _digest([a for f in model.rigid_fields for a in (f.bodies, f.at)]),
    }


def _contact(model: Model) -> dict[str, Any]:
    """Options of contact by name, who touches whom, surfaces; only whether there is any, where contact is off."""
    surfaces = model.surfaces
    if surfaces is None:
        return {"contact": False}
    apart = ("delta", "collides", "friction")
    options = {f"contact.{f.name}": getattr(model.contact, f.name) for f in fields(model.contact)}
    return {
        "contact": True,
        **options,
        "surface vertices": surfaces.vertices,
        "data of surfaces": _digest(getattr(surfaces, f.name) for f in fields(surfaces) if f.name not in apart),
        "distances that contact keeps": _digest([surfaces.delta]),
        "pairs of bodies that may touch": _digest([surfaces.collides]),
        "coefficients of friction": _digest([surfaces.friction]),
    }


def _text(force: object) -> list[str] | None:
    """What a force field was written as; None for a Python function, which its name alone tells apart, and for none."""
    texts = getattr(force, "texts", None)
    return None if texts is None else list(texts)


def _rigid(bodies: RigidBodies) -> list[np.ndarray]:
    """Where their points are, what they weigh and how they move; trajectories by their keyframes."""
    names = ("motion", "mass", "inertia", "frame_x", "frame_q", "damping", "ability_to_rotate", "local")
    keys = [array for _, t in sorted(bodies.trajectories.items()) for array in t.keys]  # type: ignore[attr-defined]
    return [*(getattr(bodies, name) for name in names), *keys]


def difference(saved: dict[str, Any], here: dict[str, Any]) -> str | None:
    """In words, the first thing in which two fingerprints differ."""
    for name, value in here.items():
        if name in saved and saved[name] != value:  # one with contact, the other without: they differ in that
            if _is_digest(value):
                return f"its {name} differ"
            return f"its {name}: {saved.get(name)}, here: {value}"
    return None


def _is_digest(value: object) -> bool:
    return isinstance(value, str) and len(value) == hashlib.sha256().digest_size * 2


def _digest(arrays: Iterable[np.ndarray]) -> str:
    out = hashlib.sha256()
    for array in arrays:
        out.update(f"{array.dtype}{array.shape}".encode())
        out.update(np.ascontiguousarray(array))
    return out.hexdigest()
