"""One folder a run: its frozen scene, and later its result.

    OUT/sweep.json                the plan: scene, what is varied, the runs in their order
    OUT/runs/NAME/scene.yaml      the scene of this run, everything in it (meshes are named, not copied)
    OUT/runs/NAME/attempt-*/      a run under way
    OUT/runs/NAME/result/         a run that ended: outcome.json, report.json, recordings, log.txt
    OUT/runs/NAME/failed-1/ ...   results of runs that failed and were tried again

There is no other record of what is done than these folders, and a folder gets the name `result` in one move once it is
whole, so whatever is killed, nothing is lost and no run counts twice.
"""

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from turnbuckle.data.errors import InputError
from turnbuckle.io.atomic import write_atomically
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.validation import given_data
from turnbuckle.scene.yaml_file import MESH_FIELDS
from turnbuckle.sweeps.values import Values, slug

PLAN, RUNS, SCENE, RESULT, OUTCOME, REPORT = "sweep.json", "runs", "scene.yaml", "result", "outcome.json", "report.json"
DRAFT = ".draft"  # in RUNS
FORMAT = "turnbuckle sweep"


@dataclass
class Run:
    """One run of a sweep, and what has become of it."""

    values: Values
    folder: Path  # OUT/runs/NAME
    outcome: dict[str, Any] = field(default_factory=dict)  # empty until it ended; `status`, `reason`, ...

    @property
    def status(self) -> str:
        """`done`, `failed`, or `waiting` while it has not ended."""
        return str(self.outcome.get("status", "waiting"))

    @property
    def reason(self) -> str:
        """Why it failed, else nothing."""
        return str(self.outcome.get("reason", ""))

    @property
    def result(self) -> Path:
        """The folder with report, recordings and log."""
        return self.folder / RESULT

    @property
    def report(self) -> dict[str, Any]:
        """The report of the run by the names of `RunReport`; empty where there is none."""
        return read_json(self.result / REPORT)

    def look(self) -> None:
        """Read the outcome again."""
        self.outcome = read_json(self.result / OUTCOME)


def read_json(path: Path) -> dict[str, Any]:
    """What a JSON file of ours holds; empty where there is none, or half of one."""
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}


def write_json(path: Path, data: Any) -> None:
    """Write a JSON file whole. Raises OSError."""
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
    write_atomically(path, lambda file: file.write(text.encode() + b"\n"))


def check_folder(out: Path) -> None:
    """Refuse a folder that holds something else. Raises `InputError`."""
    if out.exists() and not out.is_dir():
        raise InputError(f"sweep {out}: is a file; name a folder")
    if out.is_dir() and any(out.iterdir()) and read_json(out / PLAN).get("format") != FORMAT:
        raise InputError(f"sweep {out}: the folder holds something else than a sweep; name a new one")
    if not out.absolute().parent.is_dir():
        raise InputError(f"sweep {out}: there is no folder {str(out.parent)!r}")


def freeze(
    out: Path, name: str, make: Callable[[Values], Scene], combinations: Sequence[Values], settings: dict[str, Any]
) -> list[Run]:
    """Make the folder of every run, with its scene; runs that ended are found again by scene and settings.

    Where a scene cannot be made of its values, the run has failed with the reason. Raises `InputError` where that is so
    for all, or the folder cannot be written.
    """
    check_folder(out)
    fresh = not out.exists()
    runs: list[Run | tuple[Values, str]] = []
    try:
        for values in combinations:
            try:
                runs.append(_frozen(out, make(values), values, settings))
            except InputError as error:
                runs.append((values, str(error)))
        refused = [one[1] for one in runs if not isinstance(one, Run)]
        if len(refused) == len(runs):
            shutil.rmtree(out if fresh else out / RUNS / DRAFT, ignore_errors=True)
            raise InputError(refused[0])
        made = [one if isinstance(one, Run) else _refused(out, *one, settings) for one in runs]
        write_json(
            out / PLAN,
            {
                "format": FORMAT,
                "schema_version": 1,
                "scene": name,
                "settings": settings,
                "runs": [{"folder": run.folder.name, "values": run.values} for run in made],
            },
        )
    except OSError as error:
        raise InputError(f"sweep {out}: cannot be written ({error.strerror or error}); choose another place") from None
    return made


def _frozen(out: Path, scene: Scene, values: Values, settings: dict[str, Any]) -> Run:
    """The run of a scene. The scene is written beside its place first, for its folder is named by what it holds."""
    runs = out / RUNS
    runs.mkdir(parents=True, exist_ok=True)
    draft = runs / DRAFT
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir()
    scene.save(draft / SCENE)
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for file in sorted(draft.iterdir()):
        digest.update(file.name.encode() + file.read_bytes())
    for mesh in sorted(_meshes(given_data(scene.definition))):
        try:
            digest.update((scene.folder / mesh).read_bytes())
        except OSError:
            pass  # whoever runs it will say so
    folder = runs / f"{slug(values)}-{digest.hexdigest()[:8]}"
    if (folder / SCENE).is_file():
        shutil.rmtree(draft)
    else:
        shutil.rmtree(folder, ignore_errors=True)
        draft.rename(folder)
    run = Run(values, folder)
    run.look()
    return run


def _meshes(data: Any) -> set[str]:
    """Paths of all meshes in nested dicts and lists."""
    if isinstance(data, dict):
        own = {value for key, value in data.items() if key in MESH_FIELDS and isinstance(value, str)}
        return own.union(*map(_meshes, data.values()))
    return set().union(*map(_meshes, data)) if isinstance(data, list) else set()


def _refused(out: Path, values: Values, reason: str, settings: dict[str, Any]) -> Run:
    """A run whose scene is wrong: it has failed before it began."""
    digest = hashlib.sha256(json.dumps([values, settings, reason], sort_keys=True).encode()).hexdigest()[:8]
    run = Run(values, out / RUNS / f"{slug(values)}-{digest}")
    run.outcome = {"status": "failed", "reason": reason, "values": values}
    if not run.result.exists():
        run.result.mkdir(parents=True)
        write_json(run.result / OUTCOME, run.outcome)
    return run
