"""Directive that shows what `turnbuckle bench` measured, read from `benchmarks/results/` when the pages are built.

    ```{benchmark-table} curtain
    ```

shows the tables of `curtain.json` of every machine that has one, each machine named, with its notes and its plot. With the
option ``first`` only the first table, without the plot. A benchmark that no machine has measured says so.
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
    return {"parallel_read_safe": True}
