"""Dirty meshes: a counted repair or a clear error, and the mass always right."""

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.repair import check_surface, repair_tetrahedra
from turnbuckle.meshes.shapes import boundary_triangles, box_tetrahedra, six_volumes


@pytest.fixture
def box():
    return box_tetrahedra((1.0, 1.0, 1.0), (2, 2, 2))


def test_everything_at_once_is_counted_and_the_volume_is_right(box):
    vertices, tetrahedra = box
    loose = np.array([[5.0, 5, 5], [6, 6, 6]])
    dirty_points = np.concatenate([loose[:1], vertices, loose[1:]])
    shifted = tetrahedra + 1
    shifted[[3, 7, 8]] = shifted[[3, 7, 8]][:, [1, 0, 2, 3]]  # inverted
    twice = shifted[[0, 3]][:, [2, 3, 0, 1]]
    flat = np.array([[1, 2, 3, 2], [1, 2, 4, 5]])  # a corner twice; four points of a plane
    assert abs(np.linalg.det(dirty_points[flat[1, 1:]] - dirty_points[flat[1, 0]])) < 1e-15
    dirty = np.concatenate([flat[:1], shifted, twice, flat[1:]])
    points, cells, report = repair_tetrahedra(dirty_points, dirty)
    assert (report.flipped, report.duplicates, report.flat, report.loose, report.overlaps) == (3, 2, 2, 2, 0)
    assert (six_volumes(points, cells) > 0).all()
    assert six_volumes(points, cells).sum() / 6 == pytest.approx(1.0, rel=1e-14)
    assert report.point_map[0] == -1 and report.point_map[-1] == -1
    kept = report.point_map >= 0
    np.testing.assert_array_equal(points[report.point_map[kept]], dirty_points[kept])
    assert report.element_map.max() + 1 == len(cells) and (report.element_map < 0).sum() == 4
    for word in ("3 inverted", "2 duplicate", "2 elements without volume", "2 loose"):
        assert word in report.summary()


def test_clean_mesh_is_left_alone(box):
    points, cells, report = repair_tetrahedra(*box)
    np.testing.assert_array_equal(points, box[0])
    np.testing.assert_array_equal(cells, box[1])
    assert report.clean and report.summary() == "nothing to repair"


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_flatness_is_relative(box, scale):
    _, cells, report = repair_tetrahedra(box[0] * scale, box[1])
    assert report.flat == 0 and len(cells) == len(box[1])


def test_errors_name_the_place(box):
    vertices, tetrahedra = box
    bad = vertices.copy()
    bad[5, 1] = np.nan
    with pytest.raises(InputError, match="vertex 5 is not finite"):
        repair_tetrahedra(bad, tetrahedra)
    out = tetrahedra.copy()
    out[4, 2] = 99
    with pytest.raises(InputError, match="element 4"):
        repair_tetrahedra(vertices, out)
    with pytest.raises(InputError, match="without volume"):
        repair_tetrahedra(vertices * [1, 1, 0], tetrahedra)
    with pytest.raises(InputError, match="there are none"):
        repair_tetrahedra(vertices, tetrahedra[:0])


def test_overlaps_are_seen():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 2], [0, 0, -1]])
    apart, folded = np.array([[0, 1, 2, 3], [0, 2, 1, 5]]), np.array([[0, 1, 2, 3], [0, 1, 2, 4]])
    assert repair_tetrahedra(vertices, apart)[2].overlaps == 0
    assert repair_tetrahedra(vertices, folded)[2].overlaps == 1
    with pytest.raises(InputError, match="3 elements"):
        repair_tetrahedra(vertices, np.concatenate([folded, apart[1:]]))


def test_surface_inverted_or_mixed_is_turned_outwards(box):
    vertices, triangles = box[0], boundary_triangles(box[1])
    for flipped in (np.arange(len(triangles)), np.array([0, 5, 9])):
        dirty = triangles.copy()
        dirty[flipped] = dirty[flipped][:, ::-1]
        _, clean, report = check_surface(vertices, dirty)
        assert report.flipped == len(flipped) and report.volume == pytest.approx(1.0)
        assert {tuple(np.roll(t, -np.argmin(t))) for t in clean} == {
            tuple(np.roll(t, -np.argmin(t))) for t in triangles
        }


def test_surface_duplicates_and_degenerates_are_dropped(box):
    vertices, triangles = box[0], boundary_triangles(box[1])
    a, b = triangles[0, :2]
    dirty = np.concatenate([triangles, triangles[:2], [[a, b, a]]])
    _, clean, report = check_surface(vertices, dirty)
    assert (report.duplicates, report.degenerate) == (2, 1)
    assert len(clean) == len(triangles)


def test_cavity_keeps_its_orientation_and_a_twin_is_turned(box):
    vertices, triangles = box[0], boundary_triangles(box[1])
    both = np.concatenate([vertices, vertices * 0.5 + 0.25])
    hollow = np.concatenate([triangles, triangles[:, ::-1] + len(vertices)])
    report = check_surface(both, hollow)[2]
    assert report.flipped == 0 and report.volume == pytest.approx(1 - 0.125)
    assert check_surface(both, hollow[:, ::-1])[2].volume == pytest.approx(1 - 0.125)
    beside = np.concatenate([vertices, vertices * 0.5 + 3])
    report = check_surface(beside, hollow)[2]
    assert report.flipped == len(triangles) and report.volume == pytest.approx(1 + 0.125)


def test_open_one_sided_flat_and_nan_surfaces_are_refused(box):
    vertices, triangles = box[0], boundary_triangles(box[1])
    with pytest.raises(InputError, match="3 boundary edges"):
        check_surface(vertices, triangles[1:])
    # The projective plane on six vertices: closed, and with one side only.
    plane = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 1), (1, 2, 4), (2, 3, 5), (3, 4, 1), (4, 5, 2), (5, 1, 3)])  # fmt: skip
    with pytest.raises(InputError, match="one-sided"):
        check_surface(np.random.default_rng(0).normal(size=(6, 3)), plane)
    with pytest.raises(InputError, match="no volume"):
        check_surface(vertices * [1, 1, 0], triangles)
    bad = vertices.copy()
    bad[2] = np.inf
    with pytest.raises(InputError, match="vertex 2"):
        check_surface(bad, triangles)
