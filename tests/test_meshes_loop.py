"""Loop subdivision: known limits, symmetry, boundaries."""

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.loop import loop_subdivide, loop_weights
from turnbuckle.meshes.shapes import grid_sheet

OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])


def test_an_octahedron_after_one_step() -> None:
    """With 4 neighbours b = 3/32: an old vertex keeps 1 - 4 b of itself, its neighbours cancel; new ones by hand."""
    vertices, triangles = loop_subdivide(OCTAHEDRON, FACES)
    np.testing.assert_allclose(vertices[:6], OCTAHEDRON * (1 - 4 * 3 / 32), atol=1e-15)
    # of the edge (1, 0, 0), (0, 1, 0) the opposite points are (0, 0, +-1), which cancel
    np.testing.assert_allclose(np.sort(np.abs(vertices[6:]), axis=1), np.tile([0, 3 / 8, 3 / 8], (12, 1)), atol=1e-15)
    assert len(triangles) == 32
    assert len(vertices) - 3 * 32 // 2 + 32 == 2, "Euler"
    corner = vertices[triangles]
    outside = np.einsum(
        "ij,ij->i", np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), corner.mean(axis=1)
    )
    assert (outside > 0).all()


def test_it_converges_to_a_smooth_surface() -> None:
    """The angle between neighbours falls each time (by 3/4 at corners of four), as on a surface with a tangent plane."""
    bends = []
    for times in (2, 3, 4):
        vertices, triangles = loop_subdivide(OCTAHEDRON, FACES, times)
        corner = vertices[triangles]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        order = np.lexsort(sides.T)
        pair = (np.repeat(np.arange(len(triangles)), 3)[order]).reshape(-1, 2)
        bends.append(np.arccos(np.clip(np.einsum("ij,ij->i", *normal[pair.T]), -1, 1)).max())
    assert bends[1] < 0.8 * bends[0]
    assert bends[2] < 0.8 * bends[1]


def test_a_flat_sheet_stays_flat_and_its_rim_is_the_spline_of_its_rim() -> None:
    sheet = grid_sheet((2.0, 1.0), (4, 3))
    vertices, triangles = loop_subdivide(sheet.vertices, sheet.triangles)
    np.testing.assert_array_equal(vertices[:, 2], 0.0)
    corner = vertices[triangles]
    area = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
    assert (area > 0).all()
    # points of a straight side stay on it, evenly spaced ones where they are
    np.testing.assert_allclose(vertices[1:4], sheet.vertices[1:4], atol=1e-15)
    # a corner of the rim is cut: 3/4 of itself, 1/8 of each neighbour on the rim
    np.testing.assert_allclose(vertices[0], [0.5 / 8, 1 / 3 / 8, 0.0], atol=1e-15)


def test_weights_sum_to_one_and_serve_all_frames() -> None:
    rng = np.random.default_rng(1)
    weights, triangles = loop_weights(FACES, 7, 3)  # vertex 6 is in no triangle
    np.testing.assert_allclose(np.asarray(weights.sum(axis=1)).ravel(), 1.0, atol=1e-14)
    x = rng.standard_normal((7, 3))
    vertices, again = loop_subdivide(x, FACES, 3)
    np.testing.assert_array_equal(again, triangles)
    np.testing.assert_allclose(weights @ x, vertices, atol=1e-15)
    np.testing.assert_array_equal(vertices[6], x[6])


def test_three_triangles_at_an_edge_keep_it_sharp() -> None:
    x = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 0], [0.5, 0, 1]], dtype=float)
    vertices, _ = loop_subdivide(x, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert (np.abs(vertices[5:] - [0.5, 0.0, 0.0]).max(axis=1) < 1e-15).sum() == 1, "the middle of the shared edge"


def test_wrong_input_is_refused() -> None:
    with pytest.raises(InputError, match="names vertex 9 of 6"):
        loop_subdivide(OCTAHEDRON, np.array([[0, 1, 9]]))
    with pytest.raises(InputError, match="times is -1"):
        loop_subdivide(OCTAHEDRON, FACES, -1)
