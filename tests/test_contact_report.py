"""What a step reports of contact is measured on the committed state, whatever detection and solver believed."""

import pytest

import turnbuckle
from turnbuckle.contact.manifold import no_contacts


def test_intersections_are_counted_where_detection_is_blind(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = turnbuckle.Scene("blind", dt=0.01, contact={})
    scene.add_obstacle("floor", plane=[2.0, 2.0])
    scene.add_rigid("box", box=[0.2, 0.2, 0.2], position=[0.0, 0.0, 0.15], velocity=[0.0, 0.0, -4.0])
    simulation = turnbuckle.Simulation(scene)
    assert simulation.step(1e-4).intersections == 0
    monkeypatch.setattr(simulation.stepper.detector, "crossed", lambda x0, x1, **_: no_contacts())
    monkeypatch.setattr(simulation.stepper.detector, "near", lambda x0, towards=None: no_contacts())
    for _ in range(2):
        report = simulation.step()
    assert report.intersections > 0
    assert report.status == "degraded"
    assert any("edges go through faces" in message for message in report.messages)
