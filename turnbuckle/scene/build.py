"""From what the user wrote to what is simulated: ``SceneDef -> (Model, State)``."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

from turnbuckle.compute import start_warp
from turnbuckle.constraints.activation import new_owner
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Corotational, Field, Hinges, Model, Springs, StrainLimits
from turnbuckle.data.rigid import RigidBodies, RigidField
from turnbuckle.data.shape import Shape, Skin
from turnbuckle.data.state import PARAMS, Kinematics, State
from turnbuckle.data.tables import Tables, empty_table
from turnbuckle.scene.build_bodies import Body, build_body
from turnbuckle.scene.build_coating import carry_coatings, dress_coatings, expand_coatings
from turnbuckle.scene.build_constraints import add_constraints
from turnbuckle.scene.build_contact import contact_options, contact_surfaces
from turnbuckle.scene.build_hinges import hinge_angles
from turnbuckle.scene.build_joints import add_joints, empty_parts
from turnbuckle.scene.build_obstacles import first_velocities, scripted
from turnbuckle.scene.build_rigid_bodies import first_state as first_rigid_state
from turnbuckle.scene.build_rigid_bodies import no_loads, rigid_bodies, rigid_field
from turnbuckle.scene.build_skin import add_skins
from turnbuckle.scene.definitions import BodyPairDef, CoatingDef, RigidDef, SceneDef
from turnbuckle.scene.expression_force import ExpressionForce
from turnbuckle.scene.pulls import pull_field
from turnbuckle.scene.upload import make_tetrahedra, upload

STANDARD_GRAVITY = 9.81  # [m/s^2]


def build(definition: SceneDef, folder: Path, device: str = "cpu") -> tuple[Model, State]:
    """Make the model and its first state. Mesh paths are relative to ``folder``. Raises InputError."""
    start_warp()
    try:
        wp.get_device(device)
    except (ValueError, RuntimeError) as error:
        raise InputError(
            f"device '{device}' is not there ({error}); use 'cpu', or 'cuda:0' with an NVIDIA driver"
        ) from None
    if not definition.bodies:
        raise InputError(f"scene '{definition.name}' has no bodies; add one")
    written = definition
    definition = expand_coatings(definition, folder)
    bodies = [build_body(d, folder) for d in definition.bodies]
    begins = np.cumsum([0, *(len(b.x) for b in bodies)])
    x = np.concatenate([b.x for b in bodies])
    mass = np.concatenate([b.mass for b in bodies])
    springs = _springs(bodies, begins, x)
    every = _numbered([b.tetrahedra for b in bodies], begins)
    owner = np.repeat(np.arange(len(bodies)), [len(b.tetrahedra) for b in bodies]).astype(np.int32)
    elastic = np.array([b.elastic is not None for b in bodies])[owner]
    corners, material = every[~elastic], owner[~elastic]
    materials = np.array([b.material for b in bodies], dtype=np.float64)
    tets, owns_edge, owns_triangle = make_tetrahedra(corners, material, materials, x)
    shapes = tuple(_shape(b.shape, int(begin)) for b, begin in zip(bodies, begins[:-1], strict=True))
    rigid = [(d, b, s) for d, b, s in zip(definition.bodies, bodies, shapes, strict=True) if isinstance(d, RigidDef)]
    rigid_definitions = [d for d, _, _ in rigid]
    rigids = rigid_bodies(rigid_definitions, [b for _, b, _ in rigid], [s for _, _, s in rigid], len(x))
    kernels = {body.name: body.around for body in written.bodies if isinstance(body, CoatingDef)}
    dressed = dress_coatings(written, shapes, x, folder)
    fields, rigid_fields = _fields(definition, shapes, x, mass, rigids)
    hinges, corotational = _hinges(bodies, begins, x), _corotational(bodies, every[elastic], owner[elastic], x)
    model = Model(
        name=definition.name,
        device=device,
        up_axis=definition.up_axis,
        integrator=definition.integrator,
        response=definition.response,
        conflicts=definition.conflicts,
        mass=mass,
        rest=x,
        size=_size(bodies, x),
        springs=springs,
        tetrahedra=tets,
        fields=fields,
        shapes=add_skins(written, dressed, x),
        rigid=rigids,
        rigid_fields=rigid_fields,
        solver=definition.solver,
        displacement=definition.displacement,
        rigid_motion=definition.rigid_motion,
        max_rotation=definition.max_rotation,
        hinges=hinges,
        corotational=corotational,
        strain_limits=_strain_limits(bodies, begins, x),
        scripted=scripted(definition.bodies, [b.motion for b in bodies], shapes),
        surfaces=contact_surfaces(definition, kernels, dressed, x),
        contact=contact_options(definition.contact),
        repairs=tuple(b.repairs for b in bodies if b.repairs),
        device_arrays=upload(mass, springs, tets, owns_edge, owns_triangle, hinges, corotational, x, device),
    )
    velocity = np.repeat([b.velocity for b in bodies], np.diff(begins), axis=0)
    first_velocities(model.scripted, velocity, definition.dt)
    state = _first_state(definition, model, velocity, rigid_definitions)
    carry_coatings(written, model, state)
    joints = [c for c in definition.constraints if isinstance(c, BodyPairDef)]
    add_joints(model, state, joints, folder)
    state.scene_parts = state.parts.count
    add_constraints(model, state, [c for c in definition.constraints if not isinstance(c, BodyPairDef)])
    state.scene_groups = state.group_count
    return model, state


def _first_state(definition: SceneDef, model: Model, velocity: np.ndarray, rigid: list[RigidDef]) -> State:
    device, n = model.device, model.points
    gravity = definition.gravity
    if gravity is None:
        gravity = -STANDARD_GRAVITY * np.array([0.0, float(model.up_axis == "Y"), float(model.up_axis == "Z")])
    now = Kinematics.zeros(n, device)
    now.x.assign(model.rest)
    now.v.assign(np.ascontiguousarray(velocity, dtype=np.float64))
    owner, domain_use, nailed, external = new_owner(n, device)
    kinds = ("nail", "points_to_point", "attach", "slide", "velocity")
    return State(
        now=now,
        tables=Tables(**{kind: empty_table(kind, 0, device) for kind in kinds}),
        rigid=first_rigid_state(rigid, model.rigid, device),
        loads=no_loads(model.rigid.count),
        parts=empty_parts(),
        params=wp.zeros(PARAMS, dtype=wp.float64, device=device),
        gravity=np.asarray(gravity, dtype=np.float64),
        dt=0.0,
        owner=owner,
        domain_use=domain_use,
        follows=_followers(model),
        nailed=nailed,
        external=external,
    )


def _size(bodies: list[Body], x: np.ndarray) -> float:
    """Diagonal [m] of the box around all points but those of obstacles, which may be wide floors."""
    counted = np.repeat([b.motion is None for b in bodies], [len(b.x) for b in bodies])
    return float(np.linalg.norm(np.ptp(x[counted] if counted.any() else x, axis=0)))


def _followers(model: Model) -> np.ndarray:
    """Points without a mass of their own (points,) bool: those of rigid bodies and of scripts."""
    follows = model.body_of >= 0
    for script in model.scripted:
        follows[script.begin : script.end] = True
    return follows


def _numbered(parts: list[np.ndarray], begins: np.ndarray) -> np.ndarray:
    """Elements of all bodies, their points numbered among those of the state."""
    return np.concatenate([part + begin for part, begin in zip(parts, begins[:-1], strict=True)]).astype(np.int32)


def _hinges(bodies: list[Body], begins: np.ndarray, x: np.ndarray) -> Hinges:
    points = _numbered([b.hinges for b in bodies], begins)
    counts = [len(b.hinges) for b in bodies]
    k, k_d = (np.repeat([getattr(b, f"hinge_{name}") for b in bodies], counts) for name in ("stiffness", "damping"))
    return Hinges(points, hinge_angles(points, x), k, k_d)


def _strain_limits(bodies: list[Body], begins: np.ndarray, x: np.ndarray) -> StrainLimits:
    pairs = _numbered([b.limited for b in bodies], begins)
    longest = 1.0 + np.repeat([b.strain_limit for b in bodies], [len(b.limited) for b in bodies])
    return StrainLimits(pairs, longest * np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1))


def _corotational(bodies: list[Body], corners: np.ndarray, owner: np.ndarray, x: np.ndarray) -> Corotational:
    values = np.array([b.elastic or (0.0, 0.0, 0.0) for b in bodies])[owner].reshape(-1, 3)
    return Corotational(corners, *(np.ascontiguousarray(column) for column in values.T), rest=x[corners])


def _springs(bodies: list[Body], begins: np.ndarray, x: np.ndarray) -> Springs:
    pairs = _numbered([b.pairs for b in bodies], begins)
    length = np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
    for body, begin in zip(bodies, begins[:-1], strict=True):
        flat = np.linalg.norm(x[body.pairs[:, 1] + begin] - x[body.pairs[:, 0] + begin], axis=1) == 0.0
        if flat.any():
            a, b = body.pairs[np.argmax(flat)]
            raise InputError(
                f"body '{body.name}': points {a} and {b} are joined by a spring but lie in one place; merge them"
            )
    stiffness = np.concatenate([b.stiffness for b in bodies])
    damping = np.concatenate([b.damping for b in bodies])
    return Springs(pairs, length, stiffness * length**2, damping * length**2)


def _shape(shape: Shape, begin: int) -> Shape:
    skin = None if shape.skin is None else Skin(shape.skin.points + begin, shape.skin.weights, shape.skin.triangles)
    return replace(shape, begin=begin, end=begin + shape.end, skin=skin)


def _fields(
    definition: SceneDef, shapes: tuple[Shape, ...], x: np.ndarray, mass: np.ndarray, rigids: RigidBodies
) -> tuple[tuple[Field, ...], tuple[RigidField, ...]]:
    """Force fields on mass points, and on rigid bodies."""
    fields, on_rigid = [], []
    for d in definition.forces:
        if d.pull is not None:
            fields.append(pull_field(d, shapes, x, mass, definition.dt))
            continue
        force = d.callable if d.callable is not None else ExpressionForce.of(d.expression or ["0.0"] * 3)
        torque = None if d.torque is None else ExpressionForce.of(d.torque)
        field = rigid_field(d, rigids, force, torque)
        if field is not None:
            on_rigid.append(field)
        elif d.at is not None or d.torque is not None:
            raise InputError(f"force '{d.name}': 'at' and 'torque' are for rigid bodies; '{d.body}' is none")
        points = np.flatnonzero(mass > 0.0).astype(np.int32)
        if d.body is not None:
            shape = next(s for s in shapes if s.name == d.body)
            points = points[(points >= shape.begin) & (points < shape.end)]
        if len(points) and d.given(("expression", "callable")):
            fields.append(Field(d.name, points, force))
    return tuple(fields), tuple(on_rigid)
