"""What is wrong with a mesh is either counted and repaired, or refused with a sentence: never a silent wrong mass."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.shapes import TETRAHEDRON_FACES, six_volumes

# A tetrahedron is flat when 6 |V| is at most this part of the cube of its longest edge (regular: 0.7).
FLAT = 1e-10


@dataclass(frozen=True)
class RepairReport:
    """What `repair_tetrahedra` did. All counts are of the user's mesh."""

    flipped: int  # inverted elements, turned to positive volume
    duplicates: int  # elements on the same four vertices as an earlier one, dropped
    flat: int  # elements of no volume, dropped
    loose: int  # points in no element that is left, dropped
    overlaps: int  # faces with both elements on one side: the mesh folds over itself there, and its mass counts twice
    point_map: np.ndarray  # (n_old,) int32: the new index of each point, -1 where it was dropped
    element_map: np.ndarray  # (m_old,) int32: the new index of each element, -1 where it was dropped

    @property
    def clean(self) -> bool:
        """Whether there was nothing to do and nothing to warn of."""
        return not (self.flipped or self.duplicates or self.flat or self.loose or self.overlaps)

    def summary(self) -> str:
        """One line."""
        if self.clean:
            return "nothing to repair"
        words = (
            (self.flipped, "inverted elements flipped"),
            (self.duplicates, "duplicate elements dropped"),
            (self.flat, "elements without volume dropped"),
            (self.loose, "loose points dropped"),
            (self.overlaps, "faces where the mesh overlaps itself (mass counted twice)"),
        )
        return ", ".join(f"{count} {what}" for count, what in words if count)


def repair_tetrahedra(
    vertices: np.ndarray, tetrahedra: np.ndarray, flat: float = FLAT
) -> tuple[np.ndarray, np.ndarray, RepairReport]:
    """Make a tetrahedral mesh fit for masses and forces.

    Takes vertices [m] (n, 3) and tetrahedra (m, 4); returns both without what had to go, every element with positive
    volume, and the report. An element is flat when ``6 |V| <= flat * longest_edge^3``. Raises InputError for
    coordinates that are not finite, indices out of range, faces shared by more than two elements, and for a mesh of
    which nothing is left.
    """
    vertices, tetrahedra = _arrays(vertices, tetrahedra, 4, "tetrahedra")
    volumes = six_volumes(vertices, tetrahedra)
    corner = vertices[tetrahedra]
    longest = np.sqrt(((corner[:, :, None] - corner[:, None]) ** 2).sum(axis=-1).max(axis=(1, 2)))
    is_flat = np.abs(volumes) <= flat * longest**3
    _, first, inverse = np.unique(np.sort(tetrahedra, axis=1), axis=0, return_index=True, return_inverse=True)
    is_duplicate = (first[inverse.ravel()] != np.arange(len(tetrahedra))) & ~is_flat
    keep = ~(is_flat | is_duplicate)
    if not keep.any():
        raise InputError(f"tetrahedra: all {len(tetrahedra)} elements are without volume; check the file and its scale")
    inverted = keep & (volumes < 0)
    repaired = tetrahedra.copy()
    repaired[inverted] = repaired[inverted][:, [0, 2, 1, 3]]
    repaired = repaired[keep]
    overlaps = _overlaps(repaired)
    used = np.zeros(len(vertices), dtype=bool)
    used[repaired] = True
    point_map = _numbering(used)
    report = RepairReport(
        flipped=int(inverted.sum()),
        duplicates=int(is_duplicate.sum()),
        flat=int(is_flat.sum()),
        loose=int((~used).sum()),
        overlaps=overlaps,
        point_map=point_map,
        element_map=_numbering(keep),
    )
    return vertices[used], point_map[repaired], report


