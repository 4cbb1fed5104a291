"""Rigid bodies in recordings: transforms in USD, own frames and flags in the formats that keep the whole run."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from turnbuckle.data.shape import Shape
from turnbuckle.geometry.fit import fit_pose
from turnbuckle.io import open_recorder, read_recording
from turnbuckle.scene.build_rigid import rigid_shape
from turnbuckle.scene.definitions import RigidDef
from turnbuckle.viewer.camera import Framing
from turnbuckle.viewer.geometry import SceneGeometry
from turnbuckle.viewer.render import Renderer

BODY = rigid_shape(RigidDef(name="wheel", cylinder={"radius": 0.4, "length": 0.1}, markers=[[0, 0, 2.0]]), Path())
SHAPE = Shape("wheel", 1, 1 + len(BODY.vertices), triangles=BODY.triangles, local=BODY.vertices, color=(0.1, 0.2, 0.3))


def placed(frame: int) -> tuple[Rotation, np.ndarray, np.ndarray]:
    """Turned by 0.5 rad a frame about a slanted axis; the point before the body's is another body's."""
    turn = Rotation.from_rotvec(0.5 * frame * np.array([0.6, 0.0, 0.8]))
    origin = np.array([0.1 * frame, -2.0, 1.0 + frame])
    return turn, origin, np.r_[np.zeros((1, 3)), turn.apply(BODY.vertices) + origin]


def test_a_pose_is_found_from_points() -> None:
    for frame in range(12):
        turn, origin, x = placed(frame)
        found, xyzw = fit_pose(BODY.vertices, x[1:])
        np.testing.assert_allclose(found, origin, atol=1e-14)
        assert (Rotation.from_quat(xyzw) * turn.inv()).magnitude() < 1e-14
    flat = BODY.vertices * (1.0, 1.0, 0.0)  # in one plane
    found, xyzw = fit_pose(flat, turn.apply(flat) + origin)
    assert (Rotation.from_quat(xyzw) * turn.inv()).magnitude() < 1e-13


def test_usd_has_a_still_mesh_and_a_transform_that_moves(tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdPhysics

    assert pxr
    with open_recorder(tmp_path / "run.usdc", [SHAPE], up_axis="Z", frames_per_second=10.0) as recorder:
        for frame in range(12):
            x = placed(frame)[2]
            recorder.write(frame / 10.0, x, 0 * x)
    stage = Usd.Stage.Open(str(tmp_path / "run.usdc"))
    prim, mesh = stage.GetPrimAtPath("/World/wheel"), UsdGeom.Mesh(stage.GetPrimAtPath("/World/wheel/surface"))
    body = UsdPhysics.RigidBodyAPI(prim)
    assert prim.HasAPI(UsdPhysics.RigidBodyAPI) and body.GetKinematicEnabledAttr().Get()
    assert mesh.GetPointsAttr().GetNumTimeSamples() == 0
    local = np.array(mesh.GetPointsAttr().Get(), dtype=float)
    faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    orient = UsdGeom.Xformable(prim).GetOrderedXformOps()[1]
    last = None
    for frame in range(12):
        matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(mesh.GetPrim()))  # acts on rows
        world = np.c_[local, np.ones(len(local))] @ matrix
        corners = placed(frame)[2][1:][BODY.triangles]
        np.testing.assert_allclose(world[faces, :3], corners, atol=1e-6)
        q = orient.Get(frame)
        q = np.array([q.GetReal(), *q.GetImaginary()])
        assert last is None or q @ last > 0.0  # no jump between the two signs
        last = q


@pytest.mark.parametrize("name", ["run.npz", "run.vtkhdf"])
def test_own_frames_survive(tmp_path: Path, name: str) -> None:
    x = placed(3)[2]
    with open_recorder(tmp_path / name, [SHAPE], up_axis="Z", frames_per_second=10.0) as recorder:
        recorder.write(0.0, x, 0 * x)
    (back,) = read_recording(tmp_path / name).shapes
    np.testing.assert_array_equal(back.local, SHAPE.local)
    assert back.drawn and back.color == SHAPE.color


def with_floor(size: float, color: tuple[float, float, float] | None = None) -> tuple[list[Shape], np.ndarray]:
    """A wheel above a still, square plate of this size."""
    plate = rigid_shape(RigidDef(name="floor", box=[size, size, 0.2]), Path())
    wheel = BODY.vertices[1:] + (0.0, 0.0, 0.05)
    shapes = [
        Shape("wheel", 0, len(wheel), triangles=BODY.triangles - 1, local=BODY.vertices[1:]),
        Shape(
            "floor",
            len(wheel),
            len(wheel) + 8,
            triangles=plate.triangles,
            local=plate.vertices,
            still=True,
            color=color,
        ),
    ]
    return shapes, np.r_[wheel, plate.vertices - (0.0, 0.0, 0.1)]


def test_a_wide_floor_is_the_ground_and_does_not_move_the_camera_away() -> None:
    wide = SceneGeometry(*with_floor(50.0))
    assert wide.ground == pytest.approx(0.0, abs=1e-15) and len(wide.surface.cells) == len(BODY.triangles)
    shapes, x = with_floor(50.0, (0.5, 0.5, 0.5))  # painted: it is drawn, and cut by the picture's edge
    painted = SceneGeometry(shapes, x)
    assert painted.ground is None and len(painted.surface.cells) == len(BODY.triangles) + 12
    assert np.abs(painted.everything(x)).max() < 1.2
    table, y = with_floor(1.5)
    assert np.ptp(SceneGeometry(table, y).everything(y)[:, 0]) == pytest.approx(1.5)  # a table is shown whole
    assert np.ptp(SceneGeometry(shapes[1:], x).everything(x)[:, 0]) == pytest.approx(50.0)  # nothing else to look at


def test_the_simple_pictures_hide_the_backs_of_closed_bodies() -> None:
    """Each face that is seen fills its outline; by mean depth alone, backs of large triangles would cover fronts."""
    box = rigid_shape(RigidDef(name="box", box=[0.4, 0.6, 0.8]), Path())
    shapes = [Shape("box", 0, 8, triangles=box.triangles, local=box.vertices, color=(1.0, 0.0, 0.0))]
    size = (640, 400)
    picture = Renderer(shapes, "Z", size, engine="pillow").frame(box.vertices).astype(int)
    camera = Framing("Z", size, None).follow(box.vertices)
    wanted = []
    for face in ((4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5)):  # above, in front, to the right
        x, y = camera.project(box.vertices[list(face)], size)[0].T
        wanted.append(0.5 * abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)))
    red = picture[picture[..., 0] > picture[..., 2] + 60]
    shades = np.unique(red, axis=0, return_counts=True)[1]
    np.testing.assert_allclose(np.sort(shades)[-3:], np.sort(wanted), rtol=0.1)
