"""Contact as a scene says it: options, friction of pairs, who touches whom, the distance kept, materials."""

import json
from pathlib import Path

import numpy as np
import pytest

from turnbuckle.data.contact import ContactOptions, Surfaces
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.meshes.solids import sphere_surface
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.yaml_file import json_schema

SHEET = {"size": [1.0, 1.0], "cells": [4, 4]}


def built(scene: Scene) -> tuple[Model, Surfaces]:
    model, _ = scene.build()
    assert model.surfaces is not None
    return model, model.surfaces


def touching(scene: Scene, a: str, b: str) -> bool:
    model, surfaces = built(scene)
    names = [shape.name for shape in model.shapes]
    return bool(surfaces.collides[names.index(a), names.index(b)])


def test_off_unless_asked_for() -> None:
    for contact in (None, False):
        scene = Scene(contact=contact)
        scene.add_cloth("cloth", **SHEET)
        assert scene.build()[0].surfaces is None
        assert scene.definition.integrator == "verlet"


@pytest.mark.parametrize("contact", [True, {}])
def test_all_defaults_are_those_of_the_options(contact: object) -> None:
    scene = Scene(contact=contact)
    scene.add_cloth("cloth", **SHEET)
    model, _ = built(scene)
    assert model.contact == ContactOptions()
    assert model.integrator == "implicit_euler"


def test_an_integrator_that_is_given_stays() -> None:
    assert Scene(contact=True, integrator="verlet").definition.integrator == "verlet"


def test_options_reach_the_model_and_survive_a_file(tmp_path: Path) -> None:
    scene = Scene(contact={"delta": 2e-3, "solver": "ica", "friction_shape": "pyramid4", "halvings": 0, "newton": 3})
    scene.add_cloth("cloth", friction="silk", contact="self off", contact_delta=1e-3, **SHEET)
    scene.add_rigid("ball", sphere=0.2, position=[0, 0, 1], static_friction=0.8, dynamic_friction=0.5)
    scene.add_friction("silk", "ball", 0.2, 0.1)
    for suffix in (".yaml", ".gascuel"):
        scene.save(tmp_path / f"scene{suffix}")
        assert Scene.load(tmp_path / f"scene{suffix}").definition == scene.definition
    model, surfaces = built(scene)
    assert (model.contact.solver, model.contact.halvings, model.contact.newton) == ("ica", 0, 3)
    np.testing.assert_array_equal(surfaces.delta[surfaces.shape == 0], 1e-3)
    np.testing.assert_array_equal(surfaces.delta[surfaces.shape == 1], 2e-3)
    np.testing.assert_array_equal(surfaces.collides, [[False, True], [True, False]])
    np.testing.assert_allclose(surfaces.friction[0, 1], [0.2, 0.1])
    np.testing.assert_allclose(surfaces.friction[1, 0], [0.2, 0.1])


