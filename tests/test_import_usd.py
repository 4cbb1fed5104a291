"""USD: scenes go there and back without loss, other programs' edits count, and other programs' files are understood."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import turnbuckle
from turnbuckle.cli.app import app
from turnbuckle.data.errors import InputError
from turnbuckle.scenes import REGISTRY

pytest.importorskip("pxr.Usd")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics  # noqa: E402


def machine() -> turnbuckle.Scene:
    """One of each joint that UsdPhysics knows, soft bodies, and one of each constraint of points."""
    scene = turnbuckle.Scene("machine", dt=2e-3, up_axis="Y", gravity=[0, -3, 1])
    for i, name in enumerate(["a", "b", "c", "d", "e", "f", "g", "h", "i", "k"]):
        scene.add_rigid(
            name,
            box=[0.2, 0.3, 0.1],
            position=[i, 0.1, 0.2],
            rotation=[0.1 * i, 0.2, 0.3],
            density=700 + i,
            color=[1, 0, 0],
        )
    scene.add_rigid(
        "lump", parts=[{"sphere": 0.1}, {"capsule": {"radius": 0.1, "length": 0.3}, "position": [0.1, 0, 0],
                                          "rotation": [0, 1, 0]}], position=[0, 3, 0], velocity=[1, 2, 3],
        angular_velocity=[0.1, 0.2, 0.3], inertia=[0.2, 0.3, 0.4], linear_damping=0.1,
    )  # fmt: skip
    motor = {"on": "twist", "target_velocity": 2.0, "max_force": 5.0}
    scene.add_joint("revolute", "hinge", body0="a", body1="b", anchor=[0.5, 0, 0], axis=[1, 2, 3], lower_limit=-0.5,
                    upper_limit=1.0, motor=motor, break_force=100.0)  # fmt: skip
    scene.add_joint("prismatic", "rail", body0="b", body1="c", anchor=[1.5, 0, 0], axis=[0, 1, 1], upper_limit=0.4)
    scene.add_joint("ball", "ball", body0="c", body1="d", anchor=[2.5, 0, 0])
    scene.add_joint("cone_twist", "hip", body0="d", body1="e", anchor=[3.5, 0, 0], axis=[1, 0, 0], cone=0.7)
    scene.add_joint("weld", "weld", body0="e", body1="f", anchor=[4.5, 0, 0])
    scene.add_joint("cylindrical", "tube", body0="f", body1="g", anchor=[5.5, 0, 0], axis=[0, 0, 1], lower_limit=-0.1)
    scene.add_joint("planar", "table", body0="g", body1="h", anchor=[6.5, 0, 0], axis=[0, 1, 0])
    scene.add_joint(
        "distance", "rod", body0="h", body1="i", local_pos0=[0, 0, 0], local_pos1=[0, 0, 0], min=0.1, max=1.5
    )
    scene.add_joint("ball", "wall", body1="k", anchor=[9.5, 0, 0], enabled=False)
    scene.add_rope("rope", start=[0, 2, 0], end=[1, 2, 0], segments=4)
    scene.add_solid("cube", box={"size": [1, 1, 1], "cells": [1, 1, 1]}, position=[3, 2, 0])
    scene.add_cloth("cloth", size=[1, 1], cells=[2, 2], position=[6, 2, 0])
    scene.add_constraint("nail", "nail", points={"body": "rope", "index": 0})
    scene.add_constraint(
        "attach", "glue", points={"body": "rope", "index": 4}, to={"body": "cube", "nearest": "triangle"}
    )
    scene.add_constraint(
        "points_to_point", "knot", groups=[[{"body": "cloth", "index": 0}, {"body": "rope", "index": 2}]]
    )
    scene.add_constraint("velocity", "winch", points={"body": "cloth", "index": 4}, goal=[0, 0, 0.1])
    scene.add_force("wind", body="cloth", expression=["sin(t)", 0, 0])
    return scene


@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_there_and_back(tmp_path: Path, suffix: str) -> None:
    scene = machine()
    notes = turnbuckle.export_scene(scene, tmp_path / f"m.{suffix}")
    found = turnbuckle.import_scene(tmp_path / f"m.{suffix}")
    assert found.left_out == [] and found.scene.to_yaml() == scene.to_yaml()
    for word in ("winch", "wind", "lump"):
        assert any(word in note for note in notes), notes


@pytest.mark.parametrize("name", ["four_bars", "puppet", "bricard", "monocycle", "hung_and_hit", "mixed_stack"])
def test_ready_scenes_there_and_back(tmp_path: Path, name: str) -> None:
    scene = REGISTRY[name]()
    turnbuckle.export_scene(scene, tmp_path / "s.usdc")
    assert turnbuckle.import_scene(tmp_path / "s.usdc").scene.to_yaml() == scene.to_yaml()


def test_standard_attributes_alone_give_the_same_mechanism(tmp_path: Path) -> None:
    """Without what Turnbuckle adds, as another program would hand it on: joints of the same kinds that hold at the start."""
    scene = machine()
    turnbuckle.export_scene(scene, tmp_path / "m.usda")
    stage = Usd.Stage.Open(str(tmp_path / "m.usda"))
    for prim in list(stage.Traverse()):
        for attribute in prim.GetAttributes():
            if attribute.GetName().startswith("turnbuckle:"):
                prim.RemoveProperty(attribute.GetName())
    stage.GetRootLayer().Export(str(tmp_path / "plain.usda"))
    found = turnbuckle.import_scene(tmp_path / "plain.usda")
    joints = {c.name: c for c in found.scene.definition.constraints}
    kinds = {"hinge": "revolute", "rail": "prismatic", "ball": "ball", "hip": "cone_twist", "weld": "weld",
             "tube": "cylindrical", "table": "planar", "rod": "distance", "wall": "ball"}  # fmt: skip
    assert {name: joint.type for name, joint in joints.items()} == kinds
    hinge = joints["hinge"]
    assert np.allclose(hinge.axis / np.linalg.norm(hinge.axis), np.array([1, 2, 3]) / 14**0.5, atol=1e-6)
    assert (hinge.lower_limit, hinge.upper_limit) == pytest.approx((-0.5, 1.0), abs=1e-5)
    assert hinge.motor.target_velocity == pytest.approx(2.0) and hinge.motor.max_force == 5.0
    assert hinge.break_force == 100.0 and joints["wall"].enabled is False and joints["hip"].cone == pytest.approx(0.7)
    assert joints["rod"].max == 1.5 and joints["tube"].lower_limit == pytest.approx(-0.1)
    assert np.allclose(found.scene.definition.gravity, [0, -3, 1], atol=1e-6)
    simulations = [turnbuckle.Simulation(s) for s in (_rigid_only(scene), found.scene)]
    for simulation in simulations:
        for name in kinds:
            assert max(simulation.joint_residual(name)) < (0.6 if name == "rod" else 1e-5), name
    for body in "abcdefghik":
        (xa, qa), (xb, qb) = (s.pose(body) for s in simulations)
        assert np.allclose(xa, xb, atol=1e-6) and abs(np.dot(qa, qb)) > 1 - 1e-9
    masses = [simulation.model.rigid.mass for simulation in simulations]
    assert np.allclose(*masses, rtol=1e-6)
    assert np.allclose(simulations[0].model.rigid.inertia, simulations[1].model.rigid.inertia, rtol=1e-5)
    assert any("winch" in text or "attach" in text.lower() for text in found.left_out)


def _rigid_only(scene: turnbuckle.Scene) -> turnbuckle.Scene:
    kept = [b for b in scene.definition.bodies if b.type == "rigid"]
    joints = [c for c in scene.definition.constraints if hasattr(c, "body1")]
    fields = {"up_axis": "Y", "gravity": scene.definition.gravity, "bodies": kept, "constraints": joints}
    return turnbuckle.Scene.from_definition(type(scene.definition)(**fields))


def test_what_another_program_changed_counts(tmp_path: Path) -> None:
    turnbuckle.export_scene(machine(), tmp_path / "m.usda")
    stage = Usd.Stage.Open(str(tmp_path / "m.usda"))
    stage.GetPrimAtPath("/World/a").GetAttribute("xformOp:translate").Set(Gf.Vec3d(7, 8, 9))
    UsdPhysics.MassAPI(stage.GetPrimAtPath("/World/lump")).GetMassAttr().Set(50.0)
    UsdPhysics.RevoluteJoint(stage.GetPrimAtPath("/World/constraints/hinge")).GetUpperLimitAttr().Set(90.0)
    stage.GetPrimAtPath("/World/constraints/nail").GetAttribute("omniphysics:attachmentEnabled").Set(False)
    stage.GetRootLayer().Save()
    found = turnbuckle.import_scene(tmp_path / "m.usda")
    bodies = {b.name: b for b in found.scene.definition.bodies}
    constraints = {c.name: c for c in found.scene.definition.constraints}
    assert np.allclose(bodies["a"].position, [7, 8, 9]) and list(bodies["a"].color) == [1, 0, 0]
    assert bodies["lump"].mass == 50.0 and bodies["lump"].linear_damping == 0.1 and len(bodies["lump"].parts) == 2
    assert constraints["nail"].enabled is False
    told = "\n".join(found.left_out)
    assert "body 'a': was changed" in told and "body 'lump': was changed" in told and "'b'" not in told


def test_attachments_say_where(tmp_path: Path) -> None:
    """Indices and coordinates of an attachment, with the points of the prims they name, are the places of the scene."""
    scene = machine()
    turnbuckle.export_scene(scene, tmp_path / "m.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "m.usdc"))
    nail, glue, knot = (stage.GetPrimAtPath(f"/World/constraints/{n}") for n in ("nail", "glue", "knot"))
    kinds = ["OmniPhysicsVtxXformAttachment", "OmniPhysicsVtxTriAttachment", "OmniPhysicsVtxVtxAttachment"]
    assert [p.GetTypeName() for p in (nail, glue, knot)] == kinds

    def value(prim: Usd.Prim, name: str) -> np.ndarray:
        return np.array(prim.GetAttribute(f"omniphysics:{name}").Get())

    assert value(nail, "stiffness") == np.inf and value(nail, "vtxIndicesSrc0").tolist() == [0]
    assert np.allclose(value(nail, "localPositionsSrc1"), [[0, 2, 0]])
    simulation = turnbuckle.Simulation(scene)
    (target,) = glue.GetRelationship("omniphysics:src1").GetTargets()
    solid = UsdGeom.TetMesh(stage.GetPrimAtPath(target))
    corners = np.array(solid.GetSurfaceFaceVertexIndicesAttr().Get())[value(glue, "triIndicesSrc1")[0]]
    place = value(glue, "triCoordsSrc1")[0] @ np.array(solid.GetPointsAttr().Get())[corners]
    cube = simulation.positions("cube")
    end = simulation.positions("rope")[4]
    assert np.linalg.norm(place - end) <= np.linalg.norm(cube - end, axis=1).min() + 1e-6
    assert value(knot, "vtxIndicesSrc0").tolist() == [0] and value(knot, "vtxIndicesSrc1").tolist() == [2]


def foreign(path: Path) -> Usd.Stage:
    """In centimetres, Y up, nested and scaled, as programs for animation write."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    world = UsdGeom.Xform.Define(stage, "/Scene")
    world.AddTranslateOp().Set(Gf.Vec3d(100, 0, 0))
    world.AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    for name, x in (("box", 0.0), ("ball", 50.0)):
        body = UsdGeom.Xform.Define(stage, f"/Scene/{name}")
        body.AddTranslateOp().Set(Gf.Vec3d(x, 10, 0))
        UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    cube = UsdGeom.Cube.Define(stage, "/Scene/box/shape")
    cube.CreateSizeAttr(10.0)
    cube.AddScaleOp().Set(Gf.Vec3f(1, 2, 3))
    ball = UsdGeom.Sphere.Define(stage, "/Scene/ball/shape")
    ball.CreateRadiusAttr(5.0)
    floor = UsdGeom.Plane.Define(stage, "/Scene/floor")
    floor.CreateAxisAttr("Y")
    for shape in (cube, ball, floor):
        UsdPhysics.CollisionAPI.Apply(shape.GetPrim())
    UsdPhysics.MassAPI.Apply(stage.GetPrimAtPath("/Scene/box")).CreateDensityAttr(0.001)  # kg per cm^3
    hinge = UsdPhysics.RevoluteJoint.Define(stage, "/Scene/hinge")
    hinge.CreateBody0Rel().SetTargets(["/Scene/box"])
    hinge.CreateBody1Rel().SetTargets(["/Scene/ball"])
    hinge.CreateAxisAttr("Z")
    hinge.CreateLocalPos0Attr(Gf.Vec3f(25, 0, 0))
    hinge.CreateLocalPos1Attr(Gf.Vec3f(-25, 0, 0))
    hinge.CreateLocalRot1Attr(Gf.Quatf(float(np.cos(0.1)), 0, 0, float(np.sin(0.1))))
    hinge.CreateLowerLimitAttr(-30.0)
    hinge.CreateUpperLimitAttr(30.0)
    gear = stage.DefinePrim("/Scene/gear", "PhysxPhysicsGearJoint")
    gear.CreateAttribute("x", Sdf.ValueTypeNames.Float)
    cloth = UsdGeom.Mesh.Define(stage, "/Scene/cloth").GetPrim()
    cloth.SetMetadata("apiSchemas", Sdf.TokenListOp.CreateExplicit(["PhysxParticleClothAPI"]))
    UsdPhysics.MaterialAPI.Apply(stage.DefinePrim("/Scene/rubber"))
    stage.GetRootLayer().Save()
    return stage


