"""The user's own mesh, nailed at one end, as a piece of jelly."""

from pathlib import Path
from typing import Literal

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.read import SurfaceMesh, TetMesh, read_mesh
from turnbuckle.meshes.repair import check_surface, repair_tetrahedra
from turnbuckle.meshes.shapes import box_tetrahedra, six_volumes
from turnbuckle.meshes.tetrahedralise import tetrahedralise
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.stability import energy_rows

GRAVITY = 9.81  # [m/s^2]
SAFETY = 0.4  # of the largest stable step: elements that are squeezed or stretched are stiffer than at rest
DAMPING_RATIO = 0.15  # of the slowest vibration
MANY_STEPS = 200_000  # more than these, and the implicit scheme is quicker
IMPLICIT_STEPS = 200


def soft_mesh(
    mesh: str | None = None,
    side: Literal["+x", "-x", "+y", "-y", "+z", "-z"] = "-x",
    thickness: float = 0.08,
    scale: float = 1.0,
    up_axis: Literal["Y", "Z"] = "Z",
    firmness: float = 100.0,
    density: float = 1000.0,
    edge_length: float | None = None,
) -> Scene:
    """Your own mesh, nailed at one end, sags and swings under gravity like firm jelly.

    `mesh`: a closed surface (OBJ, PLY, STL, GLB, OFF; it is filled with tetrahedra of about `edge_length` [m], and the
    surface moves with them) or a tetrahedral mesh (.msh, .vtk, .vtu, .mesh); without one, a twisted bar. `scale` makes
    its units metres. The points within `thickness` (a fraction of the extent) of `side` are nailed.

    Stiffness goes with size and weight, so a mesh of a millimetre behaves as one of a hundred metres: Young's modulus is
    about `firmness` times density g L, L the mesh's largest extent. With N tetrahedra in a volume V each energy gets
    k = E V / N. dt is taken from the fastest vibration, the duration is 12 (L / g)^(1/2).
    All elements of a solid have one k, so tiny ones among large ones ask for tiny steps: where that would be more than
    200,000 steps, it is implicit Euler with 200.
    """
    for name, value in (("scale", scale), ("firmness", firmness), ("density", density)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"soft_mesh: {name} = {value:g} must be positive")
    points, cells, surface = _geometry(mesh, edge_length, scale)
    extent = float(np.ptp(points, axis=0).max())
    volume = float(six_volumes(points, cells).sum()) / 6.0
    k = firmness * density * GRAVITY * extent * volume / len(cells)

    fast = _fastest(points, cells, density, k)
    slow = (firmness * GRAVITY / extent) ** 0.5  # about the slowest vibration of a compact body [1/s]
    # Damping k_d = tau k, no stronger than leaves 0.62 of the step that is stable without.
    tau = min(2.0 * DAMPING_RATIO / slow, 1.0 / fast)
    gamma = tau * fast * fast
    dt = SAFETY * 4.0 / (gamma + (gamma * gamma + 4.0 * fast * fast) ** 0.5)
    duration = 12.0 * (extent / GRAVITY) ** 0.5
    integrator = "verlet"
    if duration > MANY_STEPS * dt:
        integrator, dt = "implicit_euler", duration / IMPLICIT_STEPS

    scene = Scene(
        "soft_mesh",
        up_axis=up_axis,
        gravity=[0.0, 0.0, -GRAVITY] if up_axis == "Z" else [0.0, -GRAVITY, 0.0],
        dt=float(f"{dt:.2g}"),
        integrator=integrator,
        duration=float(f"{duration:.3g}"),
        frames_per_second=float(f"{max(60.0, 100.0 / duration):.3g}"),
    )
    finer = {} if surface is None else {"surface": surface}
    scene.add_solid(
        "mesh",
        vertices=points / scale,
        tetrahedra=cells,
        scale=scale,
        density=density,
        color=[0.30, 0.58, 0.52],
        k_distance=k,
        k_area=k,
        k_volume=k,
        damping_distance=tau * k,
        damping_area=tau * k,
        damping_volume=tau * k,
        **finer,
    )
    scene.add_constraint("nail", "end", points={"body": "mesh", "side": side, "thickness": thickness})
    return scene


def _geometry(mesh: str | None, edge_length: float | None, scale: float) -> tuple[np.ndarray, np.ndarray, str | None]:
    """Points [m], tetrahedra, and the path of the surface that moves with them, if there is one."""
    if mesh is None:
        points, cells = _twisted_bar()
        return points * scale, cells, None
    found = read_mesh(Path(mesh).expanduser())
    surface = None
    if isinstance(found, SurfaceMesh):
        vertices, triangles, _ = check_surface(found.vertices, found.triangles)
        wanted = None if edge_length is None else edge_length / scale
        points, cells = tetrahedralise(vertices, triangles, edge_length=wanted)
        surface = mesh
    elif isinstance(found, TetMesh):
        points, cells = found.vertices, found.tetrahedra
    else:
        raise InputError(f"soft_mesh: mesh '{mesh}' has lines only; give a closed surface or tetrahedra")
    points, cells, _ = repair_tetrahedra(points, cells)
    return points * scale, cells, surface


def _twisted_bar(length: float = 1.0, width: float = 0.2, turns: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A square bar along x from x = 0 [m], twisted about its axis."""
    points, cells = box_tetrahedra((length, width, width), (20, 4, 4))
    angle = 2.0 * np.pi * turns * points[:, 0] / length
    y, z = points[:, 1] - 0.5 * width, points[:, 2] - 0.5 * width
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([points[:, 0], cos * y - sin * z, sin * y + cos * z], axis=1), cells


def _fastest(points: np.ndarray, cells: np.ndarray, density: float, k: float) -> float:
    """The angular frequency of the fastest vibration [rad/s]."""
    trial = Scene("trial")
    fields = {"k_distance": k, "k_area": k, "k_volume": k}
    trial.add_solid("mesh", vertices=points, tetrahedra=cells, density=density, **fields)
    model, state = trial.build()
    rows = energy_rows(model, state.positions())
    found = rows.largest(rows.k)
    if found == 0.0:  # the eigenvalue was not found: the largest sum of a row and of a column bound it
        g = abs(rows.gradient) * (rows.k**0.5)[:, None]
        found = float(g.sum(axis=0).max() * g.sum(axis=1).max())
    return found**0.5
