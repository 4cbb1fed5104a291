"""An articulated dancer made here: tubes and ellipsoids over bones, skinned by linear blending, and her dance.

Z is up, she faces +y, her left is +x; 1.72 m tall. Where she bends, a surface belongs in part to both bones, so that it
stays smooth; her limbs reach into her trunk, a surface that crosses itself.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from turnbuckle.meshes.solids import ring_triangles

# Bones: name, parent, place of the joint at rest [m].
BONES: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("pelvis", "", (0.0, 0.0, 0.98)),
    ("spine", "pelvis", (0.0, 0.0, 1.15)),
    ("head", "spine", (0.0, 0.0, 1.47)),
    *((f"thigh.{side}", "pelvis", (0.09 * sign, 0.0, 0.92)) for side, sign in (("l", 1), ("r", -1))),
    *((f"shin.{side}", f"thigh.{side}", (0.09 * sign, 0.0, 0.50)) for side, sign in (("l", 1), ("r", -1))),
    *((f"arm.{side}", "spine", (0.18 * sign, 0.0, 1.39)) for side, sign in (("l", 1), ("r", -1))),
    *((f"forearm.{side}", f"arm.{side}", (0.45 * sign, 0.0, 1.39)) for side, sign in (("l", 1), ("r", -1))),
)
NUMBER = {name: i for i, (name, _, _) in enumerate(BONES)}

# Profiles: place along the tube [m], half axes of the section [m].
TRUNK = [
    (0.83, 0.07, 0.06), (0.86, 0.13, 0.10), (0.92, 0.165, 0.118), (0.98, 0.16, 0.115), (1.06, 0.125, 0.092),
    (1.12, 0.12, 0.088), (1.25, 0.148, 0.10), (1.36, 0.16, 0.098), (1.42, 0.115, 0.078), (1.46, 0.055, 0.055),
    (1.53, 0.05, 0.05),
]  # fmt: skip
LEG = [
    (0.06, 0.034, 0.034), (0.12, 0.036, 0.038), (0.34, 0.052, 0.055), (0.48, 0.052, 0.055), (0.55, 0.06, 0.063),
    (0.75, 0.084, 0.088), (0.90, 0.08, 0.085),
]  # fmt: skip
ARM = [(0.15, 0.045, 0.05), (0.22, 0.046, 0.048), (0.42, 0.036, 0.038), (0.50, 0.034, 0.036), (0.70, 0.024, 0.026)]
BLEND = 0.06  # [m] half the length over which a surface changes from one bone to the next


@dataclass(frozen=True)
class Figure:
    """Vertices at rest, their bones' weights, triangles."""

    vertices: np.ndarray  # (n, 3) [m]
    weights: np.ndarray  # (n, bones), rows sum to 1
    triangles: np.ndarray  # (m, 3) int32