def test_units_scales_and_frames_of_another_program(tmp_path: Path) -> None:
    foreign(tmp_path / "f.usda")
    found = turnbuckle.import_scene(tmp_path / "f.usda")
    scene = found.scene.definition
    bodies = {b.name: b for b in scene.bodies}
    assert scene.up_axis == "Y"
    assert np.allclose(bodies["box"].position, [1.0, 0.2, 0]) and np.allclose(bodies["ball"].position, [2.0, 0.2, 0])
    assert np.allclose(bodies["box"].box, [0.2, 0.4, 0.6]) and bodies["ball"].sphere == pytest.approx(0.1)
    assert bodies["box"].density == pytest.approx(1000.0)
    (hinge,) = scene.constraints
    assert hinge.type == "revolute" and np.allclose(hinge.axis, [0, 0, 1], atol=1e-6)
    # The frames are 0.2 rad apart at the start: limits count from there.
    assert (hinge.lower_limit, hinge.upper_limit) == pytest.approx(
        (np.radians(-30) - 0.2, np.radians(30) - 0.2), abs=1e-5
    )
    told = "\n".join(found.left_out)
    for word in ("/Scene/cloth", "/Scene/rubber", "/Scene/gear"):
        assert word in told, told


def test_floor_faces_along_its_axis(tmp_path: Path) -> None:
    foreign(tmp_path / "f.usda")
    floor = next(b for b in turnbuckle.import_scene(tmp_path / "f.usda").scene.definition.bodies if b.name == "floor")
    from scipy.spatial.transform import Rotation

    assert np.allclose(Rotation.from_rotvec(np.array(floor.rotation)).apply([0, 0, 1]), [0, 1, 0])


