"""`check` of cloth that bends and of corotational solids: its limit is where the scheme itself loses stability."""

import re

import numpy as np
import pytest

from turnbuckle.scene.scene import Scene
from turnbuckle.scene.stability import step_warning
from turnbuckle.step.simulation import Simulation


def solid(scheme: str, damping: float) -> Scene:
    scene = Scene("s", integrator=scheme, gravity=[0, 0, 0])
    box = {"size": [0.2, 0.1, 0.1], "cells": [2, 1, 1]}
    scene.add_solid("block", box=box, youngs_modulus=1e6, poissons_ratio=0.3, damping=damping)
    return scene


def cloth(scheme: str, damping: float) -> Scene:
    """Stiff against bending: its fastest vibration is that of hinges."""
    scene = Scene("c", integrator=scheme, gravity=[0, 0, 0])
    soft = {"structural_stiffness": 1e-2, "shear_stiffness": 1e-2}
    scene.add_cloth(
        "sheet",
        size=[0.4, 0.4],
        cells=[4, 4],
        bend_model="hinges",
        bend_stiffness=0.02,
        bend_damping=damping,
        mass=0.1,
        **soft,
    )
    return scene


def grows(scene: Scene, dt: float) -> bool:
    """Whether a small push moves anything by far more than its drift in some hundred steps of ``dt``."""
    simulation = Simulation(scene)
    push = 1e-6 * np.random.default_rng(0).standard_normal(simulation.state.positions().shape)
    start = simulation.positions().copy()
    simulation.state.set_velocities(push)
    for _ in range(600):
        if simulation.step(dt).status == "failed":
            return True
    moved = np.abs(simulation.positions() - start).max()
    return not moved < 20 * 600 * dt * np.abs(push).max()


@pytest.mark.parametrize(("make", "damping"), [(solid, 0.0), (solid, 1e-4), (cloth, 0.0), (cloth, 1e-4)])
def test_the_limit_is_where_the_scheme_loses_stability(make, damping: float) -> None:
    scheme = "euler_cromer"
    model, state = make(scheme, damping).build()
    assert model.damped == (damping > 0.0)
    text = step_warning(model, state.positions(), 10.0, 1.0)
    assert text is not None
    limit = float(re.search(r"about (\S+) s", text)[1])
    assert step_warning(model, state.positions(), 0.95 * limit, 1.0) is None
    assert not grows(make(scheme, damping), 0.9 * limit)
    assert grows(make(scheme, damping), 1.25 * limit)
