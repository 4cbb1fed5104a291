"""The certificate of a run: a short table for the terminal."""

from collections.abc import Iterator

from turnbuckle.data.report import RunReport

SHOWN = 6  # messages and failures printed in full


def certificate(report: RunReport) -> str:
    """What was simulated, how fast, and how exactly every constraint was met, a line each."""
    rows = list(_rows(report))
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {text}".rstrip() for name, text in rows)


def _rows(report: RunReport) -> Iterator[tuple[str, str]]:
    yield "scene", f"{report.scene}: {report.status}"
    things = ("points", "springs", "tetrahedra", "rigid_bodies", "joints")
    bodies = [f"{report.counts[k]} {k.replace('_', ' ')}" for k in things if report.counts.get(k)]
    kinds = [f"{n} {kind}" for kind, n in report.counts.items() if kind in report.worst_residual]
    if bodies:
        yield "size", ", ".join(bodies)
    if kinds:
        yield "constraints", ", ".join(kinds)
    if report.resumed:
        yield (
            "resumed",
            f"from {report.resumed['file']} at {_number(report.resumed['time'])} s, step {report.resumed['steps']}",
        )
    yield (
        "steps",
        f"{report.steps}, {_number(report.simulated_seconds)} s simulated in {report.wall_seconds:.2f} s on {report.device}",
    )
    total = report.ms_per_step.get("total")
    if total is not None:
        stages = ", ".join(f"{name} {ms:.3f}" for name, ms in report.ms_per_step.items() if name != "total")
        yield "ms a step", f"{total:.3f}" + (f" ({stages})" if stages else "")
    label = "worst residual"
    for kind, position in report.worst_residual.items():
        unit = "rad" if kind.endswith("_rotation") else "m"
        rate = report.worst_rate_residual.get(kind, 0.0)
        yield label, f"{kind.replace('_rotation', '')} {position:.1e} {unit}, {rate:.1e} {unit}/s"
        label = ""
    if report.worst_conflict > 0.0:
        yield "worst conflict", f"{report.worst_conflict:.1e} m"
    error = report.momentum_error
    yield "momentum error", f"linear {error['linear']:.1e}, angular {error['angular']:.1e} (relative, a step)"
    if report.energies:
        yield "energy", ", ".join(f"{name} {_number(value)} J" for name, value in report.energies.items())
    for solver, histogram in report.iterations.items():
        yield "iterations", f"{solver}: {_typical(histogram)}"
    if report.contacts_max:
        gap = "" if report.smallest_gap is None else f", none nearer than {_number(report.smallest_gap)} m"
        yield "contacts", f"{report.contacts_max} at most, {report.intersections} intersections{gap}"
    if report.contact_residual:
        yield "", ", ".join(f"{name} {value:.1e}" for name, value in report.contact_residual.items()) + " m/s at worst"
    if report.cmr_rounds:
        yield "rounds", f"of contact refinement: {_typical(report.cmr_rounds)}"
    if report.last_resorts:
        yield "last resorts", f"{report.last_resorts} times bodies were moved rigidly to keep them apart"
    if report.halvings:
        yield "halved", f"{report.halvings} times a step was taken in two halves"
    yield "degraded", f"{report.degraded_steps} of {report.steps} steps" if report.degraded_steps else "no step"
    for number, text in enumerate(_first(report.messages)):
        yield "" if number else "notes", text
    for failure in report.failures[:SHOWN]:
        yield "failed", f"at {_number(failure['time'])} s: {failure['what']}"
        if failure.get("advice"):
            yield "advice", str(failure["advice"])
    label = "written"
    for path in report.outputs:
        yield label, path
        label = ""


def _typical(histogram: dict[str, int]) -> str:
    """Median and largest of a histogram."""
    values = sorted((int(value), count) for value, count in histogram.items())
    half, seen = sum(count for _, count in values) / 2, 0
    for value, count in values:
        seen += count
        if seen >= half:
            return f"{value} in a typical step, {values[-1][0]} at most"
    return "none"


def _first(texts: list[str]) -> list[str]:
    more = [f"and {len(texts) - SHOWN} more, in the report file"] if len(texts) > SHOWN else []
    return [*texts[:SHOWN], *more]


def _number(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)