def test_the_command_and_wrong_files(tmp_path: Path) -> None:
    invoke = CliRunner().invoke
    out = tmp_path / "four_bars.usda"
    done = invoke(app, ["export", "four_bars", "--to", "usda", "--out", str(out)])
    assert done.exit_code == 0 and UsdPhysics.RevoluteJoint(
        Usd.Stage.Open(str(out)).GetPrimAtPath("/World/constraints/ground_0")
    ) is not None, done.output  # fmt: skip
    back = invoke(app, ["import", str(out), str(tmp_path / "back.yaml")])
    assert back.exit_code == 0 and "left out" not in back.stdout, back.output
    (tmp_path / "broken.usda").write_text("#usda 1.0\n{{{")
    (tmp_path / "empty.usda").write_text("#usda 1.0\n")
    (tmp_path / "broken.usdc").write_bytes(out.read_bytes()[:100])
    for name in ("broken.usda", "empty.usda", "broken.usdc", "none.usdc"):
        result = invoke(app, ["import", str(tmp_path / name), str(tmp_path / "x.yaml")])
        assert result.exit_code == 2 and name in result.stderr and "\n" not in result.stderr.strip(), (
            name,
            result.output,
        )
    scene = turnbuckle.Scene("s")
    scene.add_rope("r", start=[0, 0, 0], end=[1, 0, 0], segments=2)
    scene.add_force("f", callable=lambda x, v, t, mass: 0 * x)
    for path in (tmp_path / "a.usda", tmp_path / "no" / "a.usda", tmp_path / "a.step"):
        with pytest.raises(InputError):
            turnbuckle.export_scene(scene, path)


