"""Constraints change while the simulation runs: a hand shakes a rope, a knot is undone, a thread breaks."""

import math

import turnbuckle


def main() -> None:
    scene = turnbuckle.Scene("live", dt=1e-3)
    scene.add_rope("rope", start=[0, 0, 0], end=[1, 0, 0], segments=20, stretch_stiffness=2e3, damping=0.2, mass=0.2)
    scene.add_solid("weight", box={"size": [0.1, 0.1, 0.1], "cells": [1, 1, 1]}, position=[1, 0, -0.1], mass=1)
    scene.add_constraint("nail", "hand", points={"body": "rope", "index": 0})
    ends = [{"body": "rope", "index": 20}, {"body": "weight", "nearest": [1, 0, 0]}]
    scene.add_constraint("points_to_point", "knot", zip=ends)

    simulation = turnbuckle.Simulation(scene)
    simulation.run(0.2)
    start = simulation.time
    simulation.retarget("hand", lambda t: [0, 0, 0.1 * math.sin(5 * (t - start))])
    simulation.run(0.1)
    print("the hand is at", simulation.positions("rope")[0], "and pulls with", simulation.forces("hand")[0], "N")

    simulation.switch("knot", False)
    here = simulation.positions("rope")[20]
    ends = [{"body": "rope", "index": 20}, {"body": "weight", "nearest": here}]
    simulation.add_constraint("points_to_point", "thread", zip=ends, break_force=15)
    report = simulation.step()
    while not report.broken:
        report = simulation.step()
    print(f"broke at {report.time:.3f} s: {', '.join(report.broken)}")


if __name__ == "__main__":
    main()
