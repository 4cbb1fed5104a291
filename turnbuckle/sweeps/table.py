"""The table of a sweep: a row a run, what was varied and what came of it."""

import csv
import io
from collections.abc import Sequence
from typing import Any

from turnbuckle.scene.suggestion import did_you_mean
from turnbuckle.sweeps.plan import Run
from turnbuckle.sweeps.values import text_of

Row = dict[str, Any]
MEASURES = (
    "steps", "ms_per_step", "worst_residual", "smallest_gap", "contacts_max", "energy", "momentum_error",
    "degraded_steps", "halvings", "wall_seconds",
)  # fmt: skip
SHOWN = ("ms_per_step", "worst_residual", "smallest_gap", "energy")  # on the terminal and in the plot


def rows(runs: Sequence[Run], measures: Sequence[str] = ()) -> list[Row]:
    """A row a run: its values, `status`, `MEASURES`, those asked for, and at the end `reason` and `folder`."""
    found = []
    for run in runs:
        report = run.report
        row: Row = dict(run.values)
        row["status"] = run.status
        row |= {name: _standard(name, report) for name in MEASURES}
        row |= {path: measured(path, report, run.outcome) for path in measures}
        found.append({**row, "reason": run.reason, "folder": run.folder.name})
    return found


def _standard(name: str, report: dict[str, Any]) -> Any:
    value = report.get(name)
    if name == "ms_per_step":
        return (value or {}).get("total")
    if name == "worst_residual":
        return max((v for v in (value or {}).values() if v is not None), default=None)
    if name == "momentum_error":
        return (value or {}).get("linear")
    if name == "energy":
        parts = report.get("energies") or {}
        known = [parts[k] for k in ("kinetic", "elastic", "gravity") if parts.get(k) is not None]
        return sum(known) if known else None
    return value


def measured(path: str, report: dict[str, Any], outcome: dict[str, Any]) -> Any:
    """What stands at a path such as `energies.kinetic` of the report, or `bodies.cloth.lowest.2` of the outcome."""
    for source in (report, outcome):
        value: Any = source
        rest = path
        while rest and value is not None:
            value, rest = _inner(value, rest)
        if value is not None:
            return value
    return None


def missing(runs: Sequence[Run], measures: Sequence[str]) -> list[str]:
    """A sentence for each measure that no run that is done has."""
    done = [r for r in runs if r.status == "done"]
    if not done:
        return []
    known = [*_paths(done[0].report), *_paths(done[0].outcome)]
    return [
        f"measure {path}: no run has it{did_you_mean(path, known)}"
        for path, values in ((p, [row.get(p) for row in rows(done, [p])]) for p in measures)
        if all(value is None for value in values)
    ]


def _paths(value: Any, at: str = "") -> list[str]:
    """All that can be measured, as paths."""
    if not isinstance(value, dict):
        return [at]
    return [path for key, inner in value.items() for path in _paths(inner, f"{at}.{key}" if at else str(key))]


def _inner(value: Any, path: str) -> tuple[Any, str]:
    """One part further down; names may hold dots, the longest that fits wins."""
    if isinstance(value, dict):
        fitting = [key for key in value if path == key or path.startswith(f"{key}.")]
        key = max(fitting, key=len, default="")
        return (value[key], path[len(key) + 1 :]) if fitting else (None, "")
    head, _, rest = path.partition(".")
    if isinstance(value, list) and head.isdigit() and int(head) < len(value):
        return value[int(head)], rest
    return None, ""


def csv_text(table: Sequence[Row]) -> str:
    """All columns as CSV; lists as JSON, what is not known empty."""
    names = list(dict.fromkeys(name for row in table for name in row))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    for row in table:
        writer.writerow([_cell(row.get(name)) for name in names])
    return out.getvalue()


def _cell(value: Any) -> Any:
    if value is None:
        return ""
    return text_of(value) if isinstance(value, list | dict | bool) else value


def text(table: Sequence[Row], varied: Sequence[str], measures: Sequence[str] = ()) -> str:
    """A table for the terminal: what is varied, the status, and `SHOWN` or the measures asked for."""
    last = list(measures) or [n for n in SHOWN if any(row.get(n) is not None for row in table)]
    names = [*varied, "status", *last]
    cells = [[_shown(row.get(name)) for name in names] for row in table]
    widths = [max(len(name), *(len(row[i]) for row in cells)) for i, name in enumerate(names)]
    lines = ["  ".join(name.ljust(width) for name, width in zip(names, widths, strict=True)).rstrip()]
    for row, one in zip(cells, table, strict=True):
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        lines.append(line if not one["reason"] else f"{line}  {_first_line(one['reason'])}")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4g}"
    return value if isinstance(value, str) else text_of(value)


def _first_line(reason: str) -> str:
    line = reason.strip().splitlines()[0] if reason.strip() else ""
    return line if len(line) <= 100 else line[:99] + "…"
