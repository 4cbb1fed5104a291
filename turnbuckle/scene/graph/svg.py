"""The graph of constrained objects as a picture in SVG, in the manner of Figure 8."""

from __future__ import annotations

import math
import os
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.scene.graph.edges import ANGLE, BOTH, POINT, ConstraintGraph, Node
from turnbuckle.scene.graph.layout import MAX_WORK, layout

MAX_NODES = 1000
EDGE = 150.0  # length of an edge on the page [px]
FONT = 14.0
LETTER = 0.56 * FONT  # mean width of a letter
HEIGHT = 32.0  # of a box
MARGIN = 36.0
BOW = 34.0  # how far apart two constraints of one pair are
COLORS = {POINT: "#2563a8", BOTH: "#1b1f24", ANGLE: "#c2571a"}
TEXTS = {POINT: "point only", BOTH: "point + angle", ANGLE: "angle only"}
DASH = "7 5"


def write_graph(graph: ConstraintGraph, path: str | os.PathLike[str], title: str = "") -> None:
    """Write the picture. Raises `InputError` for a graph too large to read, and where the file cannot be written."""
    path = Path(path)
    if path.suffix.lower() != ".svg":
        raise InputError(f"{path}: the graph is written as SVG; name the file .svg")
    text = graph_svg(graph, title)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def graph_svg(graph: ConstraintGraph, title: str = "") -> str:
    """The picture as text. Raises `InputError` for a graph too large to read."""
    if len(graph.nodes) > MAX_NODES:
        raise InputError(f"the graph has {len(graph.nodes)} objects; up to {MAX_NODES} can be drawn")
    index = {node: i for i, node in enumerate(graph.nodes)}
    pairs = [(index[edge.ends[0]], index[edge.ends[1]]) for edge in graph.edges]
    widths = np.array([_width(node) for node in graph.nodes])
    places = layout(len(graph.nodes), pairs, index.get(None)) * [max(EDGE, 0.9 * widths.max(initial=0)), EDGE]
    places = _apart(places, widths)
    body = [
        *_lines(graph, pairs, places, widths),
        *(_box(n, x, w) for n, x, w in zip(graph.nodes, places, widths, strict=True)),
    ]
    low = np.min(places - np.c_[0.5 * widths, np.full(len(widths), 0.5 * HEIGHT)], axis=0, initial=0.0)
    high = np.max(places + np.c_[0.5 * widths, np.full(len(widths), 0.5 * HEIGHT)], axis=0, initial=0.0)
    legend, wide, deep = _legend(graph)
    width = max(high[0] - low[0], wide) + 2.0 * MARGIN
    top = MARGIN + (2.0 * FONT if title else 0.0)
    height = top + high[1] - low[1] + BOW + deep + MARGIN
    shift = (0.5 * (width - high[0] - low[0]), top - low[1])
    head = f'<text x="{0.5 * width:.1f}" y="{MARGIN:.1f}" text-anchor="middle" font-weight="600">{escape(title)}</text>'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="{FONT:g}">',
            '<rect width="100%" height="100%" fill="white"/>',
            *([head] if title else []),
            f'<g transform="translate({shift[0]:.1f} {shift[1]:.1f})">',
            *body,
            "</g>",
            f'<g transform="translate({0.5 * (width - wide):.1f} {height - MARGIN - deep:.1f})">',
            *legend,
            "</g>",
            "</svg>",
            "",
        ]
    )


def _width(node: Node) -> float:
    return max(len(_label(node)) * LETTER + 26.0, 56.0)


def _label(node: Node) -> str:
    text = "world" if node is None else node
    return text if len(text) <= 28 else text[:27] + "…"


