"""Letters, cages around closed surfaces, skirts, and the skinned figure."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.cage import cage, cage_near
from turnbuckle.meshes.character import BONES, NUMBER, Dance, bone_motions, figure, skinned
from turnbuckle.meshes.embedding import INSIDE, embed
from turnbuckle.meshes.garments import layered_skirt
from turnbuckle.meshes.repair import check_surface
from turnbuckle.meshes.shapes import six_volumes
from turnbuckle.meshes.solids import box_surface, sphere_surface


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    corner = vertices[triangles]
    return float(np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6.0)


def closed(triangles: np.ndarray) -> bool:
    """Every edge is passed once each way."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    there, back = (sorted(map(tuple, s.tolist())) for s in (sides, sides[:, ::-1]))
    return there == back and len(set(there)) == len(there)


def components(elements: np.ndarray, n: int) -> int:
    pairs = np.concatenate([elements[:, [0, k]] for k in range(1, elements.shape[1])])
    graph = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(n, n))
    return connected_components(graph, directed=False)[0]


# Letters


@pytest.mark.parametrize(("character", "holes"), [("I", 0), ("A", 1), ("B", 2), ("8", 2), ("&", 1), ("é", 1)])
def test_letters_are_watertight_with_their_holes(character: str, holes: int) -> None:
    pytest.importorskip("manifold3d")
    from turnbuckle.meshes.letters import letter

    vertices, triangles = letter(character, height=0.3, depth=0.1, edge=0.1)
    assert closed(triangles)
    pieces = components(triangles, len(vertices))
    assert pieces == (2 if character == "é" else 1)
    euler = len(vertices) - 3 * len(triangles) // 2 + len(triangles)
    assert euler == 2 * pieces - 2 * holes
    assert volume(vertices, triangles) > 0.0
    np.testing.assert_allclose(vertices[:, 2].min(), -0.05, atol=1e-6)
    assert check_surface(vertices, triangles)[2].summary() == "nothing to repair"


def test_a_letter_has_its_height_and_the_area_of_its_outline() -> None:
    pytest.importorskip("manifold3d")
    from turnbuckle.meshes.letters import letter

    vertices, triangles = letter("H", height=0.6, depth=0.2)
    np.testing.assert_allclose(np.ptp(vertices, axis=0)[1:], [0.6, 0.2], rtol=1e-5)
    font = pytest.importorskip("fontTools.ttLib")
    area = pytest.importorskip("fontTools.pens.areaPen")
    from turnbuckle.meshes.letters import default_font

    file = font.TTFont(default_font())
    assert file["glyf"]["H"].yMax == 1493
    for character, part in (("H", 1e-5), ("S", 0.03)):  # straight outlines exactly, curves by a few pieces
        pen = area.AreaPen(file.getGlyphSet())
        file.getGlyphSet()[file.getBestCmap()[ord(character)]].draw(pen)
        wanted = abs(pen.value) * (0.6 / 1493.0) ** 2 * 0.2
        vertices, triangles = letter(character, height=0.6, depth=0.2)
        np.testing.assert_allclose(volume(vertices, triangles), wanted, rtol=part)


def test_what_cannot_be_a_letter(tmp_path: Path) -> None:
    pytest.importorskip("manifold3d")
    from turnbuckle.meshes.letters import letter

    with pytest.raises(InputError, match="leaves no mark"):
        letter(" ")
    with pytest.raises(InputError, match="has no letter '漢'"):
        letter("漢")
    (tmp_path / "no.ttf").write_bytes(b"no font")
    with pytest.raises(InputError, match=r"no.ttf: cannot be read"):
        letter("A", font=tmp_path / "no.ttf")
    with pytest.raises(InputError, match="must be positive"):
        letter("A", height=0.0)


# Cages


@pytest.mark.parametrize("cells", [(1, 1, 1), (4, 3, 2), (9, 9, 9)])
def test_a_cage_holds_the_surface_and_its_inside(cells: tuple[int, int, int]) -> None:
    vertices, triangles = sphere_surface(0.5, 24)
    points, tetrahedra = cage(vertices, triangles, cells)
    assert (six_volumes(points, tetrahedra) > 0).all()
    corners, weights = embed(vertices, points, tetrahedra)
    assert weights.min() >= INSIDE, "every vertex lies in a tetrahedron"
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", weights, points[corners]), vertices, atol=1e-12)
    filled = six_volumes(points, tetrahedra).sum() / 6.0
    inner = 4.0 / 3.0 * np.pi * (0.5 + np.linalg.norm(1.0 / np.array(cells))) ** 3
    assert volume(vertices, triangles) <= filled <= inner


def test_cells_inside_count_though_the_surface_is_far() -> None:
    vertices, triangles = box_surface(np.array([1.0, 1.0, 1.0]))
    _, tetrahedra = cage(vertices, triangles, (5, 5, 5))
    assert len(tetrahedra) == 5 * 125


