"""The same bits on every run, with any number of threads."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from laboratory import Run, nail
from reference import schemes
from test_physics_constraints import everything

HERE = Path(__file__).parent


def digest(run: Run) -> str:
    return hashlib.sha256(run.x.tobytes() + run.v.tobytes()).hexdigest()


def big(integrator: str, cells: int = 99) -> str:
    """A cloth of 10,000 points on nails, joined to a solid: large enough to be cut between threads."""
    solid = {
        "type": "solid",
        "name": "block",
        "box": {"size": [1, 1, 0.5], "cells": [3, 3, 3] if cells < 99 else [12, 12, 12]},
        "mass": 20.0,
    }
    solid |= {"k_distance": 0.3, "k_area": 0.2, "k_volume": 0.2, "damping_distance": 1e-4}
    cloth = {
        "type": "cloth",
        "name": "cloth",
        "size": [1, 1],
        "cells": [cells, cells],
        "mass": 3.0,
        "bend_stiffness": 5.0,
    }
    cloth |= {"structural_stiffness": 40.0, "shear_stiffness": 20.0, "damping": 0.01, "position": [0, 0, 0.5]}
    places = [[1 / 3, 1 / 3, 0.5], [2 / 3, 1 / 3, 0.5], [1 / 3, 2 / 3, 0.5]]
    joints = {"type": "points_to_point", "name": "joints"}
    joints["zip"] = [{"body": "cloth", "nearest": places}, {"body": "block", "nearest": places}]
    run = Run(
        {
            "integrator": integrator,
            "gravity": [0, 0, -9.81],
            "bodies": [cloth, solid],
            "constraints": [nail("corners", "cloth", 0, cells), joints],
        }
    )
    run.steps([4e-4] * 8 + [3e-4] * 4)
    assert np.isfinite(run.x).all() and np.abs(run.v).max() > 1e-3
    return digest(run)


@pytest.mark.parametrize("integrator, cells", [("verlet", 99), ("rk2", 99), ("implicit_euler", 9)])
def test_any_number_of_threads(integrator, cells):
    program = f"from test_physics_determinism import big; print(big({integrator!r}, {cells}))"
    digests = set()
    for threads in ("1", "2"):
        path = os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")])
        environment = {**os.environ, "TURNBUCKLE_THREADS": threads, "PYTHONPATH": path}
        done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[-2000:]
        digests.add(done.stdout.strip().splitlines()[-1])
    assert len(digests) == 1


@pytest.mark.parametrize("name", schemes.SCHEMES)
def test_two_runs(name):
    digests = set()
    for _ in range(2):
        scene, _held = everything(np.random.default_rng(21), 0.05)
        run = Run({"integrator": name, **scene})
        run.steps(np.repeat([1e-3, 4e-4], 25))
        digests.add(digest(run))
    assert len(digests) == 1
