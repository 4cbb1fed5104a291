"""Assembly (Displacement, 2.3): trees, loops, redundant joints, limits, what cannot close, what must stay as it is."""

from pathlib import Path

import numpy as np
import pytest
from assembly_scenes import frames, hinge, largest_gap, place, thrown, tree
from scipy.spatial.transform import Rotation

from turnbuckle import InputError, Scene, assemble
from turnbuckle.scenes.bricard import bricard
from turnbuckle.scenes.closed_chain import closed_chain
from turnbuckle.scenes.monocycle import monocycle


@pytest.mark.parametrize("seed", range(6))
def test_bricard_from_parts_thrown_apart(seed: int) -> None:
    """A loop that is redundant by one row; the axes must end on one line and the loop closed."""
    scene = thrown(bricard(), 0.2, np.radians(40.0), seed)
    assert largest_gap(scene) > 0.3
    result, report = assemble(scene)
    assert report.closed and report.open == [] and report.gap < 1e-10 and report.angle < 1e-10
    assert largest_gap(result) < 1e-10


def test_bricard_is_fast() -> None:
    scene = thrown(bricard(), 0.2, np.radians(40.0), 1)
    assert min(assemble(scene)[1].seconds for _ in range(5)) < 0.2


def test_tree() -> None:
    result, report = assemble(thrown(tree(), 0.5, 1.0))
    assert report.closed and largest_gap(result) < 1e-10


def test_long_closed_loop() -> None:
    result, report = assemble(thrown(closed_chain(60), 0.2, 0.7))
    assert report.closed and largest_gap(result) < 1e-10


def test_monocycle_of_the_appendix() -> None:
    """Closed loops, angles to the world, and an angle of 9 that limits nothing."""
    result, report = assemble(thrown(monocycle(), 0.2, 0.5))
    assert report.closed and report.gap < 1e-10 and report.angle < 1e-10


def test_speeds_masses_and_all_else_stay() -> None:
    scene = tree()
    for d in scene.definition.bodies:
        assert d.type == "rigid"
    scene.definition = scene.definition.model_copy(
        update={
            "bodies": [
                d.model_copy(update={"velocity": np.array([1.0, 2, i]), "angular_velocity": np.array([0.3, 0, i])})
                for i, d in enumerate(scene.definition.bodies)
            ]
        }
    )
    result, _ = assemble(scene)
    for old, new in zip(scene.definition.bodies, result.definition.bodies, strict=True):
        assert old.model_copy(update={"position": new.position, "rotation": new.rotation}) == new
    assert result.definition.constraints == scene.definition.constraints


def test_what_is_closed_stays_bit_for_bit() -> None:
    scene = closed_chain(8)
    result, report = assemble(scene)
    assert result is scene and report.iterations == report.steps == 0


def test_same_input_same_bits() -> None:
    a, _ = assemble(thrown(bricard(), 0.2, 0.7))
    b, _ = assemble(thrown(bricard(), 0.2, 0.7))
    assert a.definition == b.definition


def test_heavy_bodies_move_less_than_light_ones() -> None:
    scene = Scene("pair")
    scene.add_rigid("heavy", sphere=0.1, mass=100.0)
    scene.add_rigid("light", sphere=0.1, mass=1.0, position=[1.0, 0, 0])
    scene.add_joint("ball", "both", body0="heavy", body1="light", local_pos0=[0, 0, 0], local_pos1=[0, 0, 0])
    result, report = assemble(scene)
    assert report.closed
    np.testing.assert_allclose(result.definition.bodies[0].position, [1.0 / 101.0, 0, 0], atol=1e-9)


