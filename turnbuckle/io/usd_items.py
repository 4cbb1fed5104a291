"""What Turnbuckle keeps in a USD prim beside the standard attributes, so that nothing is lost on the way back.

`turnbuckle:definition` is the definition as JSON, `turnbuckle:written` a digest of what the standard attributes said when
it was written. While they say the same, the definition counts, bit for bit; where another program changed them, they do,
and of the definition what USD has no word for.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from typing import Any

import numpy as np

with contextlib.suppress(ImportError):  # an optional extra: whoever calls says what to install
    from pxr import Sdf, Usd

DEFINITION, WRITTEN, SCENE = "turnbuckle:definition", "turnbuckle:written", "turnbuckle:scene"
# The schema of deformables that is proposed for UsdPhysics (as in Omniverse 110): a stiffness of inf is our constraint.
ATTACHMENT = {
    "world": "OmniPhysicsVtxXformAttachment",
    "point": "OmniPhysicsVtxVtxAttachment",
    "line": "OmniPhysicsVtxCrvAttachment",
    "triangle": "OmniPhysicsVtxTriAttachment",
    "tetrahedron": "OmniPhysicsVtxTetAttachment",
}
PART_OF = "turnbuckle:part_of"  # the constraint that a further attachment belongs to
OURS = "TurnbuckleConstraint"  # what the proposal has no type for
PREFIX = "omniphysics:"


def keep(prim: Usd.Prim, name: str, data: dict[str, Any]) -> None:
    """Store a definition in a prim."""
    prim.CreateAttribute(name, Sdf.ValueTypeNames.String, custom=True).Set(json.dumps(data, default=_listed))


def kept(prim: Usd.Prim, name: str) -> dict[str, Any] | None:
    """The definition stored in a prim; None where there is none, or no JSON."""
    value = prim.GetAttribute(name).Get() if prim.HasAttribute(name) else None
    if not isinstance(value, str):
        return None
    try:
        data = json.loads(value)
    except (ValueError, RecursionError):
        return None
    return data if isinstance(data, dict) else None


def seal(prim: Usd.Prim, standard: dict[str, Any]) -> None:
    """Store what the standard attributes say now."""
    prim.CreateAttribute(WRITTEN, Sdf.ValueTypeNames.String, custom=True).Set(_digest(standard))


def is_unchanged(prim: Usd.Prim, standard: dict[str, Any]) -> bool:
    """Whether the standard attributes say what they said when they were written."""
    return prim.HasAttribute(WRITTEN) and prim.GetAttribute(WRITTEN).Get() == _digest(standard)


def _digest(standard: dict[str, Any]) -> str:
    text = json.dumps(_rounded(standard), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _rounded(value: Any) -> Any:
    """Numbers to 6 digits: programs pass some of them through float32."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    if isinstance(value, float | np.floating):
        short = float(f"{float(value):.5g}")
        return 0.0 if abs(short) < 1e-9 else short
    return value


def _listed(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(type(value).__name__)
