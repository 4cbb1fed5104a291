"""Which machine this is: results are kept by machine, and a number without its machine says nothing."""

import importlib.metadata
import os
import platform
import re
from pathlib import Path


def cpu_name() -> str:
    """The processor's own name where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.lower().startswith("model name")]
    return names[0] if names else platform.machine()


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load() -> float | None:
    """Processors in use over the last minute, by others and us; None where the system does not tell."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def describe() -> dict[str, str | int]:
    """What a reader needs to judge a timing."""
    versions = {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "warp-lang")}
    return {"cpu": cpu_name(), "cores": cores(), "system": platform.platform(), "python": platform.python_version()} | {
        f"version {name}": version for name, version in versions.items()
    }


def folder_name() -> str:
    """Name of this machine's folder of results, such as `amd-epyc-7763-2-cores`."""
    words = re.sub(r"\(r\)|\(tm\)|processor|cpu|@.*", " ", cpu_name().lower())
    return "-".join(re.findall(r"[a-z0-9]+", words)) + f"-{cores()}-cores"


def resident_bytes() -> int | None:
    """Memory that this process holds now [bytes], None where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")
