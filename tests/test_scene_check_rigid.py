"""What `check` says of rigid bodies and joints: counts, mass, degrees of freedom, repeated rows, open joints, velocities."""

import time

import numpy as np
import pytest
from rigid_scene_example import box, chain, mechanisms
from scipy.spatial.transform import Rotation

import turnbuckle
from turnbuckle.scene.check import inspect_scene
from turnbuckle.scene.freedom import freedom
from turnbuckle.scene.joint_rows import acting_at_start, joint_rows
from turnbuckle.scenes.bricard import bricard
from turnbuckle.scenes.closed_chain import closed_chain
from turnbuckle.scenes.four_bars import four_bars


def told(scene: turnbuckle.Scene) -> dict[str, str]:
    return dict(inspect_scene(scene).counts)


def degrees(scene: turnbuckle.Scene) -> tuple[int, int]:
    """Degrees of freedom and repeated rows, as `check` finds them, held against a dense rank."""
    model, state = scene.build()
    joints, acting = acting_at_start(state)
    rows = joint_rows(state, joints, acting)
    moves = model.rigid.motion == 2
    found = freedom(rows, moves, 1.0)
    dense = np.zeros((len(rows.joint), 6 * model.rigid.count))
    for r in range(len(rows.joint)):
        for body, sign, torque in ((rows.a[r], 1.0, rows.torque_a[r]), (rows.b[r], -1.0, rows.torque_b[r])):
            if moves[body]:
                dense[r, 6 * body : 6 * body + 6] = sign * np.r_[rows.force[r], torque]
    rank = np.linalg.matrix_rank(dense, tol=1e-9) if dense.size else 0
    assert found.degrees == 6 * moves.sum() - rank and found.repeated == len(rows.joint) - rank
    return found.degrees, found.repeated


def door(**more: object) -> turnbuckle.Scene:
    ends = {"body1": "door", "axis": [0, 0, 1]}
    hinges = [{"type": "revolute", "name": f"hinge_{k}", **ends, "anchor": [-0.1, 0, 0.02 * k]} for k in (0, 1)]
    return turnbuckle.Scene("door", bodies=[box("door", [0, 0, 0], **more)], constraints=hinges)


def test_counts_and_mass() -> None:
    counts = told(mechanisms())
    assert counts["rigid bodies"] == "16 (14 dynamic, 2 on a trajectory)"
    assert counts["joints: revolute"] == "3" and counts["joints: ball"] == "4" and counts["joints: rolling"] == "1"
    wheel = 1.0
    assert float(counts["mass"].split()[0]) == pytest.approx(13 * 1.0 + wheel, rel=1e-5)
    assert "constraints" not in counts
    soft = turnbuckle.Scene("soft", bodies=[{"type": "rope", "name": "r", "start": [0, 0, 0], "end": [1, 0, 0],
                                             "segments": 4, "mass": 2.0}])  # fmt: skip
    assert "rigid bodies" not in told(soft) and "degrees of freedom" not in told(soft)
    soft.add_rigid("b", box=[1, 1, 1], mass=3.0, position=[0, 0, 3])
    soft.add_rigid("floor", box=[9, 9, 1], mass=500.0, position=[0, 0, -3], motion="immobile")
    assert told(soft)["mass"] == "5 kg"
    assert told(soft)["degrees of freedom"].startswith("6 ") and told(soft)["joints"] == "0"


@pytest.mark.parametrize(
    ("kind", "fields", "free"),
    [
        ("ball", {}, 3), ("revolute", {"axis": [0, 1, 0]}, 1), ("universal", {"axis0": [1, 0, 0], "axis1": [0, 1, 0]}, 2),
        ("prismatic", {"axis": [1, 1, 0]}, 1), ("cylindrical", {"axis": [1, 0, 2]}, 2), ("planar", {"axis": [0, 0, 1]}, 3),
        ("weld", {}, 0), ("cone_twist", {"axis": [1, 0, 0], "cone": 0.3}, 3), ("point_to_ring", {"axis": [0, 0, 1]}, 5),
        ("revolute", {"axis": [0, 0, 1], "lower_limit": -1, "upper_limit": 1}, 1),
        ("rolling", {"normal": [0, 0, 1], "radius": 0.3}, 3), ("joint", {"fixed_rotation": True}, 0),
        ("rolling", {"normal": [0, 0, 1], "radius": 0.3, "axis": [1, 0, 0]}, 3),
    ],
)  # fmt: skip
def test_degrees_of_freedom_of_every_joint(kind: str, fields: dict, free: int) -> None:
    scene = turnbuckle.Scene("one", bodies=[box("b", [0.2, 0.3, 0.4], rotation=[0.3, -0.2, 0.1])])
    scene.add_joint(kind, "j", body1="b", anchor=[0.1, 0.2, 0.5], **fields)
    assert degrees(scene) == (free, 0)


def test_domains_and_rods() -> None:
    ends = {"body1": "b", "local_pos0": [0, 0, 0], "local_pos1": [0.1, 0, 0]}
    domains = [
        ({"curve": {"points": [[-1, 0, 0], [0, 0.1, 0], [2, 0, 0]], "interpolation": "spline"}}, 4),
        ({"surface": {"vertices": [[-9, -9, 0], [9, -9, 0], [0, 9, 0]], "triangles": [[0, 1, 2]]}}, 5),
        ({"sphere": {"min": 0.1, "max": 0.1}}, 5),
        ({"sphere": {"max": 0.5}}, 6),
        ({"axial": {"axis": [1, 0, 0], "min": -1, "max": 1}}, 4),
        ({"angle": {"axis0": [1, 0, 0], "axis1": [0, 1, 0], "min": 0.4, "max": 0.4}}, 2),
        ({"sphere": {"min": 0.1, "max": 0.1, "stiffness": 10.0}}, 6),
    ]
    for fields, free in domains:
        scene = turnbuckle.Scene("one", bodies=[box("b", [0.0, 0.0, 0.0], rotation=[0, 0, 0.2])])
        scene.add_joint("joint", "j", **ends, **fields)
        assert degrees(scene) == (free, 0), fields