def figure(around: int = 24, spacing: float = 0.03) -> Figure:
    """The dancer at rest, arms out. ``around`` points a section of the trunk, sections ``spacing`` [m] apart."""
    parts = [
        _tube(TRUNK, "z", 0.0, around, spacing, [("pelvis", None), ("spine", 1.15), ("head", 1.47)]),
        _ball((0.0, 0.01, 1.61), (0.075, 0.095, 0.115), around, "head"),
    ]
    for side, sign in (("l", 1.0), ("r", -1.0)):
        legs = [(f"shin.{side}", None), (f"thigh.{side}", 0.50)]
        parts.append(_tube(LEG, "z", 0.09 * sign, (2 * around) // 3, spacing, legs))
        parts.append(_ball((0.09 * sign, 0.07, 0.036), (0.042, 0.125, 0.036), (2 * around) // 3, f"shin.{side}"))
        arms = [("spine", None), (f"arm.{side}", 0.18), (f"forearm.{side}", 0.45)]
        parts.append(_tube(ARM, "x" if sign > 0.0 else "-x", 1.39, around // 2, spacing, arms))
    begins = np.cumsum([0, *(len(p.vertices) for p in parts)])
    return Figure(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.weights for p in parts]),
        np.concatenate([p.triangles + b for p, b in zip(parts, begins[:-1], strict=True)]).astype(np.int32),
    )


def _tube(
    profile: list[tuple[float, float, float]],
    axis: str,
    offset: float,
    around: int,
    spacing: float,
    bones: list[tuple[str, float | None]],
) -> Figure:
    """A tube along z at x = offset, or along x or -x at z = offset; ``bones`` each with the place where it begins."""
    table = np.array(profile)
    along = np.linspace(table[0, 0], table[-1, 0], int(np.ceil((table[-1, 0] - table[0, 0]) / spacing)) + 1)
    radii = PchipInterpolator(table[:, 0], table[:, 1:])(along)
    angle = 2.0 * np.pi * np.arange(around) / around
    a, b = radii[:, :1] * np.cos(angle), radii[:, 1:] * np.sin(angle)
    s = np.broadcast_to(along[:, None], a.shape)
    rings = np.stack([a, b, s], axis=2).reshape(-1, 3)
    ends = np.array([[0.0, 0.0, along[0] - 0.3 * radii[0].min()], [0.0, 0.0, along[-1] + 0.3 * radii[-1].min()]])
    own = np.concatenate([rings, ends])
    weights = np.zeros((len(own), len(BONES)))
    weights[:, NUMBER[bones[0][0]]] = 1.0
    for (before, _), (bone, place) in zip(bones[:-1], bones[1:], strict=True):
        part = _smooth((own[:, 2] - float(place or 0.0) + BLEND) / (2.0 * BLEND))
        weights[:, NUMBER[bone]] = weights[:, NUMBER[before]] * part
        weights[:, NUMBER[before]] *= 1.0 - part
    triangles = ring_triangles(len(along), around)
    if axis == "z":
        vertices = own + np.array([offset, 0.0, 0.0])
    else:
        x, y, along_it = own.T
        sign = 1.0 if axis == "x" else -1.0
        vertices = np.stack([sign * along_it, y, offset - x], axis=1)
        triangles = triangles if sign > 0.0 else triangles[:, ::-1]
    return Figure(vertices, weights, triangles)


def _ball(center: tuple[float, ...], half: tuple[float, ...], around: int, bone: str) -> Figure:
    """An ellipsoid that belongs to one bone."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, around // 2 + 1)[1:-1]
    turn = 2.0 * np.pi * np.arange(around) / around
    ring = np.cos(angle)[:, None]
    height = np.broadcast_to(np.sin(angle)[:, None], (len(angle), around))
    rings = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=2)
    own = np.concatenate([rings.reshape(-1, 3), [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]])
    weights = np.zeros((len(own), len(BONES)))
    weights[:, NUMBER[bone]] = 1.0
    return Figure(own * np.array(half) + np.array(center), weights, ring_triangles(len(angle), around))


@dataclass(frozen=True)
class Dance:
    """What she does when: a turn of 360 degrees, then a kick with the right leg. Times [s], angles [rad]."""

    turn_at: float = 0.6
    turn_time: float = 0.9
    kick_at: float = 1.8
    kick_time: float = 0.7
    kick: float = 1.35

    def pose(self, t: float) -> tuple[np.ndarray, dict[str, Rotation]]:
        """Displacement of the pelvis (3,) [m], and turns of bones relative to their parents."""
        turn = 2.0 * np.pi * _smoother((t - self.turn_at) / self.turn_time)
        near = _bump((t - self.turn_at) / self.turn_time)
        up = _bump((t - self.kick_at) / self.kick_time)
        bend = _bump((t - self.kick_at + 0.1 * self.kick_time) / (0.7 * self.kick_time))  # the knee stretches late
        begun = float(np.clip(t / max(self.turn_at, 1e-9), 0.0, 1.0))
        sway = 0.5 - 0.5 * np.cos(2.0 * np.pi * begun)
        raised = 0.15 + 0.6 * _smoother(begun) - 0.3 * near
        shift = np.array([0.02 * sway, -0.03 * up, 0.01 * near])
        turns = {
            "pelvis": Rotation.from_rotvec([0.0, 0.0, turn]) * Rotation.from_rotvec([-0.12 * up, 0.05 * sway, 0.0]),
            "spine": Rotation.from_rotvec([0.15 * up, -0.08 * sway, 0.25 * near]),
            "thigh.r": Rotation.from_rotvec([self.kick * up, 0.0, 0.0]),
            "shin.r": Rotation.from_rotvec([-0.8 * bend * (1.0 - up), 0.0, 0.0]),
            "thigh.l": Rotation.from_rotvec([0.12 * up, 0.0, 0.0]),
            "arm.l": Rotation.from_rotvec([0.0, -raised, 0.3 * near]),
            "arm.r": Rotation.from_rotvec([0.0, raised, -0.3 * near]),
            "forearm.l": Rotation.from_rotvec([0.0, -0.5 * raised, 0.6 * near]),
            "forearm.r": Rotation.from_rotvec([0.0, 0.5 * raised, -0.6 * near]),
        }
        return shift, turns


def bone_motions(pose: Callable[[float], tuple[np.ndarray, dict[str, Rotation]]], times: np.ndarray) -> np.ndarray:
    """The motion of each bone from rest, (k, bones, 3, 4): rotation and shift."""
    rest = np.array([place for _, _, place in BONES])
    out = np.zeros((len(times), len(BONES), 3, 4))
    for k, t in enumerate(times):
        shift, turns = pose(float(t))
        places: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for i, (name, parent, _) in enumerate(BONES):
            turn = turns.get(name, Rotation.identity()).as_matrix()
            if parent:
                above, there = places[parent]
                turn, place = above @ turn, there + above @ (rest[i] - rest[NUMBER[parent]])
            else:
                place = rest[i] + shift
            places[name] = turn, place
            out[k, i, :, :3], out[k, i, :, 3] = turn, place - turn @ rest[i]
    return out


def skinned(body: Figure, motions: np.ndarray) -> np.ndarray:
    """Vertices (k, n, 3) [m]: each moves as its bones do, by their weights."""
    out = np.empty((len(motions), *body.vertices.shape))
    whole = np.c_[body.vertices, np.ones(len(body.vertices))]
    for k, motion in enumerate(motions):
        blended = (body.weights @ motion.reshape(len(BONES), 12)).reshape(-1, 3, 4)
        out[k] = np.einsum("nij,nj->ni", blended, whole)
    return out


def _smooth(s: np.ndarray) -> np.ndarray:
    s = np.clip(s, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


def _smoother(s: float) -> float:
    """From 0 to 1, with no speed and no acceleration at both ends."""
    s = float(np.clip(s, 0.0, 1.0))
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def _bump(s: float) -> float:
    """From 0 up to 1 at s = 1/2 and back at 1."""
    return _smoother(2.0 * s) if s < 0.5 else _smoother(2.0 - 2.0 * s)
