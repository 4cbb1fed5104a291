"""What can be said of contact before a scene runs: what is there to touch, and what crosses at the start."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from turnbuckle.contact.intersections import intersections
from turnbuckle.data.model import Model
from turnbuckle.data.state import State

MAX_PAIRS = 10  # of bodies named


def contact_counts(model: Model) -> list[tuple[str, str]]:
    """What is in the surfaces of a scene, as (label, text)."""
    surfaces = model.surfaces
    if surfaces is None:
        return [("contact", "off")]
    low, high = (1e3 * float(d) for d in (surfaces.delta.min(initial=np.inf), surfaces.delta.max(initial=0.0)))
    return [
        ("obstacles", str(len(model.scripted))),
        ("contact", f"{surfaces.vertices} vertices, {len(surfaces.edges)} edges, {len(surfaces.faces)} faces"),
        ("distance kept", f"{low:.3g} to {high:.3g} mm" if surfaces.vertices else "nothing touches"),
    ]


def crossing_bodies(model: Model, state: State) -> list[tuple[str, str, int]]:
    """Bodies that cross at the start though they may touch: two names, and how many edges go through faces."""
    surfaces = model.surfaces
    if surfaces is None or not surfaces.collides.any():
        return []
    found = intersections(surfaces, surfaces.positions(state.positions()))
    first, second = surfaces.shape[surfaces.edges[found[:, 0], 0]], surfaces.shape[surfaces.faces[found[:, 1], 0]]
    pairs, count = np.unique(np.sort(np.stack([first, second], axis=1), axis=1), axis=0, return_counts=True)
    return [(model.shapes[a].name, model.shapes[b].name, int(n)) for (a, b), n in zip(pairs, count, strict=True)]


def contact_warnings(model: Model, state: State) -> Iterator[str]:
    """Bodies that cross at the start, and scenes in which nothing can touch."""
    surfaces = model.surfaces
    if surfaces is None:
        return
    if not surfaces.collides.any():
        yield "contact is on, but no two bodies may touch; see the fields contact of the bodies, and contact.ignore"
        return
    for one, other, times in crossing_bodies(model, state)[:MAX_PAIRS]:
        who = f"body '{one}' crosses itself" if one == other else f"bodies '{one}' and '{other}' cross"
        yield f"{who} at the start ({times} edges through faces); move them apart, or set contact.on_intersection: grow"
