"""A table that a terminal, a markdown page and a script can read."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import rich.table
from rich.console import Console

from turnbuckle.benchmarks.machine import cores, describe, folder_name


@dataclass
class Table:
    """Rows of text and numbers under a title. Notes stand below."""

    title: str
    columns: list[str]
    rows: list[list[Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, *cells: Any) -> None:
        """One more row, with a cell for each column."""
        if len(cells) != len(self.columns):
            raise ValueError(f"table {self.title!r}: {len(cells)} cells for {len(self.columns)} columns")
        self.rows.append(list(cells))

    def rich(self) -> rich.table.Table:
        """For the terminal."""
        table = rich.table.Table(title=self.title, caption="\n".join(self.notes) or None, caption_justify="left")
        for index, column in enumerate(self.columns):
            table.add_column(column, justify="left" if index == 0 else "right")
        for row in self.rows:
            table.add_row(*map(text, row))
        return table

    def markdown(self) -> str:
        """For a page."""
        lines = [f"## {self.title}", "", "| " + " | ".join(self.columns) + " |"]
        lines.append("|" + "|".join([" --- ", *[" ---: "] * (len(self.columns) - 1)]) + "|")
        lines += ["| " + " | ".join(map(text, row)) + " |" for row in self.rows]
        return "\n".join([*lines, "", *[f"* {note}" for note in self.notes]]).rstrip() + "\n"


def text(cell: Any) -> str:
    """Three figures that count; `-` where nothing was measured."""
    if cell is None:
        return "-"
    if isinstance(cell, float):
        return f"{cell:.0f}" if 1000 <= abs(cell) < 1e6 else f"{cell:.3g}"
    return f"{cell:,}" if isinstance(cell, int) else str(cell)


def results_folder(folder: Path | None) -> Path:
    """`folder`, by default this machine's in the current directory; made where it is missing."""
    folder = folder if folder is not None else Path("benchmarks") / "results" / folder_name()
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def busy_note(before: float | None) -> list[str]:
    """A warning when others kept the processors busy `before` a measurement began."""
    if before is None or before < 0.3 * cores():
        return []
    return [
        f"Measured on a busy machine (load {before:.1f} on {cores()} processors): times are too long, ratios unsafe."
    ]


def publish(
    name: str, tables: list[Table], console: Console | None, folder: Path | None, load_before: float | None = None
) -> Path:
    """Print the tables and write `name.json` and `name.md`; returns the folder.

    `load_before` is `machine.load()` from before the measurement: a busy machine is said below every table.
    """
    console, folder = console or Console(), results_folder(folder)
    for table in tables:
        table.notes += busy_note(load_before)
    for table in tables:
        console.print(table.rich())
    machine = describe()
    where = ", ".join(f"{key} {value}" for key, value in machine.items())
    page = f"# {name}\n\n{where}\n\n" + "\n".join(table.markdown() for table in tables)
    (folder / f"{name}.md").write_text(page)
    (folder / f"{name}.json").write_text(
        json.dumps({"schema_version": 1, "machine": machine, "tables": [asdict(table) for table in tables]}, indent=1)
    )
    console.print(f"Written: {folder / name}.md, .json", highlight=False)
    return folder
