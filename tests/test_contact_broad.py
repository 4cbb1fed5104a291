"""The broad phase: every method finds the same pairs, and none that is near is ever missing."""

import numpy as np
import pytest

from tests.reference.contact_bodies import NO_FACES, NO_LINES, box, rope, sheet, spikes
from turnbuckle.contact.broad import METHODS, BroadPhase, candidates
from turnbuckle.contact.surface import DELTA_FRACTION, SurfacePart, find_edges, make_surfaces, neighbours
from turnbuckle.data.contact import EDGE_EDGE, VERTEX_FACE, Pairs, Surfaces
from turnbuckle.data.errors import InputError


def scene(*bodies: tuple, **more: object) -> tuple[Surfaces, np.ndarray]:
    """Surfaces of bodies (vertices, triangles, lines), shape after shape, and where their vertices are."""
    x, parts, first = np.concatenate([b[0] for b in bodies]), [], 0
    for k, (own, faces, lines) in enumerate(bodies):
        parts.append(SurfacePart(k, first + np.arange(len(own)), triangles=faces, lines=lines))
        first += len(own)
    return make_surfaces(parts, x, **more), x


def soup(rng: np.random.Generator, n: int, scale: float = 1.0) -> tuple:
    """Small triangles anywhere, of sizes over three decades."""
    centre, size = rng.uniform(-1, 1, (n, 1, 3)), 10.0 ** rng.uniform(-3, -0.3, (n, 1, 1))
    x = (centre + size * rng.normal(size=(n, 3, 3))).reshape(-1, 3)
    return scale * x, np.arange(3 * n).reshape(n, 3), NO_LINES


def curl(n: int) -> tuple:
    """A sheet rolled up in several layers."""
    x, faces, lines = sheet(n)
    angle = 20.0 * (x[:, 0] + 0.5)
    radius = 0.05 + 0.006 * angle
    return np.stack([radius * np.cos(angle), x[:, 1], radius * np.sin(angle)], axis=1), faces, lines


def plain(s: Surfaces, x0: np.ndarray, x1: np.ndarray, inflation: np.ndarray, moves: np.ndarray, slack: float) -> set:
    """All pairs whose boxes overlap by more than ``slack``, in float64."""
    half = 0.5 * inflation[:, None] - slack
    features = {k: c for k, c in (("v", np.arange(s.vertices)[:, None]), ("e", s.edges), ("f", s.faces)) if len(c)}
    boxes = [{k: ((x - half)[c].min(axis=1), (x + half)[c].max(axis=1)) for k, c in features.items()} for x in (x0, x1)]
    out = set()
    for kind, one, two in ((VERTEX_FACE, "v", "f"), (EDGE_EDGE, "e", "e")):
        if one not in features or two not in features:
            continue
        above, below = True, True  # on each axis, at both ends
        for at in boxes:
            (la, ha), (lb, hb) = at[one], at[two]
            above, below = above & (la[:, None] > hb[None]), below & (lb[None] > ha[:, None])
        near = ~(above | below).any(axis=2)
        for a, b in zip(*np.nonzero(near), strict=True):
            ca, cb = features[one][a], features[two][b]
            apart = not set(ca.tolist()) & set(cb.tolist()) and (kind == VERTEX_FACE or a < b)
            if apart and s.collides[s.shape[ca[0]], s.shape[cb[0]]] and (moves[ca].any() or moves[cb].any()):
                out.add((kind, int(a), int(b)))
    return out


def rows(pairs: Pairs) -> list:
    return list(zip(pairs.kind.tolist(), pairs.a.tolist(), pairs.b.tolist(), strict=True))


