"""The start of the default solver where bodies are small: operator splitting, each body and each contact by itself.

With z a copy of the relative velocities u = J v, the problem is

    min (v - v*) . A (v - v*) / 2 - load . v   with  u = z,   and the contact law between z and the impulse r,

and the method of multipliers with alternating directions (ADMM; Boyd et al. 2011, 3; with friction Daviet 2020) takes
turns, with R > 0 a weight of each contact:

    z, r:  y = u - r / R,  r <- the impulse of Coulomb's law at a compliance of 1 / R,  z = y + r / R
    v:     v <- v - K^-1 (A (v - v*) - load - J^T (r + R (z - u))),    K >= A + J^T R J

A contact that has the same compliance in all directions is solved in closed form, friction and all: nothing is
linearised. K adds to the diagonal of A (`splitting_kernels.majorant`), so bodies stay apart from each other, and small
ones are factored when their weights change. Information travels a body an iteration, which is why some dozens of cheap iterations
bring a heap of bodies to within what Newton's method would need dozens of solves with all bodies for. Convergence is
linear, and over-relaxed by 1.7.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from turnbuckle.compute import host
from turnbuckle.linalg.skyline import factor_parts, solve_parts
from turnbuckle.solvers.contact import newton_blocks as blocks
from turnbuckle.solvers.contact import newton_kernels as kernels
from turnbuckle.solvers.contact import splitting_kernels as own
from turnbuckle.solvers.contact.newton_errors import LOST

if TYPE_CHECKING:
    from turnbuckle.linalg.skyline import SkylineFactors
    from turnbuckle.solvers.contact.newton_buffers import Buffers
    from turnbuckle.solvers.contact.newton_errors import Errors

WEIGHT = 0.7  # R times the estimated compliance of a contact
RELAX = 1.7
BATCH = 8  # iterations between two looks at the errors
LIMIT = 8  # batches
SLOW = 0.85  # contacts whose u and z come together less in a batch
PATIENCE = 2  # batches between two looks at that
GROWTH = 4.0  # get a larger weight, by this factor


class Splitting:
    """The start of one solver, and for which bodies the factors of K still hold."""

    def __init__(self, buffers: "Buffers", run: Callable[[str], None], evaluate: Callable[[], "Errors"]) -> None:
        self.buffers, self.run, self.evaluate = buffers, run, evaluate
        self.part = np.zeros(0, dtype=np.int64)  # (n,) small body of each block, -1 for none
        self.stale = np.zeros(0, dtype=bool)  # small bodies whose factor is that of another matrix
        self.weight = np.zeros(0)  # R when K was factored

    def take(self, part: np.ndarray, parts: int) -> None:
        """Another matrix, with so many small bodies."""
        self.part, self.stale, self.weight = part, np.ones(parts, dtype=bool), np.zeros(0)

    def lost(self, parts: np.ndarray | slice) -> None:
        """Something else was factored in place of K."""
        self.stale[parts] = True

    def start(self, n: int, m: int, tolerance: float, same: bool) -> int:
        """Bring velocities and multipliers near the solution; iterations made. ``same``: contacts are those of the last."""
        b = self.buffers
        self.run("first_shift")  # u
        b.write("copy", b.read("u", m))
        if not same:  # weights that have grown stay
            self.run("weights")
        self._factor(m)
        velocity, multiplier, before = b.read("v", n), b.read("multiplier", m), self.evaluate()
        b.write("r", multiplier)
        errors, batches = before, 0
        while batches < LIMIT:
            self.run("iterations")
            batches += 1
            b.write("multiplier", b.read("r", m))
            self.run("first_shift")
            errors = self.evaluate()
            if errors.worst <= tolerance or not errors.worst < LOST:
                break
            b.write("r", b.read("multiplier", m))
            if batches % PATIENCE:
                continue
            self.run("stiffen")
            if batches < LIMIT and host(b.stiffened).any():
                self._factor(m)
        if not errors.worst < before.worst:  # bodies that are too stiff for single precision, say
            b.write("v", velocity)
            b.write("multiplier", multiplier)
        b.write("missed", np.full(m, np.inf))  # Newton's method measures otherwise
        return batches * BATCH

    def _factor(self, m: int) -> None:
        """Factor K, of bodies whose contacts have other weights than when it was, and of those whose factor was lost."""
        b = self.buffers
        weight = b.read("weight", m)
        changed = np.ones(m, dtype=bool)
        kept = min(len(self.weight), m)
        changed[:kept] = weight[:kept] != self.weight[:kept]
        rows = np.repeat(changed, np.diff(b.read("offsets", m + 1)))
        part = self.part[b.read("columns", len(rows))[rows]]
        self.stale[part[part >= 0]] = True
        some = np.flatnonzero(self.stale)
        self.stale[:] = False
        sizes = b.read("sizes", kernels.SIZES)
        sizes[kernels.PARTS] = len(some)
        b.write("sizes", sizes)
        b.write("some_parts", some)
        self.weight = weight
        self.run("split")


def launches(b: "Buffers", tiles: int, factors: "SkylineFactors | None") -> dict[str, tuple]:
    """What splitting runs on the buffers of the Newton solver, by name."""
    t, s = tiles, b.sizes
    matrix, transposed = [b.starts, b.others, b.a], [b.t_offsets, b.t_contacts, b.jt]
    contact = [t, s, b.offsets, b.columns, b.j]
    weights = (own.weights, [*contact, b.local, b.fixed, b.partner, b.mass, WEIGHT, b.kept, b.weight, b.span], t)
    stiffen = (own.stiffen, [t, s, b.u, b.copy, b.goal, SLOW, GROWTH, b.missed, b.weight, b.stiffened], t)
    factor = [
        (own.majorant, [t, s, *matrix, *transposed, b.weight, b.span, b.partner, b.diagonal, b.coupled], t),
        (blocks.invert_blocks, [t, s, int(kernels.BLOCKS), b.all, b.partner, b.diagonal, b.coupled, b.m, b.n], t),
    ]
    solve = []
    if factors is not None:
        parts = factors.parts.count
        some = (b.sizes, int(kernels.PARTS), b.some_parts)
        factor.append((factor_parts, factors.factor_inputs(b.starts, b.others, b.a, b.diagonal, b.fixed, some), parts))
        solve.append((solve_parts, factors.solve_inputs(b.fixed, b.g, b.z, b.zero), parts))
    iteration = [
        (own.contact_step, [*contact, b.v, b.floor, b.mu, b.weight, RELAX, b.u, b.copy, b.r, b.push], t),
        (kernels.gradient, [t, s, int(kernels.BLOCKS), b.all, *matrix, *transposed, b.fixed, b.v, b.free, b.load, b.push,
                            b.local, b.g, b.miss], t),
        *solve,
        (own.motion_step, [t, s, b.partner, b.fixed, b.apart, b.m, b.n, b.g, b.z, b.v], t),
    ]  # fmt: skip
    return {
        "weights": (weights,),
        "split": tuple(factor),
        "iterations": tuple(iteration * BATCH),
        "stiffen": (stiffen,),
    }
