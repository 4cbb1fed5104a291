"""Directives that show what `turnbuckle bench` measured, read from `benchmarks/results/` when the pages are built.

    ```{benchmark-table} curtain
    ```

shows the tables of `curtain.json` of every machine that has one, each machine named, with its notes and its plot. With the
option ``first`` only the first table, without the plot. A benchmark that no machine has measured says so.

    ```{benchmark-peers}
    ```

gathers each line of another library from all of them: its time over ours, and what it misses by beside what we do.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from turnbuckle.benchmarks.table import text

# Columns that say what a library misses by, and the unit.
MISSED = {"gap [m]": "m", "worst gap [m]": "m", "cross": "crossing states"}
RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


class BenchmarkTable(SphinxDirective):
    """See the head of this file."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {"first": directives.flag}

    def run(self) -> list[nodes.Node]:
        name = self.arguments[0]
        shown: list[nodes.Node] = []
        for path in sorted(RESULTS.glob(f"*/{name}.json")):
            self.env.note_dependency(str(path))
            found = json.loads(path.read_text(encoding="utf-8"))
            shown.append(nodes.paragraph("", "", nodes.strong(text=_machine(found["machine"]))))
            tables = found["tables"][:1] if "first" in self.options else found["tables"]
            for table in tables:
                shown += _table(table)
            plot = path.with_suffix(".png")
            if plot.is_file() and "first" not in self.options:
                shown.append(self._plot(plot))
        if not shown:
            missing = nodes.paragraph()
            missing += nodes.Text("No machine has a result of this benchmark in ")
            missing += nodes.literal(text="benchmarks/results/")
            missing += nodes.Text(" yet; it is measured by ")
            missing += nodes.literal(text=f"turnbuckle bench {name}")
            missing += nodes.Text(".")
            shown.append(missing)
        return shown

    def _plot(self, path: Path) -> nodes.image:
        """The picture, by its way from the folder of the page that asks for it."""
        page = Path(self.env.doc2path(self.env.docname)).parent
        return nodes.image(uri=Path(os.path.relpath(path, page)).as_posix(), alt=path.stem)


class BenchmarkPeers(SphinxDirective):
    """See the head of this file."""

    def run(self) -> list[nodes.Node]:
        rows = []
        for path in sorted(RESULTS.glob("*/*.json")):
            self.env.note_dependency(str(path))
            for table in json.loads(path.read_text(encoding="utf-8"))["tables"]:
                rows += [(f"{path.stem} ({path.parent.name})", *row) for row in _peers(table)]
        if not rows:
            return [nodes.paragraph(text="No results with other libraries are there yet.")]
        rows.sort(key=lambda row: row[3])
        told = [(*row[:3], text(row[3]), _faster(row[3]), *row[4:]) for row in rows]
        columns = ["benchmark", "library", "case", "time / ours", "faster", "they miss by", "we miss by"]
        return _table({"title": "Other libraries, the fastest first", "columns": columns, "rows": told, "notes": []})


def _faster(ratio: float) -> str:
    """Who is; within a tenth nobody."""
    return "nobody" if 1.0 / 1.1 < ratio < 1.1 else "they" if ratio < 1.0 else "we"


def _peers(table: dict[str, Any]) -> list[tuple]:
    """Library, case, time over ours, and what both miss by, of each line of a table that is not ours and has a ratio."""
    columns, rows = table["columns"], table["rows"]
    if columns[0] != "library" or "/ ours" not in columns:
        return []
    ratio = columns.index("/ ours")
    case = columns.index("boxes") if "boxes" in columns else None
    missed = next((i for i, name in enumerate(columns) if name in MISSED), None)
    found = []
    for row in rows:
        if row[0] == "turnbuckle" or row[ratio] is None:
            continue
        ours = next(o for o in rows if o[0] == "turnbuckle" and (case is None or o[case] == row[case]))
        told = ["-" if missed is None else f"{text(r[missed])} {MISSED[columns[missed]]}" for r in (row, ours)]
        found.append((row[0], "" if case is None else f"{text(row[case])} {columns[case]}", float(row[ratio]), *told))
    return found


def _machine(machine: dict[str, Any]) -> str:
    versions = ", ".join(
        f"{key.removeprefix('version ')} {machine[key]}" for key in machine if key.startswith("version ")
    )
    return f"{machine['cpu']}, {machine['cores']} cores, Python {machine['python']}, {versions}"


def _table(table: dict[str, Any]) -> list[nodes.Node]:
    """Title, rows and notes."""
    columns = table["columns"]
    group = nodes.tgroup(cols=len(columns))
    group += [nodes.colspec(colwidth=2 if i == 0 else 1) for i in range(len(columns))]
    head, body = nodes.thead(), nodes.tbody()
    head += _row(columns)
    body += [_row([text(cell) for cell in row]) for row in table["rows"]]
    group += [head, body]
    out: list[nodes.Node] = [nodes.table("", nodes.title(text=table["title"]), group, classes=["benchmark"])]
    if table["notes"]:
        notes = nodes.bullet_list()
        notes += [nodes.list_item("", nodes.paragraph(text=note)) for note in table["notes"]]
        out.append(notes)
    return out


def _row(cells: list[str]) -> nodes.row:
    row = nodes.row()
    row += [nodes.entry("", nodes.paragraph(text=cell)) for cell in cells]
    return row


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.add_directive("benchmark-table", BenchmarkTable)
    app.add_directive("benchmark-peers", BenchmarkPeers)
    return {"parallel_read_safe": True}
