"""Regions of the contact solver against plain NumPy, and their steps against evaluations of everything."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reference import contact_problem
from turnbuckle.solvers.contact import newton_kernels as kernels
from turnbuckle.solvers.contact.newton import NewtonSolver
from turnbuckle.solvers.contact.newton_region import SETTLED


class Watched(NewtonSolver):
    """Checks every region that it finds and every step that it makes of one."""

    regions = steps = unsettled = 0

    def solve(self, problem, *args, **more):
        self.problem = problem
        return super().solve(problem, *args, **more)

    def lists(self) -> list[np.ndarray]:
        sizes = self.buffers.read("sizes", kernels.SIZES)
        places = (("some", kernels.SOME), ("theirs", kernels.THEIRS), ("around", kernels.AROUND))
        return [self.buffers.read(name, int(sizes[int(place)])) for name, place in places]

    def near(self, blocks: np.ndarray, contacts: np.ndarray) -> np.ndarray:
        """``blocks`` (n,) bool, and those next to them by A or by one of ``contacts`` (m,) bool."""
        a, j = self.problem.a, self.problem.j
        row, contact = (
            np.repeat(np.arange(len(blocks)), np.diff(a.indptr)),
            np.repeat(np.arange(len(contacts)), np.diff(j.indptr)),
        )
        out = blocks.copy()
        out[a.indices[blocks[row]]] = True
        touched = np.zeros(len(contacts), dtype=bool)
        touched[contact[blocks[j.indices]]] = True
        out[j.indices[(touched & contacts)[contact]]] = True
        return out

    def _region(self, gradient: float, tolerance: float) -> bool:
        found = super()._region(gradient, tolerance)
        if not self._local:
            return found
        n, m = len(self.problem.free) // 3, self.problem.count
        free = np.ones(n, dtype=bool) if self.problem.fixed is None else ~self.problem.fixed
        pushes = self.buffers.read("r", m)[:, 0] != 0.0
        least = float(self.buffers.read("least", 1)[0])
        some = self.near((self.buffers.read("miss", n) > least) & free, pushes)
        for part in range(self.bodies.factors.parts.count if self.bodies.factors is not None else 0):
            mine = self.bodies.part == part
            some |= mine & some[mine].any()
        for first in self.problem.pairs:
            some[first : first + 2] = some[first : first + 2].any()
        some &= free
        contact = np.repeat(np.arange(m), np.diff(self.problem.j.indptr))
        theirs = np.unique(contact[some[self.problem.j.indices]])
        around = self.near(some, np.ones(m, dtype=bool))
        for got, wanted in zip(self.lists(), (np.flatnonzero(some), theirs, np.flatnonzero(around)), strict=True):
            np.testing.assert_array_equal(got, wanted)
        assert least >= SETTLED * tolerance
        self.regions += 1
        return found

    def _update(self, least: float):
        before = self.buffers.read("primal", self.problem.count), self.buffers.read("wrong", self.problem.count)
        out = super()._update(least)
        if self._local:
            np.testing.assert_array_equal(self.lists()[1], np.flatnonzero((before[0] > least) | (before[1] > least)))
            self.unsettled += 1
        return out

    def _newton_step(self, part: str):
        tries, errors = super()._newton_step(part)
        if part:  # nothing that was left alone has changed
            n, m = len(self.problem.free) // 3, self.problem.count
            names = {"g": n, "miss": n, "r": m, "u": m, "primal": m, "wrong": m}
            of_part = {name: self.buffers.read(name, count) for name, count in names.items()}
            assert not self.buffers.read("p", n).any() and not self.buffers.read("dv", n).any()
            every = self._evaluate()
            for name, count in names.items():
                np.testing.assert_array_equal(of_part[name], self.buffers.read(name, count), err_msg=name)
            assert every == errors
            self.steps += 1
        return tries, errors


@pytest.mark.parametrize("name", ["cloth_on_plane", "soft_stack", "rigid_pile", "mixed"])
def test_regions_and_their_steps(name: str) -> None:
    """A solution, then one contact that asks for more: what is near it is all there is to do. ``mixed`` has joints."""
    sizes = {
        "cloth_on_plane": {"n": 40, "layers": 3},
        "soft_stack": {"count": 5},
        "rigid_pile": {"count": 8},
        "mixed": {},
    }
    problem = getattr(contact_problem, name)(mu=0.4, seed=2, **sizes[name])
    solver = Watched()
    found = solver.solve(problem, tolerance=1e-6, max_iterations=2000)
    assert found.converged
    floor = problem.floor.copy()
    for k in range(1, 8):
        floor[k * len(floor) // 8] += 0.5
        found = solver.solve(replace(problem, floor=floor), found.impulse, found.velocity, 1e-6, 2000)
        assert found.converged
    if name == "cloth_on_plane":
        assert solver.steps > 1 and solver.regions > 1 and solver.unsettled > 5
    if name == "mixed":
        assert solver.regions == solver.unsettled == 0
