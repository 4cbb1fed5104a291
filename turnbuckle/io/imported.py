"""What readers of other programs' files share: bodies and joints by name, and a list of all that was left out."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

LIGHT = 1e-3  # [kg] of a body that the file gives no mass, but lets move
SMALL = 0.01  # [m], radius drawn for a body without shape
HALF_TURN = np.pi * (1.0 + 1e-9)
CONTACT_OFF = "contacts are off; import with --contact, or say contact: true in the scene"
APART = "pairs that do not touch count with --contact alone"
SAME = 1e-9  # two directions or places are the same, relative


@dataclass
class Imported:
    """A scene read from another program's file."""

    scene: Scene
    left_out: list[str]  # a sentence for each thing of the file that has no counterpart here, or was changed
    apart: list[tuple[str, str]] = field(default_factory=list)  # bodies that the file says do not touch


@dataclass
class Frame:
    """A pose in the world at the start."""

    x: np.ndarray = field(default_factory=lambda: np.zeros(3))  # [m]
    turn: Rotation = field(default_factory=Rotation.identity)  # from the frame to the world

    def __mul__(self, other: "Frame") -> "Frame":
        """The frame ``other``, given in this one, in the world."""
        return Frame(self.x + self.turn.apply(other.x), self.turn * other.turn)

    def inverse(self) -> "Frame":
        back = self.turn.inv()
        return Frame(-back.apply(self.x), back)

    def fields(self) -> dict[str, Any]:
        """`position` and `rotation` of a definition; zeros are left out."""
        found: dict[str, Any] = {}
        if np.abs(self.x).max() > 0.0:
            found["position"] = self.x
        rotation = self.turn.as_rotvec()
        if np.abs(rotation).max() > 1e-15:
            found["rotation"] = rotation
        return found


