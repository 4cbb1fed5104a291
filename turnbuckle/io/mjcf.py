"""MJCF files (MuJoCo): bodies, joints, equality constraints, by MuJoCo's own parser, an optional extra.

The compiled model is what counts: defaults, includes, compiler settings and inertia from geoms are resolved by it. Joints
start at the file's reference configuration, or at the nearest one within their limits. Several joints of one body become
the joint that allows the same motions where there is one, else a chain with light bodies between.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.io.imported import APART, CONTACT_OFF, LIGHT, SAME, Frame, Gathering, Imported, ellipsoid, within

FREE, BALL, SLIDE, HINGE = 0, 1, 2, 3
FAR = 100.0  # [m], of a plane without end


@dataclass(frozen=True)
class _Joint:
    """One joint of MuJoCo at the start, in the world."""

    name: str
    kind: int
    anchor: np.ndarray
    axis: np.ndarray
    low: float | None  # from the start
    high: float | None


def read_mjcf(path: str | Path) -> Imported:
    """The scene in an MJCF file. Raises `InputError`, also where the optional `mujoco` is missing."""
    path = Path(path)
    if find_spec("mujoco") is None:
        raise InputError(f"{path}: MJCF needs the parser of MuJoCo; run: pip install 'turnbuckle[import]'")
    import mujoco

    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, OSError, UnicodeError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo cannot read it ({' '.join(str(error).split())})") from None
    return _Reader(mujoco, model, path).read()


class _Reader:
    def __init__(self, mujoco: Any, model: Any, path: Path) -> None:
        self.mujoco, self.model, self.path = mujoco, model, path
        self.out = Gathering(path, path.stem)
        self.data = mujoco.MjData(model)
        self.start: dict[int, float] = {}  # joint -> where hinges and slides start

    def named(self, kind: str, number: int, otherwise: str = "") -> str:
        return self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind}"), number) or otherwise

    def read(self) -> Imported:
        model, out = self.model, self.out
        out.data |= {"gravity": np.array(model.opt.gravity), "dt": float(model.opt.timestep)}
        self._begin_within_limits()
        self.mujoco.mj_kinematics(model, self.data)
        carrier: list[int] = [0] * model.nbody  # body -> itself, or the body whose part a massless frame is
        parts: dict[int, list[dict[str, Any]]] = {}
        for b in range(1, model.nbody):
            fused = model.body_jntnum[b] == 0 and model.body_mass[b] == 0.0 and model.body_mocapid[b] < 0
            carrier[b] = carrier[model.body_parentid[b]] if fused else b
        self.names = {b: out.name(self.named("BODY", b), "bodies", f"body_{b}") for b in set(carrier) - {0}}
        geoms: dict[int, list[int]] = {}
        for g in range(model.ngeom):
            geoms.setdefault(carrier[model.geom_bodyid[g]], []).append(g)
        for b, own in geoms.items():
            for g in self._taken(own) if b else own:
                self._geom(g, b, parts.setdefault(b, []))
        for b, name in self.names.items():
            self._body(b, name, parts.get(b, []), self._touch(geoms.get(b, [])))
        for b in self.names:
            self._joints(b, carrier[model.body_parentid[b]])
        for e in range(model.neq):
            self._equality(e, carrier)
        for signature in model.exclude_signature.tolist():
            one, other = (self.names.get(carrier[b]) for b in (signature >> 16, signature & 0xFFFF))
            if one is not None and other is not None and one != other:
                out.apart.append((one, other))
        out.note_all(APART, (self.named("EXCLUDE", e) for e in range(model.nexclude)))
        self._tell()
        return out.finish()

    def _begin_within_limits(self) -> None:
        m = self.model
        self.data.qpos[:] = m.qpos0
        for j in range(m.njnt):
            if m.jnt_type[j] not in (SLIDE, HINGE):
                continue
            at = m.jnt_qposadr[j]
            value = float(m.qpos0[at])
            if m.jnt_limited[j]:
                inside = within(value, *m.jnt_range[j].tolist())
                if inside != value:
                    self.out.note(f"joint '{self.named('JOINT', j)}': starts at {inside:.6g}, within its range")
                value = inside
            self.data.qpos[at] = self.start[j] = value

    def _frame(self, b: int) -> Frame:
        """Pose of a body in the world; MuJoCo's quaternions are wxyz."""
        return _frame(self.data.xpos[b], self.data.xquat[b])

    def _geom(self, g: int, b: int, parts: list[dict[str, Any]]) -> None:
        m = self.model
        frame = self._frame(m.geom_bodyid[g]) * _frame(m.geom_pos[g], m.geom_quat[g])
        label = self.named("GEOM", g, f"geom_{g}")
        size, kind = m.geom_size[g].tolist(), self.mujoco.mjtGeom(int(m.geom_type[g])).name.removeprefix("mjGEOM_")
        shape: dict[str, Any]
        if kind == "PLANE":
            sides = [2.0 * s if s > 0.0 else FAR for s in size[:2]]
            if b:
                self.out.note(f"geom '{label}': a plane that moves with body '{self.names[b]}' has no counterpart")
                return
            shape = {"plane": sides}
        elif kind == "BOX":
            shape = {"box": [2.0 * s for s in size]}
        elif kind == "SPHERE":
            shape = {"sphere": size[0]}
        elif kind in ("CAPSULE", "CYLINDER"):
            shape = {kind.lower(): {"radius": size[0], "length": 2.0 * size[1]}}
        elif kind == "ELLIPSOID":
            shape = ellipsoid(np.array(size))
        elif kind == "MESH":
            d = m.geom_dataid[g]
            points = slice(m.mesh_vertadr[d], m.mesh_vertadr[d] + m.mesh_vertnum[d])
            faces = slice(m.mesh_faceadr[d], m.mesh_faceadr[d] + m.mesh_facenum[d])
            shape = {"vertices": m.mesh_vert[points].astype(float), "triangles": m.mesh_face[faces].copy()}
        else:
            self.out.note(f"geom '{label}': a shape of type {kind.lower()} has no counterpart")
            return
        color = [float(c) for c in m.geom_rgba[g][:3]]
        if b:
            parts.append({**shape, **(self._frame(b).inverse() * frame).fields()})
            return
        name = self.out.name(label, "bodies", label)
        touch = self._touch([g])
        self.out.data["bodies"].append(
            {"type": "obstacle", "name": name, "color": color, **frame.fields(), **shape, **touch}
        )

    def _taken(self, geoms: list[int]) -> list[int]:
        """Of the geoms of a body those that can touch, where it has such."""
        m = self.model
        touching = [g for g in geoms if m.geom_contype[g] or m.geom_conaffinity[g]]
        left = [self.named("GEOM", g, f"geom_{g}") for g in geoms if touching and g not in touching]
        self.out.note_all("geoms that touch nothing, of bodies with others that do", left)
        return touching or geoms

    def _touch(self, geoms: Sequence[int]) -> dict[str, Any]:
        """What a scene says of the surface of a body: friction (the largest of its geoms), or that it touches nothing."""
        m = self.model
        touching = [g for g in geoms if m.geom_contype[g] or m.geom_conaffinity[g]]
        if not touching:
            return {"contact": "off"} if geoms else {}
        return {"static_friction": max(float(m.geom_friction[g][0]) for g in touching)}

    def _body(self, b: int, name: str, parts: list[dict[str, Any]], touch: dict[str, Any]) -> None:
        m = self.model
        mass = float(m.body_mass[b])
        inertial = Rotation.from_quat(m.body_iquat[b], scalar_first=True).as_matrix()
        still = m.body_mocapid[b] >= 0 or (m.body_jntnum[b] == 0 and m.body_weldid[b] == 0)
        more: dict[str, Any] = {"motion": "immobile", **touch} if still else dict(touch)
        if m.body_mocapid[b] >= 0:
            self.out.note(f"body '{name}': a mocap body stands still")
        if mass <= 0.0:
            self.out.rigid(name, self._frame(b), parts, None, None, None, **more)
            return
        inertia = inertial @ np.diag(m.body_inertia[b]) @ inertial.T
        self.out.rigid(name, self._frame(b), parts, mass, np.array(m.body_ipos[b]), inertia, **more)

    def _joints(self, b: int, parent: int) -> None:
        m = self.model
        name, body0 = self.names[b], self.names.get(parent)
        if m.body_mocapid[b] >= 0 or (m.body_jntnum[b] == 0 and m.body_weldid[b] == 0):
            return
        joints = []
        for j in range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b]):
            low = high = None
            if m.jnt_limited[j]:
                start = self.start.get(j, 0.0)
                low, high = (float(v) - start for v in m.jnt_range[j])
            joint = self.out.name(self.named("JOINT", j), "constraints", f"{name}_joint")
            kind = int(m.jnt_type[j])
            joints.append(_Joint(joint, kind, np.array(self.data.xanchor[j]), np.array(self.data.xaxis[j]), low, high))
        if not joints:
            weld = self.out.name(f"{name}_weld", "constraints", "weld")
            self.out.join("weld", weld, body0, name, anchor=self._frame(b).x)
            return
        if all(j.kind == FREE for j in joints):
            return
        back = self._frame(parent).turn.inv() if parent else Rotation.identity()
        if len(joints) == 1:
            self._single(joints[0], back, body0, name)
        elif not self._together(joints, back, self._frame(b).turn.inv(), body0, name):
            self._chain(joints, self._frame(b), back, body0, name)

    def _single(self, j: _Joint, back: Rotation, body0: str | None, body1: str) -> None:
        """One joint; ``back`` turns the world's axes into body0's."""
        axis = back.apply(j.axis)
        if j.kind == BALL:
            if j.high is not None:
                self.out.note(f"joint '{j.name}': the range of a ball joint has no counterpart")
            self.out.join("ball", j.name, body0, body1, anchor=j.anchor)
            return
        kind = "revolute" if j.kind == HINGE else "prismatic"
        limits = self.out.limits(j.name, j.low, j.high, j.kind == HINGE)
        self.out.join(kind, j.name, body0, body1, anchor=j.anchor, axis=axis, **limits)

    def _together(
        self, joints: Sequence[_Joint], back: Rotation, back1: Rotation, body0: str | None, body1: str
    ) -> bool:
        """Several joints as one of ours, if there is one with the same freedom and no limit is lost."""
        hinges, slides = ([j for j in joints if j.kind == kind] for kind in (HINGE, SLIDE))
        if len(hinges) + len(slides) < len(joints) or any(j.low is not None for j in hinges):
            return False
        axes = np.array([j.axis for j in slides])
        name, anchor = "_".join(j.name for j in joints), joints[-1].anchor
        at_one = all(np.abs(j.anchor - anchor).max() < SAME * (1.0 + np.abs(anchor).max()) for j in hinges)
        free_slides = all(j.low is None for j in slides)
        name = self.out.name(name, "constraints", name)
        if len(hinges) == 2 and not slides and at_one and abs(hinges[0].axis @ hinges[1].axis) < SAME:
            turns = {"axis0": back.apply(hinges[0].axis), "axis1": back1.apply(hinges[1].axis)}
            self.out.join("universal", name, body0, body1, anchor=anchor, **turns)
        elif len(hinges) == 3 and not slides and at_one and _span(np.array([j.axis for j in hinges])) == 3:
            self.out.join("ball", name, body0, body1, anchor=anchor)
        elif len(hinges) == 1 and len(slides) == 1 and 1.0 - abs(slides[0].axis @ hinges[0].axis) < SAME:
            limits = self.out.limits(name, slides[0].low, slides[0].high, False)
            axis = back.apply(slides[0].axis)
            self.out.join("cylindrical", name, body0, body1, anchor=hinges[0].anchor, axis=axis, **limits)
        elif len(slides) == 2 and free_slides and _span(axes) == 2 and len(hinges) <= 1:
            normal = np.cross(*axes)
            normal /= np.linalg.norm(normal)
            if hinges and 1.0 - abs(normal @ hinges[0].axis) > SAME:
                return False
            normal = back.apply(normal)
            if hinges:
                self.out.join("planar", name, body0, body1, anchor=anchor, axis=normal)
            else:
                self.out.join(
                    "joint", name, body0, body1, anchor=anchor, planar={"normal": normal}, fixed_rotation=True
                )
        elif len(slides) == 3 and not hinges and free_slides and _span(axes) == 3:
            self.out.join("joint", name, body0, body1, fixed_rotation=True)
        else:
            return False
        return True

    def _chain(self, joints: Sequence[_Joint], frame: Frame, back: Rotation, body0: str | None, body1: str) -> None:
        """Joint by joint, with a light body after each but the last."""
        made = []
        for j in joints[:-1]:
            link = self.out.name(f"{body1}_{j.name}", "bodies", body1)
            self.out.data["bodies"].append(
                {"type": "rigid", "name": link, "position": j.anchor, "sphere": 0.01, "mass": LIGHT, "contact": "off"}
            )
            self._single(j, back, body0, link)
            body0, back = link, Rotation.identity()
            made.append(link)
        self._single(joints[-1], back, body0, body1)
        self.out.note(
            f"body '{body1}': its {len(joints)} joints became a chain over light bodies ({', '.join(made)}, "
            f"{1e3 * LIGHT:g} g each)"
        )

    def _equality(self, e: int, carrier: Sequence[int]) -> None:
        m = self.model
        name = self.out.name(self.named("EQUALITY", e), "constraints", f"equality_{e}")
        kind = self.mujoco.mjtEq(int(m.eq_type[e])).name.removeprefix("mjEQ_").lower()
        if kind not in ("connect", "weld"):
            self.out.note(f"equality '{name}': a coupling of type {kind} has no counterpart")
            return
        sites = int(m.eq_objtype[e]) == int(self.mujoco.mjtObj.mjOBJ_SITE)
        own = [int(m.eq_obj1id[e]), int(m.eq_obj2id[e])]
        raw = [int(m.site_bodyid[o]) for o in own] if sites else own
        ends = [carrier[b] for b in raw]
        frames = [self._frame(b) for b in raw]
        if sites:
            frames = [f * _frame(m.site_pos[o], m.site_quat[o]) for f, o in zip(frames, own, strict=True)]
        values = np.array(m.eq_data[e])
        places = [Frame(), Frame()]  # of the joint, in each of the two frames
        if kind == "connect" and not sites:
            places = [Frame(values[:3]), Frame(values[3:6])]
        elif kind == "weld" and not sites:
            # `relpose` is the pose of body 2 in body 1, and the anchor is given in body 2.
            relative = Frame(values[3:6], Rotation.from_quat(values[6:10], scalar_first=True))
            places = [relative * Frame(values[:3]), Frame(values[:3])]
        joint = [f * p for f, p in zip(frames, places, strict=True)]
        local = [(self._frame(b).inverse() * f if b else f) for b, f in zip(ends, joint, strict=True)]
        more: dict[str, Any] = {} if m.eq_active0[e] else {"enabled": False}
        if ends[0] == ends[1]:
            self.out.note(f"equality '{name}': both ends are of one body")
            return
        first, second = (0, 1) if ends[1] else (1, 0)
        if kind == "weld":
            turned = (joint[0].turn.inv() * joint[1].turn).magnitude()
            if turned > 1e-6:
                self.out.note(f"equality '{name}': keeps the rotation of the start, {turned:.3g} rad from the file's")
        self.out.join(
            "ball" if kind == "connect" else "weld", name, self.names.get(ends[first]), self.names[ends[second]],
            local_pos0=local[first].x, local_pos1=local[second].x, **more,
        )  # fmt: skip

    def _tell(self) -> None:
        """All else in the file."""
        m, out = self.model, self.out
        for kind, count, what in (
            ("ACTUATOR", m.nu, "actuators"), ("TENDON", m.ntendon, "tendons"), ("SENSOR", m.nsensor, "sensors"),
            ("FLEX", getattr(m, "nflex", 0), "flexes"), ("SKIN", m.nskin, "skins"), ("KEY", m.nkey, "keyframes"),
            ("PAIR", m.npair, "contact pairs"),
            ("PLUGIN", getattr(m, "nplugin", 0), "plugins"),
        ):  # fmt: skip
            out.note_all(f"{what} have no counterpart", (self.named(kind, i) for i in range(count)))
        dofs = m.jnt_dofadr
        for values, what in (
            (m.jnt_stiffness, "spring of a joint"), (m.dof_damping[dofs] if m.njnt else [], "damping of a joint"),
            (m.dof_frictionloss[dofs] if m.njnt else [], "friction of a joint"),
            (m.dof_armature[dofs] if m.njnt else [], "armature of a joint"),
        ):  # fmt: skip
            out.note_all(f"{what} has no counterpart", (self.named("JOINT", int(j)) for j in np.flatnonzero(values)))
        if m.ngeom:
            out.note(CONTACT_OFF)


def _frame(x: np.ndarray, wxyz: np.ndarray) -> Frame:
    return Frame(np.array(x, dtype=float), Rotation.from_quat(wxyz, scalar_first=True))


def _span(axes: np.ndarray) -> int:
    return int(np.linalg.matrix_rank(axes, tol=1e-6)) if len(axes) else 0
