"""Rigid bodies, soft solids and cloth dropped on each other: Contact, Figure 4."""

import numpy as np

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.solids import sphere_surface
from turnbuckle.scene.scene import Scene

YELLOW, ORANGE, RED = (0.93, 0.78, 0.30), (0.91, 0.52, 0.24), (0.78, 0.25, 0.24)  # as in the paper's figure


def mixed_stack(
    storeys: int = 2,
    youngs_modulus: float = 2e5,
    poissons_ratio: float = 0.35,
    density: float = 500.0,
    mu: float = 0.4,
    cloth_cells: int = 24,
    dt: float = 5e-3,
    duration: float = 4.0,
) -> Scene:
    """Rigid bodies (yellow), soft solids (orange) and cloth (red) are dropped on each other (Contact, Figure 4).

    Each of `storeys` storeys is four rigid boxes, a cloth of `cloth_cells` cells a side over them, four soft boxes and a
    soft ball, another cloth, and three rigid balls: cloth is pressed between rigid and soft bodies, as in the paper.
    Boxes are 0.25 m, balls 0.24 m across, cloths 1 m. Solids are corotational: E = `youngs_modulus` [Pa] 2e5,
    nu = `poissons_ratio` 0.35, `density` [kg/m^3] 500, that of rigid bodies too; cloth 0.3 kg/m^2, springs of 500 N/m,
    bending 5e-5 N m/rad. Friction `mu` 0.4.
    """
    if storeys < 1:
        raise InputError(f"mixed_stack: storeys = {storeys} must be at least 1")
    scene = Scene("mixed_stack", dt=dt, duration=duration, contact={"friction": mu})
    scene.add_obstacle("ground", box=[12.0, 12.0, 0.2], position=[0.0, 0.0, -0.1])
    soft = {
        "youngs_modulus": youngs_modulus,
        "poissons_ratio": poissons_ratio,
        "density": density,
        "damping": 0.005,
        "color": ORANGE,
    }
    edge, gap, height = 0.25, 0.05, 0.03
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.19
    ball, ball_triangles = sphere_surface(0.12, 20)
    for storey in range(storeys):
        for k, (x, y) in enumerate(corners):
            turned = [0.0, 0.0, 0.15 * (k - 1.5)]
            scene.add_rigid(
                f"box{storey}{k}",
                box=[edge] * 3,
                position=[x, y, height + 0.5 * edge],
                rotation=turned,
                density=density,
                color=YELLOW,
            )
        height += edge + gap
        height = _add_cloth(scene, f"cloth{storey}a", height, cloth_cells, 0.1) + gap
        for k, (x, y) in enumerate(corners):
            scene.add_solid(
                f"soft{storey}{k}",
                box={"size": [edge] * 3, "cells": [3, 3, 3]},
                position=[x - 0.5 * edge + 0.03 * storey, y - 0.5 * edge, height],
                **soft,
            )
        scene.add_solid(
            f"ball{storey}",
            vertices=ball,
            triangles=ball_triangles,
            cage=200,
            position=[0.02, 0.01, height + edge + gap + 0.12],
            **soft,
        )
        height += edge + gap + 0.24 + gap
        height = _add_cloth(scene, f"cloth{storey}b", height, cloth_cells, 0.6) + gap
        for k in range(3):
            angle = 2.0 * np.pi * k / 3 + storey
            scene.add_rigid(
                f"stone{storey}{k}",
                sphere=0.12,
                position=[0.17 * np.cos(angle), 0.17 * np.sin(angle), height + 0.12 + 0.02 * k],
                density=density,
                color=YELLOW,
            )
        height += 0.24 + 0.04 + gap
    return scene


def _add_cloth(scene: Scene, name: str, height: float, cells: int, turn: float) -> float:
    """A level cloth of 1 m, turned about the vertical; returns its height."""
    cos, sin = np.cos(turn), np.sin(turn)
    corner = -0.5 * np.array([cos - sin, sin + cos])
    scene.add_cloth(
        name,
        size=[1.0, 1.0],
        cells=[cells, cells],
        position=[*corner, height],
        rotation=[0.0, 0.0, turn],
        density=0.3,
        structural_stiffness=500.0,
        shear_stiffness=500.0,
        bend_model="hinges",
        bend_stiffness=5e-5,
        damping=0.02,
        color=RED,
    )
    return height
