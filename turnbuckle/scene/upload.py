"""The constant arrays of a model on its device: springs, tetrahedra, hinges, and who gathers from where."""

from typing import Any

import numpy as np
import warp as wp

from turnbuckle.bodies.bending import upload_hinges
from turnbuckle.bodies.corotational import upload_corotational
from turnbuckle.bodies.tetrahedra import EDGES, RESTS, TRIANGLES
from turnbuckle.data.model import Corotational, Hinges, Springs, Tetrahedra
from turnbuckle.math.lanes import CPU_LANES, CUDA_LANES, algebra

WINDOW = 160  # tetrahedra that may change places to bring like masks together; small, so that neighbours stay near


def unique_elements(
    corners: np.ndarray, local: tuple[tuple[int, ...], ...], points: int
) -> tuple[np.ndarray, np.ndarray]:
    """Edges or triangles of tetrahedra, each once.

    Returns the elements (m, k) int32, and (n, len(local)) int64: the element's number where the tetrahedron is the first
    that has it, else -1.
    """
    table = np.sort(corners[:, local].astype(np.int64).reshape(-1, len(local[0])), axis=1)
    key = table[:, 0]
    for k in range(1, table.shape[1]):
        key = key * points + table[:, k]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    owns = np.full(len(table), -1, dtype=np.int64)
    owns[first] = inverse.ravel()[first]
    return table[first].astype(np.int32), owns.reshape(len(corners), len(local))


def make_tetrahedra(
    corners: np.ndarray, material: np.ndarray, materials: np.ndarray, x: np.ndarray
) -> tuple[Tetrahedra, np.ndarray, np.ndarray]:
    """Rest measures at positions ``x``, and which edges and triangles each tetrahedron computes (see `unique_elements`)."""
    n = len(x)
    edges, owns_edge = unique_elements(corners, EDGES, n)
    triangles, owns_triangle = unique_elements(corners, TRIANGLES, n)
    edge_material = np.zeros(len(edges), dtype=np.int32)
    triangle_material = np.zeros(len(triangles), dtype=np.int32)
    for owns, of_element in ((owns_edge, edge_material), (owns_triangle, triangle_material)):
        tet, which = np.nonzero(owns >= 0)
        of_element[owns[tet, which]] = material[tet]
    a, b, c = (x[corners[:, k]] - x[corners[:, 0]] for k in (1, 2, 3))
    t = x[triangles]
    return (
        Tetrahedra(
            corners=corners,
            material=material,
            materials=materials,
            volume=np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0,
            edges=edges,
            edge_length=np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1),
            edge_material=edge_material,
            triangles=triangles,
            triangle_area=0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1),
            triangle_material=triangle_material,
        ),
        owns_edge,
        owns_triangle,
    )


