"""Nails, hinges, soft-rigid attachments, cloth and piles in one scene."""

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene

WOOD, RUBBER, CLOTH, STONE = (0.70, 0.52, 0.34), (0.88, 0.50, 0.28), (0.36, 0.50, 0.70), (0.60, 0.60, 0.62)


def hung_and_hit(
    cells: int = 30,
    youngs_modulus: float = 2e5,
    poissons_ratio: float = 0.35,
    density: float = 400.0,
    mu: float = 0.4,
    swing: float = 60.0,
    dt: float = 5e-3,
    duration: float = 3.0,
) -> Scene:
    """A hammer swings on hinges through a nailed curtain into a pile, a soft buffer on its front.

    The paper's unified contact beside the constraints of the other two: a curtain of `cells` cells a side is nailed at
    its top edge; an arm of two rigid links hangs from a hinge in the air, with a rigid head at its end, on whose front a
    soft block is attached point by point; raised by `swing` [degrees] it falls, hits the curtain, and pushes it into a
    pile of rigid and soft boxes with a cloth over them.
    Soft bodies are corotational: E = `youngs_modulus` [Pa] 2e5, nu = `poissons_ratio` 0.35, `density` [kg/m^3] 400, that
    of rigid bodies too; boxes of 0.2 m; cloth 0.3 kg/m^2, springs of 500 N/m, bending 5e-5 N m/rad. Friction `mu` 0.4.
    """
    if not 5.0 <= swing <= 100.0:
        raise InputError(f"hung_and_hit: swing = {swing:g} degrees must be from 5 to 100")
    scene = Scene("hung_and_hit", dt=dt, duration=duration, contact={"friction": mu})
    scene.add_obstacle("ground", box=[12.0, 12.0, 0.2], position=[0.0, 0.0, -0.1])
    soft = {
        "youngs_modulus": youngs_modulus,
        "poissons_ratio": poissons_ratio,
        "density": density,
        "damping": 0.005,
        "color": RUBBER,
    }
    _add_hammer(scene, np.radians(swing), density, soft)
    woven = {
        "density": 0.3,
        "structural_stiffness": 500.0,
        "shear_stiffness": 500.0,
        "bend_model": "hinges",
        "bend_stiffness": 5e-5,
        "damping": 0.02,
        "color": CLOTH,
    }
    # The curtain hangs in the plane x = 0.3, just past the hammer's lowest point.
    scene.add_cloth(
        "curtain",
        size=[1.0, 1.2],
        cells=[cells, cells],
        position=[0.3, -0.5, 0.3],
        rotation=Rotation.from_matrix([[0, 0, 1], [1, 0, 0], [0, 1, 0]]).as_rotvec(),  # x to y, y to z
        **woven,
    )
    scene.add_constraint("nail", "rail", points={"body": "curtain", "side": "+z", "thickness": 0.005})
    edge = 0.2
    for layer in range(3):
        for k, y in enumerate((-0.22, 0.0, 0.22)):
            name, place = f"brick{layer}{k}", [0.62 + 0.01 * (k - 1), y, 0.01 + layer * (edge + 0.01)]
            if (layer + k) % 2:
                scene.add_solid(
                    name,
                    box={"size": [edge] * 3, "cells": [2, 2, 2]},
                    position=np.array(place) - [0.5 * edge, 0.5 * edge, 0.0],
                    **soft,
                )
            else:
                middle = np.array(place) + [0.0, 0.0, 0.5 * edge]
                scene.add_rigid(name, box=[edge] * 3, position=middle, density=density, color=STONE)
    scene.add_cloth("cover", size=[0.6, 0.9], cells=[18, 27], position=[0.34, -0.45, 0.69], **woven)
    return scene


def _add_hammer(scene: Scene, angle: float, density: float, soft: dict) -> None:
    """Two links and a head on hinges about y, hanging from (0, 0, 1.55), raised towards -x by ``angle`` [rad]."""
    pivot = np.array([0.0, 0.0, 1.55])
    along = np.array([-np.sin(angle), 0.0, -np.cos(angle)])  # from the pivot down the arm
    front = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    turn = np.array([0.0, angle, 0.0])
    half = 0.27  # of a link with its share of the gap
    for number in range(2):
        middle = pivot + (2 * number + 1) * half * along
        scene.add_rigid(
            f"link{number}",
            box=[0.05, 0.05, 2.0 * half - 0.06],
            position=middle,
            rotation=turn,
            density=density,
            color=WOOD,
        )
    scene.add_rigid(
        "head",
        box=[0.2, 0.24, 0.24],
        position=pivot + (4.0 * half + 0.15) * along,
        rotation=turn,
        density=2.0 * density,
        color=STONE,
    )
    axis = [0.0, 1.0, 0.0]
    scene.add_joint("revolute", "hook", body1="link0", anchor=pivot, axis=axis)
    scene.add_joint("revolute", "elbow", body0="link0", body1="link1", anchor=pivot + 2.0 * half * along, axis=axis)
    scene.add_joint("weld", "haft", body0="link1", body1="head", anchor=pivot + 4.0 * half * along)
    # The buffer's back lies on the head's front face (its +x), point on face.
    block = 0.2
    corner = pivot + (4.0 * half + 0.15) * along + 0.1 * front
    corner = corner + 0.5 * block * along - np.array([0.0, 0.5 * block, 0.0])
    scene.add_solid(
        "buffer",
        box={"size": [0.12, block, block], "cells": [2, 3, 3]},
        position=corner,
        rotation=turn,
        **soft,
    )
    back = np.array([i * 3 for i in range(16)])  # points of the box with x = 0: 3 points a row along x
    scene.add_constraint(
        "attach", "glue", points={"body": "buffer", "indices": back}, to={"body": "head", "nearest": "triangle"}
    )