def _overlaps(tetrahedra: np.ndarray) -> int:
    """Number of faces whose two elements (of positive volume) lie on the same side; more than two is an error."""
    faces = tetrahedra[:, TETRAHEDRON_FACES].reshape(-1, 3)
    unique, inverse, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    if count.max() > 2:
        place = unique[np.argmax(count)].tolist()
        raise InputError(
            f"tetrahedra: the face of points {place} belongs to {count.max()} elements, so some overlap; repair the mesh"
        )
    # Both elements see a proper common face from outside, hence with opposite orientation: their signs cancel.
    sign = np.bincount(inverse.ravel(), weights=_parity(faces), minlength=len(count))
    return int((np.abs(sign) > 1.5).sum())


def _parity(triples: np.ndarray) -> np.ndarray:
    """+1 for an even permutation of the sorted triple, -1 for an odd one."""
    a, b, c = triples.T
    return np.sign(b - a) * np.sign(c - b) * np.sign(c - a).astype(np.float64)


@dataclass(frozen=True)
class SurfaceReport:
    """What `check_surface` did."""

    flipped: int  # triangles turned, so that all normals point outwards
    duplicates: int  # triangles dropped that repeat another
    degenerate: int  # triangles dropped that name a vertex twice
    parts: int  # connected parts of the surface
    volume: float  # enclosed [m^3]

    def summary(self) -> str:
        """One line."""
        words = (
            (self.flipped, "triangles flipped outwards"),
            (self.duplicates, "duplicate triangles dropped"),
            (self.degenerate, "degenerate triangles dropped"),
        )
        return ", ".join(f"{count} {what}" for count, what in words if count) or "nothing to repair"


def check_surface(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, SurfaceReport]:
    """Make sure that a surface encloses a volume, its triangles oriented outwards.

    Takes vertices [m] (n, 3) and triangles (m, 3); returns the vertices as they were, the triangles left, oriented,
    and the report. A part inside another keeps an inward orientation (a cavity). Raises InputError for coordinates
    that are not finite, indices out of range, a surface that is open (with the number of edges and one place), that
    cannot be oriented, or that encloses nothing.
    """
    vertices, triangles = _arrays(vertices, triangles, 3, "triangles")
    a, b, c = triangles.T
    degenerate = (a == b) | (b == c) | (c == a)
    kept = triangles[~degenerate]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    duplicates = len(kept) - len(first)
    kept = kept[np.sort(first)]
    if not len(kept):
        raise InputError("surface: has no triangles with three different vertices")
    orient, part = _orient(vertices, kept)
    oriented = np.where(orient[:, None], kept[:, [0, 2, 1]], kept)
    six = np.einsum("ij,ij->i", vertices[oriented[:, 0]], np.cross(vertices[oriented[:, 1]], vertices[oriented[:, 2]]))
    parts = int(part.max()) + 1
    volumes = np.bincount(part, weights=six, minlength=parts)
    turn = _parts_to_turn(vertices, oriented, part, volumes)
    oriented = np.where(turn[part][:, None], oriented[:, [0, 2, 1]], oriented)
    volume = float(np.where(turn, -volumes, volumes).sum() / 6)
    extent = np.ptp(vertices[oriented], axis=(0, 1)).max()
    if not volume > 1e-12 * extent**3:
        raise InputError("surface: encloses no volume; give the object a thickness, or use it as cloth")
    report = SurfaceReport(int((orient ^ turn[part]).sum()), duplicates, int(degenerate.sum()), parts, volume)
    return vertices, oriented.astype(np.int32), report