def some_scene(kind: str, rng: np.random.Generator) -> tuple[Surfaces, np.ndarray]:
    if kind == "soup":
        return scene(soup(rng, 60), soup(rng, 40))
    if kind == "tiny":
        return scene(soup(rng, 60, 1e-6), soup(rng, 40, 1e-6))
    if kind == "far":
        s, x = scene(soup(rng, 60), soup(rng, 40))
        return s, x + [1e6, -1e6, 1e6]
    if kind == "curl":
        return scene(curl(14))
    if kind == "coincident":
        return scene(sheet(9), sheet(9), (box((1, 1, 1))))
    if kind == "mixed":  # a floor of two triangles a thousand times as large
        floor = 300.0 * sheet(2)[0] - [0, 0, 0.5]
        return scene((floor, sheet(2)[1], NO_LINES), rope(rng), spikes(rng), curl(8))
    return scene(rope(rng), rope(rng))


@pytest.mark.parametrize("kind", ["soup", "tiny", "far", "curl", "coincident", "mixed", "ropes"])
def test_all_methods_find_what_is_there(kind: str) -> None:
    rng = np.random.default_rng(7)
    s, x0 = some_scene(kind, rng)
    size = 1e-6 if kind == "tiny" else 1.0
    n = len(s.collides)
    collides = s.collides.copy()
    collides[n - 1, n - 1] = n == 1
    s = Surfaces(**{**s.__dict__, "collides": collides})
    moves = s.shape != 0 if kind in ("mixed", "soup") else np.ones(s.vertices, dtype=bool)
    searches = {method: BroadPhase(s, method=method, moves=moves) for method in METHODS}
    for speed in (0.0, 0.02, 0.5):
        x1 = x0 + speed * size * rng.normal(size=x0.shape)
        inflation = size * rng.uniform(0.0, 0.05, s.vertices)
        found = {method: rows(search.candidates(x0, x1, inflation)) for method, search in searches.items()}
        wanted = plain(s, x0, x1, inflation, moves, 0.0)
        assert found["bvh"] == found["hash"] == found["brute"] == sorted(set(found["brute"]))
        assert wanted <= set(found["bvh"])
        # nothing but what float32 adds: boxes are about the middle, so their error is that of the scene's size
        extra = plain(s, x0, x1, inflation, moves, -1e-6 * float(np.ptp(np.concatenate([x0, x1]), axis=0).max()))
        assert set(found["bvh"]) <= extra
        assert len(wanted) > 10 or (kind == "ropes" and speed < 0.1)


def test_far_apart_and_of_very_different_size() -> None:
    rng = np.random.default_rng(3)
    here, there = soup(rng, 30, 1e-6), soup(rng, 30)
    s, x = scene(here, (there[0] + 1e6, *there[1:]), (1e6 * sheet(2)[0], sheet(2)[1], NO_LINES))
    moves = np.ones(s.vertices, dtype=bool)
    wanted = plain(s, x, x, np.zeros(s.vertices), moves, 0.0)
    for method in METHODS:
        assert wanted <= set(rows(candidates(s, x, x, method=method)))


def test_boxes_are_rounded_outwards() -> None:
    """Two vertices and two triangles whose boxes touch in a float64 number that float32 has not."""
    edge = 0.1 + 1e-9
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    s, x = scene((corners - [0, 0, 1.0], [[0, 1, 2]], NO_LINES), (corners + [0, 0, edge], [[0, 1, 2]], NO_LINES))
    gap = x[3, 2] - x[0, 2]
    for method in METHODS:
        assert candidates(s, x, x, gap * (1 + 1e-15), method).count == 6 + 9
        assert candidates(s, x, x, gap * (1 - 1e-5), method).count == 0


def test_more_partners_than_there_is_room_for() -> None:
    rng = np.random.default_rng(0)
    s, x = scene(sheet(24), rope(rng))
    x[-8:] *= 2.0
    both = [rows(BroadPhase(s, method=method).candidates(x, x, 0.6)) for method in METHODS]
    assert both[0] == both[1] == both[2]
    assert np.bincount(candidates(s, x, x, 0.6).a).max() > 500