def test_set_from_the_command_line() -> None:
    scene = Scene()
    scene.add_cloth("cloth", **SHEET)
    scene.apply_set("contact.friction=0.7")
    scene.apply_set("bodies.cloth.contact=false")
    assert scene.definition.contact.friction == 0.7
    assert scene.definition.bodies[0].contact == "off"
    scene.apply_set("contact=false")
    assert scene.definition.contact is None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scene(contact={"solvr": "ica"}), "contact.solvr: unknown field, did you mean 'solver'"),
        (lambda: Scene(contact={"solver": "icaa"}), "contact.solver: expected newton, ica or anticipation"),
        (lambda: Scene(contact={"friction": -0.1}), "contact.friction: expected a number of at least 0"),
        (lambda: Scene(contact={"friction": 0.1, "dynamic_friction": 0.2}), "nothing slides so"),
        (lambda: Scene(contact={"ignore": [["a", "b"]]}), "contact.ignore[0].between[0]: there is no body 'a'"),
        (lambda: Scene(contact="yes"), "contact: expected a mapping of fields"),
        (lambda: Scene().add_cloth("c", contact="self", **SHEET), "cloth 'c', contact: expected on, off or others"),
        (lambda: Scene().add_obstacle("o", box=[1, 1, 1], plane=[1, 1]), "not box and plane together"),
        (lambda: Scene().add_obstacle("o"), "give exactly one of box"),
        (lambda: Scene().add_obstacle("o", frames=np.zeros((2, 3, 3))), "'frames' needs 'triangles' beside it"),
        (lambda: Scene().add_obstacle("o", box=[1, 1, 1], frame_rate=25), "frame_rate goes with sequence or frames"),
        (lambda: Scene().add_obstacle("o", box=[1, 1, 1], velocity=[1, 0, 0]), "give a trajectory"),
        (
            lambda: Scene().add_solid("s", box={"size": [1, 1, 1], "cells": [1, 1, 1]}, youngs_modulus=1e5, k_area=1),
            "k_area does not go with material: corotational",
        ),
        (
            lambda: Scene().add_solid("s", box={"size": [1, 1, 1], "cells": [1, 1, 1]}, poissons_ratio=0.5),
            "poissons_ratio: expected a number less than 0.5",
        ),
        (lambda: Scene().add_solid("s", box={"size": [1, 1, 1], "cells": [1, 1, 1]}, cage=5), "cage goes with mesh"),
    ],
)
def test_what_is_wrong_is_named(make: object, message: str) -> None:
    with pytest.raises(InputError) as caught:
        make()
    assert message in str(caught.value)


def test_a_friction_of_nothing_is_refused() -> None:
    scene = Scene()
    scene.add_cloth("cloth", friction="silk", **SHEET)
    with pytest.raises(InputError, match="no body and no material 'sylk', did you mean 'silk'"):
        scene.add_friction("sylk", "cloth", 0.2)
    assert scene.definition.frictions == []


def test_friction_of_pairs_goes_from_the_particular_to_the_general() -> None:
    scene = Scene(contact={"friction": 0.4, "dynamic_friction": 0.1})
    scene.add_cloth("a", friction="silk", **SHEET)
    scene.add_cloth("b", friction="silk", position=[0, 0, 1], **SHEET)
    scene.add_cloth("c", static_friction=0.9, position=[0, 0, 2], **SHEET)
    scene.add_cloth("d", position=[0, 0, 3], **SHEET)
    scene.add_friction("a", "b", 0.05)
    scene.add_friction("silk", "c", 0.3)
    scene.add_friction("silk", "silk", 0.2, 0.15)
    friction = built(scene)[1].friction
    np.testing.assert_allclose(friction[0, 1], [0.05, 0.05])  # two bodies before two materials, whatever the order
    np.testing.assert_allclose(friction[0, 0], [0.2, 0.15])
    np.testing.assert_allclose(friction[1, 2], [0.3, 0.3])
    np.testing.assert_allclose(friction[2, 3], [np.sqrt(0.9 * 0.4), np.sqrt(0.9 * 0.1)])  # geometric means
    np.testing.assert_allclose(friction[3, 3], [0.4, 0.1])
    np.testing.assert_array_equal(friction, friction.transpose(1, 0, 2))


def hinged(**contact: object) -> Scene:
    scene = Scene(contact=contact)
    for k in range(3):
        scene.add_rigid(f"link{k}", box=[0.1, 0.1, 1.0], position=[0, 0, -0.5 - k])
    scene.add_obstacle("ground", plane=[9, 9], position=[0, 0, -9])
    for k in range(2):
        scene.add_joint(
            "revolute", f"hinge{k}", body0=f"link{k}", body1=f"link{k + 1}", anchor=[0, 0, -1.0 - k], axis=[0, 1, 0]
        )
    return scene


def test_bodies_that_a_joint_joins_pass_each_other() -> None:
    scene = hinged()
    assert not touching(scene, "link0", "link1")
    assert touching(scene, "link0", "link2")
    assert touching(scene, "link2", "ground")
    assert not touching(scene, "link0", "link0")
    assert touching(hinged(jointed=True), "link0", "link1")
    scene.set_contact(collide=[["link0", "link1"]], ignore=[["link2", "ground"]])
    assert touching(scene, "link0", "link1")
    assert not touching(scene, "link2", "ground")


