"""The chain in MuJoCo: `python -m turnbuckle.benchmarks.peers.chain_mujoco --joints connect` (or `tree`).

`connect`: free bodies, each joint an equality constraint, as every joint is here. `tree`: ball joints in reduced
coordinates, which cannot open, and one equality constraint that closes the loop.
"""

import argparse
import sys
import xml.etree.ElementTree as Xml

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.benchmarks.peers.chain_protocol import (
    DT,
    GRAVITY,
    LENGTH,
    MASS,
    THICKNESS,
    ChainTask,
    simulate,
    task_from_arguments,
)

HOW = {
    "connect": "free bodies, every joint an equality constraint (connect), Newton solver, implicitfast, closing within 2 steps",
    "tree": "ball joints in reduced coordinates, one connect closes the loop, Newton solver, implicitfast",
}


def text(numbers: object) -> str:
    """Numbers as MJCF wants them."""
    return " ".join(f"{number:.17g}" for number in np.ravel(np.asarray(numbers, dtype=float)))


def model_text(task: ChainTask, joints: str) -> str:
    """The chain as MJCF."""
    ends, turns = task.start()
    quats, rotations = turns[:, [3, 0, 1, 2]], Rotation.from_quat(turns)
    model = Xml.Element("mujoco")
    options = {
        "timestep": f"{DT:.17g}",
        "gravity": text([0, 0, GRAVITY]),
        "solver": "Newton",
        "integrator": "implicitfast",
    }
    Xml.SubElement(Xml.SubElement(model, "option", options), "flag", {"contact": "disable"})
    half = text([0.5 * LENGTH, 0.5 * THICKNESS, 0.5 * THICKNESS])
    place = Xml.SubElement(model, "worldbody")
    equality = Xml.Element("equality")
    # Closing within two steps, the quickest that it allows. With an impedance of 0.9999 in place of the default 0.95 a
    # chain of 100 opens by 1 mm, but one of 400 flies apart.
    stiff = {"solref": text([2.0 * DT, 1.0])}
    middle = 0.5 * (ends[1:] + ends[:-1])
    for i in range(task.n):
        if joints == "connect":
            body = Xml.SubElement(place, "body", {"name": f"b{i}", "pos": text(middle[i]), "quat": text(quats[i])})
            Xml.SubElement(body, "freejoint")
        else:
            body = place = _link(place, i, ends, rotations)
        Xml.SubElement(body, "geom", {"type": "box", "size": half, "mass": f"{MASS}"})
        if joints == "connect":
            other = {"body2": f"b{i - 1}"} if i > 0 else {}
            Xml.SubElement(
                equality, "connect", {"body1": f"b{i}", **other, "anchor": text([-0.5 * LENGTH, 0, 0]), **stiff}
            )
    last = {"body1": f"b{task.n - 1}", "anchor": text([0.5 * LENGTH, 0, 0]), **stiff}
    Xml.SubElement(equality, "connect", last)
    model.append(equality)
    return Xml.tostring(model, encoding="unicode")


def _link(parent: Xml.Element, i: int, ends: np.ndarray, turns: Rotation) -> Xml.Element:
    """A body on a ball joint at its left end, in the frame of the one before."""
    if i == 0:
        x, q = ends[0] + turns[0].apply([0.5 * LENGTH, 0.0, 0.0]), turns[0]
    else:
        q = turns[i - 1].inv() * turns[i]
        x = q.apply([0.5 * LENGTH, 0.0, 0.0]) + [0.5 * LENGTH, 0.0, 0.0]
    body = Xml.SubElement(parent, "body", {"name": f"b{i}", "pos": text(x), "quat": text(q.as_quat()[[3, 0, 1, 2]])})
    Xml.SubElement(body, "joint", {"type": "ball", "pos": text([-0.5 * LENGTH, 0, 0])})
    return body


def main() -> None:
    import mujoco

    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--joints", choices=sorted(HOW), default="connect")
    own, sys.argv[1:] = parser.parse_known_args()
    task = task_from_arguments()
    model = mujoco.MjModel.from_xml_string(model_text(task, own.joints))
    data = mujoco.MjData(model)

    def poses() -> tuple[np.ndarray, np.ndarray]:
        mujoco.mj_kinematics(model, data)
        return data.xpos[1:].copy(), data.xquat[1:][:, [1, 2, 3, 0]]

    name = f"mujoco {own.joints}"
    simulate(task, lambda: mujoco.mj_step(model, data), poses, name, mujoco.__version__, HOW[own.joints])


if __name__ == "__main__":
    main()
