"""Letters of any font as watertight solids (needs fonttools and manifold3d)."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from turnbuckle.data.errors import InputError

BENDS = 3  # straight pieces of a curved segment of an outline
SMOOTH = 0.01  # of the letter's height: corners that stand out less are left out


def letter(
    character: str, height: float = 0.3, depth: float = 0.1, edge: float | None = None, font: str | Path | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """One letter: vertices (n, 3) [m] and triangles (m, 3) int32 of a closed surface, normals outwards.

    It stands in the x-y plane, upright along y, ``height`` [m] is that of a capital H, and goes from z = -depth/2 to
    depth/2; its bounding box is centred on the origin. No edge is longer than ``edge`` [m]. ``font``: path of a TrueType
    or OpenType file; DejaVu Sans Bold of matplotlib when left out. Raises InputError for a character that the font does
    not have or that leaves no mark, and where a library is missing.
    """
    if not (height > 0.0 and depth > 0.0):
        raise InputError(f"letter: height {height:g} and depth {depth:g} must be positive")
    try:
        import manifold3d
    except ImportError:
        raise InputError(
            "letters need the library manifold3d; install it with 'pip install turnbuckle[text]'"
        ) from None
    contours = [contour * height for contour in _outline(character, str(font or default_font()))]
    if not contours:
        raise InputError(f"letter {character!r} leaves no mark; leave it out")
    section = manifold3d.CrossSection(contours, manifold3d.FillRule.NonZero).simplify(SMOOTH * height)
    solid = section.extrude(depth)
    if edge is not None:
        solid = solid.refine_to_length(edge)
    mesh = solid.to_mesh()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    triangles = np.asarray(mesh.tri_verts, dtype=np.int32)
    return vertices - 0.5 * (vertices.min(axis=0) + vertices.max(axis=0)), triangles


def default_font() -> Path:
    """DejaVu Sans Bold, which comes with matplotlib."""
    try:
        from matplotlib import get_data_path
    except ImportError:
        raise InputError("letters need a font; give the path of one, or install matplotlib") from None
    return Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf"


@lru_cache(maxsize=8)
def _font(path: str) -> Any:
    try:
        from fontTools.ttLib import TTFont, TTLibError
    except ImportError:
        raise InputError("letters need the library fonttools; install it with 'pip install turnbuckle[text]'") from None
    try:
        return TTFont(path, lazy=True)
    except (OSError, TTLibError) as error:
        raise InputError(f"font {path}: cannot be read ({str(error)[:80]}); give a TrueType or OpenType file") from None


@lru_cache(maxsize=512)
def _outline(character: str, path: str) -> tuple[np.ndarray, ...]:
    """Closed contours (k, 2) of a character, the height of a capital H being 1."""
    from fontTools.pens.recordingPen import DecomposingRecordingPen

    font = _font(path)
    names, glyphs = font.getBestCmap(), font.getGlyphSet()
    if ord(character) not in names:
        raise InputError(f"font {path}: has no letter {character!r}")
    pen = DecomposingRecordingPen(glyphs)
    glyphs[names[ord(character)]].draw(pen)
    contours: list[np.ndarray] = []
    points: list[np.ndarray] = []
    for command, given in pen.value:
        corners = [np.asarray(p, dtype=np.float64) for p in given if p is not None]
        if command == "moveTo":
            points = [corners[0]]
        elif command == "lineTo":
            points.append(corners[0])
        elif command == "qCurveTo":
            _quadratic(points, corners, closed=given[-1] is None)
        elif command == "curveTo":
            _cubic(points, corners)
        elif command in ("closePath", "endPath") and len(points) > 2:
            contours.append(np.array(points))
    return tuple(contour / _capital_height(path) for contour in contours)


@lru_cache(maxsize=8)
def _capital_height(path: str) -> float:
    from fontTools.pens.boundsPen import BoundsPen

    font = _font(path)
    names, glyphs = font.getBestCmap(), font.getGlyphSet()
    if ord("H") in names:
        pen = BoundsPen(glyphs)
        glyphs[names[ord("H")]].draw(pen)
        if pen.bounds is not None:
            return float(pen.bounds[3])
    return 0.7 * float(font["head"].unitsPerEm)


def _quadratic(points: list[np.ndarray], corners: list[np.ndarray], closed: bool) -> None:
    """TrueType: between two controls in a row lies a point of the curve, halfway."""
    if closed:  # a contour of controls only
        points[:] = [0.5 * (corners[-1] + corners[0])]
        corners = [*corners, points[0]]
    for k, control in enumerate(corners[:-1]):
        end = corners[-1] if k == len(corners) - 2 else 0.5 * (control + corners[k + 1])
        start = points[-1]
        for t in np.arange(1, BENDS + 1) / BENDS:
            points.append((1 - t) ** 2 * start + 2 * t * (1 - t) * control + t * t * end)


def _cubic(points: list[np.ndarray], corners: list[np.ndarray]) -> None:
    start, (a, b, end) = points[-1], corners
    for t in np.arange(1, BENDS + 1) / BENDS:
        points.append((1 - t) ** 3 * start + 3 * t * (1 - t) ** 2 * a + 3 * t * t * (1 - t) * b + t**3 * end)
