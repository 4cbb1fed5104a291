"""Continuous collision detection of pairs of surfaces: contacts at the time of impact, certified gaps."""

import numpy as np
import pytest
from reference.ccd_distance import distances

from turnbuckle.contact.ccd_bulk import time_of_impact
from turnbuckle.contact.ccd_pairs import CLOSE, Ccd, clear, first_impacts
from turnbuckle.data.contact import Contacts, Pairs, Surfaces
from turnbuckle.data.errors import InputError

FACES = np.array([[1, 2, 3]], np.int32)
EDGES = np.array([[0, 4], [1, 2], [1, 3], [2, 3]], np.int32)
START = np.array([[0.2, 0.2, 1.0], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0.8, 0.2, 2.0]])  # a face, an edge 0-4 above it


def surfaces(vertices: int, faces: np.ndarray, edges: np.ndarray) -> Surfaces:
    n = vertices
    return Surfaces(
        support=np.repeat(np.arange(n, dtype=np.int32)[:, None], 4, axis=1),
        weights=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        faces=faces,
        edges=edges,
        edge_faces=np.full((len(edges), 2), -1, np.int32),
        shape=np.zeros(n, np.int32),
        delta=np.full(n, 0.01),
        collides=np.ones((1, 1), bool),
        friction=np.zeros((1, 1, 2)),
    )


def pairs(*rows: tuple[int, int, int]) -> Pairs:
    kind, a, b = np.array(rows, np.int32).reshape(-1, 3).T
    return Pairs(kind, a, b)


def soup(rng: np.random.Generator, n: int = 3000) -> tuple[Surfaces, Pairs, np.ndarray, np.ndarray]:
    """Pairs of features of their own, half of each kind, in all places of their surfaces."""
    x0 = rng.normal(size=(4 * n, 3))
    x1 = x0 + 0.5 * rng.normal(size=(4 * n, 3))
    corner = np.arange(4 * n, dtype=np.int32).reshape(n, 4)
    half = n // 2
    faces, edges = corner[:half, 1:], corner[half:].reshape(-1, 2)
    number = np.arange(half, dtype=np.int32)
    kind = np.repeat([0, 1], half).astype(np.int32)
    a, b = np.concatenate([corner[:half, 0], 2 * number]), np.concatenate([number, 2 * number + 1])
    return surfaces(4 * n, faces, edges), Pairs(kind, a, b), x0, x1


def separation_vectors(contacts: Contacts, x: np.ndarray) -> np.ndarray:
    return np.einsum("nk,nkd->nd", contacts.coefficients, x[contacts.vertices])


def test_vertex_and_edge_falling_on_a_face():
    end = START.copy()
    end[[0, 4], 2] -= 1.8
    contacts = first_impacts(
        surfaces(5, FACES, EDGES), pairs((0, 0, 0), (0, 4, 0), (1, 0, 1)), START, end, [0.1, 0.1, 0.2001]
    )
    assert contacts.count == 2  # the edge's upper end does not get there
    assert contacts.vertices.tolist() == [[0, 1, 2, 3], [0, 4, 1, 2]]
    np.testing.assert_allclose(contacts.coefficients[0], [1, -0.6, -0.2, -0.2])
    np.testing.assert_allclose(contacts.normal[0], [0, 0, 1])
    np.testing.assert_allclose(contacts.distance[0], 1.0)
    assert 0.49 < contacts.time[0] <= 0.5
    np.testing.assert_allclose(contacts.coefficients[1], [1, 0, -0.8, -0.2], atol=1e-12)  # its lower end comes first


