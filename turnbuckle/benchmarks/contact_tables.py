"""The tables of the benchmarks of contact: steps by window, stages, and other libraries beside them."""

from collections.abc import Mapping, Sequence

import numpy as np

from turnbuckle.benchmarks.contact_protocol import ContactResult
from turnbuckle.benchmarks.contact_run import ContactRun
from turnbuckle.benchmarks.table import Table

Windows = Mapping[str, tuple[float, float]]  # name -> begin and end [s] of the simulated time


def steps_table(title: str, run: ContactRun, windows: Windows, aims: Mapping[str, float] | None = None) -> Table:
    """A column a window; ``aims`` [ms a step in the mean] by window, where the run is the one they are for."""
    table = Table(title, ["", *windows])
    columns = [_window(run, *ends) for ends in windows.values()]
    for row in columns[0]:
        table.add(row, *(column.get(row) for column in columns))
    table.add("committed states judged, whole run", run.judged, *[None] * (len(windows) - 1))
    table.add("of them, states that intersect", run.crossing, *[None] * (len(windows) - 1))
    for name, aim in (aims or {}).items():
        mean = columns[list(windows).index(name)].get("mean, ms")
        if mean is not None:
            table.notes.append(f"{name}: aim {aim:g} ms a step in the mean: {'met' if mean <= aim else 'missed'}.")
    count = f"{run.points:,} points, " + (f"{run.solids:,} tetrahedra, " if run.solids else "")
    table.notes.append(
        f"{count}{run.vertices:,} surface vertices; steps of {1e3 * run.dt:g} ms, the first not counted; build() "
        f"{run.build_s:.2g} s; points went {run.went:.3g} m in the mean. Judged by ipctk."
    )
    table.notes += [f"Said: {message}" for message in run.messages]
    return table


def _window(run: ContactRun, begin: float, end: float) -> dict[str, float | int | str]:
    """What the steps of a window did, by the words of the rows."""
    inside = run.within(begin, end)
    if not inside.any():
        return {"steps": 0}
    ms, contacts, rounds = (run.of(n, inside) for n in ("ms", "contacts", "rounds"))
    halvings, last = run.of("halvings", inside), run.of("last_resorts", inside)
    status = run.of("status", inside)
    return {
        "steps": int(inside.sum()),
        "mean, ms": float(ms.mean()),
        "median, ms": float(np.median(ms)),
        "nine in ten below, ms": float(np.quantile(ms, 0.9)),
        "worst, ms": float(ms.max()),
        "contacts, mean": float(contacts.mean()),
        "contacts, most": int(contacts.max()),
        "rounds, mean": float(rounds.mean()),
        "three rounds or fewer": f"{np.mean(rounds <= 3):.1%}",
        "halvings": int(halvings.sum()),
        "last resorts": int(last.sum()),
        "steps with either": f"{np.mean((halvings > 0) | (last > 0)):.2%}",
        "degraded": int((status == "degraded").sum()),
        "failed": int((status == "failed").sum()),
    }


def stages_table(run: ContactRun, windows: Windows) -> Table:
    """Mean times of the stages of a step, and their part of it."""
    names = [stage for stage in run.stages[-1] if stage != "total"] if run.stages else []
    names += sorted({s for step in run.stages for s in step} - {*names, "total"})
    table = Table("Stages: mean ms a step", ["stage", *windows, *(f"part, {name}" for name in windows)])
    means = {}
    for name, (begin, end) in windows.items():
        steps = [s for s, inside in zip(run.stages, run.within(begin, end), strict=True) if inside]
        means[name] = {k: float(np.mean([s.get(k, 0.0) for s in steps])) if steps else 0.0 for k in [*names, "total"]}
    for one in means.values():
        one["other"] = one["total"] - sum(one[n] for n in names)
    for stage in [*names, "other", "total"]:
        parts = [one[stage] / one["total"] if one["total"] else 0.0 for one in means.values()]
        table.add(stage, *(one[stage] for one in means.values()), *(f"{part:.0%}" for part in parts))
    return table


def peers_table(title: str, run: ContactRun, answers: Sequence[ContactResult | str]) -> Table:
    """Other libraries on the same scene, on this machine, in this run; ratios over the time that both have simulated."""
    columns = ["library", "ms mean", "median", "/ ours", "s", "judged", "cross", "edges", "went [m]"]
    table = Table(title, columns)
    ours = np.array(run.ms[1:])
    if len(ours):
        cells = [
            float(ours.mean()),
            float(np.median(ours)),
            1.0,
            run.time[-1],
            run.judged,
            run.crossing,
            None,
            run.went,
        ]
        table.add("turnbuckle", *cells)
    for answer in answers:
        if isinstance(answer, str):
            table.notes.append(answer)
            continue
        theirs = np.array(answer.ms)
        common = min(len(ours), len(theirs))
        ratio = float(theirs[:common].mean() / ours[:common].mean()) if common else None
        times = [float(theirs.mean()), float(np.median(theirs))] if len(theirs) else [None, None]
        seconds = (len(theirs) + 1) * answer.dt
        counts = [seconds, answer.judged, answer.crossing, answer.most_edges, answer.went]
        table.add(f"{answer.name} {answer.version}", *times, ratio, *counts)
        table.notes.append(f"{answer.name}: {answer.how}.")
    table.notes.append(
        f"Times for {1e3 * run.dt:g} ms of the scene; / ours: over the time that both have simulated; s: that time. Cross: "
        "judged states that intersect, by ipctk; edges: through faces in the worst of them."
    )
    return table
