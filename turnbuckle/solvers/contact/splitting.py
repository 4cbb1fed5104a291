"""The start of the default solver where bodies are small: operator splitting, each body and each contact by itself.

With z a copy of the relative velocities u = J v, the problem is

    min (v - v*) . A (v - v*) / 2 - load . v   with  u = z,   and the contact law between z and the impulse r,

and the method of multipliers with alternating directions (ADMM; Boyd et al. 2011, 3; with friction Daviet 2020) takes
turns, with R > 0 a weight of each contact:

    z, r:  y = u - r / R,  r <- the impulse of Coulomb's law at a compliance of 1 / R,  z = y + r / R
    v:     v <- v - K^-1 (A (v - v*) - load - J^T (r + R (z - u))),    K >= A + J^T R J

A contact that has the same compliance in all directions is solved in closed form, friction and all: nothing is
linearised. K adds to the diagonal of A (`splitting_kernels.majorant`), so bodies stay apart from each other, and small
ones are factored once a problem. Information travels a body an iteration, which is why some dozens of cheap iterations
bring a heap of bodies to within what Newton's method would need dozens of solves with all bodies for. Convergence is
linear, and over-relaxed by 1.7.
"""

from typing import TYPE_CHECKING

from turnbuckle.linalg.skyline import factor_parts, solve_parts
from turnbuckle.solvers.contact import newton_blocks as blocks
from turnbuckle.solvers.contact import newton_kernels as kernels
from turnbuckle.solvers.contact import splitting_kernels as own

if TYPE_CHECKING:
    from turnbuckle.linalg.skyline import SkylineFactors
    from turnbuckle.solvers.contact.newton_buffers import Buffers

WEIGHT = 0.7  # R times the estimated compliance of a contact
RELAX = 1.7
BATCH = 8  # iterations between two looks at the errors
LIMIT = 8  # batches
SLOW = 0.85  # contacts whose u and z come together less in a batch
PATIENCE = 2  # batches between two looks at that
GROWTH = 4.0  # get a larger weight, by this factor


def launches(b: "Buffers", tiles: int, factors: "SkylineFactors | None") -> dict[str, tuple]:
    """What splitting runs on the buffers of the Newton solver, by name."""
    t, s = tiles, b.sizes
    matrix, transposed = [b.starts, b.others, b.a], [b.t_offsets, b.t_contacts, b.jt]
    contact = [t, s, b.offsets, b.columns, b.j]
    weights = (own.weights, [*contact, b.local, b.fixed, b.partner, b.mass, WEIGHT, b.kept, b.weight, b.span], t)
    stiffen = (own.stiffen, [t, s, b.u, b.copy, b.goal, SLOW, GROWTH, b.missed, b.weight, b.sums], t)
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