def test_loops_and_what_repeats() -> None:
    assert degrees(door()) == (1, 5)
    assert told(door())["redundant"] == "5 of 10 rows of joints, among 'hinge_0', 'hinge_1'"
    assert not [text for text in inspect_scene(door()).warnings if "hinge" in text], "a fact, not a warning"
    linkage = bricard()
    assert degrees(linkage)[1] == 1 and told(linkage)["degrees of freedom"].startswith("1 ")
    bars = four_bars(3)
    assert degrees(bars)[0] == 1 and "redundant" in told(bars)
    pair = door()
    pair.add_rigid("free", box=[0.1, 0.1, 0.1], position=[0, 3, 0])
    pair.add_joint("ball", "alone", body1="free", anchor=[0, 3, 0.1])
    assert "alone" not in told(pair)["redundant"]


def test_random_mechanisms_against_a_dense_rank() -> None:
    random = np.random.default_rng(4)
    seen = set()
    for _ in range(25):
        n = int(random.integers(2, 7))
        bodies = [
            box(f"b{i}", random.normal(size=3).tolist(), rotation=Rotation.random(rng=random).as_rotvec().tolist())
            for i in range(n)
        ]
        scene = turnbuckle.Scene("random", bodies=bodies)
        for j in range(int(random.integers(n, 2 * n))):
            a, b = random.choice(n, 2, replace=False)
            kind = str(random.choice(["ball", "revolute", "weld", "prismatic"]))
            fields = {"axis": [0.0, 0.0, 1.0]} if kind in ("revolute", "prismatic") else {}
            ends = {"body1": f"b{a}", **({"body0": f"b{b}"} if random.random() < 0.8 else {})}
            scene.add_joint(kind, f"j{j}", anchor=random.normal(size=3).tolist(), **ends, **fields)
        seen.add(degrees(scene)[1] > 0)
    assert seen == {True, False}


def test_long_chains_are_counted_quickly() -> None:
    model, state = closed_chain(2000).build()
    joints, acting = acting_at_start(state)
    rows = joint_rows(state, joints, acting)
    began = time.perf_counter()
    found = freedom(rows, model.rigid.motion == 2, model.size)
    assert found.degrees == 6 * 2000 - 3 * 2001 and found.repeated == 0
    assert time.perf_counter() - began < 10.0


def test_joints_that_start_open() -> None:
    scene = chain(3)
    assert inspect_scene(scene).warnings == []
    scene.add_rigid("far", box=[0.1, 0.1, 0.1], position=[1, 1, 1])
    scene.add_joint("revolute", "open", body1="far", local_pos0=[1, 1, 0.7], local_pos1=[0, 0, 0], axis=[0, 0, 1])
    scene.add_joint(
        "joint", "turned", body1="far", angle={"axis0": [0, 0, 1], "axis1": [1, 0, 0], "min": 0, "max": 1.0}
    )
    (warning,) = inspect_scene(scene).warnings
    assert "'open' by 0.3 m" in warning and "'turned' by 0.571 rad" in warning and "turnbuckle assemble" in warning
    assert warning.startswith("2 joints start open")
    late = chain(2)
    late.add_joint("ball", "late", body1="b1", local_pos0=[1, 1, 0.7], local_pos1=[0, 0, 0], start=0.5)
    assert inspect_scene(late).warnings == [], "it does not act at the start"


def test_velocities_that_open_joints() -> None:
    spin = np.array([0.0, 0.0, 2.0])
    ends = {"body1": "door", "axis": [0, 0, 1], "anchor": [-0.1, 0, 0]}
    good = turnbuckle.Scene(
        "good",
        bodies=[box("door", [0, 0, 0], velocity=np.cross(spin, [0.1, 0, 0]).tolist(), angular_velocity=spin.tolist())],
        constraints=[{"type": "revolute", "name": "hinge", **ends}],
    )
    assert inspect_scene(good).warnings == []
    good.apply_set("bodies.door.velocity=[0.3, 0.2, 0]")
    good.apply_set("bodies.door.angular_velocity=[0.5, 0, 2]")
    (warning,) = inspect_scene(good).warnings
    assert "'hinge' by 0.3 m/s and 0.5 rad/s" in warning and "initial velocities open 1 joint" in warning


def test_soft_bodies_beside_rigid_ones_are_still_checked() -> None:
    """A step too large for a stiff rope is found in a scene with rigid bodies, whose points have no mass of their own."""
    rope = {"type": "rope", "name": "rope", "start": [0, 0, 0], "end": [1, 0, 0], "segments": 10, "mass": 0.1,
            "stretch_stiffness": 1e6}  # fmt: skip
    scene = turnbuckle.Scene("stiff", dt=1e-2, bodies=[rope, box("b", [0, 0, -1])])
    with np.errstate(all="raise"):
        (warning,) = inspect_scene(scene).warnings
    assert "too large for the stiffness" in warning