def upload(
    mass: np.ndarray,
    springs: Springs,
    tets: Tetrahedra,
    owns_edge: np.ndarray,
    owns_triangle: np.ndarray,
    hinges: Hinges,
    corotational: Corotational,
    start: np.ndarray,
    device: str,
) -> dict[str, Any]:
    """All constant arrays by name (see `turnbuckle.step.recording` for who reads them). ``start``: (points, 3) [m]."""
    lanes = CUDA_LANES if wp.get_device(device).is_cuda else CPU_LANES
    order = _blocks(tets.material, _masks(owns_edge, owns_triangle), lanes)
    present = order >= 0
    tet = np.where(present, order, np.maximum.accumulate(order))  # padding repeats a tetrahedron, with no rest measure
    blocks = len(order) // lanes
    rest = np.zeros((len(order), RESTS))
    rest[:, 0] = 1.0 / (6.0 * tets.volume[tet])
    for k in range(len(EDGES)):
        own = owns_edge[tet, k]
        rest[:, 1 + k] = np.where(own >= 0, 1.0 / tets.edge_length[own], 0.0)
    for k in range(len(TRIANGLES)):
        own = owns_triangle[tet, k]
        rest[:, 7 + k] = np.where(own >= 0, 1.0 / tets.triangle_area[own], 0.0)
    rest[~present] = 0.0
    used = (rest != 0.0).reshape(blocks, lanes, RESTS).any(axis=1)[:, 1:]
    bits = (used * (1 << np.arange(RESTS - 1))).sum(axis=1)
    corners = tets.corners[tet].reshape(blocks, lanes, 4).transpose(0, 2, 1).reshape(4 * blocks, lanes)
    first_hinge = len(springs.pairs) + 4 * lanes * blocks
    first_corotational = first_hinge + 4 * len(hinges.points)
    others = np.concatenate([hinges.points, corotational.corners])
    offsets, slots = _slots(len(mass), springs.pairs, tets.corners, order, lanes, others)

    def put(values: np.ndarray, kind: object) -> wp.array:
        return wp.array(np.ascontiguousarray(values), dtype=kind, device=device)

    scalars = algebra(lanes).scalars
    own = np.where(mass > 0.0, mass, 1.0)  # points of rigid bodies go where their bodies go: any mass will do
    return {
        "mass": put(own, wp.float64),
        "inverse_mass": put(1.0 / own, wp.float64),
        "counted_mass": put(mass, wp.float64),
        "spring_pairs": put(springs.pairs, wp.vec2i),
        "spring_inverse_length": put(1.0 / springs.length, wp.float64),
        "spring_k": put(springs.k, wp.float64),
        "spring_k_d": put(springs.k_d, wp.float64),
        "lanes": lanes,
        "blocks": blocks,
        "block_corners": put(corners.astype(np.int32), wp.int32),
        "block_mask": put(bits.astype(np.int32), wp.int32),
        "block_material": put(tets.material[tet][::lanes].astype(np.int32), wp.int32),
        "materials": put(tets.materials.reshape(-1, 6), wp.float64),
        "block_rest": put(rest.reshape(blocks, lanes, RESTS).transpose(0, 2, 1), scalars),
        "slot_offsets": put(offsets, wp.int32),
        "slots": put(slots, wp.int32),
        "hinges": upload_hinges(hinges, start, device),
        "first_hinges": first_hinge,
        "corotational": upload_corotational(corotational, device),
        "first_corotational": first_corotational,
        "slots_total": first_hinge + 4 * len(others),
    }


def _masks(owns_edge: np.ndarray, owns_triangle: np.ndarray) -> np.ndarray:
    """A number for the set of edges and triangles that each tetrahedron computes."""
    owned = np.concatenate([owns_edge >= 0, owns_triangle >= 0], axis=1)
    return (owned * (1 << np.arange(owned.shape[1]))).sum(axis=1)


def _blocks(material: np.ndarray, mask: np.ndarray, lanes: int) -> np.ndarray:
    """Tetrahedra in the order of lanes, -1 for padding: one material a block, like masks together in each window."""
    n = len(material)
    order = np.lexsort((mask, np.arange(n) // WINDOW, material))
    counts = np.bincount(material, minlength=1) if n else np.zeros(0, dtype=np.int64)
    padded = -(-counts // lanes) * lanes
    start, first = np.cumsum(padded) - padded, np.cumsum(counts) - counts
    out = np.full(padded.sum(), -1, dtype=np.int64)
    m = material[order]
    out[start[m] + np.arange(n) - first[m]] = order
    return out


def _slots(
    points: int, pairs: np.ndarray, corners: np.ndarray, order: np.ndarray, lanes: int, others: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """For each point, where the forces of its elements lie; a spring's force is that on its second point.

    ``others`` (n, 4) are elements whose four forces follow those of the blocks.
    """
    place = np.flatnonzero(order >= 0)
    block, lane = place // lanes, place % lanes
    spring = np.arange(len(pairs))
    corner_slots = [len(pairs) + (4 * block + k) * lanes + lane for k in range(4)]
    other_slots = len(pairs) + 4 * len(order) + np.arange(others.size)
    slots = np.concatenate([spring, -spring - 1, *corner_slots, other_slots])
    owner = np.concatenate([pairs[:, 1], pairs[:, 0], *(corners[order[place], k] for k in range(4)), others.ravel()])
    by_point = np.argsort(owner, kind="stable")
    offsets = np.r_[0, np.cumsum(np.bincount(owner, minlength=points))]
    return offsets.astype(np.int32), slots[by_point].astype(np.int32)
