"""Nearest permissible points (Displacement, 4.1) against dense samples, and what domains hold."""

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.geometry.curve_domain import Curve
from turnbuckle.geometry.domains import CallableDomain, Domain, Point, Ring, Segment, Sphere
from turnbuckle.geometry.surface_domain import Surface

RNG = np.random.default_rng(7)
ZIGZAG = np.array([[0.0, 0, 0], [1, 0.5, 0], [2, -0.5, 0.3], [3, 0.4, 0.8], [2.5, 1.5, 1.0]])
TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def spread(n: int, size: float = 2.0) -> np.ndarray:
    return RNG.uniform(-size, size, (n, 3))


def samples(domain: Domain) -> np.ndarray:
    """Many permissible points."""
    if isinstance(domain, Curve):
        return domain.at(np.linspace(0.0, domain.length, 20001))
    if isinstance(domain, Surface):
        w = RNG.dirichlet(np.ones(3), 4000)
        return np.concatenate([w @ domain.vertices[t] for t in domain.triangles])
    angle, part, z = RNG.uniform(0, 2 * np.pi, 40000), RNG.uniform(0, 1, 40000), RNG.uniform(-1, 1, 40000)
    if isinstance(domain, Segment):
        return np.outer(domain.lo + part * (domain.hi - domain.lo), [0.0, 0, 1])
    r = np.concatenate([domain.lo + part[:20000] * (domain.hi - domain.lo), np.repeat([domain.lo, domain.hi], 10000)])
    if isinstance(domain, Ring):
        return np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r], axis=1)
    flat = np.sqrt(1 - z**2)
    return r[:, None] * np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)


DOMAINS = {
    "segment": Segment(-0.3, 0.7),
    "ring": Ring(0.4, 1.1),
    "shell": Sphere(0.6, 1.2),
    "polyline": Curve(ZIGZAG),
    "closed polyline": Curve(ZIGZAG, closed=True),
    "spline": Curve(ZIGZAG, spline=True),
    "closed spline": Curve(ZIGZAG, closed=True, spline=True),
    "surface": Surface(TETRAHEDRON, FACES),
    "open surface": Surface(TETRAHEDRON, FACES[:3]),
}


@pytest.mark.parametrize("domain", DOMAINS.values(), ids=DOMAINS)
def test_nearest_is_permissible_and_no_sample_is_nearer(domain: Domain) -> None:
    p = spread(60)
    nearest = domain.nearest(p)
    np.testing.assert_allclose(domain.nearest(nearest), nearest, atol=1e-12)
    best = np.linalg.norm(p[:, None] - samples(domain), axis=2).min(axis=1)
    found = np.linalg.norm(p - nearest, axis=1)
    assert (found <= best + 1e-12).all()
    assert (found >= best - 0.08).all()


@pytest.mark.parametrize("domain", DOMAINS.values(), ids=DOMAINS)
def test_held_directions_span_the_gap(domain: Domain) -> None:
    """The way to the nearest point lies in what is held; one-sided directions point into the domain."""
    p = spread(80)
    held = domain.held(p)
    np.testing.assert_allclose(held.point, domain.nearest(p), atol=1e-12)
    np.testing.assert_allclose(
        np.einsum("nij,nkj->nik", held.directions, held.directions), np.tile(np.eye(3), (80, 1, 1)), atol=1e-12
    )
    gap = np.einsum("nij,nj->ni", held.directions, p - held.point)
    free = np.arange(3) >= held.count[:, None]
    corner = isinstance(domain, Curve) and domain.spline is None
    if not corner:  # at a corner the mean of both tangents is let go
        assert np.abs(gap[free]).max(initial=0.0) < 1e-9
    assert (gap[held.one_sided & ~free] < 1e-12).all()
    for k in range(3):
        tip = (np.linalg.norm(held.point[:, None] - TETRAHEDRON, axis=2) < 1e-9).any(
            axis=1
        )  # there it is the gap's way
        row = np.flatnonzero(held.one_sided[:, k] & ~free[:, k] & ~(tip & isinstance(domain, Surface)))
        inside = held.point[row] + 1e-5 * held.directions[row, k]
        assert (np.linalg.norm(domain.nearest(inside) - inside, axis=1) < 1e-8).all()


