"""Mass, centre and inertia of rigid bodies, against closed forms, against trimesh, and against each other."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.mass_properties import mass_properties
from turnbuckle.meshes.solids import box_surface, capsule_surface, cylinder_surface, sphere_surface
from turnbuckle.scene.build_rigid import RigidShape, rigid_shape
from turnbuckle.scene.definitions import RigidDef

HERE = Path()
ROUND = {"radius": 0.3, "length": 0.8}
BOX = (0.2, 0.5, 0.7)


def rigid(**fields: object) -> RigidShape:
    return rigid_shape(RigidDef(name="body", **fields), HERE)


def closed_forms() -> dict[str, tuple[dict, float, np.ndarray]]:
    """Fields, volume, and the principal moments for a density of one, written down from a table of moments."""
    a, b, c = BOX
    r, h = 0.3, 0.8
    ball = 4 / 3 * np.pi * r**3
    rod = np.pi * r**2 * h
    across = rod * (r**2 / 4 + h**2 / 12) + ball * (2 / 5 * r**2 + h**2 / 4 + 3 / 8 * h * r)
    return {
        "box": ({"box": BOX}, a * b * c, a * b * c / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])),
        "sphere": ({"sphere": r}, ball, np.full(3, 2 / 5 * ball * r**2)),
        "cylinder": (
            {"cylinder": ROUND},
            rod,
            np.array([rod * (r**2 / 4 + h**2 / 12)] * 2 + [rod * r**2 / 2]),
        ),
        "capsule": (
            {"capsule": ROUND},
            rod + ball,
            np.array([across, across, rod * r**2 / 2 + ball * 2 / 5 * r**2]),
        ),
    }


@pytest.mark.parametrize("name", ["box", "sphere", "cylinder", "capsule"])
def test_primitives_have_their_closed_forms(name: str) -> None:
    fields, volume, moments = closed_forms()[name]
    shape = rigid(**fields, density=700.0)
    assert shape.mass == pytest.approx(700.0 * volume, rel=1e-14)
    assert np.abs(shape.center).max() == 0.0
    np.testing.assert_allclose(shape.inertia, np.diag(700.0 * moments), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", ["box", "sphere", "cylinder", "capsule"])
def test_surfaces_are_watertight_outward_and_converge_to_the_closed_form(name: str) -> None:
    make = {
        "box": lambda n: box_surface(BOX),
        "sphere": lambda n: sphere_surface(0.3, n),
        "cylinder": lambda n: cylinder_surface(0.3, 0.8, n),
        "capsule": lambda n: capsule_surface(0.3, 0.8, n),
    }[name]
    _, volume, moments = closed_forms()[name]
    error = []
    for around in (32, 64):
        vertices, triangles = make(around)
        mesh = trimesh.Trimesh(vertices, triangles, process=False)
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.euler_number == 2
        mass, center, inertia = mass_properties(vertices, triangles, 1.0)
        assert np.abs(center).max() < 1e-15
        error.append(max(abs(mass / volume - 1), np.abs(np.diag(inertia) / moments - 1).max()))
    if name == "box":
        assert max(error) < 1e-14
    else:  # an inscribed polyhedron: second order in the angle
        assert error[0] < 0.03
        assert 3.8 < error[0] / error[1] < 4.2


def asymmetric_mesh() -> tuple[np.ndarray, np.ndarray]:
    """A closed surface without any symmetry: a sphere bent and stretched."""
    vertices, triangles = sphere_surface(0.4, 24)
    x, y, z = vertices.T
    return np.stack([x * (1 + 0.5 * z) + 0.3 * y * y, 0.7 * y + 0.2 * x, 1.4 * z - x * x], axis=1), triangles


def test_meshes_agree_with_trimesh() -> None:
    vertices, triangles = asymmetric_mesh()
    shape = rigid(vertices=vertices, triangles=triangles, density=850.0)
    other = trimesh.Trimesh(vertices, triangles, process=False)
    other.density = 850.0
    assert shape.mass == pytest.approx(other.mass, rel=1e-12)
    np.testing.assert_allclose(shape.center, other.center_mass, atol=1e-13)
    np.testing.assert_allclose(shape.inertia, other.moment_inertia, rtol=1e-11, atol=1e-11)


def test_a_cavity_takes_its_mass_away() -> None:
    outer, faces = sphere_surface(0.5, 32)
    inner = 0.6 * outer + (0.05, 0.0, 0.0)
    hollow = mass_properties(np.r_[outer, inner], np.r_[faces, faces[:, ::-1] + len(outer)], 1.0)
    full, hole = mass_properties(outer, faces, 1.0), mass_properties(inner, faces, 1.0)
    assert hollow[0] == pytest.approx(full[0] - hole[0], rel=1e-13)
    np.testing.assert_allclose(hollow[0] * hollow[1], full[0] * full[1] - hole[0] * hole[1], atol=1e-15)


def test_moving_and_turning_a_mesh_moves_and_turns_its_moments() -> None:
    vertices, triangles = asymmetric_mesh()
    mass, center, inertia = mass_properties(vertices, triangles, 3.0)
    generator = np.random.default_rng(4)
    for far in (1.0, 1e4):
        turn = Rotation.random(random_state=generator).as_matrix()
        shift = far * generator.standard_normal(3)
        moved = mass_properties(vertices @ turn.T + shift, triangles, 3.0)
        assert moved[0] == pytest.approx(mass, rel=1e-12 * far)
        np.testing.assert_allclose(moved[1], turn @ center + shift, atol=1e-13 * far)
        np.testing.assert_allclose(moved[2], turn @ inertia @ turn.T, rtol=0, atol=1e-12 * far * np.trace(inertia))


def test_a_compound_is_the_union_of_its_parts() -> None:
    """A box cut in two, each half turned and moved to its place, has the moments of the box."""
    a, b, c = BOX
    whole = rigid(box=BOX, density=500.0)
    halves = rigid(
        density=500.0,
        parts=[
            {"box": (b, a, c / 2), "position": (0, 0, c / 4), "rotation": (0, 0, np.pi / 2)},
            {"box": (c / 2, b, a), "position": (0, 0, -c / 4), "rotation": (0, np.pi / 2, 0), "density": 500.0},
        ],
    )
    assert halves.mass == pytest.approx(whole.mass, rel=1e-14)
    np.testing.assert_allclose(halves.center, whole.center, atol=1e-15)
    np.testing.assert_allclose(halves.inertia, whole.inertia, atol=1e-13)
    np.testing.assert_allclose(np.ptp(halves.vertices, axis=0), BOX, atol=1e-14)


def test_a_compound_with_densities_agrees_with_its_integral() -> None:
    """A dumb-bell of a steel and a wooden ball on a rod; the moments by summing the parts' second moments about 0."""
    balls = [((0.0, 0.0, 0.6), 0.2, 7800.0), ((0.1, 0.0, -0.6), 0.3, 600.0)]
    shape = rigid(
        density=1000.0,
        parts=[
            *({"sphere": r, "position": p, "density": rho} for p, r, rho in balls),
            {"cylinder": {"radius": 0.05, "length": 0.7}},
        ],
    )
    second, first, mass = np.zeros((3, 3)), np.zeros(3), 0.0
    for p, r, rho in balls:
        m = rho * 4 / 3 * np.pi * r**3
        mass, first = mass + m, first + m * np.array(p)
        second += m * (np.outer(p, p) + r**2 / 5 * np.eye(3))
    m = 1000.0 * np.pi * 0.05**2 * 0.7
    mass += m
    second += m * np.diag([0.05**2 / 4, 0.05**2 / 4, 0.7**2 / 12])
    second -= np.outer(first, first) / mass
    assert shape.mass == pytest.approx(mass, rel=1e-13)
    np.testing.assert_allclose(shape.center, first / mass, atol=1e-14)
    np.testing.assert_allclose(shape.inertia, np.trace(second) * np.eye(3) - second, atol=1e-10)


