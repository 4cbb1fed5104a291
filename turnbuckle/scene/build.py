"""From what the user wrote to what is simulated: ``SceneDef -> (Model, State)``."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

from turnbuckle.compute import start_warp
from turnbuckle.constraints.activation import new_owner
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Field, ForceField, Model, Springs
from turnbuckle.data.shape import Shape, Skin
from turnbuckle.data.state import PARAMS, Kinematics, State
from turnbuckle.data.tables import Tables, empty_table
from turnbuckle.scene.build_bodies import Body, build_body
from turnbuckle.scene.build_constraints import add_constraints
from turnbuckle.scene.definitions import ForceDef, SceneDef
from turnbuckle.scene.expression import compile_expression
from turnbuckle.scene.upload import make_tetrahedra, upload

STANDARD_GRAVITY = 9.81  # [m/s^2]
FORCE_VARIABLES = ("x", "y", "z", "vx", "vy", "vz", "t", "m")


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
    bodies = [build_body(d, folder) for d in definition.bodies]
    begins = np.cumsum([0, *(len(b.x) for b in bodies)])
    x = np.concatenate([b.x for b in bodies])
    mass = np.concatenate([b.mass for b in bodies])
    springs = _springs(bodies, begins, x)
    corners = np.concatenate([b.tetrahedra + begin for b, begin in zip(bodies, begins[:-1], strict=True)]).astype(
        np.int32
    )
    material = np.repeat(np.arange(len(bodies)), [len(b.tetrahedra) for b in bodies]).astype(np.int32)
    materials = np.array([b.material for b in bodies], dtype=np.float64)
    tets, owns_edge, owns_triangle = make_tetrahedra(corners, material, materials, x)
    shapes = tuple(_shape(b.shape, int(begin)) for b, begin in zip(bodies, begins[:-1], strict=True))
    model = Model(
        name=definition.name,
        device=device,
        up_axis=definition.up_axis,
        integrator=definition.integrator,
        response=definition.response,
        conflicts=definition.conflicts,
        mass=mass,
        rest=x,
        size=float(np.linalg.norm(np.ptp(x, axis=0))),
        springs=springs,
        tetrahedra=tets,
        fields=tuple(_field(f, shapes, len(x)) for f in definition.forces),
        shapes=shapes,
        repairs=tuple(b.repairs for b in bodies if b.repairs),
        device_arrays=upload(mass, springs, tets, owns_edge, owns_triangle, device),
    )
    state = _first_state(definition, model, np.repeat([b.velocity for b in bodies], np.diff(begins), axis=0))
    add_constraints(model, state, definition.constraints)
    state.scene_groups = state.group_count
    return model, state


def _first_state(definition: SceneDef, model: Model, velocity: np.ndarray) -> State:
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
        params=wp.zeros(PARAMS, dtype=wp.float64, device=device),
        gravity=np.asarray(gravity, dtype=np.float64),
        dt=0.0,
        owner=owner,
        domain_use=domain_use,
        nailed=nailed,
        external=external,
    )


def _springs(bodies: list[Body], begins: np.ndarray, x: np.ndarray) -> Springs:
    pairs = np.concatenate([b.pairs + begin for b, begin in zip(bodies, begins[:-1], strict=True)]).astype(np.int32)
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


def _field(definition: ForceDef, shapes: tuple[Shape, ...], n: int) -> Field:
    points = np.arange(n, dtype=np.int32)
    if definition.body is not None:
        shape = next(s for s in shapes if s.name == definition.body)
        points = points[shape.begin : shape.end]
    force = definition.callable if definition.callable is not None else _expression_force(definition.expression)
    return Field(definition.name, points, force)


def _expression_force(texts: list[str]) -> ForceField:
    parts: list[Callable[..., np.ndarray]] = [compile_expression(text, FORCE_VARIABLES) for text in texts]

    def force(x: np.ndarray, v: np.ndarray, t: float, mass: np.ndarray) -> np.ndarray:
        given = dict(zip(FORCE_VARIABLES, (*x.T, *v.T, t, mass), strict=True))
        return np.stack([np.broadcast_to(part(**given), len(mass)) for part in parts], axis=1)

    return force
