"""Random mechanisms: trees with loops, joints of all kinds, bodies of all shapes. Closed to 1e-10, or said to be not."""

import numpy as np
import pytest
from mechanism import ZERO, Mechanism, frame_of
from reference import joint_rows

KINDS = ("ball", "revolute", "universal", "prismatic", "cylindrical", "planar", "weld", "distance", "point_to_ring")


def random_mechanism(seed: int, floating: bool) -> Mechanism:
    """2 to 8 bodies; each but the first joined to one before it, then up to two joints that close loops."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    mechanism = Mechanism(gravity=ZERO if floating else [0.0, 0.0, -9.81])
    for i in range(n):
        half = 0.05 + 0.2 * rng.random(3)
        mass = 10.0 ** rng.uniform(-1.0, 1.0)
        inertia = mass / 3.0 * (half @ half - half**2)
        turned = frame_of(rng.normal(size=3))
        mechanism.body(
            f"b{i}", rng.uniform(-1, 1, 3), rng.normal(size=3), mass, turned @ np.diag(inertia) @ turned.T,
            center=0.1 * rng.normal(size=3), v=rng.normal(size=3), w=2.0 * rng.normal(size=3), box=2.0 * half,
        )  # fmt: skip
    pairs = [(i, int(rng.integers(0, i))) for i in range(1, n)]
    if not floating:
        pairs.append((0, None))
    for _ in range(int(rng.integers(0, 3))):
        i, j = rng.choice(n, 2, replace=False)
        pairs.append((int(i), int(j)))
    for k, (i, j) in enumerate(pairs):
        kind = str(rng.choice(KINDS if k < n else ("ball", "revolute", "distance")))
        axis = rng.normal(size=3)
        a, b = f"b{i}", None if j is None else f"b{j}"
        middle = mechanism.parts[i].position
        middle = 0.5 * (middle + (mechanism.parts[j].position if j is not None else middle))
        place = middle + 0.1 * rng.normal(size=3)
        if kind == "distance":
            other = place + 0.2 * rng.normal(size=3)
            d = float(np.linalg.norm(other - place))
            mechanism.joint(kind, f"j{k}", a, b, place, joint_rows.distance(d), at_b=other, min=d, max=d)
        elif kind == "universal":
            mechanism.joint(kind, f"j{k}", a, b, place, axis=axis, axis_a=np.cross(axis, rng.normal(size=3)))
        elif kind == "point_to_ring":
            mechanism.joint(kind, f"j{k}", a, b, place, joint_rows.plane, axis=axis)
        else:
            mechanism.joint(kind, f"j{k}", a, b, place, axis=axis)
    return mechanism


def check(seed: int) -> bool:
    """Runs a mechanism for 40 steps; True where every step was ok."""
    floating = seed % 2 == 0
    mechanism = random_mechanism(seed, floating)
    system = mechanism.system()
    simulation = mechanism.simulation()
    state = mechanism.state_of(simulation)
    energy, before = system.energy(state), system.momentum(state)
    fine = True
    swing = 0.0
    for _ in range(40):
        report = simulation.step(2e-3)
        assert report.status != "failed", (seed, report.messages)
        worst = max(*report.position_residual.values(), *report.rate_residual.values())
        assert report.status == "degraded" or worst <= 1e-10, (seed, worst)
        fine &= report.status == "ok"
        state = mechanism.state_of(simulation)
        x, r, v, w = system.unpack(state)
        assert np.isfinite(state).all(), seed
        # the reference, with rows of its own, finds them closed as well
        if report.status == "ok":
            place, rate = system.residual(state)
            assert place < 1e-9 and rate < 3e-9, (seed, place, rate)
        speeds = system.mass * np.linalg.norm(v, axis=1)
        swing = max(swing, 0.5 * float(system.mass @ (v * v).sum(1)))
        if floating:
            after = system.momentum(state)
            assert np.linalg.norm(after[0] - before[0]) <= 1e-12 * speeds.sum(), seed
            spin = np.linalg.norm(np.einsum("nij,njk,nlk,nl->ni", r, system.inertia, r, w), axis=1)
            moments = speeds @ np.linalg.norm(x, axis=1) + spin.sum()
            assert np.linalg.norm(after[1] - before[1]) <= 1e-12 * moments, seed
            before = after
    if fine:
        kinetic = energy + sum(m * np.linalg.norm(system.gravity) for m in system.mass)
        assert abs(system.energy(state) - energy) <= 0.02 * max(abs(kinetic), swing), (
            seed,
            energy,
            system.energy(state),
        )
    return fine


def test_random_mechanisms():
    assert all([check(seed) for seed in range(10)])


@pytest.mark.slow
def test_three_hundred_random_mechanisms():
    fine = [check(seed) for seed in range(100, 400)]
    assert np.mean(fine) > 0.97
