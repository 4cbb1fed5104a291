"""A fine surface carried by coarse tetrahedra: exact at rest, linear in motion, and truly the nearest outside."""

import time

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.embedding import embed
from turnbuckle.meshes.shapes import boundary_faces, box_tetrahedra


def _graded_box(rng, cells):
    """Elements whose sizes differ by a hundred, so that the nearest centroid is often another element's."""
    vertices, tetrahedra = box_tetrahedra((1, 1, 1), (cells, cells, cells))
    inner = ((vertices > 0) & (vertices < 1)).all(axis=1)
    vertices[inner] += rng.normal(size=(inner.sum(), 3)) * 0.1 / cells
    return vertices**3, tetrahedra


def test_inside_points_are_inside_their_element():
    rng = np.random.default_rng(3)
    vertices, tetrahedra = _graded_box(rng, 6)
    surface = rng.uniform(0.001, 0.999, (3000, 3))
    points, weights = embed(surface, vertices, tetrahedra)
    assert points.dtype == np.int32 and weights.min() > -1e-9  # the box is full: every point lies in some element
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", weights, vertices[points]), surface, atol=1e-13)
    known = {tuple(sorted(t)) for t in tetrahedra.tolist()}
    assert {tuple(sorted(p)) for p in points.tolist()} <= known


def test_affine_motion_carries_the_surface_exactly():
    rng = np.random.default_rng(4)
    vertices, tetrahedra = _graded_box(rng, 4)
    surface = rng.uniform(-0.2, 1.2, (500, 3))
    points, weights = embed(surface, vertices, tetrahedra)
    matrix, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = np.einsum("nk,nkd->nd", weights, (vertices @ matrix.T + shift)[points])
    np.testing.assert_allclose(moved, surface @ matrix.T + shift, atol=1e-9)


def test_outside_points_take_the_closest_element():
    rng = np.random.default_rng(5)
    vertices, tetrahedra = _graded_box(rng, 4)
    surface = rng.uniform(-0.5, 1.5, (400, 3))
    surface = surface[((surface < -1e-6) | (surface > 1 + 1e-6)).any(axis=1)]
    points, weights = embed(surface, vertices, tetrahedra)
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", weights, vertices[points]), surface, atol=1e-12)
    # The solid is the unit cube, so the closest point is known; it must lie on the element that was chosen.
    closest = np.clip(surface, 0, 1)
    corner = vertices[points]
    solved = np.linalg.solve(np.moveaxis(corner[:, 1:] - corner[:, :1], 1, 2), (closest - corner[:, 0])[..., None])[
        ..., 0
    ]
    inside = np.concatenate([1 - solved.sum(axis=1, keepdims=True), solved], axis=1)
    assert inside.min() > -1e-9


def test_boundary_faces_know_their_element():
    _, tetrahedra = box_tetrahedra((1, 1, 1), (2, 2, 2))
    faces, owners = boundary_faces(tetrahedra)
    assert all(set(face) <= set(tetrahedra[owner]) for face, owner in zip(faces.tolist(), owners, strict=True))


def test_large_meshes_are_quick():
    rng = np.random.default_rng(6)
    vertices, tetrahedra = box_tetrahedra((1, 1, 1), (16, 16, 16))
    surface = rng.uniform(-0.02, 1.02, (20000, 3))
    start = time.perf_counter()
    embed(surface, vertices, tetrahedra)
    assert time.perf_counter() - start < 6  # the aim is 3 s, here with room for a busy machine


def test_wrong_input_is_refused():
    vertices, tetrahedra = box_tetrahedra((1, 1, 1), (1, 1, 1))
    with pytest.raises(InputError, match="finite"):
        embed(np.full((1, 3), np.nan), vertices, tetrahedra)
    with pytest.raises(InputError, match="no tetrahedra"):
        embed(np.zeros((1, 3)), vertices, tetrahedra[:0])
    with pytest.raises(InputError, match="no volume"):
        embed(np.zeros((1, 3)), vertices * [1, 1, 0], tetrahedra)
