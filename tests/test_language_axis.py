"""Whose axis it is, in motion: the point P2 of object2 moves in a domain that is fixed in object1."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation

P1, P2, U = np.array([0.1, 0.2, -0.3]), np.array([0.3, -0.1, 0.2]), np.array([1.0, 2.0, -2.0]) / 3.0
TEXT = """
world gravity 0 0 0; dt 2e-3; duration 1; end
object arm box 1 .5 .2; mass 2; rotation .3 -.2 .9; spin 1 -2 .5; end
object bead box .3 .4 .5; mass 1; position {place}; rotation 1 .4 .2; spin -3 1 2; velocity .3 0 .1; end
constraint name slot; object1 arm; object2 bead; hinge .1 .2 -.3  .3 -.1 .2; {domain} 1 2 -2; end
"""


def in_frame(simulation: Simulation, body: str, other: str, point: np.ndarray) -> np.ndarray:
    """A point of `other`, given in its frame, in the frame of `body` [m]."""
    (x, q), (y, p) = simulation.pose(body), simulation.pose(other)
    return Rotation.from_quat(q).inv().apply(y + Rotation.from_quat(p).apply(point) - x)


@pytest.mark.parametrize("domain", ["axial", "planar"])
def test_the_domain_goes_with_object1(domain: str) -> None:
    at_start = Rotation.from_rotvec([0.3, -0.2, 0.9]).apply(P1) - Rotation.from_rotvec([1.0, 0.4, 0.2]).apply(P2)
    text = TEXT.format(place=" ".join(map(repr, at_start.tolist())), domain=domain)
    simulation = Simulation(Scene.from_description(text))

    def off(gap: np.ndarray) -> float:
        along = abs(gap @ U)
        return along if domain == "planar" else float(np.linalg.norm(gap - (gap @ U) * U))

    moved = other_way = 0.0
    for _ in range(300):
        simulation.step()
        gap = in_frame(simulation, "arm", "bead", P2) - P1
        assert off(gap) < 1e-9
        moved = max(moved, float(np.linalg.norm(gap)))
        other_way = max(other_way, off(in_frame(simulation, "bead", "arm", P1) - P2))
    assert moved > 0.1  # it does slide
    assert other_way > 0.05  # the roles of section 4 would be another motion
