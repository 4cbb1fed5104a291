"""What tells one model from another, so that a checkpoint of another scene is refused."""

import hashlib
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from turnbuckle.data.model import Model


def fingerprint(model: Model) -> dict[str, Any]:
    """Counts and settings as they are, arrays by their SHA-256. Names and the device do not count."""
    springs, solids = ([getattr(part, f.name) for f in fields(part)] for part in (model.springs, model.tetrahedra))
    return {
        "points": model.points,
        "springs": len(model.springs.pairs),
        "tetrahedra": len(model.tetrahedra.corners),
        "integrator": model.integrator,
        "response": model.response,
        "conflicts": model.conflicts,
        "forces": [f.name for f in model.fields],
        "masses": _digest([model.mass]),
        "rest positions": _digest([model.rest]),
        "spring data": _digest(springs),
        "tetrahedron data": _digest(solids),
        "points under forces": _digest([f.points for f in model.fields]),
    }


def difference(saved: dict[str, Any], here: dict[str, Any]) -> str | None:
    """In words, the first thing in which two fingerprints differ."""
    for name, value in here.items():
        if saved.get(name) != value:
            if name.startswith(("masses", "rest", "spring d", "tetrahedron d", "points u")):
                return f"its {name} differ"
            return f"its {name}: {saved.get(name)}, here: {value}"
    return None


def _digest(arrays: Iterable[np.ndarray]) -> str:
    out = hashlib.sha256()
    for array in arrays:
        out.update(f"{array.dtype}{array.shape}".encode())
        out.update(np.ascontiguousarray(array))
    return out.hexdigest()
