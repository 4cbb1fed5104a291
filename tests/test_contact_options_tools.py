"""The parts of contact by themselves, on arrays: a hand-written explicit stepper of a cloth of particles."""

import numpy as np
import pytest

import turnbuckle

H, DELTA, MASS = 2e-3, 5e-3, 0.01


def _cloth(n: int = 6) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Particles over a tetrahedron that stands still; springs, triangles of the cloth, triangles of the spike."""
    u = np.linspace(-0.2, 0.2, n)
    x = np.stack([*(g.ravel() for g in np.meshgrid(u, u + 0.013)), np.full(n * n, 0.12)], axis=1)
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)))
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    springs = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [0, 2]]]), axis=1), axis=0)
    spike = np.array([[0.15, 0, 0], [-0.1, 0.13, 0], [-0.1, -0.13, 0], [0, 0, 0.1]])
    return np.concatenate([x, spike]), springs, faces, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def _refined(
    surfaces: turnbuckle.Surfaces, detector: turnbuckle.ContactDetector, x: np.ndarray, v_free: np.ndarray, solver: str
) -> tuple[bool, turnbuckle.ContactSolution]:
    """Whether refinement ends with a clear way, and its last solution."""
    s0, masses, fixed = surfaces.positions(x), np.full(len(x), MASS), np.arange(len(x)) >= len(x) - 4
    found: list[turnbuckle.ContactSolution] = []

    def solve(contacts: turnbuckle.Contacts) -> np.ndarray:
        problem = turnbuckle.contact_problem(
            surfaces, contacts, s0, v_free, masses, H, DELTA, friction=0.2, fixed=fixed
        )
        found.append(turnbuckle.solve_contact(problem, solver, tolerance=1e-6))
        assert found[-1].converged
        return surfaces.positions(x + H * found[-1].velocity.reshape(-1, 3))

    refined = turnbuckle.refine_contacts(detector.near(s0), solve, lambda s1: detector.crossed(s0, s1), rounds=8)
    return refined.clear, found[-1]


@pytest.mark.parametrize("solver", ["newton", "ica", "anticipation"])
def test_a_stepper_of_ones_own_keeps_a_cloth_off_a_spike(solver: str) -> None:
    x, springs, cloth, spike = _cloth()
    n, free = len(x), len(x) - 4
    fixed = np.arange(n) >= free
    rest = np.linalg.norm(x[springs[:, 1]] - x[springs[:, 0]], axis=1)
    surfaces = turnbuckle.make_surfaces(
        [
            turnbuckle.SurfacePart(0, np.arange(free), triangles=cloth, delta=DELTA),
            turnbuckle.SurfacePart(1, np.arange(free, n), triangles=spike, delta=DELTA),
        ],
        x,
    )  # fmt: skip
    detector = turnbuckle.ContactDetector(surfaces, ~fixed)
    v, pushed, kept = np.zeros((n, 3)), 0, np.inf
    for _ in range(110):
        d = x[springs[:, 1]] - x[springs[:, 0]]
        length = np.linalg.norm(d, axis=1)
        along = d / length[:, None]
        rate = np.einsum("sd,sd->s", along, v[springs[:, 1]] - v[springs[:, 0]])
        pull = (60.0 * (length - rest) + 0.05 * rate)[:, None] * along
        force = np.tile([0.0, 0.0, -9.81 * MASS], (n, 1))
        np.add.at(force, springs[:, 0], pull)
        np.add.at(force, springs[:, 1], -pull)
        v_free = np.where(fixed[:, None], 0.0, v + H * force / MASS)
        refined, found = _refined(surfaces, detector, x, v_free, solver)
        assert refined
        pushed = max(pushed, int((found.impulse[:, 0] > 0.0).sum()))
        v = found.velocity.reshape(-1, 3)
        x = x + H * v
        kept = min(kept, detector.smallest_gap)
        assert len(turnbuckle.intersections(surfaces, surfaces.positions(x))) == 0
    assert pushed >= 3 and kept > 0.0
    assert x[:free, 2].max() > 0.08 > 0.0 > x[:free, 2].min()  # it hangs over the spike


def test_a_single_pair_has_its_time_of_impact() -> None:
    start = np.array([[0.2, 0.2, 1.0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    end = start.copy()
    end[0, 2] = -1.0
    hit, time = turnbuckle.time_of_impact(np.concatenate([start, end])[None], "vertex_face")
    assert hit[0] and 0.49 < time[0] <= 0.5


def test_what_cannot_be_is_named() -> None:
    x, _, cloth, _ = _cloth()
    surfaces = turnbuckle.make_surfaces([turnbuckle.SurfacePart(0, np.arange(len(x)), triangles=cloth)], x)
    near = turnbuckle.ContactDetector(surfaces, np.ones(len(x), dtype=bool)).near(x)
    with pytest.raises(turnbuckle.InputError, match="masses"):
        turnbuckle.contact_problem(surfaces, near, x, np.zeros_like(x), np.ones(3), H)
    problem = turnbuckle.contact_problem(surfaces, near, x, np.zeros_like(x), np.ones(len(x)), H)
    with pytest.raises(turnbuckle.InputError, match="gauss"):
        turnbuckle.solve_contact(problem, "gauss")
