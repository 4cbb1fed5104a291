"""Forces and energies of springs and tetrahedra against the reference, and recovery from inversion."""

import numpy as np
import pytest
from laboratory import Run, rope
from reference import energies

K, K_D = (3.0, 2.0, 5.0), (0.06, 0.04, 0.1)


def solid(vertices: np.ndarray, tetrahedra: list, k=K, k_d=K_D, **more) -> dict:
    names = ("distance", "area", "volume")
    stiffness = {f"k_{name}": value for name, value in zip(names, k, strict=True)}
    damping = {f"damping_{name}": value for name, value in zip(names, k_d, strict=True)}
    shape = {"vertices": vertices, "tetrahedra": np.array(tetrahedra)}
    return {"type": "solid", "name": "solid", "mass": 4.0, **shape, **stiffness, **damping, **more}


def forces_of(scene: dict, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """What pushes the points, read off one explicit Euler step: F = m (v+ - v) / h."""
    run = Run({"integrator": "explicit_euler", **scene}, x, v)
    run.step(1.0)
    return run.m[:, None] * (run.v - v)


def oriented(vertices: np.ndarray, tetrahedra: list) -> list:
    """Tetrahedra of positive volume."""
    return [t if energies.measure("volume", vertices[list(t)]) > 0 else (t[1], t[0], *t[2:]) for t in tetrahedra]


def random_cluster(rng: np.random.Generator, tetrahedra: int) -> tuple[np.ndarray, list]:
    """Tetrahedra that share faces: each new point sits on a random face of an older tetrahedron."""
    points = [np.array(p, dtype=float) for p in ([0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1])]
    elements, open_faces = [(0, 1, 2, 3)], [((0, 1, 2), 3), ((0, 1, 3), 2), ((0, 2, 3), 1), ((1, 2, 3), 0)]
    for _ in range(tetrahedra - 1):
        face, inner = open_faces.pop(int(rng.integers(len(open_faces))))
        a, b, c = (points[i] for i in face)
        normal = np.cross(b - a, c - a)
        normal *= -np.sign(normal @ (points[inner] - a)) / np.linalg.norm(normal)
        points.append((a + b + c) / 3 + normal * rng.uniform(0.4, 1.0) + 0.1 * rng.standard_normal(3))
        new = len(points) - 1
        elements.append((*face, new))
        i, j, k = face
        open_faces += [((i, j, new), k), ((i, k, new), j), ((j, k, new), i)]
    vertices = np.array(points)
    return vertices, oriented(vertices, elements)


@pytest.mark.parametrize("count", [1, 2, 5, 23])
def test_forces_of_tetrahedra(count):
    rng = np.random.default_rng(count)
    for _ in range(3):
        rest, tetrahedra = random_cluster(rng, count)
        x, v = rest + 0.3 * rng.standard_normal(rest.shape), rng.standard_normal(rest.shape)
        got = forces_of({"bodies": [solid(rest, tetrahedra)]}, x, v)
        want = energies.forces(energies.solid(rest, tetrahedra, K, K_D), x, v)
        assert np.abs(got - want).max() < 1e-12 * np.abs(want).max()


@pytest.mark.parametrize("which", range(3))
def test_each_kind_of_energy_alone(which):
    rng = np.random.default_rng(10 + which)
    k, k_d = [0.0] * 3, [0.0] * 3
    k[which], k_d[which] = 7.0, 0.3
    rest, tetrahedra = random_cluster(rng, 6)
    x, v = rest + 0.3 * rng.standard_normal(rest.shape), rng.standard_normal(rest.shape)
    got = forces_of({"bodies": [solid(rest, tetrahedra, k, k_d)]}, x, v)
    want = energies.forces(energies.solid(rest, tetrahedra, tuple(k), tuple(k_d)), x, v)
    assert np.abs(want).max() > 0.1
    assert np.abs(got - want).max() < 1e-12 * np.abs(want).max()


def test_forces_of_a_rope_with_bending():
    rng = np.random.default_rng(4)
    points = np.cumsum(rng.uniform(0.1, 0.5, (7, 3)), axis=0)
    stiff = {"bend_stiffness": 30.0, "bend_damping": 0.2}
    x, v = points + 0.1 * rng.standard_normal(points.shape), rng.standard_normal(points.shape)
    got = forces_of({"bodies": [rope("rope", points, 1.0, 200.0, 1.5, **stiff)]}, x, v)
    springs = []
    for gap, s, c in ((1, 200.0, 1.5), (2, 30.0, 0.2)):
        springs += [
            energies.spring(i, i + gap, float(np.linalg.norm(points[i + gap] - points[i])), s, c)
            for i in range(7 - gap)
        ]
    assert np.abs(got - energies.forces(springs, x, v)).max() < 1e-12 * np.abs(got).max()


def test_masses_of_a_rope_and_a_solid():
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.4, 0, 0]])
    run = Run({"bodies": [rope("rope", points, 2.0, 1.0)]})
    assert run.m == pytest.approx([0.25, 1.0, 0.75], rel=1e-14)  # half of each segment to each of its ends
    rest, tetrahedra = random_cluster(np.random.default_rng(8), 9)
    run = Run({"bodies": [solid(rest, tetrahedra) | {"mass": None, "density": 700.0}]})
    want = np.zeros(len(rest))
    for t in tetrahedra:
        want[list(t)] += 700.0 * energies.measure("volume", rest[list(t)]) / 4
    assert run.m == pytest.approx(want, rel=1e-12)


@pytest.mark.parametrize("name", ["verlet", "euler_cromer", "implicit_euler"])
def test_a_tetrahedron_turned_inside_out_recovers(name):
    rest = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1.0]], dtype=float)
    x = rest.copy()
    x[3, 2] = -0.6
    k, k_d = (20.0, 20.0, 200.0), (2.0, 2.0, 8.0)
    run = Run({"integrator": name, "bodies": [solid(rest, [(0, 1, 2, 3)], k, k_d)]}, x)
    start = energies.measure("volume", x)
    assert start < 0
    run.steps([2e-2] * 400 if name == "implicit_euler" else [2e-3] * 4000)
    element = energies.solid(rest, [(0, 1, 2, 3)], k)
    assert energies.measure("volume", run.x) == pytest.approx(energies.measure("volume", rest), rel=1e-2)
    assert energies.energy(element, run.x) < 1e-3 * energies.energy(element, x)
