"""A dancer turns and kicks in a dress of six layers: Contact, Figure 1."""

from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.character import NUMBER, Dance, bone_motions, figure, skinned
from turnbuckle.meshes.garments import layered_skirt
from turnbuckle.meshes.read import SurfaceMesh, read_mesh
from turnbuckle.meshes.sequences import MeshSequence, read_sequence
from turnbuckle.scene.scene import Scene

FRAME_RATE = 200.0  # of the dancer made here [1/s]
NEAR = 16  # vertices of the body whose motion a point of the waist follows
RESOLVED = 0.45  # [rad] a step of the springs of an elastic waist
WOVEN = {"density": 0.15, "structural_stiffness": 300.0, "shear_stiffness": 0.0, "damping": 0.01}


def dancer(
    body: str | None = None,
    garment: str | None = None,
    layers: int = 6,
    around: int = 100,
    rows: int = 28,
    mu: float = 0.3,
    bend_stiffness: float = 1e-5,
    turn_at: float = 0.6,
    turn_time: float = 0.9,
    kick_at: float = 1.8,
    kick_time: float = 0.7,
    settle: float = 0.3,
    frame_rate: float | None = None,
    up_axis: Literal["Y", "Z"] = "Z",
    waist: Literal["nails", "elastic"] | None = None,
    dt: float = 2e-3,
    duration: float | None = None,
) -> Scene:
    """A dancer in a six-layered dress turns by 360 degrees in under a second and kicks (Contact, Figure 1).

    The dress is `layers` skirts, one over the other, `around` by `rows` vertices each (16,800 in all, as in the paper),
    its waist nailed to the motion of the hips. She stands for `settle` [s], begins her turn `turn_at` [s] later and takes
    `turn_time` [s] for it, and kicks from `kick_at` [s] for `kick_time` [s]. She is made here: a skinned articulated
    figure 1.72 m tall. The paper's step is 2 ms.
    `body`: your own sequence of meshes, an .npz (verts (k, n, 3), faces (m, 3), dt or times) or a folder of OBJ, with
    `frame_rate` [1/s] where the file has none. `garment`: your own cloth around its first frame, an .npz (verts, faces,
    and top_rings, the vertices that are held) or a mesh, whose highest rim is held. Both in metres, `up_axis` up.
    Cloth: density 0.15 kg/m^2 a layer, springs of 300 N/m along the edges, damping 0.01 N s/m, bending by angles,
    `bend_stiffness` [N m/rad] 1e-5. Friction `mu` 0.3 of cloth on cloth and on skin.
    `waist`: `nails` hold it exactly, the default for the dancer made here. `elastic` pulls it to the same places by springs
    of 0.45 rad a step `dt`, the default for your own: recorded arms pass through places where a waist is held,
    which no motion can keep apart from nails.
    """
    if body is not None and garment is None:
        raise InputError("dancer: body is given without garment; give the garment that fits it, too")
    if min(turn_time, kick_time) <= 0.0 or settle < 0.0:
        raise InputError("dancer: turn_time and kick_time must be positive, settle 0 or more")
    vertices, triangles, held = _garment(garment, layers, around, rows, 1 if up_axis == "Y" else 2)
    if body is None:
        dance = Dance(turn_at, turn_time, kick_at, kick_time)
        end = max(turn_at + turn_time, kick_at + kick_time) + 0.3
        times = np.arange(int(np.ceil(end * FRAME_RATE)) + 1) / FRAME_RATE
        made, motions = figure(), bone_motions(dance.pose, times)
        sequence = MeshSequence(skinned(made, motions), made.triangles, times)
        hips = motions[:, NUMBER["pelvis"]]
        goals = np.einsum("kij,pj->kpi", hips[:, :, :3], vertices[held]) + hips[:, None, :, 3]
    else:
        sequence = read_sequence(Path(body).expanduser(), frame_rate=frame_rate)
        goals = followers(sequence.vertices, vertices[held])
    length = float(sequence.times[-1]) + settle if duration is None else duration
    scene = Scene("dancer", up_axis=up_axis, dt=dt, duration=float(f"{length:.3g}"), contact={"friction": mu})
    moved = {"frames": sequence.vertices, "triangles": sequence.triangles, "times": sequence.times, "start": settle}
    scene.add_obstacle("body", color=[0.85, 0.66, 0.55], **moved)
    scene.add_cloth(
        "dress",
        vertices=vertices,
        triangles=triangles,
        bend_model="hinges",
        bend_stiffness=bend_stiffness,
        color=[0.70, 0.12, 0.20],
        **WOVEN,
    )
    where, goal = {"body": "dress", "indices": held}, {"times": sequence.times + settle, "positions": goals}
    if (waist or ("nails" if body is None else "elastic")) == "elastic":
        scene.add_force("waist", pull={"points": where, "goal": goal, "frequency": RESOLVED / dt})
    else:
        scene.add_constraint("nail", "waist", points=where, goal=goal)
    return scene


def followers(frames: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Where points (p, 3) that lie around the first of ``frames`` (k, n, 3) go with it, (k, p, 3) [m].

    Each moves rigidly with the vertices near it: the rotation that fits them best (Kabsch), about their middle.
    """
    near = cKDTree(frames[0]).query(points, k=min(NEAR, frames.shape[1]))[1]
    rest = frames[0][near]
    middle = rest.mean(axis=1)
    out = np.empty((len(frames), len(points), 3))
    for k, frame in enumerate(frames):
        now = frame[near]
        center = now.mean(axis=1)
        u, _, vt = np.linalg.svd(np.einsum("pki,pkj->pij", rest - middle[:, None], now - center[:, None]))
        u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]  # a rotation, not a reflection
        out[k] = np.einsum("pij,pi->pj", u @ vt, points - middle) + center
    return out


def _garment(
    path: str | None, layers: int, around: int, rows: int, up: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, triangles, and the vertices that are held."""
    if path is None:
        made = layered_skirt(layers, around, rows)
        return made.vertices, made.triangles, made.top
    file = Path(path).expanduser()
    if file.suffix.lower() == ".npz":
        read = read_sequence(file)
        vertices, triangles = read.vertices[0], read.triangles
        with np.load(file, allow_pickle=False) as arrays:
            held = np.unique(arrays["top_rings"]) if "top_rings" in arrays else None
        if held is not None and len(held) and not 0 <= held[0] <= held[-1] < len(vertices):
            raise InputError(f"dancer: garment {path}: 'top_rings' names vertex {held[-1]} of {len(vertices)}")
    else:
        mesh = read_mesh(file)
        if not isinstance(mesh, SurfaceMesh):
            raise InputError(f"dancer: garment {path}: has no triangles; give cloth")
        vertices, triangles, held = mesh.vertices, mesh.triangles, None
    if held is None or not len(held):
        held = _highest_rim(vertices, triangles, up, path)
    return vertices, triangles, held.astype(np.int32)


def _highest_rim(vertices: np.ndarray, triangles: np.ndarray, up: int, path: str) -> np.ndarray:
    """The boundary's vertices near its highest."""
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    rim = np.unique(edges[count == 1])
    if not len(rim):
        raise InputError(f"dancer: garment {path}: is closed, and has no rim to hold; give top_rings in an .npz")
    height = vertices[rim, up]
    return rim[height >= height.max() - 0.02 * np.ptp(vertices[:, up])]
