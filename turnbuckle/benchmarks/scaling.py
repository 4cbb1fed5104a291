"""How the time of a step, the time of `build()` and the memory grow with the number of cubes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from rich.console import Console

import turnbuckle
from turnbuckle.benchmarks.machine import load, resident_bytes
from turnbuckle.benchmarks.own import curtain_scene, measure_curtain
from turnbuckle.benchmarks.plot import scaling as draw
from turnbuckle.benchmarks.table import Table, publish
from turnbuckle.benchmarks.timing import line_fit
from turnbuckle.scenes.curtain_geometry import curtain_geometry

SIZES = (50, 150, 500, 1500, 5000)  # 990 to 99,990 cubes
MEMORY_M = 1500

# In a process of its own, so that what earlier scenes left behind is not counted; a small scene first, so that
# libraries and kernels are not either.
MEMORY = "from turnbuckle.benchmarks.scaling import own_memory; own_memory()"


def own_memory() -> None:
    """Print the memory [bytes] that a curtain adds to this process by its build and first steps, and its tetrahedra."""
    grown = []
    for m in (40, MEMORY_M):
        curtain = curtain_geometry(m)
        before = resident_bytes()
        simulation = turnbuckle.Simulation(curtain_scene(curtain))
        for _ in range(2):
            simulation.step()
        after = resident_bytes()
        grown.append(None if before is None or after is None else after - before)
    print(json.dumps([grown[-1], len(curtain.tetrahedra)]))


def bytes_per_tetrahedron() -> float | None:
    """Resident memory of a large curtain by its tetrahedra, None where the system does not tell."""
    done = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, timeout=300, check=True)
    grown, tetrahedra = json.loads(done.stdout.strip().splitlines()[-1])
    return None if grown is None else grown / tetrahedra


def measure(console: Console | None = None, folder: Path | None = None) -> list[Table]:
    """Measure, print, write tables and plot."""
    console, busy = console or Console(), load()
    console.print("Measuring curtains of 990 to 99,990 cubes; about a minute ...")
    results = [measure_curtain(m, seconds=2.0, least=5) for m in SIZES]
    cubes = [own.cubes for own in results]
    ms = [own.ms_per_step for own in results]
    a, b, misfit = line_fit(np.array(cubes), np.array(ms))

    table = Table("Growth with the number of cubes", ["cubes", "ms a step", "us a cube", "off the line", "build() [s]"])
    for own, off in zip(results, misfit, strict=True):
        table.add(own.cubes, own.ms_per_step, 1e3 * own.ms_per_step / own.cubes, f"{off:+.0%}", own.build_s)
    table.notes.append(f"Line: {a:.3g} ms + {1e3 * b:.3g} us a cube (least squares of the relative misfit).")
    memory = bytes_per_tetrahedron()
    if memory is not None:
        table.notes.append(
            f"Memory: {memory:.0f} bytes a tetrahedron ({10 * (2 * MEMORY_M - 1)} cubes, constraints included)."
        )
    folder = publish("scaling", [table], console, folder, busy)
    console.print(draw(cubes, ms, a, b, folder / "scaling.png"), highlight=False)
    return [table]


if __name__ == "__main__":
    measure()