def test_a_coating_passes_its_kernel_and_what_is_jointed_to_it() -> None:
    scene = Scene(contact=True)
    scene.add_rigid("bone", capsule={"radius": 0.05, "length": 0.5})
    scene.add_rigid("next", capsule={"radius": 0.05, "length": 0.5}, position=[0, 0, 0.6])
    scene.add_rigid("far", sphere=0.1, position=[0, 0, 3])
    scene.add_coating("flesh", around="bone", thickness=0.05, friction="rubber", contact="others")
    scene.add_joint("ball", "joint", body0="bone", body1="next", anchor=[0, 0, 0.3])
    definition = scene.definition
    assert definition.bodies[3].friction == "rubber"
    scene.apply_set("integrator=verlet")
    assert not touching(scene, "flesh", "bone")
    assert not touching(scene, "flesh", "next")
    assert not touching(scene, "flesh", "flesh")
    assert touching(scene, "flesh", "far")


def test_nothing_scripted_touches_what_is_scripted() -> None:
    scene = Scene(contact=True)
    scene.add_obstacle("a", box=[1, 1, 1])
    scene.add_obstacle("b", box=[1, 1, 1], position=[0.5, 0, 0])
    scene.add_rigid("c", box=[1, 1, 1], motion="immobile", position=[0, 0.5, 0])
    scene.add_cloth("cloth", position=[0, 0, 2], **SHEET)
    scene.set_contact(collide=[["a", "b"]])
    _, surfaces = built(scene)
    np.testing.assert_array_equal(surfaces.collides[:3, :3], False)
    np.testing.assert_array_equal(surfaces.collides[3], True)


def test_the_distance_kept_follows_edges_size_and_what_moves() -> None:
    scene = Scene(contact=True)
    scene.add_cloth("cloth", size=[1.0, 1.0], cells=[50, 50], position=[0, 0, 1])
    scene.add_obstacle("ground", plane=[100, 100])
    scene.add_rigid("crate", box=[1.0, 1.0, 1.0], position=[0, 0, 3])
    _, surfaces = built(scene)
    middle = (np.abs(surfaces.positions(scene.build()[1].positions())[:, :2] - 0.5) < 0.4).all(axis=1)
    delta = surfaces.delta[(surfaces.shape == 0) & middle]
    # inside, vertices have 4 straight neighbours, and every other one 4 along diagonals
    np.testing.assert_allclose(np.unique(delta.round(9)), [0.002, 0.1 * 0.02 * (1 + np.sqrt(2)) / 2], rtol=1e-6)
    np.testing.assert_allclose(surfaces.delta[surfaces.shape == 2], 0.005 * np.sqrt(3.0))
    assert surfaces.delta[surfaces.shape == 1].max() <= np.median(surfaces.delta[surfaces.shape != 1])


def test_contact_acts_on_the_finer_surface_of_a_solid() -> None:
    vertices, triangles = sphere_surface(0.3, 24)
    scene = Scene(contact=True)
    scene.add_solid(
        "ball", vertices=vertices, triangles=triangles, cage=60, youngs_modulus=2e5, density=500.0, position=[0, 0, 1]
    )
    model, surfaces = built(scene)
    assert len(model.tetrahedra.corners) == 0
    assert 40 <= len(model.corotational.corners) <= 80
    np.testing.assert_array_equal(model.corotational.youngs_modulus, 2e5)
    np.testing.assert_array_equal(model.corotational.poissons_ratio, 0.3)
    assert len(surfaces.faces) == len(triangles)
    x = scene.build()[1].positions()
    np.testing.assert_allclose(
        np.sort(surfaces.positions(x), axis=0), np.sort(vertices + [0, 0, 1], axis=0), atol=1e-12
    )
    # the mass is that of the surface, not of the cells around it
    corner = vertices[triangles]
    volume = np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6.0
    np.testing.assert_allclose(model.mass.sum(), 500.0 * volume, rtol=1e-12)


