"""What can be wrong with the bodies of a joint, found in the definitions, where file and line are still known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from turnbuckle.scene.joint_definitions import BodyPairDef
from turnbuckle.scene.rigid_definitions import RigidDef

NOT_RIGID = "is no rigid body; joints join rigid bodies, points are joined by point constraints"
NOT_FREE = "neither of its bodies is dynamic; one of them must be free to move"

Located = tuple[tuple[str | int, ...], str]  # a place in the scene, and what is wrong there


def joint_problems(bodies: Sequence[Any], constraints: Sequence[Any]) -> Iterator[Located]:
    """Joints of bodies that are not rigid, and of bodies none of which can move. Bodies that do not exist are not looked at."""
    known = {body.name: body for body in bodies}
    for i, joint in enumerate(constraints):
        if not isinstance(joint, BodyPairDef):
            continue
        ends = {field: known.get(getattr(joint, field)) for field in ("body0", "body1")}
        soft = [field for field, body in ends.items() if body is not None and not isinstance(body, RigidDef)]
        for field in soft:
            yield ("constraints", i, field), f"{getattr(joint, field)!r} {NOT_RIGID}"
        missing = any(body is None and getattr(joint, field) is not None for field, body in ends.items())
        if not soft and not missing and not any(b is not None and b.motion == "dynamic" for b in ends.values()):
            yield ("constraints", i, "body1"), NOT_FREE