def test_large_triangles_are_followed_between_their_corners() -> None:
    """A thin slanted slab: its corners alone would leave a gap in the cage."""
    vertices, triangles = box_surface(np.array([2.0, 0.02, 0.02]))
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    points, tetrahedra = cage(vertices @ turn.T, triangles, (12, 16, 1))
    assert components(tetrahedra, len(points)) == 1


@pytest.mark.parametrize("wanted", [20, 40, 140, 600])
def test_about_as_many_tetrahedra_as_wanted(wanted: int) -> None:
    vertices, triangles = sphere_surface(0.3, 24)
    points, tetrahedra = cage_near(vertices * [1.0, 1.0, 0.4], triangles, wanted)
    assert 0.7 * wanted <= len(tetrahedra) <= 1.4 * wanted
    again = cage_near(vertices * [1.0, 1.0, 0.4], triangles, wanted)
    np.testing.assert_array_equal(again[0], points)
    again[0][:] = 0.0
    assert cage_near(vertices * [1.0, 1.0, 0.4], triangles, wanted)[0].any(), "what is remembered cannot be spoilt"


def test_a_flat_surface_has_no_cage() -> None:
    with pytest.raises(InputError, match="flat"):
        cage_near(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), 10)


# Skirts


def test_a_dress_of_six_layers() -> None:
    dress = layered_skirt()
    assert len(dress.vertices) == 16_800
    assert components(dress.triangles, 16_800) == 6
    np.testing.assert_array_equal(np.bincount(dress.layer), 2800)
    np.testing.assert_allclose(dress.vertices[dress.top, 2], 1.06)
    assert len(dress.top) == 600
    sides = np.sort(dress.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    assert (count <= 2).all()
    assert (count == 1).sum() == 6 * 2 * 100, "waist and hem"
    length = np.linalg.norm(dress.vertices[edges[:, 0]] - dress.vertices[edges[:, 1]], axis=1)
    assert 0.004 < length.min() < length.max() < 0.05
    corner = dress.vertices[dress.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (np.einsum("ij,ij->i", normal[:, :2], corner.mean(axis=1)[:, :2]) > 0).all(), "outwards"


def test_wrong_skirts() -> None:
    with pytest.raises(InputError, match="0 layers"):
        layered_skirt(layers=0)
    with pytest.raises(InputError, match="gap and length"):
        layered_skirt(gap=0.0)


# The dancer


def test_the_figure_is_closed_and_its_skin_belongs_to_its_bones() -> None:
    body = figure()
    assert closed(body.triangles)
    assert components(body.triangles, len(body.vertices)) == 8
    np.testing.assert_allclose(body.weights.sum(axis=1), 1.0, atol=1e-12)
    assert body.weights.min() >= 0.0
    assert ((body.weights > 0).sum(axis=1) >= 2).sum() > 50, "where she bends, two bones share the skin"
    assert volume(body.vertices, body.triangles) > 0.04
    np.testing.assert_allclose([body.vertices[:, 2].min(), body.vertices[:, 2].max()], [0.0, 1.72], atol=0.01)


def test_bones_stay_rigid_and_joined() -> None:
    dance = Dance()
    motions = bone_motions(dance.pose, np.linspace(0.0, 3.0, 13))
    turns = motions[:, :, :, :3]
    np.testing.assert_allclose(turns @ turns.transpose(0, 1, 3, 2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-12)
    for name, parent, place in BONES:
        if parent:
            here = np.array([*place, 1.0])
            np.testing.assert_allclose(motions[:, NUMBER[name]] @ here, motions[:, NUMBER[parent]] @ here, atol=1e-12)


def test_she_turns_by_360_degrees_in_under_a_second_and_kicks() -> None:
    dance = Dance()
    assert dance.turn_time < 1.0
    times = np.linspace(dance.turn_at, dance.turn_at + dance.turn_time, 200)
    facing = bone_motions(dance.pose, times)[:, NUMBER["pelvis"], :, 1]  # where +y has gone
    angle = np.unwrap(np.arctan2(-facing[:, 0], facing[:, 1]))
    np.testing.assert_allclose(angle[-1] - angle[0], 2.0 * np.pi, atol=1e-6)
    body = figure()
    foot = np.argmax((body.vertices[:, 1] > 0.1) * (body.vertices[:, 0] < 0) * (body.vertices[:, 2] < 0.08))
    kick = dance.kick_at + np.linspace(0.0, dance.kick_time, 40)
    height = skinned(body, bone_motions(dance.pose, kick))[:, foot, 2]
    assert height.max() > 0.7
    assert height[[0, -1]].max() < 0.1


def test_her_skin_moves_without_leaps() -> None:
    """Two steps of half the length are the same motion: no frame jumps."""
    body, dance = figure(), Dance()
    times = np.arange(0.0, 2.8, 1.0 / 100.0)
    x = skinned(body, bone_motions(dance.pose, times))
    np.testing.assert_allclose(x[0], skinned(body, bone_motions(dance.pose, np.array([-1.0])))[0], atol=1e-12)
    speed = np.linalg.norm(np.diff(x, axis=0), axis=2) * 100.0
    assert 3.0 < speed.max() < 15.0
    assert np.abs(np.diff(speed, axis=0)).max() < 2.5