@pytest.mark.parametrize("method", ["bvh", "hash"])
def test_same_for_any_number_of_threads_and_any_history(method: str) -> None:
    rng = np.random.default_rng(1)
    s, x = scene(sheet(26), curl(26))
    assert len(s.faces) + len(s.edges) > 2000
    one, two = (BroadPhase(s, method=method, threads=k) for k in (1, 2))
    places = [x + 0.01 * rng.normal(size=x.shape), x[rng.permutation(len(x))], 3.0 * x, x]
    for k in range(12):  # boxes grow and shrink: leaves are dealt out anew
        x0, x1 = places[k % 4], places[k % 4] + 0.01 * rng.normal(size=x.shape)
        if k % 4 == 1 and k > 1:
            continue
        found = rows(one.candidates(x0, x1, 0.01))
        assert found == rows(two.candidates(x0, x1, 0.01))
    assert found == rows(BroadPhase(s, method=method).candidates(x0, x1, 0.01)) and len(found) > 1000


def test_leaves_are_dealt_out_when_order_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    dealt, deal = [], BroadPhase._deal
    monkeypatch.setattr(BroadPhase, "_deal", lambda self, x: (dealt.append(1), deal(self, x))[1])
    rng = np.random.default_rng(1)
    corners, places = 0.01 * rng.normal(size=(600, 3, 3)), rng.uniform(-1, 1, (600, 1, 3))
    s, x = scene(((places + corners).reshape(-1, 3), np.arange(1800).reshape(600, 3), NO_LINES))
    search = BroadPhase(s)
    for _ in range(40):  # fast, but in order
        search.candidates(x, x + 0.2 * rng.normal(size=3), 0.01)
    assert len(dealt) == 1
    shuffled = (places[rng.permutation(600)] + corners).reshape(-1, 3)
    for _ in range(40):
        search.candidates(shuffled, shuffled, 0.01)
    assert len(dealt) == 2


def shapes_of(s: Surfaces, pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """The bodies of both sides."""
    face = pairs.kind == VERTEX_FACE
    one, two = np.empty(pairs.count, dtype=int), np.empty(pairs.count, dtype=int)
    one[face], two[face] = s.shape[pairs.a[face]], s.shape[s.faces[pairs.b[face], 0]]
    one[~face], two[~face] = s.shape[s.edges[pairs.a[~face], 0]], s.shape[s.edges[pairs.b[~face], 0]]
    return one, two


def test_what_is_left_out() -> None:
    s, x = scene(sheet(6), sheet(6))
    one, two = shapes_of(s, candidates(s, x, x))
    assert (one == two).any() and (one != two).any()
    others, _ = scene(sheet(6), sheet(6), collides=~np.eye(2, dtype=bool))
    for method in METHODS:
        found = candidates(others, x, x, method=method)
        one, two = shapes_of(s, found)
        assert found.count and (one != two).all()
        still = candidates(s, x, x, method=method, moves=s.shape == 1)
        one, two = shapes_of(s, still)
        assert ((one == 1) | (two == 1)).all() and ((one == 1) & (two == 1)).any() and (one != two).any()
        assert candidates(s, x, x, method=method, moves=np.zeros(s.vertices, dtype=bool)).count == 0


def test_nothing_to_search() -> None:
    empty = make_surfaces([], np.zeros((0, 3)))
    assert candidates(empty, np.zeros((0, 3)), np.zeros((0, 3))).count == 0
    single = (np.zeros((1, 3)), NO_FACES, NO_LINES)
    s, x = scene(single, sheet(3))
    for method in METHODS:
        found = candidates(s, x, x, method=method)
        assert 0 in found.a[found.kind == VERTEX_FACE]


def test_wrong_input_is_named() -> None:
    s, x = scene(sheet(3))
    with pytest.raises(InputError, match="no method 'tree'"):
        BroadPhase(s, method="tree")
    with pytest.raises(InputError, match=r"give \(9, 3\)"):
        candidates(s, x[1:], x)
    bad = x.copy()
    bad[4, 1] = np.nan
    with pytest.raises(InputError, match="vertex 4 is not finite at the end"):
        candidates(s, x, bad)
    with pytest.raises(InputError, match="'triangles' names vertices outside"):
        make_surfaces([SurfacePart(0, np.arange(3), triangles=[[0, 1, 3]])], np.zeros((3, 3)))
    with pytest.raises(InputError, match="must sum to 1"):
        make_surfaces([SurfacePart(0, np.array([[0, 1]]), np.array([[0.5, 0.4]]))], np.zeros((3, 3)))


def test_topology() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3], [1, 2, 4], [5, 5, 0]])
    edges, at = find_edges(faces, np.array([[6, 3], [1, 0]]))
    assert edges.tolist() == [[0, 1], [0, 2], [0, 5], [1, 2], [1, 3], [1, 4], [2, 3], [2, 4], [3, 6]]
    assert at[3].tolist() == [0, 1] and at[0].tolist() == [0, -1] and at[8].tolist() == [-1, -1]
    start, other = neighbours(7, edges)
    assert [other[start[v] : start[v + 1]].tolist() for v in (0, 6)] == [[1, 2, 5], [3]]


