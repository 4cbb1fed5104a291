"""An otary balances a tray and a ball on its nose: Displacement, Figure 6."""

import math

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.solids import revolve, sphere_surface
from turnbuckle.scene.scene import Scene

# The animal in the plane z = 0, y up, looking along x [m]: where the middle lines of its parts begin and end.
TAIL_TIP, RUMP = np.array([-1.30, 0.30, 0.0]), np.array([-0.68, 0.42, 0.0])
NECK, NOSE = np.array([0.42, 1.00, 0.0]), np.array([0.98, 1.34, 0.0])
BELLY = np.array([-0.15, 0.36, 0.0])
# Of each part: mass of the kernel [kg], radius of the kernel and thickness of the coat [m], stiffness of the coat [J].
PARTS = {"tail": (5.0, 0.05, 0.05, 0.06), "body": (40.0, 0.20, 0.10, 0.6), "head": (9.0, 0.09, 0.06, 0.12)}
# Rings of the skin from the tip of the tail to the nose: part, place along the part, 0 at its joint with the body or
# the rump, radius [m].
RINGS = (
    ("tail", 0.98, 0.05), ("tail", 0.85, 0.11), ("tail", 0.5, 0.10), ("tail", 0.1, 0.16),
    ("body", 0.08, 0.23), ("body", 0.35, 0.31), ("body", 0.65, 0.30), ("body", 0.92, 0.21),
    ("head", 0.12, 0.16), ("head", 0.4, 0.15), ("head", 0.7, 0.16), ("head", 0.9, 0.11), ("head", 1.02, 0.06),
)  # fmt: skip
FUR = [0.36, 0.33, 0.31]
TRAY_THICKNESS = 0.03  # [m]
RIM, RIM_HEIGHT = 0.015, 0.04  # of the tray that a ball lies in by contact: thickness, height over it [m]
RUBBER = 1e5  # Young's modulus of a ball that lies by contact [Pa]
GAP = 1e-3  # between ball and tray at the start [m]
DELTA = 1e-3  # distance that they keep [m]


