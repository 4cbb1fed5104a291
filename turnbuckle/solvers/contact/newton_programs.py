"""What the Newton solver runs: launches on its buffers, by name, recorded when they are first wanted.

Those of a step come twice: for all blocks, and, with "some " before their names, for those of a region (`newton_region`).
"""

from collections.abc import Callable

from turnbuckle.compute import Program
from turnbuckle.linalg.skyline import SkylineFactors, factor_parts, solve_parts
from turnbuckle.solvers.contact import newton_blocks as blocks
from turnbuckle.solvers.contact import newton_gradients as gradients
from turnbuckle.solvers.contact import newton_kernels as kernels
from turnbuckle.solvers.contact import splitting
from turnbuckle.solvers.contact.newton_buffers import Buffers
from turnbuckle.solvers.contact.newton_region import region, unsettled
from turnbuckle.solvers.contact.newton_search import along, slopes

BATCH = 8  # iterations of conjugate gradients between two looks at the result
CG_LIMIT = 200.0
SLOW = 0.7  # contacts that gain less from an update of multipliers
GROWTH = 2.0  # get a larger penalty, by this factor
SLIP = 0.25  # of the goal: shifts that miss by more, and come to rest slowly,
LONGER = 2.0, 15.0  # take longer steps, by this factor an update, at most so many times the usual

BLOCKS, CONTACTS, SOME, THEIRS, AROUND, PARTS = (
    int(place)
    for place in (kernels.BLOCKS, kernels.CONTACTS, kernels.SOME, kernels.THEIRS, kernels.AROUND, kernels.PARTS)
)
Launch = tuple | Callable[[], None]  # kernel, inputs, items; or a call on the host


