"""Record frames of a simulation that you step yourself, and read them back as NumPy arrays."""

import numpy as np

import turnbuckle
from turnbuckle.io import open_recorder, read_recording


def main() -> None:
    scene = turnbuckle.Scene("rope", dt=1e-3)
    scene.add_rope("rope", start=[0, 0, 0], end=[1, 0, 0], segments=20, stretch_stiffness=2e3, mass=0.2)
    scene.add_constraint("nail", "hook", points={"body": "rope", "index": 0})
    simulation = turnbuckle.Simulation(scene)

    with open_recorder("rope.npz", list(simulation.model.shapes), up_axis="Z", frames_per_second=50) as recorder:
        for step in range(200):
            if step % 20 == 0:
                recorder.write(simulation.time, simulation.positions(), simulation.velocities())
            simulation.step()

    recording = read_recording("rope.npz")
    tip = np.array([recording.x(frame)[-1] for frame in range(len(recording))])
    for time, place in zip(recording.times, tip, strict=True):
        print(f"{time:.2f} s: the tip is at {np.round(place, 3)}")


if __name__ == "__main__":
    main()
