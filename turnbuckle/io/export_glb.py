"""A recording as one animated .glb (glTF 2.0), for the web, Blender, and most programs that show models.

A rigid body is a node whose translation and rotation are animated. What deforms is a mesh with a morph target a frame:
exact at frames, linear between, as recordings are. glTF is Y up; a scene with Z up hangs on a node that turns it.
"""

import json
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.geometry.fit import fit_pose
from turnbuckle.io.atomic import write_atomically
from turnbuckle.io.export_meshes import GREY, pieces
from turnbuckle.io.recorder import reason

FRAMES = 600  # of what deforms: every frame is a mesh of its own, and its weights are frames squared
BYTES = 1 << 31  # programs that read more are few
_FLOAT, _UINT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963


def write_glb(
    path: Path, shapes: list[Shape], times: np.ndarray, x: Callable[[int], np.ndarray], frames: Sequence[int], up: str
) -> None:
    """Write ``frames`` of a recording. Raises `InputError` for more than the format can hold, or a place that refuses."""
    soft = [shape for shape in shapes if shape.drawn and shape.local is None and not shape.still]
    if soft and len(frames) > FRAMES:
        every = -(-len(frames) // FRAMES)
        raise InputError(
            f"export {path}: a .glb holds {FRAMES} frames of what deforms, not {len(frames)}; give --every {every}"
        )
    glb = _Glb()
    start = float(times[frames[0]]) if len(frames) else 0.0
    seconds = glb.accessor(np.array([times[f] - start for f in frames], dtype=np.float32), "SCALAR", bounds=True)
    root: dict[str, Any] = {"name": "turnbuckle", "children": []}
    if up == "Z":
        root["rotation"] = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
    glb.nodes.append(root)
    positions = [np.asarray(x(f)) for f in frames]
    estimate = sum(12 * (s.end - s.begin) for s in soft) * len(frames)
    if estimate > BYTES:
        raise InputError(f"export {path}: would be larger than 2 GiB; give --every N, or another format")
    for shape in shapes:
        if not shape.drawn:
            continue
        if shape.local is not None:
            _rigid(glb, shape, positions, seconds)
        else:
            _soft(glb, shape, positions, seconds)
    try:
        write_atomically(path, lambda file: file.write(glb.data()))
    except OSError as error:
        raise InputError(f"export {path}: cannot be written ({reason(error)})") from None


class _Glb:
    """The parts of a file in the making."""

    def __init__(self) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.views: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self.samplers: list[dict[str, Any]] = []
        self.parts: list[bytes] = []
        self.size = 0

    def accessor(self, values: np.ndarray, kind: str, bounds: bool = False, target: int | None = None) -> int:
        """Add an array; its number."""
        raw = np.ascontiguousarray(values).tobytes()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": len(raw)}
        if target is not None:
            view["target"] = target
        self.parts += [raw, b"\0" * (-len(raw) % 4)]
        self.size += len(raw) + (-len(raw) % 4)
        self.views.append(view)
        found: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": _FLOAT if values.dtype == np.float32 else _UINT,
            "count": len(values),
            "type": kind,
        }
        if bounds and len(values):
            rows = values.reshape(len(values), -1)
            found["min"], found["max"] = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        self.accessors.append(found)
        return len(self.accessors) - 1

    def material(self, color: Sequence[float]) -> int:
        linear = [float(c) ** 2.2 for c in color]
        look = {"baseColorFactor": [*linear, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        entry = {"pbrMetallicRoughness": look, "doubleSided": True}
        if entry not in self.materials:
            self.materials.append(entry)
        return self.materials.index(entry)

    def node(self, name: str, mesh: int) -> int:
        self.nodes.append({"name": name, "mesh": mesh})
        self.nodes[0]["children"].append(len(self.nodes) - 1)
        return len(self.nodes) - 1

    def animate(self, node: int, path: str, seconds: int, values: int) -> None:
        self.samplers.append({"input": seconds, "output": values, "interpolation": "LINEAR"})
        self.channels.append({"sampler": len(self.samplers) - 1, "target": {"node": node, "path": path}})

    def data(self) -> bytes:
        """The file."""
        content: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "Turnbuckle"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": self.nodes,
        }
        if not self.nodes[0]["children"]:
            del self.nodes[0]["children"]
        for name in ("meshes", "materials", "accessors"):
            if getattr(self, name):
                content[name] = getattr(self, name)
        if self.views:
            content["bufferViews"] = self.views
            content["buffers"] = [{"byteLength": self.size}]
        if self.channels:
            content["animations"] = [{"name": "run", "channels": self.channels, "samplers": self.samplers}]
        text = json.dumps(content, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = b"".join(self.parts)
        total = 12 + 8 + len(text) + 8 + len(binary)
        return b"".join(
            [struct.pack("<4sII", b"glTF", 2, total), struct.pack("<I4s", len(text), b"JSON"), text,
             struct.pack("<I4s", len(binary), b"BIN\0"), binary]
        )  # fmt: skip


def _rigid(glb: _Glb, shape: Shape, positions: Sequence[np.ndarray], seconds: int) -> None:
    """A still mesh on a node that moves."""
    assert shape.local is not None
    used, index = np.unique(shape.triangles, return_inverse=True)
    if not len(used):
        return
    primitive = _primitive(glb, shape.local[used], index.reshape(-1, 3), 4, shape.color)
    glb.meshes.append({"name": shape.name, "primitives": [primitive]})
    node = glb.node(shape.name, len(glb.meshes) - 1)
    places, turns = np.zeros((len(positions), 3)), np.zeros((len(positions), 4))
    last = np.array([0.0, 0.0, 0.0, 1.0])
    for i, x in enumerate(positions):
        places[i], xyzw = fit_pose(shape.local, x[shape.begin : shape.end])
        last = turns[i] = -xyzw if xyzw @ last < 0.0 else xyzw
    glb.nodes[node]["translation"], glb.nodes[node]["rotation"] = places[0].tolist(), turns[0].tolist()
    if len(positions) > 1 and not shape.still:
        glb.animate(node, "translation", seconds, glb.accessor(places.astype(np.float32), "VEC3"))
        glb.animate(node, "rotation", seconds, glb.accessor(turns.astype(np.float32), "VEC4"))


def _soft(glb: _Glb, shape: Shape, positions: Sequence[np.ndarray], seconds: int) -> None:
    """A mesh with a morph target for each frame after the first."""
    frames = [next(pieces([shape], x), None) for x in (positions[:1] if shape.still else positions)]
    first = frames[0]
    if first is None:
        return
    moving = [piece.vertices - first.vertices for piece in frames[1:] if piece is not None]
    targets = [{"POSITION": glb.accessor(d.astype(np.float32), "VEC3", True, _VERTICES)} for d in moving]
    primitives = []
    for mode, elements in ((4, first.triangles), (1, first.lines)):
        if len(elements):
            primitives.append(_primitive(glb, first.vertices, elements, mode, shape.color))
            if targets:
                primitives[-1]["targets"] = targets
    mesh: dict[str, Any] = {"name": shape.name, "primitives": primitives}
    if targets:
        mesh["weights"] = [0.0] * len(targets)
    glb.meshes.append(mesh)
    node = glb.node(shape.name, len(glb.meshes) - 1)
    if targets:
        weights = np.eye(len(targets) + 1, dtype=np.float32)[:, 1:]
        glb.animate(node, "weights", seconds, glb.accessor(weights.ravel(), "SCALAR"))


def _primitive(
    glb: _Glb, vertices: np.ndarray, elements: np.ndarray, mode: int, color: Sequence[float] | None
) -> dict[str, Any]:
    """Triangles (mode 4) or lines (mode 1)."""
    return {
        "attributes": {"POSITION": glb.accessor(vertices.astype(np.float32), "VEC3", True, _VERTICES)},
        "indices": glb.accessor(elements.astype(np.uint32).ravel(), "SCALAR", target=_INDICES),
        "mode": mode,
        "material": glb.material(GREY if color is None else color),
    }