def test_attachments_to_rigid_bodies_and_nets_say_where(tmp_path: Path) -> None:
    """Places in the frame of a rigid body, and vertices of curves that repeat the knots of a net."""
    scene = turnbuckle.Scene("mixed")
    scene.add_rigid("brick", box=[1, 1, 1], position=[0, 0, 3], rotation=[0, 0.5, 0], markers=[[0.5, 0.5, 0.5]])
    scene.add_net("net", size=[1, 1], cells=[2, 2], position=[0, 0, 1])
    scene.add_rope("rope", start=[0, 0, 4], end=[1, 0, 4], segments=2)
    corner = {"body": "brick", "index": 0}
    scene.add_constraint(
        "points_to_point", "knots", groups=[[{"body": "net", "index": 5}, corner, {"body": "rope", "index": 1}]]
    )
    turnbuckle.export_scene(scene, tmp_path / "m.usda")
    stage = Usd.Stage.Open(str(tmp_path / "m.usda"))
    parts = [p for p in stage.Traverse() if "Attachment" in p.GetTypeName()]
    assert sorted(p.GetTypeName() for p in parts) == ["OmniPhysicsVtxVtxAttachment", "OmniPhysicsVtxXformAttachment"]
    simulation = turnbuckle.Simulation(scene)
    for prim in parts:
        source, target = (
            stage.GetPrimAtPath(prim.GetRelationship(f"omniphysics:src{k}").GetTargets()[0]) for k in (0, 1)
        )
        vertex = prim.GetAttribute("omniphysics:vtxIndicesSrc0").Get()[0]
        assert np.allclose(UsdGeom.PointBased(source).GetPointsAttr().Get()[vertex], simulation.positions("net")[5])
        if prim.GetTypeName() == "OmniPhysicsVtxXformAttachment":
            assert target.GetName() == "brick"
            assert np.allclose(prim.GetAttribute("omniphysics:localPositionsSrc1").Get()[0], [0.5, 0.5, 0.5], atol=1e-6)
    found = turnbuckle.import_scene(tmp_path / "m.usda")
    assert found.left_out == [] and found.scene.to_yaml() == scene.to_yaml()
