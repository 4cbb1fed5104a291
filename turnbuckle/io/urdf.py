"""URDF files: links as rigid bodies, joints, and a list of what has no counterpart. No other program is needed.

Joints start at zero, or at the nearest place within their limits. A link of the name `world`, or a root without mass and
shape, is the world; a link without mass on a fixed joint is part of its parent.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.io.imported import CONTACT_OFF, Frame, Gathering, Imported, within
from turnbuckle.meshes.read import SurfaceMesh, read_mesh

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
DEEP = 200  # links after each other; deeper is no robot
KNOWN = {"link", "joint", "material"}


@dataclass
class _Joint:
    """A joint as the file has it."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Frame
    axis: np.ndarray
    low: float | None
    high: float | None


def read_urdf(path: str | Path, shapes: str = "collision") -> Imported:
    """The scene in a URDF file. ``shapes``: "collision" or "visual", the other where a link has none of these.

    Raises `InputError` that names file, element and what is wrong.
    """
    path = Path(path)
    if shapes not in ("collision", "visual"):
        raise InputError(f"{path}: shapes is {shapes!r}; give 'collision' or 'visual'")
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except (OSError, ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: is no XML that can be read ({getattr(error, 'strerror', None) or error})") from None
    if root.tag != "robot":
        raise InputError(f"{path}: is no URDF; its first element is <{root.tag[:40]}>, not <robot>")
    return _Reader(path, root, shapes).read()


class _Reader:
    def __init__(self, path: Path, root: ElementTree.Element, shapes: str) -> None:
        self.path, self.root, self.shapes = path, root, shapes
        self.out = Gathering(path, root.get("name") or path.stem)
        self.links = {self.text(e, "name"): e for e in root.findall("link")}
        if len(self.links) < len(root.findall("link")):
            raise self.wrong("two links have the same name")
        if not self.links:
            raise self.wrong("has no links")
        self.frames: dict[str, Frame] = {}
        self.carrier: dict[str, str | None] = {}  # link -> the body it is (a part of); None is the world
        self.parts: dict[str, list[dict[str, Any]]] = {}

    def wrong(self, text: str) -> InputError:
        return InputError(f"{self.path}: {text}")

    def text(self, element: ElementTree.Element, name: str) -> str:
        value = element.get(name)
        if not value:
            raise self.wrong(f"a <{element.tag}> has no {name}")
        return value

    def numbers(self, element: ElementTree.Element | None, name: str, count: int, default: Any = None) -> np.ndarray:
        text = None if element is None else element.get(name)
        if text is None or not text.strip():
            if default is not None:
                return np.array(default, dtype=float)
            raise self.wrong(f"a <{element.tag if element is not None else '?'}> has no {name}")
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.zeros(0)
        if len(values) != count or not np.isfinite(values).all() or np.abs(values).max() > 1e12:
            raise self.wrong(f"{name}={text[:60]!r}: expected {count} finite number{'s' * (count > 1)}")
        return values

    def one(self, element: ElementTree.Element | None, name: str, default: float | None = None) -> float:
        return float(self.numbers(element, name, 1, None if default is None else [default])[0])

    def origin(self, element: ElementTree.Element) -> Frame:
        """`xyz`, and `rpy` about fixed axes x, y, z."""
        found = element.find("origin")
        xyz, rpy = self.numbers(found, "xyz", 3, np.zeros(3)), self.numbers(found, "rpy", 3, np.zeros(3))
        return Frame(xyz, Rotation.from_euler("xyz", rpy))

    def read(self) -> Imported:
        self.out.data["gravity"] = [0, 0, -9.81]
        joints = [self._joint(e) for e in self.root.findall("joint")]
        children: dict[str, list[_Joint]] = {}
        seen: set[str] = set()
        for joint in joints:
            for end in (joint.parent, joint.child):
                if end not in self.links:
                    raise self.wrong(f"joint '{joint.name}': there is no link '{end}'")
            if joint.child in seen:
                raise self.wrong(f"link '{joint.child}' is the child of two joints")
            seen.add(joint.child)
            children.setdefault(joint.parent, []).append(joint)
        roots = [name for name in self.links if name not in seen]
        if not roots:
            raise self.wrong("its joints run in a circle; there is no root link")
        ordered = list(self._walk(roots, children))
        if len(ordered) < len(self.links):
            left = next(name for name in self.links if name not in self.frames)
            raise self.wrong(f"link '{left}' is in a circle of joints")
        for name in self.links:
            body = self.carrier[name]
            if body is not None:
                self._shapes(name, body)
        for name in self.links:
            if self.carrier[name] == name:
                self._body(name)
        for moved in ordered:
            if moved is not None:
                self._connect(moved)
        self._tell()
        return self.out.finish()

    def _joint(self, e: ElementTree.Element) -> _Joint:
        name, kind = self.out.name(self.text(e, "name"), "constraints", "joint"), self.text(e, "type")
        if kind not in KINDS:
            raise self.wrong(f"joint '{name}': unknown type {kind[:40]!r}; known are {', '.join(KINDS)}")
        ends = {}
        for end in ("parent", "child"):
            found = e.find(end)
            if found is None:
                raise self.wrong(f"joint '{name}': has no <{end}>")
            ends[end] = self.text(found, "link")
        axis = self.numbers(e.find("axis"), "xyz", 3, [1.0, 0.0, 0.0])
        if kind in ("revolute", "continuous", "prismatic", "planar") and not np.linalg.norm(axis) > 1e-9:
            raise self.wrong(f"joint '{name}': its axis is zero")
        low = high = None
        limit = e.find("limit")
        if kind in ("revolute", "prismatic") and limit is not None:
            low, high = self.one(limit, "lower", 0.0), self.one(limit, "upper", 0.0)
            if low > high:
                raise self.wrong(f"joint '{name}': its lower limit {low:g} is above its upper limit {high:g}")
        return _Joint(name, kind, ends["parent"], ends["child"], self.origin(e), axis, low, high)

    def _walk(self, roots: list[str], children: dict[str, list[_Joint]]) -> Iterator[_Joint | None]:
        """All links from the roots, parents first: poses at the start, and which body each is. None for a root."""
        for name in roots:
            self.frames[name] = Frame()
            empty = self._mass(name) is None and not self._elements(name)
            self.carrier[name] = None if name == "world" or empty else name
            if self.carrier[name] is not None:
                self.out.note(f"link '{name}' is free, as URDF has it; give it motion: immobile to stand on the ground")
            yield None
        waiting = [(name, 0) for name in reversed(roots)]
        while waiting:
            name, depth = waiting.pop()
            if depth > DEEP:
                raise self.wrong(f"more than {DEEP} links hang on each other")
            for joint in children.get(name, []):
                start = within(0.0, joint.low, joint.high)
                axis = joint.axis / max(np.linalg.norm(joint.axis), 1e-300)
                move = Frame()
                if start and joint.kind == "prismatic":
                    move = Frame(start * axis)
                elif start:
                    move = Frame(turn=Rotation.from_rotvec(start * axis))
                if start:
                    self.out.note(f"joint '{joint.name}': starts at {start:g}, within its limits")
                self.frames[joint.child] = self.frames[name] * joint.origin * move
                fused = joint.kind == "fixed" and (self._mass(joint.child) is None or self.carrier[name] is None)
                if fused and self.carrier[name] is None and (self._mass(joint.child) or self._elements(joint.child)):
                    fused = False  # a base bolted to the world is a body that stands still
                self.carrier[joint.child] = self.carrier[name] if fused else joint.child
                waiting.append((joint.child, depth + 1))
                yield joint

    def _mass(self, name: str) -> float | None:
        inertial = self.links[name].find("inertial")
        found = None if inertial is None else inertial.find("mass")
        mass = None if found is None else self.one(found, "value")
        if mass is not None and mass < 0.0:
            raise self.wrong(f"link '{name}': its mass {mass:g} is negative")
        return mass or None

    def _elements(self, name: str) -> list[ElementTree.Element]:
        link = self.links[name]
        other = "visual" if self.shapes == "collision" else "collision"
        return link.findall(self.shapes) or link.findall(other)

    def _shapes(self, name: str, body: str) -> None:
        """The shapes of a link as parts of its body."""
        to_body = self.frames[body].inverse() * self.frames[name]
        for element in self._elements(name):
            geometry = element.find("geometry")
            shape = None if geometry is None or not len(geometry) else self._shape(name, geometry[0])
            if shape is None:
                continue
            frame = to_body * self.origin(element)
            self.parts.setdefault(body, []).append({**shape, **frame.fields()})

    def _shape(self, link: str, e: ElementTree.Element) -> dict[str, Any] | None:
        if e.tag == "box":
            return {"box": self.numbers(e, "size", 3)}
        if e.tag == "sphere":
            return {"sphere": self.one(e, "radius")}
        if e.tag in ("cylinder", "capsule"):
            return {e.tag: {"radius": self.one(e, "radius"), "length": self.one(e, "length")}}
        if e.tag != "mesh":
            self.out.note(f"link '{link}': a shape of type {e.tag} has no counterpart")
            return None
        file = self.text(e, "filename")
        found = self._found(file)
        if found is None:
            self.out.note(f"link '{link}': its mesh '{file}' was not found and is left out")
            return None
        try:
            mesh = read_mesh(found)
        except InputError as error:
            self.out.note(f"link '{link}': its mesh is left out ({error})")
            return None
        if not isinstance(mesh, SurfaceMesh):
            self.out.note(f"link '{link}': its mesh '{file}' is no surface and is left out")
            return None
        scale = self.numbers(e, "scale", 3, np.ones(3))
        triangles = mesh.triangles[:, ::-1] if scale.prod() < 0.0 else mesh.triangles
        return {"vertices": mesh.vertices * scale, "triangles": np.ascontiguousarray(triangles)}

    def _found(self, file: str) -> Path | None:
        """The file of a mesh: beside the URDF, or for `package://NAME/...` in a folder NAME above it."""
        folder = self.path.resolve().parent
        rest = file.partition("://")[2] if "://" in file else file
        tried = [folder / rest]
        if file.startswith("package://"):
            package, _, inner = rest.partition("/")
            tried += [above / rest for above in folder.parents]
            tried += [above / inner for above in (folder, *folder.parents) if above.name == package]
        return next((p for p in tried if p.is_file()), None)

    def _body(self, name: str) -> None:
        inertial, mass = self.links[name].find("inertial"), self._mass(name)
        center = inertia = None
        if inertial is not None and mass is not None:
            frame = self.origin(inertial)
            center = frame.x
            e = inertial.find("inertia")
            if e is not None:
                xx, xy, xz, yy, yz, zz = (self.one(e, "i" + k, 0.0) for k in ("xx", "xy", "xz", "yy", "yz", "zz"))
                turn = frame.turn.as_matrix()
                inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        parts = self.parts.get(name, [])
        if mass is None and parts:
            self.out.note(f"link '{name}': has no mass; that of its shapes at 1000 kg/m^3 is taken")
        still = {"motion": "immobile"} if self._bolted(name) else {}
        self.out.rigid(self.out.name(name, "bodies", "link"), self.frames[name], parts, mass, center, inertia, **still)

    def _bolted(self, name: str) -> bool:
        """Whether a link hangs on the world by a fixed joint."""
        for e in self.root.findall("joint"):
            child, parent = e.find("child"), e.find("parent")
            if child is not None and parent is not None and child.get("link") == name and e.get("type") == "fixed":
                return self.carrier.get(parent.get("link", ""), "") is None
        return False

    def _connect(self, j: _Joint) -> None:
        body0, body1 = self.carrier[j.parent], self.carrier[j.child]
        if body1 is None or body0 == body1 or self._bolted(body1) or j.kind == "floating":
            return
        frame = self.frames[j.child]
        place = {"anchor": frame.x}
        back = Rotation.identity() if body0 is None else self.frames[body0].turn.inv()
        axis = back.apply(frame.turn.apply(j.axis / max(np.linalg.norm(j.axis), 1e-300)))
        start = within(0.0, j.low, j.high)
        low, high = (None if limit is None else limit - start for limit in (j.low, j.high))
        if j.kind in ("revolute", "continuous"):
            limits = self.out.limits(j.name, low, high, turning=True)
            self.out.join("revolute", j.name, body0, body1, axis=axis, **place, **limits)
        elif j.kind == "prismatic":
            limits = self.out.limits(j.name, low, high, turning=False)
            self.out.join("prismatic", j.name, body0, body1, axis=axis, **place, **limits)
        elif j.kind == "planar":
            self.out.join("planar", j.name, body0, body1, axis=axis, **place)
        else:
            self.out.join("weld", j.name, body0, body1, **place)

    def _tell(self) -> None:
        """All else in the file."""
        out = self.out
        for tag, what in (
            ("mimic", "a joint that follows another"), ("dynamics", "damping and friction of a joint"),
            ("safety_controller", "a safety controller"), ("calibration", "the calibration of a joint"),
        ):  # fmt: skip
            found = [e.get("name", "") for e in self.root.findall("joint") if e.find(tag) is not None]
            out.note_all(f"{what} has no counterpart", found)
        bounded = [
            e.get("name", "") for e in self.root.findall("joint")
            if (limit := e.find("limit")) is not None
            and any(math.isfinite(self.one(limit, k, 0.0)) and self.one(limit, k, 0.0) > 0 for k in ("effort", "velocity"))
        ]  # fmt: skip
        out.note_all("limits of effort and speed have no counterpart", bounded)
        others: dict[str, int] = {}
        for e in self.root:
            if isinstance(e.tag, str) and e.tag not in KNOWN:
                others[e.tag] = others.get(e.tag, 0) + 1
        out.note_all("elements that are not understood", (f"<{tag}> ({n})" for tag, n in others.items()))
        if self.parts:
            out.note(CONTACT_OFF)