def _apart(places: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Boxes that overlap are pushed apart, the way that is shorter."""
    x = places.copy()
    for _ in range(min(60, max(5, int(MAX_WORK / len(x) ** 2)) if len(x) else 0)):
        gap = x[:, None] - x[None]
        need_x = 0.5 * (widths[:, None] + widths[None]) + 24.0 - np.abs(gap[..., 0])
        need_y = HEIGHT + 28.0 - np.abs(gap[..., 1])
        hit = (need_x > 0.0) & (need_y > 0.0)
        np.fill_diagonal(hit, False)
        if not hit.any():
            break
        side = np.sign(gap) + (gap == 0.0) * np.sign(np.arange(len(x))[:, None] - np.arange(len(x)))[..., None]
        push = np.stack([np.where(need_x <= need_y, need_x, 0.0), np.where(need_x > need_y, need_y, 0.0)], axis=2)
        x += 0.26 * (push * side * hit[..., None]).sum(1)
    return x


def _box(node: Node, at: np.ndarray, width: float) -> str:
    x, y = at - [0.5 * width, 0.5 * HEIGHT]
    fill, line, radius = ("#e4e7ea", "#1b1f24", 3) if node is None else ("#fbfbf8", "#5b6570", 15)
    slant = ' font-style="italic"' if node is None else ""
    return (
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{HEIGHT:g}" rx="{radius}" fill="{fill}" stroke="{line}" '
        f'stroke-width="1.3"/><text x="{at[0]:.1f}" y="{at[1] + 0.35 * FONT:.1f}" text-anchor="middle" fill="#1b1f24"'
        f"{slant}>{escape(_label(node))}</text>"
    )


def _lines(graph: ConstraintGraph, pairs: list[tuple[int, int]], places: np.ndarray, widths: np.ndarray) -> list[str]:
    """The edges; several between one pair are bowed apart."""
    among: dict[tuple[int, int], list[int]] = {}
    for k, (i, j) in enumerate(pairs):
        among.setdefault((min(i, j), max(i, j)), []).append(k)
    found = []
    for (i, j), own in among.items():
        a, b = places[i], places[j]
        along = b - a
        length = max(float(np.hypot(*along)), 1e-9)
        normal = np.array([-along[1], along[0]]) / length
        base = _clearance(i, j, places, widths)
        for n, k in enumerate(own):
            bow = base + BOW * (n - 0.5 * (len(own) - 1))
            found.append(
                _line(a, b, 0.5 * (a + b) + 2.0 * bow * normal, graph.edges[k].kind, graph.edges[k].name, i == j)
            )
    return found


def _clearance(i: int, j: int, places: np.ndarray, widths: np.ndarray) -> float:
    """How far the line between two nodes must bow so as not to run through the box of a third."""
    if i == j or len(places) > 200:
        return 0.0
    along = places[j] - places[i]
    length = max(float(np.hypot(*along)), 1e-9)
    normal = np.array([-along[1], along[0]]) / length
    t = (places - places[i]) @ along / length**2
    off = (places - places[i]) @ normal
    reach = 0.5 * (abs(normal[0]) * widths + abs(normal[1]) * HEIGHT) + 8.0
    near = (t > 0.08) & (t < 0.92) & (np.abs(off) < reach)
    near[[i, j]] = False
    if not near.any():
        return 0.0
    k = int(np.argmax(np.where(near, reach - np.abs(off), -np.inf)))
    return -math.copysign((reach[k] - abs(off[k])) / (4.0 * t[k] * (1.0 - t[k])), float(off[k]))


def _line(a: np.ndarray, b: np.ndarray, bend: np.ndarray, kind: str, name: str, loop: bool) -> str:
    if loop:
        x, y = a
        path = f"M{x - 16:.1f} {y:.1f} C{x - 60:.1f} {y - 80:.1f} {x + 60:.1f} {y - 80:.1f} {x + 16:.1f} {y:.1f}"
    else:
        path = f"M{a[0]:.1f} {a[1]:.1f} Q{bend[0]:.1f} {bend[1]:.1f} {b[0]:.1f} {b[1]:.1f}"
    return f"<g><title>{escape(name)}</title>{_stroke(path, kind)}</g>"


def _stroke(path: str, kind: str) -> str:
    """Single for a point, double for a point and an angle, dashed for an angle."""
    color = COLORS[kind]
    draw = f'<path d="{path}" fill="none" stroke="{{}}" stroke-width="{{:g}}"{{}}/>'
    if kind == BOTH:
        return draw.format(color, 5.2, "") + draw.format("white", 2.2, "")
    return draw.format(color, 2, f' stroke-dasharray="{DASH}"' if kind == ANGLE else "")


def _legend(graph: ConstraintGraph) -> tuple[list[str], float, float]:
    """The kinds with their numbers, and the free objects; with its width and height."""
    entries = [(kind, f"{TEXTS[kind]} ({graph.count(kind)})") for kind in TEXTS]
    found, x = [], 0.0
    for kind, text in entries:
        found.append(_stroke(f"M{x:.1f} 0 H{x + 40:.1f}", kind))
        found.append(f'<text x="{x + 50:.1f}" y="{0.35 * FONT:.1f}" fill="#1b1f24">{text}</text>')
        x += 50.0 + len(text) * LETTER + 26.0
    if not graph.free:
        return found, x - 26.0, FONT
    some = ", ".join(graph.free[:6]) + (", ..." if len(graph.free) > 6 else "")
    text = f"not constrained: {some}"
    found.append(f'<text x="0" y="{2.2 * FONT:.1f}" fill="#5b6570">{escape(text)}</text>')
    return found, max(x - 26.0, len(text) * LETTER), 3.0 * FONT
