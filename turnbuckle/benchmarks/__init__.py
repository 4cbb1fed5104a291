"""Measurements. Each prints tables, and writes them with a plot into `benchmarks/results/<machine>/`.

`REGISTRY[name](console, folder)`; both may be left out. Nothing heavy is imported before a benchmark is called.
"""

import importlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

Benchmark = Callable[..., Any]  # (rich.console.Console | None, Path | None) -> its tables


def _measure(module: str, console: Any = None, folder: Path | None = None) -> Any:
    return importlib.import_module(f"turnbuckle.benchmarks.{module}").measure(console, folder)


REGISTRY: dict[str, Benchmark] = {
    name: partial(_measure, name) for name in ("curtain", "constraints", "scaling", "chain", "monocycle", "ccd")
}