class Programs:
    """Programs on buffers that keep their places. ``tiles`` and ``threads`` as in `newton_kernels`.

    Where there are equality rows ``take_out`` takes them out of a product of A, ``project`` puts directions in their null space.
    """

    def __init__(
        self,
        buffers: Buffers,
        device: str,
        tiles: int,
        threads: int | None,
        factors: SkylineFactors | None,
        take_out: Callable[[], None] | None,
        project: Callable[[], None] | None,
    ) -> None:
        self.device, self.tiles, self.threads = device, tiles, threads
        b, t = buffers, tiles
        self.b, self.factors = buffers, factors
        self.take_out, self.project = take_out, project
        contact = [t, b.sizes, b.offsets, b.columns, b.j]
        every, both = [BLOCKS, b.all], [b.starts, b.others, b.a]
        self._launches: dict[str, tuple[Launch, ...]] = {
            **splitting.launches(b, t, factors),
            **self._steps(every, [CONTACTS, b.all], every, None),
            "region": self._region(),
            "unsettled": (
                (unsettled, [b.least, b.primal, b.wrong, b.offsets, b.columns, b.block_mark, b.theirs, b.around, b.sizes], 1),
            ),
            "begin": (
                (blocks.local_inverses, [t, b.sizes, *both, b.local], t),
                (kernels.penalties, [*contact, b.local, b.fixed, b.scale, b.rho], t),
            ),
            "first_shift": ((kernels.first_shift, [*contact, b.v, b.mu, b.u, b.shift], t),),
        }  # fmt: skip
        parts = (b.sizes, PARTS, b.some_parts)
        some = self._steps([SOME, b.some], [THEIRS, b.theirs], [AROUND, b.around], parts)
        self._launches |= {"some " + name: launches for name, launches in some.items()}
        self._recorded: dict[str, Program] = {}

    def run(self, name: str, most: int | None = None) -> None:
        """Run one, on at most so many threads."""
        if name not in self._recorded:
            self._recorded[name] = self._record(self._launches[name])
        self._recorded[name].run(most)

    def _record(self, launches: tuple[Launch, ...]) -> Program:
        out = Program(self.device, self.threads)
        for launch in launches:
            if callable(launch):
                out.host(launch)
                continue
            kernel, inputs, count = launch
            out.launch(kernel, count, inputs, 512 if count > 1 and self.tiles > 1 else 1)
            out.barrier()
        return out.finish()

    def _region(self) -> tuple[Launch, ...]:
        b, f = self.b, self.factors
        bodies = [0, b.starts, b.starts] if f is None else [f.parts.count, f.offsets, f.nodes]
        marks = [b.block_mark, b.contact_mark, b.some, b.theirs, b.around, b.sizes]
        transposed = [b.t_offsets, b.t_contacts]
        place = [b.fixed, b.partner, b.starts, b.others, *transposed, b.offsets, b.columns, b.r]
        return ((region, [b.least, *bodies, b.some_parts, b.miss, *place, *marks], 1),)

    def _steps(self, own: list, touched: list, around: list, parts: tuple | None) -> dict[str, tuple[Launch, ...]]:
        """What a Newton step runs: on the blocks ``own``, their contacts, and all whose gradient that changes.

        Each of these is a place in `sizes` and a list; ``parts`` those of small bodies for `solve_parts`.
        """
        b, t, s = self.b, self.tiles, self.b.sizes
        matrix, transposed = [b.starts, b.others, b.a], [b.t_offsets, b.t_contacts, b.jt]
        law = [b.floor, b.mu, b.rho, b.shift, b.multiplier]
        blocked, touching = [t, s, *own], [t, s, *touched]
        apply: list[Launch] = []
        factor: list[Launch] = []
        if self.factors is not None:
            f, count, done = self.factors, self.factors.parts.count, int(kernels.DONE)
            apply.append((solve_parts, f.solve_inputs(b.fixed, b.residual, b.z, b.scalars, done, parts), count))
            factor.append((factor_parts, f.factor_inputs(b.starts, b.others, b.a, b.diagonal, b.fixed, parts), count))
        if self.project is not None:
            apply.append(self.project)
        if apply:  # z is another than that of `advance`
            apply.append((gradients.dot, [*blocked, b.residual, b.z, b.sums], t))
        advance = (gradients.advance, [*blocked, b.scalars, b.pq, b.partner, b.fixed, b.apart, b.m, b.n, b.p, b.q, b.dv,
                                       b.residual, b.z, b.sums], t)  # fmt: skip
        iteration: tuple[Launch, ...] = (
            (gradients.direct, [*blocked, b.scalars, b.z, b.p], t),
            (gradients.contact_product, [*touching, b.scalars, b.offsets, b.columns, b.j, b.d, b.p, b.y], t),
            (gradients.product, [*blocked, b.scalars, *matrix, *transposed, b.fixed, b.y, b.p, b.q, b.pq], t),
            *(() if self.take_out is None else (self.take_out,)), advance, *apply, (gradients.next_direction, [t, b.sums, CG_LIMIT, b.scalars], 1),
        )  # fmt: skip
        begin = (gradients.begin_gradients, [*blocked, b.g, b.residual, b.dv, b.p, b.q, b.pq, b.scalars], t)
        first = (gradients.first_direction, [t, b.sums, b.forcing, b.scalars], 1)
        batch = BATCH if self.project is None else 1
        return {
            "blocks": (
                (blocks.diagonals, [*blocked, *matrix, *transposed, b.d, b.partner, b.diagonal, b.coupled], t),
                (blocks.invert_blocks, [*blocked, b.partner, b.diagonal, b.coupled, b.m, b.n], t),
            ),
            "factor": tuple(factor),
            "evaluate": (
                (kernels.contact_forces, [*touching, b.offsets, b.columns, b.j, b.v, *law, b.u, b.r, b.d, b.primal,
                                          b.wrong], t),
                (kernels.gradient, [t, s, *around, *matrix, *transposed, b.fixed, b.v, b.free, b.load, b.r, b.local,
                                    b.g, b.miss], t),
                (kernels.largest_errors, [t, s, b.primal, b.wrong, b.miss, b.errors], t),
                (kernels.largest, [t, b.errors, b.scalars], 1),
            ),
            "newton": (begin, advance, *apply, first, *(iteration * batch)),
            "iterate": iteration * batch,
            "slopes": ((slopes, [t, s, own[0], touched[0], own[1], touched[1], b.offsets, b.columns, b.j, b.dv, b.g,
                                 b.residual, b.r, b.d, b.du, b.slopes], t),),
            "along": ((along, [*touching, b.length, b.u, b.du, *law, b.slopes], t),),
            "move": ((kernels.move, [*blocked, b.length, b.v, b.dv, b.p], t),),
            "update": ((kernels.update_multipliers, [*touching, b.u, b.mu, b.r, b.goal, SLOW, GROWTH, SLIP, *LONGER,
                                                     b.shortest,
                                                     b.rho, b.missed, b.lag, b.stride, b.shift, b.multiplier], t),),
        }  # fmt: skip