def test_same_as_in_bulk_and_closest_points_at_the_impact():
    rng = np.random.default_rng(0)
    made, near, x0, x1 = soup(rng)
    apart = rng.uniform(0.0, 0.2, near.count)
    ccd = Ccd(made)
    contacts, walked = ccd.first_impacts(near, x0, x1, apart)
    corner = np.arange(len(x0)).reshape(-1, 4)
    queries = np.concatenate([x0[corner], x1[corner]], axis=1)
    hit, time = time_of_impact(queries, near.kind, apart)
    assert np.array_equal(hit, walked.hit) and np.array_equal(time, walked.time)
    assert 100 < hit.sum() == contacts.count == ccd.clear(near, x0, x1, apart) == clear(made, near, x0, x1, apart)
    which = np.flatnonzero(hit)
    # Hits are looked at again, more tightly, from the safe side.
    again, tight = time_of_impact(queries, near.kind, apart, tightness=CLOSE)
    assert np.array_equal(contacts.vertices, corner[which])
    assert np.array_equal(contacts.time, np.where(again, np.maximum(time, tight), time)[which])
    assert all(np.array_equal(getattr(contacts, f), getattr(near, f)[which]) for f in ("kind", "a", "b"))

    x = x0[contacts.vertices] + contacts.time[:, None, None] * (x1 - x0)[contacts.vertices]
    both = [np.where(contacts.kind == 0, distances(y, 0), distances(y, 1)) for y in (x0[contacts.vertices], x)]
    np.testing.assert_allclose(contacts.distance, both[0], atol=1e-12)
    p = np.einsum("nk,nkd->nd", contacts.coefficients, x)
    np.testing.assert_allclose(p, both[1][:, None] * contacts.normal, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(contacts.normal, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(contacts.coefficients.sum(axis=1), 0.0, atol=1e-14)
    assert (contacts.coefficients[:, 0] >= 0).all() and (contacts.coefficients[:, 2:] <= 0).all()


def test_certified_gap_is_a_lower_bound_and_worth_something():
    rng = np.random.default_rng(1)
    made, near, x0, x1 = soup(rng)
    walked = Ccd(made).walk(near, x0, x1, 0.02)
    corner = np.arange(len(x0)).reshape(-1, 4)
    smallest = np.full(near.count, np.inf)
    for t in np.linspace(0.0, 1.0, 201):
        x = (x0 + t * (x1 - x0))[corner]
        there = np.where(near.kind == 0, distances(x, 0), distances(x, 1))
        smallest = np.where(t <= walked.time, np.minimum(smallest, there), smallest)
    assert (walked.gap <= smallest).all()
    free = ~walked.hit
    assert (walked.gap[free] >= 0.02 + 0.2 * (smallest[free] - 0.03)).all()
    assert walked.smallest_gap == walked.gap.min()


@pytest.mark.parametrize("shift", [-1.0, 1.0])
def test_touching_start_takes_the_side_that_the_motion_comes_from(shift):
    """A vertex in the plane of the face: no closest direction. At rest, the face's own outside."""
    start = START.copy()
    start[0, 2] = 0.0
    end = start.copy()
    end[0] += [0.1, 0.0, shift]
    made, one = surfaces(5, FACES, EDGES), pairs((0, 0, 0))
    contacts = first_impacts(made, one, start, end, 0.0)
    assert contacts.time[0] == 0.0 and contacts.distance[0] < 1e-15
    np.testing.assert_allclose(contacts.normal[0], [0, 0, -shift], atol=1e-15)
    still = first_impacts(made, one, start, start, 0.0)
    np.testing.assert_allclose(still.normal[0], [0, 0, 1], atol=1e-15)


def test_touching_start_a_hair_above_keeps_its_side():
    start = START.copy()
    start[0, 2] = 1e-9
    end = start.copy()
    for rise in (-1.0, 1.0):
        end[0, 2] = rise
        contacts = first_impacts(surfaces(5, FACES, EDGES), pairs((0, 0, 0)), start, end, 1e-6)
        np.testing.assert_allclose(contacts.normal[0], [0, 0, 1], atol=1e-6)


def test_edges_that_cross_or_lie_on_each_other():
    x = np.array([[0, 0, 0], [1, 0, 0], [0.5, -1, 0], [0.5, 1, 0], [0, 0, 0], [1, 0, 0]], dtype=float)
    edges = np.array([[0, 1], [2, 3], [4, 5]], np.int32)
    end = x.copy()
    end[:2, 2] = -1.0
    contacts = first_impacts(surfaces(6, np.zeros((0, 3), np.int32), edges), pairs((1, 0, 1), (1, 0, 2)), x, end, 0.0)
    assert contacts.count == 2 and np.isfinite(contacts.normal).all()
    np.testing.assert_allclose(contacts.normal, [[0, 0, 1], [0, 0, 1]], atol=1e-15)


def test_pairs_without_area_or_length_have_a_unit_normal():
    x = np.zeros((5, 3))
    contacts = first_impacts(surfaces(5, FACES, EDGES), pairs((0, 0, 0), (1, 0, 1)), x, x, 0.0)
    np.testing.assert_allclose(np.linalg.norm(contacts.normal, axis=1), 1.0)


def test_buffers_serve_lists_of_any_length():
    rng = np.random.default_rng(2)
    made, near, x0, x1 = soup(rng)
    ccd = Ccd(made)
    for n in (10, 0, near.count, 57):
        part = Pairs(near.kind[:n], near.a[:n], near.b[:n])
        contacts, walked = ccd.first_impacts(part, x0, x1, 0.1)
        fresh = Ccd(made).walk(part, x0, x1, np.full(n, 0.1))
        assert np.array_equal(walked.time, fresh.time) and contacts.count == fresh.hit.sum()
        assert walked.smallest_gap == fresh.smallest_gap


def test_wrong_input_names_what_is_wrong():
    made, one = surfaces(5, FACES, EDGES), pairs((1, 0, 1), (0, 0, 0))
    bad = START.copy()
    bad[3, 1] = np.nan
    with pytest.raises(InputError, match="pair 1"):
        Ccd(made).walk(one, START, bad, 0.1)
    with pytest.raises(InputError, match="shapes"):
        Ccd(made).walk(one, START[:4], START, 0.1)
    for wrong in (-1.0, np.nan, np.ones(3)):
        with pytest.raises(InputError, match="separation"):
            Ccd(made).walk(one, START, START, wrong)