def test_distance_to_keep() -> None:
    """A tenth of the local edge length; the edges of a large floor count as much as the finest part's."""
    fine, floor = sheet(11), 100.0 * sheet(2)[0]
    s, _ = scene(fine, (floor, sheet(2)[1], NO_LINES))
    length = np.linalg.norm(fine[0][s.edges[:, 0] % 121] - fine[0][s.edges[:, 1] % 121], axis=1)
    median = np.median(length[s.edges[:, 1] < 121])
    assert np.allclose(s.delta[121:], DELTA_FRACTION * median)
    assert np.allclose(s.delta[60], DELTA_FRACTION * min(median, (4 * 0.1 + 2 * 0.1 * np.sqrt(2)) / 6))
    part = SurfacePart(0, np.arange(121), triangles=fine[1], delta=0.002)
    assert (make_surfaces([part], fine[0]).delta == 0.002).all()


def test_as_ipctk() -> None:
    ipctk = pytest.importorskip("ipctk")
    rng = np.random.default_rng(2)
    s, x0 = scene(sheet(12), curl(12))
    for x1 in (x0, x0 + 0.02 * rng.normal(size=x0.shape)):
        theirs = ipctk.Candidates()
        theirs.build(ipctk.CollisionMesh(x0, s.edges, s.faces), x0, x1, 0.005, ipctk.BruteForce())
        wanted = {(VERTEX_FACE, c.vertex_id, c.face_id) for c in theirs.fv_candidates}
        wanted |= {(EDGE_EDGE, *sorted((c.edge0_id, c.edge1_id))) for c in theirs.ee_candidates}
        found = set(rows(candidates(s, x0, x1, 0.01)))
        assert len(found) > 500 and found <= wanted
        left_out = wanted - found  # boxes that meet, each at another time
        assert (
            not left_out
            if x1 is x0
            else left_out.isdisjoint(plain(s, x0, x1, np.full(s.vertices, 0.01), s.shape >= 0, 0.0))
        )


@pytest.mark.parametrize("method", METHODS)
def test_pairs_of_some_vertices(method: str) -> None:
    """As the first call, as a later one, and everything again after that."""
    rng = np.random.default_rng(4)
    s, x = scene(soup(rng, 60), soup(rng, 40))
    only = rng.random(s.vertices) < 0.05
    whole = rows(candidates(s, x, x, 0.05))
    corners = {VERTEX_FACE: (np.arange(s.vertices)[:, None], s.faces), EDGE_EDGE: (s.edges, s.edges)}
    wanted = [(k, a, b) for k, a, b in whole if only[corners[k][0][a]].any() or only[corners[k][1][b]].any()]
    search = BroadPhase(s, method=method)
    assert 0 < len(wanted) < len(whole)
    for _ in range(2):
        assert rows(search.candidates(x, x, 0.05, only=only)) == wanted
        assert rows(search.candidates(x, x, 0.05)) == whole
