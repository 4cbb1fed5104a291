"""Frames of a recording as meshes: one .obj or .ply a frame, with the surfaces and lines of all bodies that are drawn."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.io.recorder import reason

SUFFIXES = (".obj", ".ply")
GREY = (0.7, 0.7, 0.7)


@dataclass(frozen=True)
class Piece:
    """What is drawn of a body in a frame."""

    name: str
    vertices: np.ndarray  # (n, 3) [m]
    triangles: np.ndarray  # (m, 3) into vertices
    lines: np.ndarray  # (k, 2)
    color: tuple[float, float, float]


def pieces(shapes: list[Shape], x: np.ndarray) -> Iterator[Piece]:
    """All that is drawn, for the positions ``x`` [m] of all points; only points that are used."""
    for shape in shapes:
        if not shape.drawn:
            continue
        color = GREY if shape.color is None else shape.color
        own = x[shape.begin : shape.end]
        if shape.skin is not None:
            yield Piece(shape.name, shape.skin.positions(x), shape.skin.triangles, np.zeros((0, 2), int), color)
            continue
        used, index = np.unique(np.concatenate([shape.triangles.ravel(), shape.lines.ravel()]), return_inverse=True)
        if len(used):
            cut = shape.triangles.size
            yield Piece(shape.name, own[used], index[:cut].reshape(-1, 3), index[cut:].reshape(-1, 2), color)


def write_mesh_file(path: Path, shapes: list[Shape], x: np.ndarray, time: float) -> None:
    """Write a frame; the suffix chooses. Raises `InputError` where it cannot be written."""
    write = _obj if path.suffix.lower() == ".obj" else _ply
    try:
        path.write_bytes(write(list(pieces(shapes, x)), time))
    except OSError as error:
        raise InputError(f"export {path}: cannot be written ({reason(error)})") from None


def _obj(found: list[Piece], time: float) -> bytes:
    """Objects with their names; 9 digits are exact in float32."""
    lines = [f"# Turnbuckle, t = {time:.9g} s, metres"]
    first = 1
    for piece in found:
        lines.append(f"o {'_'.join(piece.name.split())}")
        lines += [f"v {a:.9g} {b:.9g} {c:.9g}" for a, b, c in piece.vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (piece.triangles + first).tolist()]
        lines += [f"l {a} {b}" for a, b in (piece.lines + first).tolist()]
        first += len(piece.vertices)
    return ("\n".join(lines) + "\n").encode()


def _ply(found: list[Piece], time: float) -> bytes:
    """Binary: vertices with colours, faces, and edges where there are lines."""
    begins = np.cumsum([0, *(len(p.vertices) for p in found)])
    count = int(begins[-1])
    points = np.zeros(count, dtype=[("x", "<f8", 3), ("color", "u1", 3)])
    faces, edges = [np.zeros((0, 3), int)], [np.zeros((0, 2), int)]
    for piece, begin in zip(found, begins[:-1], strict=True):
        own = slice(begin, begin + len(piece.vertices))
        points["x"][own] = piece.vertices
        points["color"][own] = np.clip(np.round(255 * np.array(piece.color)), 0, 255)
        faces.append(piece.triangles + begin)
        edges.append(piece.lines + begin)
    triangles, lines = np.concatenate(faces), np.concatenate(edges)
    rows = np.zeros(len(triangles), dtype=[("n", "u1"), ("v", "<i4", 3)])
    rows["n"], rows["v"] = 3, triangles
    header = ["ply", "format binary_little_endian 1.0", f"comment Turnbuckle, t = {time:.9g} s, metres"]
    header += [f"element vertex {count}", *(f"property double {a}" for a in "xyz")]
    header += [f"property uchar {c}" for c in ("red", "green", "blue")]
    header += [f"element face {len(rows)}", "property list uchar int vertex_indices"]
    if len(lines):
        header += [f"element edge {len(lines)}", "property int vertex1", "property int vertex2"]
    text = "\n".join([*header, "end_header"]) + "\n"
    return text.encode() + points.tobytes() + rows.tobytes() + lines.astype("<i4").tobytes()
