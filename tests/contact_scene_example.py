"""Small scenes in which contact is at work at step 40, for checkpoints: what touches then slides, sticks, hangs and is led."""

import turnbuckle

DT = 4e-3
MIDDLE = 40  # steps


def draped(
    mu: float = 0.4, shift: float = 0.05, bend: float = 1e-4, limit: float = 0.1, touches: str = "on", **contact: object
) -> turnbuckle.Scene:
    """A cloth with bending and strain limits that slides over a ball which a script moves."""
    scene = turnbuckle.Scene("draped", dt=DT, duration=0.2, contact={"friction": mu, "delta": 4e-3, **contact})
    keys = {"times": [0.0, 0.3], "positions": [[0, 0, 0], [shift, 0, 0.03]]}
    scene.add_obstacle("ball", sphere=0.2, trajectory=keys)
    scene.add_cloth(
        "cloth", size=[0.6, 0.6], cells=[9, 9], position=[-0.28, -0.31, 0.205], density=0.3, bend_model="hinges",
        bend_stiffness=bend, structural_stiffness=200.0, shear_stiffness=50.0, strain_limit=limit, damping=0.01,
        contact=touches,
    )  # fmt: skip
    return scene


def pile(young: float = 1e5, **contact: object) -> turnbuckle.Scene:
    """Rigid and soft boxes that settle on each other, one thrown at the others."""
    scene = turnbuckle.Scene("pile", dt=DT, duration=0.2, contact=contact)
    scene.add_obstacle("ground", plane=[4.0, 4.0])
    for k in range(3):
        scene.add_rigid(f"box{k}", box=[0.2, 0.2, 0.1], position=[0.02 * k, 0, 0.053 + 0.104 * k], density=500.0)
    box = {"size": [0.2, 0.2, 0.1], "cells": [2, 2, 1]}
    soft = {"youngs_modulus": young, "poissons_ratio": 0.3, "density": 300.0, "damping": 0.01}
    scene.add_solid("soft", box=box, position=[-0.1, -0.1, 0.32], **soft)
    scene.add_rigid("thrown", sphere=0.06, position=[-0.5, 0.02, 0.2], velocity=[3.0, 0, 0], density=800.0)
    return scene


def hung(**contact: object) -> turnbuckle.Scene:
    """A nailed cloth that a hammer on a hinge hits, and a plate tied to it: nails, joints and contact together."""
    scene = turnbuckle.Scene("hung", dt=DT, duration=0.2, contact={"delta": 4e-3, **contact})
    scene.add_cloth(
        "cloth", size=[0.5, 0.5], cells=[8, 8], position=[0, -0.25, -0.25], rotation=[0, -1.5707963, 0], density=0.3,
        structural_stiffness=300.0, shear_stiffness=100.0, damping=0.01,
    )  # fmt: skip
    scene.add_rigid("head", sphere=0.06, position=[-0.15, 0, 0.0], velocity=[1.2, 0, 0], density=500.0)
    scene.add_rigid(
        "plate", box=[0.02, 0.1, 0.1], position=[0.015, 0.25, -0.3], density=500.0, markers=[[-0.01, 0, 0.05]]
    )
    scene.add_constraint("revolute", "hinge", body1="head", anchor=[-0.15, 0, 0.5], axis=[0, 1, 0])
    top = [{"body": "cloth", "index": k} for k in (8, 80)]
    scene.add_constraint("nail", "top", points=top)
    return scene


SCENES = {"draped": draped, "pile": pile, "hung": hung}