def test_immobile_and_driven_bodies_stay() -> None:
    scene = Scene("held")
    scene.add_rigid("wall", box=[1.0, 1, 1], motion="immobile", position=[0.0, 0, 1])
    scene.add_rigid("arm", box=[1.0, 0.1, 0.1], position=[3.0, 0, 0], rotation=[0.0, 0.4, 0])
    scene.add_rigid(
        "crank", box=[1.0, 0.1, 0.1], trajectory={"times": [0.0, 1.0], "positions": [[1.5, 0, 1.0], [1, 0, 1]]}
    )
    scene.add_joint("ball", "a", body0="wall", body1="arm", local_pos0=[0.5, 0, 0], local_pos1=[-0.5, 0, 0])
    scene.add_joint("ball", "b", body0="arm", body1="crank", local_pos0=[0.5, 0, 0], local_pos1=[0.0, 0, 0])
    result, report = assemble(scene)
    assert report.closed
    assert result.definition.bodies[0] == scene.definition.bodies[0]
    assert result.definition.bodies[2] == scene.definition.bodies[2]
    np.testing.assert_allclose(place(result, "arm", [0.5, 0, 0]), [1.5, 0, 1.0], atol=1e-10)


def test_what_cannot_close_is_named_and_finite() -> None:
    """A rod of 1 m between places 1.5 m apart, and a healthy joint beside it."""
    scene = Scene("short")
    scene.add_rigid("rod", box=[1.0, 0.1, 0.1], position=[0.2, 0.3, 0])
    scene.add_rigid("other", box=[1.0, 0.1, 0.1], position=[0.0, 5.0, 0])
    scene.add_joint("ball", "left", body1="rod", local_pos0=[-0.75, 0, 0], local_pos1=[-0.5, 0, 0])
    scene.add_joint("ball", "right", body1="rod", local_pos0=[0.75, 0, 0], local_pos1=[0.5, 0, 0])
    scene.add_joint("ball", "fine", body1="other", local_pos0=[0.0, 5.2, 0], local_pos1=[0.0, 0, 0])
    result, report = assemble(scene)
    assert report.status == "open" and {joint.name for joint in report.open} == {"left", "right"}
    assert [joint.gap for joint in report.open] == pytest.approx([0.25, 0.25], abs=1e-6)
    assert "'left' cannot close: 0.25 m" in report.text()
    assert all(np.isfinite(d.position).all() for d in result.definition.bodies)
    np.testing.assert_allclose(place(result, "other", [0, 0, 0]), [0.0, 5.2, 0], atol=1e-9)


def test_contradictory_axes_are_reported_in_radians() -> None:
    scene = Scene("twisted")
    scene.add_rigid("box", box=[1.0, 1, 1])
    hinge(scene, "x", None, "box", [0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0])
    hinge(scene, "y", None, "box", [0, 0, 0], [0, 0, 0], [0, 1, 0], [np.sin(0.2), np.cos(0.2), 0])
    _, report = assemble(scene)
    assert not report.closed and len(report.open) == 2
    assert sum(joint.angle for joint in report.open) == pytest.approx(0.2, abs=1e-3)


def test_limits_are_reached_and_not_passed() -> None:
    scene = Scene("limits")
    scene.add_rigid("upper", box=[0.1, 0.1, 1.0], position=[0, 0, 1], rotation=[2.0, 0.3, 0.1])
    scene.add_rigid("bead", sphere=0.1, position=[3.0, 1.0, 2.0])
    scene.add_rigid("puck", sphere=0.1, position=[0.1, 0.1, 4.0])
    scene.add_joint(
        "joint", "cone", body1="upper", local_pos0=[0, 0, 0], local_pos1=[0, 0, -0.5],
        angle={"axis0": [0, 0, 1], "axis1": [0, 0, 1], "max": 0.4},
        twist={"vector0": [1, 0, 0], "vector1": [1, 0, 0], "min": -0.2, "max": 0.3},
    )  # fmt: skip
    wire = {"axis": [1, 0, 0], "min": -1.0, "max": 2.0}
    scene.add_joint("joint", "wire", body1="bead", local_pos0=[0, 0, 0], local_pos1=[0, 0, 0], axial=wire)
    ring = {"normal": [0, 0, 1], "min": 0.5, "max": 1.0}
    scene.add_joint("joint", "tray", body1="puck", local_pos0=[0, 0, 3.0], local_pos1=[0, 0, 0], planar=ring)
    result, report = assemble(scene)
    assert report.closed
    _, turn = frames(result)["upper"]
    assert np.arccos(turn.apply([0, 0, 1])[2]) <= 0.4 + 1e-9
    x, y, z, w = turn.as_quat()
    assert -0.2 - 1e-9 <= 2.0 * np.arctan2(z, w) <= 0.3 + 1e-9
    np.testing.assert_allclose(place(result, "bead", [0, 0, 0]), [2.0, 0, 0], atol=1e-9)
    at = place(result, "puck", [0, 0, 0])
    assert at[2] == pytest.approx(3.0, abs=1e-9) and np.hypot(at[0], at[1]) == pytest.approx(0.5, abs=1e-9)


