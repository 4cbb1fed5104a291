"""Measurements. Each prints tables, and writes them with a plot into `benchmarks/results/<machine>/`.

`REGISTRY[name](console, folder, **options)`; all may be left out. Options are the keyword-only parameters of the
benchmark's `measure`. Nothing heavy is imported before a benchmark is called.
"""

import importlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

Benchmark = Callable[..., Any]  # (rich.console.Console | None, Path | None) -> its tables


def _measure(module: str, console: Any = None, folder: Path | None = None, **options: Any) -> Any:
    return importlib.import_module(f"turnbuckle.benchmarks.{module}").measure(console, folder, **options)


NAMES = (
    "curtain", "constraints", "scaling", "chain", "monocycle", "ccd",
    "view", "local_global", "falling_cloth", "letters", "dancer", "contact_windows", "contact_scaling", "contact_histograms",
)  # fmt: skip
LONG = (
    "letters",
    "dancer",
    "contact_windows",
    "contact_scaling",
    "contact_histograms",
)  # many minutes: only when named

REGISTRY: dict[str, Benchmark] = {name: partial(_measure, name) for name in NAMES}