def test_a_given_mass_scales_the_density_and_given_moments_are_taken() -> None:
    plain, heavy = rigid(box=BOX, density=1000.0), rigid(box=BOX, mass=5.0)
    assert heavy.mass == 5.0
    np.testing.assert_allclose(heavy.inertia / 5.0, plain.inertia / plain.mass, rtol=1e-14)
    given = rigid(box=BOX, mass=5.0, inertia=(1.0, 2.0, 2.5), center=(0.01, 0.0, 0.02))
    np.testing.assert_array_equal(given.inertia, np.diag([1.0, 2.0, 2.5]))
    np.testing.assert_array_equal(given.center, (0.01, 0.0, 0.02))


def test_scale_is_of_coordinates() -> None:
    plain = rigid(capsule=ROUND, density=10.0, markers=[[0, 0, 1.0]])
    large = rigid(capsule=ROUND, density=10.0, markers=[[0, 0, 1.0]], scale=2.0)
    assert large.mass == pytest.approx(8.0 * plain.mass, rel=1e-14)
    np.testing.assert_allclose(large.inertia, 32.0 * plain.inertia, rtol=1e-14)
    np.testing.assert_allclose(large.vertices, 2.0 * plain.vertices, atol=1e-15)


def test_markers_come_first_and_triangles_follow() -> None:
    shape = rigid(sphere=0.5, markers=[[0, 0, 2.0], [0, 3.0, 0]])
    np.testing.assert_array_equal(shape.vertices[:2], [[0, 0, 2.0], [0, 3.0, 0]])
    assert shape.triangles.min() == 2
    np.testing.assert_allclose(np.linalg.norm(shape.vertices[2:], axis=1), 0.5, rtol=1e-14)