class Gathering:
    """A scene in the making."""

    def __init__(self, path: Path, name: str) -> None:
        self.path = path
        self.data: dict[str, Any] = {"name": name, "bodies": [], "constraints": []}
        self.left_out: list[str] = []
        self.apart: list[tuple[str, str]] = []
        self._names: dict[str, set[str]] = {"bodies": set(), "constraints": set()}

    def name(self, wanted: str | None, kind: str, otherwise: str) -> str:
        """A name that no other of the kind has, as near to the wanted one as can be."""
        base = (wanted or "").strip() or otherwise
        free, number = base, 1
        while free in self._names[kind]:
            number += 1
            free = f"{base}_{number}"
        self._names[kind].add(free)
        return free

    def note(self, text: str) -> None:
        """Something of the file that is not in the scene as it was."""
        if text not in self.left_out:
            self.left_out.append(text)

    def note_all(self, what: str, names: Iterable[str]) -> None:
        """Things of one kind that have no counterpart, by their names."""
        listed = [name or "(no name)" for name in names]
        if listed:
            shown = ", ".join(listed[:8]) + (f" and {len(listed) - 8} more" if len(listed) > 8 else "")
            self.note(f"{what}: {shown}")

    def rigid(
        self,
        name: str,
        frame: Frame,
        parts: Sequence[dict[str, Any]],
        mass: float | None,
        center: np.ndarray | None,
        inertia: np.ndarray | None,
        **more: Any,
    ) -> None:
        """Add a rigid body; ``parts`` as in a scene, ``inertia`` (3, 3) about the centre in the body's axes.

        Without mass, those of the shapes count; where there are none either, it is light and says so.
        """
        body: dict[str, Any] = {"type": "rigid", "name": name, **frame.fields(), **more}
        if not parts:
            parts = [{"sphere": self._radius(mass, inertia)}]
            if mass is None:
                mass = LIGHT
                self.note(f"body '{name}': has no mass and no shape; it is a sphere of {1e3 * LIGHT:g} g")
        if mass is not None:
            body["mass"] = float(mass)
        if inertia is not None:
            inertia = self._possible(name, 0.5 * (inertia + inertia.T))
            if inertia is not None:
                off = inertia - np.diag(np.diag(inertia))
                body["inertia"] = np.diag(inertia) if np.abs(off).max() == 0.0 else inertia
        if center is not None:
            body["center"] = center
        first = parts[0]
        if len(parts) == 1 and not first.keys() & {"position", "rotation", "density"}:
            body |= first
        else:
            body["parts"] = list(parts)
        self.data["bodies"].append(body)

    def _radius(self, mass: float | None, inertia: np.ndarray | None) -> float:
        """Of the sphere that has this inertia."""
        if mass is None or inertia is None:
            return SMALL
        found = float(np.sqrt(2.5 * max(float(np.trace(inertia)) / 3.0, 0.0) / mass)) if mass > 0.0 else 0.0
        return found if np.isfinite(found) and found > 1e-6 else SMALL

    def _possible(self, name: str, inertia: np.ndarray) -> np.ndarray | None:
        """The inertia, if a body can have it."""
        low, middle, high = np.linalg.eigvalsh(inertia)
        if low > 0.0 and high <= (low + middle) * (1.0 + 1e-9):
            return inertia
        if low > 0.0 and high <= (low + middle) * (1.0 + 1e-3):  # rounded in the file
            self.note(
                f"body '{name}': its inertia is that of no body by a rounding error; the largest moment was lowered"
            )
            moments, axes = np.linalg.eigh(inertia)
            moments[2] = moments[0] + moments[1]
            return axes @ np.diag(moments) @ axes.T
        self.note(
            f"body '{name}': no body has the inertia {np.round(np.diag(inertia), 9).tolist()}; its shape's is taken"
        )
        return None

    def limits(self, joint: str, low: float | None, high: float | None, turning: bool) -> dict[str, float]:
        """`lower_limit` and `upper_limit`, measured from the start; of a rotation only within half a turn."""
        found = {}
        for field_name, limit in (("lower_limit", low), ("upper_limit", high)):
            if limit is None or not np.isfinite(limit):
                continue
            if turning and abs(limit) > HALF_TURN:
                self.note(
                    f"joint '{joint}': {field_name} {limit:.6g} rad is more than half a turn away and was left out"
                )
                continue
            found[field_name] = float(limit)
        return found

    def join(self, kind: str, name: str, body0: str | None, body1: str, **fields: Any) -> None:
        """Add a joint; ``body0`` None is the world."""
        joint = {"type": kind, "name": name}
        if body0 is not None:
            joint["body0"] = body0
        self.data["constraints"].append({**joint, "body1": body1, **fields})

    def finish(self) -> Imported:
        """The scene. Raises `InputError` where the file says what no scene can hold."""
        try:
            data = {key: value for key, value in self.data.items() if key not in self._names or value}
            scene = Scene.from_dict(data, self.path.parent)
        except InputError as error:
            raise InputError("\n".join(f"{self.path}: {line}" for line in str(error).splitlines())) from None
        return Imported(scene, self.left_out, self.apart)


def within(value: float, low: float | None, high: float | None) -> float:
    """The value nearest to ``value`` within limits."""
    if low is not None and value < low:
        return low
    return high if high is not None and value > high else value


def ellipsoid(radii: np.ndarray, around: int = 16) -> dict[str, Any]:
    """`vertices` and `triangles` of an ellipsoid about the origin."""
    polar, turn = np.meshgrid(np.linspace(0, np.pi, around // 2 + 1)[1:-1], np.arange(around) * 2 * np.pi / around)
    ring = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1)
    rings = polar.shape[1]
    points = np.concatenate([[[0, 0, 1.0]], ring.transpose(1, 0, 2).reshape(-1, 3), [[0, 0, -1.0]]]) * radii
    here, there = np.arange(around), (np.arange(around) + 1) % around
    first, last = 1 + here, 1 + (rings - 1) * around + here
    faces = [np.stack([0 * here, first, 1 + there], axis=1)]
    for i in range(rings - 1):
        a, b = 1 + i * around + here, 1 + i * around + there
        faces += [np.stack([a, a + around, b], axis=1), np.stack([b, a + around, b + around], axis=1)]
    faces.append(np.stack([last, 0 * here + len(points) - 1, 1 + (rings - 1) * around + there], axis=1))
    return {"vertices": points, "triangles": np.concatenate(faces)}