CURVED = {"spline": Curve(ZIGZAG, spline=True), "rod": Sphere(1.0, 1.0), "circle": Ring(0.8, 0.8)}


@pytest.mark.parametrize("domain", CURVED.values(), ids=CURVED)
def test_newton_on_held_directions_is_quadratic_on_curved_domains(domain: Domain) -> None:
    p = domain.nearest(spread(30)) + 0.02 * spread(30, 1.0)
    gaps = []
    for _ in range(4):
        held = domain.held(p)
        mask = (np.arange(3) < held.count[:, None]) & ~held.one_sided
        gap = np.where(mask, np.einsum("nij,nj->ni", held.directions, p - held.point), 0.0)
        drag = np.array([0.01, -0.004, 0.006]) * np.linalg.norm(gap, axis=1, keepdims=True)
        p = p - np.einsum("nij,ni->nj", held.directions, gap) + drag
        p = p - np.einsum(
            "nij,ni->nj", held.directions, np.where(mask, np.einsum("nij,nj->ni", held.directions, drag), 0)
        )
        gaps.append(np.linalg.norm(domain.nearest(p) - p, axis=1)[~held.one_sided.any(axis=1)].max())
    assert gaps[-1] < 1e-13


def test_point_and_limits() -> None:
    p = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.2], [0.1, 0.0, -3.0]])
    assert (Point().held(p).count == 3).all()
    held = Segment(-1.0, 1.0).held(p)
    assert held.count.tolist() == [3, 2, 3]
    assert held.directions[0, 2, 2] == -1.0 and held.directions[2, 2, 2] == 1.0
    inside = Sphere(0.0, 1.0).held(np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]))
    assert inside.count.tolist() == [0, 0, 1] and inside.one_sided[2, 0]
    rod = Sphere(1.0, 1.0).held(np.array([[0.0, 2.0, 0.0]]))
    assert rod.count[0] == 1 and not rod.one_sided[0].any()
    disc = Ring(0.0, 1.0).held(np.array([[0.0, 0.0, 0.3], [5.0, 0.0, 0.3]]))
    assert disc.count.tolist() == [1, 2] and disc.one_sided[1].tolist() == [False, True, False]
    each = Segment(np.array([0.0, -9.0]), np.array([1.0, 9.0])).nearest(np.array([[0.0, 1.0, 5.0], [1.0, 0.0, 5.0]]))
    np.testing.assert_array_equal(each, [[0, 0, 1], [0, 0, 5]])


def test_spline_has_continuous_curvature_and_passes_its_points() -> None:
    curve = Curve(ZIGZAG, closed=True, spline=True)
    np.testing.assert_allclose(curve.nearest(ZIGZAG), ZIGZAG, atol=1e-12)
    for s in [*curve.knots[1:-1], curve.knots[0]]:
        second = curve.spline.derivative(2)
        before = second(s - 1e-9 if s > 0 else curve.length - 1e-9)
        np.testing.assert_allclose(before, second(s + 1e-9), atol=1e-6)


def test_callable_domain_knows_what_it_holds() -> None:
    def cup(p: np.ndarray) -> np.ndarray:  # the half space z >= 0
        return np.array([p[0], p[1], max(p[2], 0.0)])

    def line(p: np.ndarray) -> np.ndarray:
        return np.array([p[0], 0.0, 0.0])

    held = CallableDomain(cup).held(np.array([[0.3, 0.2, -0.5], [0.1, 0.1, 0.5]]))
    assert held.count.tolist() == [1, 0]
    np.testing.assert_allclose(held.directions[0, 0], [0, 0, 1], atol=1e-9)
    assert held.one_sided[0, 0]
    wire = CallableDomain(line).held(np.array([[0.3, 0.2, -0.5]]))
    assert wire.count[0] == 2 and not wire.one_sided.any()
    with pytest.raises(InputError, match="rail: .*three finite numbers"):
        CallableDomain(lambda p: p[:2], "rail").nearest(np.zeros((1, 3)))
    with pytest.raises(InputError, match="rail: .*fails"):
        CallableDomain(lambda p: 1 / 0, "rail").nearest(np.zeros((1, 3)))
