"""Bodies without a graphics library: triangles drawn from far to near (the painter's algorithm) with Pillow.

Taken where Polyscope or the system library it needs is missing. Drawn at twice the size and reduced, which smooths
edges.
"""

import numpy as np
from PIL import Image, ImageDraw

from turnbuckle.viewer.camera import Camera
from turnbuckle.viewer.geometry import SceneGeometry

_OVERSAMPLE = 2


def draw(geometry: SceneGeometry, x: np.ndarray, camera: Camera, backdrop: Image.Image) -> np.ndarray:
    """A picture (height, width, 3) uint8 of all bodies at ``x`` [m] (points, 3) before the backdrop."""
    size = backdrop.size
    large = (size[0] * _OVERSAMPLE, size[1] * _OVERSAMPLE)
    image = backdrop.resize(large, Image.Resampling.BILINEAR)
    surface, lines = geometry.surface, geometry.lines
    vertices, nodes = geometry.vertices("surface", x), geometry.vertices("lines", x)
    paint = np.concatenate([_shade(vertices, surface.cells, surface.colors, camera), 255 * lines.colors * 0.85])
    rgb = [tuple(c) for c in np.nan_to_num(np.clip(np.round(paint), 0, 255)).astype(int).tolist()]
    outlines: list[list[tuple[float, float]]] = []
    far, visible = [], []
    for points, cells in ((vertices, surface.cells), (nodes, lines.cells)):
        pixels, depth = camera.project(points, large)
        sound = np.isfinite(pixels).all(axis=1) & (depth > 1e-3 * camera.diagonal)
        visible.append(sound[cells].all(axis=1))
        if cells is surface.cells:
            # Sorted by mean depth, the backs of large triangles would show through.
            visible[-1] &= ~(surface.closed & _away(points, cells, camera))
        far.append(np.where(np.isfinite(depth), depth, 0)[cells].mean(axis=1))
        outlines.extend([tuple(p) for p in outline] for outline in pixels[cells].tolist())
    shown, depths = np.concatenate(visible), np.concatenate(far)
    order = np.argsort(-depths, kind="stable")
    pen = ImageDraw.Draw(image)
    width = max(2, round(large[1] / 240))
    for k in order[shown[order]].tolist():
        if len(outlines[k]) == 3:
            pen.polygon(outlines[k], fill=rgb[k], outline=rgb[k])  # the outline closes the seam to the neighbours
        else:
            pen.line(outlines[k], fill=rgb[k], width=width, joint="curve")
    return np.asarray(image.resize(size, Image.Resampling.BOX))


def _shade(vertices: np.ndarray, cells: np.ndarray, colors: np.ndarray, camera: Camera) -> np.ndarray:
    """Colours (m, 3) in 0..255 under a lamp above the camera's left shoulder and light from all around."""
    a, b, c = (vertices[cells[:, k]] for k in range(3))
    facet = np.cross(b - a, c - a)
    at_vertex = np.stack(  # the mean of the vertices' normals hides the facets
        [np.bincount(cells.ravel(), np.repeat(facet[:, k], 3), minlength=len(vertices)) for k in range(3)], axis=1
    )
    normal = at_vertex[cells].sum(axis=1)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    away = _away(vertices, cells, camera)
    normal = np.where(away[:, None], -normal, normal)  # both sides are lit
    right, _, forward = camera.axes()
    lamp = -0.55 * right + 0.75 * camera.up - 0.6 * forward
    lit = np.clip(normal @ (lamp / np.linalg.norm(lamp)), 0, 1)
    sky = 0.5 + 0.5 * normal @ camera.up
    strength = 0.40 + 0.20 * sky + 0.50 * lit
    return 255 * colors * strength[:, None] + 25 * lit[:, None] ** 24


def _away(vertices: np.ndarray, cells: np.ndarray, camera: Camera) -> np.ndarray:
    """Which triangles show their back, (m,) bool."""
    a, b, c = (vertices[cells[:, k]] for k in range(3))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), camera.eye - (a + b + c) / 3) < 0)