def cube() -> tuple[np.ndarray, np.ndarray]:
    return box_surface((1.0, 1.0, 1.0))


def two_cubes_on_an_edge() -> tuple[np.ndarray, np.ndarray]:
    vertices, triangles = cube()
    return np.r_[vertices, vertices + (1.0, 1.0, 0.0)], np.r_[triangles, triangles + 8]


def one_of_two_inverted() -> tuple[np.ndarray, np.ndarray]:
    vertices, triangles = cube()
    return np.r_[vertices, 0.5 * vertices + (3.0, 0.0, 0.0)], np.r_[triangles, triangles[:, ::-1] + 8]


def one_triangle_turned() -> tuple[np.ndarray, np.ndarray]:
    vertices, triangles = cube()
    triangles = triangles.copy()
    triangles[3] = triangles[3][::-1]
    return vertices, triangles


def flattened() -> tuple[np.ndarray, np.ndarray]:
    vertices, triangles = cube()
    return vertices * (1.0, 1.0, 1e-16), triangles


WRONG = {
    "open": (lambda: (cube()[0], cube()[1][:-1]), "not closed: 3 open edges"),
    "inverted": (lambda: (cube()[0], cube()[1][:, ::-1]), "is inverted: .* turn its triangles round"),
    "inverted part": (one_of_two_inverted, r"inverted in parts \(12 triangles\)"),
    "turned triangle": (one_triangle_turned, "disagree about outside.* make its normals point outwards"),
    "flat": (flattened, "encloses no volume"),
    "touching": (two_cubes_on_an_edge, "touches itself: 4 triangles share the edge near"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_mesh_is_one_sentence_that_names_the_body(kind: str) -> None:
    make, text = WRONG[kind]
    vertices, triangles = make()
    with pytest.raises(InputError, match=f"body 'body': surface: .*{text}") as error:
        rigid(vertices=vertices, triangles=triangles)
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match=r"parts\[1\]: surface"):
        rigid(parts=[{"sphere": 1.0}, {"vertices": vertices, "triangles": triangles}])


def test_an_open_mesh_with_its_moments_given_is_taken() -> None:
    vertices, triangles = cube()
    moments = {"mass": 2.0, "inertia": (1.0, 1.0, 1.0), "center": (0.0, 0.0, 0.1)}
    shape = rigid(vertices=vertices, triangles=triangles[:-1], **moments)
    assert shape.mass == 2.0 and len(shape.triangles) == 11


def test_mesh_files_are_read_and_split_vertices_welded(tmp_path: Path) -> None:
    vertices, triangles = asymmetric_mesh()
    trimesh.Trimesh(vertices, triangles, process=False).export(tmp_path / "body.ply")
    trimesh.Trimesh(vertices, triangles, process=False).export(tmp_path / "body.stl")  # single precision, corners apart
    wanted = rigid(vertices=vertices, triangles=triangles)
    for name, accuracy in (("body.ply", 1e-6), ("body.stl", 1e-6)):
        shape = rigid_shape(RigidDef(name="body", mesh=name), tmp_path)
        np.testing.assert_allclose(shape.inertia, wanted.inertia, rtol=accuracy, atol=accuracy * wanted.mass)
    apart = rigid(vertices=vertices[triangles.ravel()], triangles=np.arange(triangles.size).reshape(-1, 3))
    np.testing.assert_allclose(apart.inertia, wanted.inertia, rtol=1e-12, atol=1e-12)


def test_a_missing_mesh_names_body_and_file() -> None:
    with pytest.raises(InputError, match=r"body 'body': mesh gone.obj: there is no such file"):
        rigid(mesh="gone.obj")