def test_curves_and_surfaces() -> None:
    scene = Scene("domains")
    scene.add_rigid("bead", sphere=0.1, position=[0.3, 2.0, 1.0])
    scene.add_rigid("skate", box=[0.2, 0.1, 0.1], position=[0.2, 0.2, 3.0])
    points = [[0.0, 0, 0], [1.0, 1.0, 0], [2.0, 0, 0.5]]
    rail = {"points": points, "interpolation": "spline"}
    scene.add_joint("joint", "rail", body1="bead", local_pos1=[0.05, 0, 0], curve=rail)
    floor = {"vertices": [[-1, -1, 0], [1, -1, 0], [1, 1, 0.5], [-1, 1, 0.5]], "triangles": [[0, 1, 2], [0, 2, 3]]}
    scene.add_joint("joint", "floor", body1="skate", local_pos1=[0, 0, -0.05], surface=floor)
    result, report = assemble(scene)
    assert report.closed
    p = place(result, "skate", [0, 0, -0.05])
    assert p[2] == pytest.approx(0.25 * (p[1] + 1.0), abs=1e-9)


def test_only_what_acts_at_the_start_counts() -> None:
    scene = Scene("windows")
    scene.add_rigid("a", sphere=0.1, position=[0.0, 0, 0])
    both = {"body1": "a", "local_pos1": [0, 0, 0]}
    scene.add_joint("ball", "now", **both, local_pos0=[1.0, 0, 0], end=2.0)
    scene.add_joint("ball", "later", **both, local_pos0=[5.0, 0, 0], start=2.0)
    scene.add_joint("ball", "never", **both, local_pos0=[9.0, 0, 0], enabled=False)
    result, report = assemble(scene)
    assert report.closed and report.joints >= 1
    np.testing.assert_allclose(place(result, "a", [0, 0, 0]), [1.0, 0, 0], atol=1e-10)


def test_anchors_and_limits_from_the_start_keep_their_meaning() -> None:
    """`anchor` names a place in both bodies, a twist counts from the start: both must survive the move."""
    scene = Scene("meaning")
    scene.add_rigid("a", box=[1.0, 0.1, 0.1], position=[0.5, 0, 0.3])
    scene.add_rigid("b", box=[1.0, 0.1, 0.1], position=[1.5, 0, 0.3])
    scene.add_joint("ball", "world", body1="a", local_pos0=[0, 0, 0], local_pos1=[-0.5, 0, 0])
    scene.add_joint("revolute", "elbow", body0="a", body1="b", anchor=[1.0, 0, 0.3], axis=[0, 0, 1], lower_limit=-0.1,
                    upper_limit=0.2)  # fmt: skip
    reach = 2.0 * np.cos(0.075) * np.array([1.9, 0.4, 0.1]) / np.linalg.norm([1.9, 0.4, 0.1])
    scene.add_joint("ball", "tip", body1="b", local_pos0=reach, local_pos1=[0.5, 0, 0])
    result, report = assemble(scene)
    assert report.closed
    # the elbow has bent by what it must, and the scene returned still counts from where it was
    (_, ra), (_, rb) = frames(result)["a"], frames(result)["b"]
    bend = (ra.inv() * rb).as_rotvec()
    assert bend[2] == pytest.approx(0.15, abs=1e-6)
    np.testing.assert_allclose(place(result, "a", [0.5, 0, 0]), place(result, "b", [-0.5, 0, 0]), atol=1e-10)
    again, second = assemble(result)
    assert second.closed and second.iterations == 0 and again is result
    model, state = result.build()
    twist = state.parts.kind == 8
    assert twist.sum() == 1
    part = int(np.flatnonzero(twist)[0])
    a, b = int(state.parts.a[part]), int(state.parts.b[part])
    q = state.rigid.q.numpy()
    frame_a = Rotation.from_quat(q[a]) * Rotation.from_quat(state.parts.q_a[part])
    frame_b = Rotation.from_quat(q[b]) * Rotation.from_quat(state.parts.q_b[part])
    assert (frame_b.inv() * frame_a).as_rotvec()[2] == pytest.approx(bend[2], abs=1e-9)