def _orient(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which triangles to flip so that neighbours agree (bool, (m,)), and the connected part of each (int, (m,)).

    Each triangle is two nodes of a graph, as it is and flipped. A neighbour with which it agrees joins like with
    like, one with which it does not joins like with unlike. If a triangle's two nodes fall into one component, the
    surface is one-sided.
    """
    count = len(triangles)
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    owner = np.tile(np.arange(count), 3)
    edges, inverse, uses = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    _check_closed(vertices, edges, uses)
    order = np.argsort(inverse, kind="stable")
    simple = order[uses[inverse[order]] == 2].reshape(-1, 2)  # edges of four triangles and more join nothing
    left, right = owner[simple].T
    agree = directed[simple[:, 0], 0] != directed[simple[:, 1], 0]
    other = np.where(agree, right, right + count)
    mirror = np.where(agree, right + count, right)
    graph = coo_array(
        (np.ones(2 * len(left)), (np.concatenate([left, left + count]), np.concatenate([other, mirror]))),
        shape=(2 * count, 2 * count),
    )
    _, label = connected_components(graph, directed=False)
    plain, flipped = label[:count], label[count:]
    if (plain == flipped).any():
        place = vertices[triangles[np.argmax(plain == flipped)]].mean(axis=0)
        raise InputError(f"surface: is one-sided (a Moebius strip, a Klein bottle) near {_place(place)}; close it")
    # Component and mirror image are the two ways to orient a part; take the one that flips fewer triangles.
    part = np.unique(np.minimum(plain, flipped), return_inverse=True)[1].ravel()
    flip = plain > flipped
    mostly = np.bincount(part, weights=flip) * 2 > np.bincount(part)
    return flip ^ mostly[part], part


def _check_closed(vertices: np.ndarray, edges: np.ndarray, uses: np.ndarray) -> None:
    odd = np.flatnonzero(uses % 2)
    if len(odd):
        place = vertices[edges[odd[0]]].mean(axis=0)
        kind = "boundary" if (uses[odd] == 1).all() else "boundary or T-shaped"
        raise InputError(
            f"surface: is not closed: {len(odd)} {kind} edges, one near {_place(place)}; close its holes, "
            "or use it as cloth"
        )


def _parts_to_turn(vertices: np.ndarray, triangles: np.ndarray, part: np.ndarray, volumes: np.ndarray) -> np.ndarray:
    """Which parts to turn inside out: all, if the whole is inverted; then each inverted one that is no cavity."""
    turn = np.full(len(volumes), volumes.sum() < 0)
    volumes = np.where(turn, -volumes, volumes)
    for k in np.flatnonzero(volumes < 0):
        point = vertices[triangles[np.argmax(part == k), 0]]
        others = part != k
        if abs(_winding(point, vertices[triangles[others]])) < 0.5:
            turn[k] = not turn[k]
    return turn


def _winding(point: np.ndarray, corners: np.ndarray) -> float:
    """How often the triangles (m, 3, 3) wind around the point: their solid angles over 4 pi (van Oosterom 1983)."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    dot = [np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a))]
    below = la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb
    return float(np.arctan2(above, below).sum() / (2 * np.pi))


def _arrays(vertices: np.ndarray, cells: np.ndarray, corners: int, what: str) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.asarray(vertices, dtype=np.float64)
    cells = np.asarray(cells)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise InputError(f"{what}: the vertices have shape {vertices.shape}; (n, 3) is needed")
    if cells.ndim != 2 or cells.shape[1] != corners or not np.issubdtype(cells.dtype, np.integer):
        raise InputError(
            f"{what}: have shape {cells.shape} and type {cells.dtype}; ({'m'}, {corners}) integers are needed"
        )
    if not len(cells):
        raise InputError(f"{what}: there are none")
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise InputError(f"{what}: vertex {bad[0]} is not finite ({len(bad)} such vertices); repair the mesh")
    low, high = int(cells.min()), int(cells.max())
    if low < 0 or high >= len(vertices):
        row = int(np.argmax(((cells < 0) | (cells >= len(vertices))).any(axis=1)))
        raise InputError(
            f"{what}: element {row} names a vertex out of the range 0..{len(vertices) - 1}; repair the mesh"
        )
    return vertices, cells.astype(np.int32)


def _numbering(kept: np.ndarray) -> np.ndarray:
    return np.where(kept, np.cumsum(kept) - 1, -1).astype(np.int32)


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{c:.4g}" for c in point) + ")"
