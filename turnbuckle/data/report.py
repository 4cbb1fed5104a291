"""Reports: what a step and a run tell about themselves. Plain data."""

import re
from dataclasses import dataclass, field


@dataclass
class StepReport:
    """One step. Residuals are measured on the committed state (see `turnbuckle.step.certificate`)."""

    status: str = "ok"  # "ok" | "degraded" | "failed"
    messages: list[str] = field(default_factory=list)  # why it is not "ok", what broke, advice
    time: float = 0.0  # at the end of the step [s]
    dt: float = 0.0  # [s]
    position_residual: dict[str, float] = field(default_factory=dict)  # [m] by kind, of fully active constraints
    rate_residual: dict[str, float] = field(default_factory=dict)  # [m/s] by kind
    active: dict[str, int] = field(default_factory=dict)  # constraints acting, by kind
    ramping: int = 0  # constraints in gradual activation
    settling: bool = False  # explicit Euler, first step of new constraints: residuals say nothing yet
    broken: list[str] = field(default_factory=list)  # constraints that broke in this step
    momentum_error: tuple[float, float] = (
        0.0,
        0.0,
    )  # change by internal constraints: linear over sum m|v|, angular over that times the largest |x|
    energies: dict[str, float] = field(default_factory=dict)  # kinetic, elastic, gravity, work, dissipation [J]
    iterations: dict[str, int] = field(default_factory=dict)  # by solver
    rounds: int = 0  # of constraint manifold refinement
    halvings: int = 0
    intersections: int = 0  # edges through faces in the committed state
    last_resorts: int = 0  # times that zones of impact had to be moved rigidly
    contacts: int = 0  # rows of non-penetration in the last solve
    touching: int = 0  # of them, those that push
    contact_residual: dict[str, float] = field(default_factory=dict)  # [m/s] by condition (Contact, (7))
    smallest_gap: float | None = None  # [m] certified by continuous collision detection
    seconds: dict[str, float] = field(default_factory=dict)  # wall time by stage, and "total"

    @property
    def worst_residual(self) -> float:
        """The largest position residual of all kinds [m]."""
        return max(self.position_residual.values(), default=0.0)


_BROKE = "broke: "
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def _kind(message: str) -> str:
    """What a message says, without its numbers, and without the joints it names and says how far they are open."""
    if message.startswith(_BROKE):
        return _BROKE
    head, colon, names = message.partition(": ")
    return head if colon and "'" in names else _NUMBER.sub("#", message)


def merge_reports(first: StepReport, second: StepReport) -> StepReport:
    """The report of two steps after each other, as of one."""
    out = second
    out.dt = first.dt + second.dt
    out.halvings = first.halvings + second.halvings + 1
    for name in ("position_residual", "rate_residual", "iterations", "contact_residual"):
        mine, other = getattr(out, name), getattr(first, name)
        for kind, value in other.items():
            mine[kind] = max(value, mine.get(kind, value))
    out.rounds, out.contacts, out.touching = (
        max(getattr(first, n), getattr(second, n)) for n in ("rounds", "contacts", "touching")
    )
    out.intersections = max(first.intersections, second.intersections)
    out.last_resorts = first.last_resorts + second.last_resorts
    gaps = [r.smallest_gap for r in (first, second) if r.smallest_gap is not None]
    out.smallest_gap = min(gaps, default=None)
    for stage, seconds in first.seconds.items():
        out.seconds[stage] = out.seconds.get(stage, 0.0) + seconds
    out.momentum_error = (
        max(first.momentum_error[0], second.momentum_error[0]),
        max(first.momentum_error[1], second.momentum_error[1]),
    )
    out.broken = [*first.broken, *second.broken]
    told = {
        _kind(m): m for m in (*first.messages, *second.messages)
    }  # of one kind the last: it is of the state committed
    told.pop(_BROKE, None)
    out.messages = [*told.values(), *([_BROKE + ", ".join(out.broken[:5])] if out.broken else [])]
    if out.status == "ok" and first.status != "ok":
        out.status = first.status
    return out


@dataclass
class RunReport:
    """A run of many steps. `to_json` of `turnbuckle.run` writes it under the names that scripts rely on."""

    scene: str = ""
    status: str = "done"  # "done" | "failed"
    steps: int = 0
    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    device: str = "cpu"
    versions: dict[str, str] = field(default_factory=dict)
    ms_per_step: dict[str, float] = field(default_factory=dict)  # medians: "total" and one key a stage
    worst_residual: dict[str, float] = field(default_factory=dict)  # by constraint kind [m]
    worst_rate_residual: dict[str, float] = field(default_factory=dict)  # by constraint kind [m/s]
    worst_conflict: float = 0.0  # [m], what constraints that contradict each other miss by
    smallest_gap: float | None = None  # [m]
    intersections: int = 0  # most edges through faces in a committed state
    contacts_max: int = 0
    contact_residual: dict[str, float] = field(default_factory=dict)  # worst by condition [m/s]
    momentum_error: dict[str, float] = field(default_factory=lambda: {"linear": 0.0, "angular": 0.0})  # relative
    energies: dict[str, float] = field(default_factory=dict)  # at the end [J]
    iterations: dict[str, dict[str, int]] = field(default_factory=dict)  # histograms by solver
    cmr_rounds: dict[str, int] = field(default_factory=dict)  # histogram
    halvings: int = 0
    last_resorts: int = 0
    degraded_steps: int = 0
    messages: list[str] = field(default_factory=list)  # why steps were degraded, what broke; each once
    counts: dict[str, int] = field(default_factory=dict)  # points, springs, tetrahedra, constraints by kind
    failures: list[dict[str, object]] = field(default_factory=list)  # each with time, what, advice
    outputs: list[str] = field(default_factory=list)  # files written
    resumed: dict[str, object] | None = None  # "file", "time" [s] and "steps" where the run went on from a checkpoint