def test_materials_stand_side_by_side() -> None:
    scene = Scene()
    cell = {"size": [1.0, 1.0, 1.0], "cells": [1, 1, 1]}
    scene.add_solid("jelly", box=cell, k_volume=7.0)
    scene.add_solid("rubber", box=cell, position=[2, 0, 0], material="corotational")
    scene.add_solid("steel", box=cell, position=[4, 0, 0], youngs_modulus=1e9, poissons_ratio=0.25, damping=1e-3)
    model, _ = scene.build()
    assert len(model.tetrahedra.corners) == 5
    assert model.tetrahedra.corners.max() < 8
    assert len(model.corotational.corners) == 10
    np.testing.assert_array_equal(model.corotational.youngs_modulus, np.repeat([1e5, 1e9], 5))
    np.testing.assert_array_equal(model.corotational.damping, np.repeat([0.0, 1e-3], 5))
    np.testing.assert_array_equal(model.corotational.rest, model.rest[model.corotational.corners])
    a, b, c = (model.corotational.rest[:, k] - model.corotational.rest[:, 0] for k in (1, 2, 3))
    assert (np.einsum("ij,ij->i", np.cross(a, b), c) > 0.0).all()


def test_hinges_of_a_garment_of_panels() -> None:
    """Two panels that share no vertex, one of them folded by 60 degrees: its hinge rests there."""
    cos, sin = np.cos(np.pi / 3), np.sin(np.pi / 3)
    flat = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]]
    folded = [[0, 0, 1], [1, 0, 1], [0, 1, 1], [0, -cos, 1 + sin]]
    scene = Scene()
    scene.add_cloth(
        "panels",
        vertices=np.array(flat + folded, dtype=float),
        triangles=[[0, 1, 2], [1, 0, 3], [4, 5, 6], [5, 4, 7]],
        bend_model="hinges",
        bend_stiffness=2e-4,
        bend_damping=1e-6,
        strain_limit=0.1,
    )
    model, _ = scene.build()
    assert len(model.hinges.points) == 2
    np.testing.assert_allclose(np.abs(model.hinges.angle), [0.0, np.pi / 3], atol=1e-12)
    np.testing.assert_array_equal(model.hinges.k, 2e-4)
    np.testing.assert_array_equal(model.hinges.k_d, 1e-6)
    assert len(model.springs.pairs) == 10, "no bending springs beside hinges"
    np.testing.assert_allclose(model.strain_limits.length, 1.1 * model.springs.length)


def test_bending_springs_have_a_damping_of_their_own() -> None:
    scene = Scene()
    scene.add_cloth(
        "cloth",
        bend_stiffness=1.0,
        bend_damping=0.5,
        damping=0.25,
        structural_stiffness=3.0,
        shear_stiffness=0,
        **SHEET,
    )
    springs = scene.build()[0].springs
    damping, stiffness = springs.k_d / springs.length**2, springs.k / springs.length**2
    np.testing.assert_allclose(damping[np.isclose(stiffness, 1.0)], 0.5)
    np.testing.assert_allclose(damping[np.isclose(stiffness, 3.0)], 0.25)


def test_ropes_and_nets_touch_by_their_lines() -> None:
    scene = Scene(contact=True)
    scene.add_rope("rope", start=[0, 0, 0], end=[1, 0, 0], segments=5)
    scene.add_net("net", size=[1, 1], cells=[2, 2], position=[0, 0, 1])
    _, surfaces = built(scene)
    assert len(surfaces.faces) == 0
    assert len(surfaces.edges) == 5 + 12
    assert (surfaces.edge_faces == -1).all()


def test_the_schema_knows_contact() -> None:
    schema = json_schema()
    text = json.dumps(schema)
    assert "contact" in schema["properties"] and "frictions" in schema["properties"]
    for name in ("ObstacleDef", "ContactDef", "FrictionDef", "youngs_modulus", "bend_model", "strain_limit"):
        assert name in text