def otary(
    tray: float = 0.38,
    ball: float = 0.13,
    level: float = 0.06,
    strength: float = 1.0,
    soft: bool = True,
    contact: bool = False,
    mu: float = 0.5,
    dt: float = 1.0 / 960.0,
    duration: float = 6.0,
) -> Scene:
    """An otary keeps a ball on a tray on its nose while forces and torques move head and tail (Figure 6).

    As in the paper: head, body and tail of deformable material around rigid kernels on points to point with angle and
    twist, under one skin; a tray of radius `tray` [m] hinged on the nose, kept within `level` [rad] of horizontal by an
    angle to the world; a deformable ball of radius `ball` [m] that must stay on it by a point to ring, here a disc. Head
    and tail are driven by forces and torques, times `strength`. The paper does not say what the otary lies on: here a
    drum, by a ball joint with angle and twist; soft angles stand for the muscles that hold up head and tail. y is up.
    `soft=False` leaves the kernels bare.
    With `contact` nothing keeps the ball but the tray: it lies and rolls on it by contact and friction `mu` 0.5, and a rim
    holds it back; rigid bodies that no joint joins keep apart, but for the drum. The scheme is backward Euler then.
    """
    if not 0.0 < ball < tray:
        raise InputError(f"otary: ball = {ball:g} m must be less than tray = {tray:g} m")
    touching = {"contact": {"friction": mu}} if contact else {}
    scene = Scene("otary", up_axis="Y", dt=dt, duration=duration, **touching)
    _add_part(scene, "body", RUMP, NECK, soft)
    _add_part(scene, "head", NECK, NOSE, soft)
    _add_part(scene, "tail", RUMP, TAIL_TIP, soft)
    if soft:
        _add_skin(scene)
    _add_flippers(scene)
    up, along = [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
    held = {"cone": 0.20, "lower_limit": -0.35, "upper_limit": 0.35}
    scene.add_joint("cone_twist", "belly", body1="body", anchor=BELLY, axis=up, **held)
    turning = {"lower_limit": -0.5, "upper_limit": 0.5}
    scene.add_joint("cone_twist", "neck", body0="body", body1="head", anchor=NECK, axis=along, cone=0.5, **turning)
    scene.add_joint("cone_twist", "rump", body0="body", body1="tail", anchor=RUMP, axis=along, cone=0.6, **turning)
    _add_muscles(scene)
    _add_drum(scene)
    _add_tray(scene, tray, level, contact)
    if contact:
        _add_free_ball(scene, ball, soft)
    else:
        _add_ball(scene, tray, ball, soft)

    def wave(size: float, rate: float) -> str:
        return f"{size * strength!r} * sin({rate!r} * t)"

    nod = [wave(20.0, 2.1), wave(60.0, 1.7), wave(150.0, 3.1)]
    scene.add_force("nod", body="head", expression=[wave(120.0, 2.6), 0.0, wave(90.0, 1.9)], torque=nod)
    wag = [wave(3.0, 2.3), wave(8.0, 3.7), wave(6.0, 4.3)]
    scene.add_force("wag", body="tail", expression=[0.0, wave(90.0, 4.1), wave(100.0, 5.3)], torque=wag)
    return scene


def _coat(stiffness: float) -> dict[str, float]:
    soft = dict.fromkeys(("k_distance", "k_area", "k_volume"), stiffness)
    return {**soft, **dict.fromkeys(("damping_distance", "damping_area", "damping_volume"), 3e-4 * stiffness)}


def _add_part(scene: Scene, name: str, start: np.ndarray, end: np.ndarray, soft: bool) -> None:
    """A capsule from start to end [m], both in the plane z = 0, with its coat."""
    mass, radius, coat, stiffness = PARTS[name]
    along = end - start
    far = float(np.linalg.norm(along))
    # z onto the direction, by a turn in the plane y = 0 and one in the plane z = 0.
    turn = Rotation.from_euler("yz", [0.5 * math.pi, math.atan2(along[1], along[0])])
    scene.add_rigid(
        name,
        capsule={"radius": radius, "length": far - radius},
        mass=mass,
        position=0.5 * (start + end),
        rotation=turn.as_rotvec(),
        color=FUR,
        linear_damping=0.2,
        angular_damping=1.0,
    )
    if soft:
        flesh = {
            "thickness": coat,
            "density": 100.0,
            "contact": "off",
            **_coat(stiffness),
        }  # it reaches beyond the skin
        scene.add_coating(f"{name}_flesh", around=name, color=FUR, **flesh)


def _add_skin(scene: Scene) -> None:
    """One surface from the tip of the tail to the nose."""
    lengths = {"tail": TAIL_TIP - RUMP, "body": NECK - RUMP, "head": NOSE - NECK}
    sections = []
    for part, place, radius in RINGS:
        # The tail's kernel points backwards, against the way of the rings.
        axis = [0.0, 0.0, -1.0 if part == "tail" else 1.0]
        position = [0.0, 0.0, (place - 0.5) * float(np.linalg.norm(lengths[part]))]
        sections.append({"body": f"{part}_flesh", "position": position, "axis": axis, "radius": radius})
    scene.add_skin("skin", bodies=["tail_flesh", "body_flesh", "head_flesh"], sections=sections, color=FUR)


def _add_flippers(scene: Scene) -> None:
    """Two flippers on the body, welded."""
    points, triangles = sphere_surface(1.0)
    for name, sign in (("left_flipper", 1.0), ("right_flipper", -1.0)):
        place = np.array([0.12, 0.52, 0.33 * sign])
        scene.add_rigid(
            name,
            vertices=points * [0.10, 0.26, 0.035],
            triangles=triangles,
            mass=0.8,
            position=place,
            rotation=[-0.7 * sign, 0.0, 0.25],
            color=FUR,
        )
        scene.add_joint("weld", f"{name}_weld", body0="body", body1=name, anchor=place)


def _add_drum(scene: Scene) -> None:
    """What the otary lies on, to look at."""
    height = float(BELLY[1])
    drum = {"cylinder": {"radius": 0.34, "length": height}, "rotation": [0.5 * math.pi, 0.0, 0.0]}
    drum["position"] = [BELLY[0], 0.5 * height, 0.0]
    scene.add_rigid("drum", parts=[drum], motion="immobile", contact="off", color=[0.55, 0.20, 0.25])


def _add_tray(scene: Scene, radius: float, level: float, rim: bool) -> None:
    """The tray on the nose, kept almost horizontal; with a rim that a ball cannot roll over."""
    top, up = np.array([0.0, 0.5 * TRAY_THICKNESS, 0.0]), [0.0, 1.0, 0.0]
    plate: dict = {"cylinder": {"radius": radius, "length": TRAY_THICKNESS}, "rotation": [0.5 * math.pi, 0.0, 0.0]}
    if rim:
        half = 0.5 * TRAY_THICKNESS
        heights = np.array([-half, half + RIM_HEIGHT, half + RIM_HEIGHT, half])
        radii = np.array([radius, radius, radius - RIM, radius - RIM])
        points, triangles = revolve(radii, heights, (-half, half), 64)
        plate = {"vertices": points, "triangles": triangles, "rotation": [-0.5 * math.pi, 0.0, 0.0]}  # z up
    tip = NOSE + [0.05, 0.08, 0.0]
    delta = {"contact_delta": DELTA} if rim else {}
    scene.add_rigid("tray", parts=[plate], mass=0.8, position=tip + top, color=[0.78, 0.62, 0.25], **delta)
    scene.add_joint("ball", "nose", body0="head", body1="tray", anchor=tip)
    scene.add_joint("joint", "tray_level", body1="tray", angle={"axis0": up, "axis1": up, "max": level})


def _add_ball(scene: Scene, tray: float, radius: float, soft: bool) -> None:
    """A ball whose middle stays in a disc above the tray."""
    above = np.array([0.0, 0.5 * TRAY_THICKNESS + radius, 0.0])
    start = next(body for body in scene.definition.bodies if body.name == "tray").position + above
    kernel = 0.6 * radius if soft else radius
    scene.add_rigid("ball", sphere=kernel, mass=0.3, position=start, color=[0.80, 0.20, 0.20])
    if soft:
        coat = {"thickness": radius - kernel, "density": 100.0, "color": [0.80, 0.20, 0.20]}
        scene.add_coating("ball_rubber", around="ball", **coat, **_coat(0.05))
    disc = {"normal": [0.0, 1.0, 0.0], "max": tray - 0.5 * radius}
    places = {"local_pos0": above, "local_pos1": [0.0, 0.0, 0.0]}
    scene.add_joint("joint", "on_tray", body0="tray", body1="ball", planar=disc, restitution=0.6, **places)


def _add_free_ball(scene: Scene, radius: float, soft: bool) -> None:
    """A ball that lies on the tray and is joined to nothing; round enough to roll off a slope of 0.02 rad."""
    tray = next(body for body in scene.definition.bodies if body.name == "tray").position
    surface = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    ball = {"vertices": np.array(surface.vertices), "triangles": np.array(surface.faces, dtype=np.int32)}
    ball |= {"position": tray + [0.0, 0.5 * TRAY_THICKNESS + radius + GAP, 0.0], "mass": 0.3, "contact_delta": DELTA}
    if soft:
        scene.add_solid("ball", cage=200, youngs_modulus=RUBBER, damping=0.005, color=[0.80, 0.20, 0.20], **ball)
    else:
        scene.add_rigid("ball", color=[0.80, 0.20, 0.20], **ball)


def _add_muscles(scene: Scene) -> None:
    """Preferred directions of body, head and tail: those of the start, held by springs and dampers."""
    frames = {
        body.name: Rotation.from_rotvec(np.array(body.rotation))
        for body in scene.definition.bodies
        if body.type == "rigid"
    }
    ahead = np.array([0.0, 0.0, 1.0])  # along every part, in its own frame
    for name, first, second, stiffness in (
        ("back", None, "body", 4000.0),
        ("nape", "body", "head", 1500.0),
        ("loin", "body", "tail", 250.0),
    ):
        axis0 = frames[second].apply(ahead)
        if first is not None:
            axis0 = frames[first].inv().apply(axis0)
        spring = {"axis0": axis0, "axis1": ahead, "max": 0.0, "stiffness": stiffness, "damping": 0.08 * stiffness}
        scene.add_joint("joint", name, body0=first, body1=second, angle=spring)