def test_weld_keeps_the_relative_orientation_even_where_it_cannot_close() -> None:
    scene = Scene("welds")
    scene.add_rigid("a", box=[1.0, 0.1, 0.1], position=[0.0, 0, 0])
    scene.add_rigid("b", box=[1.0, 0.1, 0.1], position=[1.2, 0.1, 0], rotation=[0.0, 0, 0.5])
    scene.add_joint("weld", "w", body0="a", body1="b", local_pos0=[0.5, 0, 0], local_pos1=[-0.5, 0, 0])
    hinge(scene, "h", "a", "b", [0.5, 0, 0], [-0.5, 0, 0], [0, 1, 0], [0, 1, 0])
    result, report = assemble(scene)
    assert not report.closed and {joint.name for joint in report.open} == {"w", "h"}
    _, second = assemble(result)
    assert {joint.name for joint in second.open} == {"w", "h"}
    assert sum(j.angle for j in second.open) == pytest.approx(sum(j.angle for j in report.open), rel=1e-3)


def test_saved_and_loaded(tmp_path: Path) -> None:
    result, _ = assemble(thrown(bricard(), 0.2, 0.7))
    for name in ("closed.yaml", "closed.gascuel"):
        result.save(tmp_path / name)
        back = Scene.load(tmp_path / name)
        assert back.definition == result.definition
        assert assemble(back)[1].iterations == 0


def test_limits_on_the_work(tmp_path: Path) -> None:
    scene = thrown(closed_chain(20), 0.2, 0.7)
    calls: list[tuple[int, float]] = []
    _, report = assemble(scene, max_iterations=5, progress=lambda count, gap: calls.append((count, gap)))
    assert report.iterations <= 5 and [count for count, _ in calls] == list(range(1, len(calls) + 1))
    assert calls[-1][1] < calls[0][1]
    with pytest.raises(InputError, match="greater than 0"):
        assemble(scene, tolerance=0.0)
    with pytest.raises(InputError, match="suffix"):
        assemble(scene, watch=tmp_path / "way.txt")


def test_watch_records_the_way(tmp_path: Path) -> None:
    scene = thrown(bricard(), 0.2, 0.7)
    result, report = assemble(scene, watch=tmp_path / "way.npz")
    with np.load(tmp_path / "way.npz") as film:
        x, t = film["x"], film["time"]
    first, last = (s.build()[1].positions() for s in (scene, result))
    np.testing.assert_allclose(x[0], first, atol=1e-12)
    np.testing.assert_allclose(x[-1], last, atol=1e-9)
    assert len(t) > 15 and (np.diff(t) > 0).all()
    assert np.abs(np.diff(x, axis=0)).max() < 0.3
    assert any("way.npz" in message for message in report.messages)


def test_rolling_wheel_is_put_on_its_plane() -> None:
    scene = Scene("wheel")
    scene.add_rigid("wheel", cylinder={"radius": 0.5, "length": 0.1}, position=[0, 0, 2.0], rotation=[1.2, 0.0, 0.0])
    scene.add_joint("rolling", "roll", body1="wheel", local_pos0=[0, 0, 0], local_pos1=[0, 0, 0], normal=[0, 0, 1],
                    radius=0.5, axis=[0, 0, 1])  # fmt: skip
    result, report = assemble(scene)
    assert report.closed
    at, turn = frames(result)["wheel"]
    axle = turn.apply([0, 0, 1])
    lowest = at[2] - 0.5 * np.sqrt(1.0 - axle[2] ** 2)
    assert lowest == pytest.approx(0.0, abs=1e-9)
