"""Posing by hand: bodies of the scene's start are dragged, and the joints stay closed (`assemble`, `pose`)."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.live.picking import Pick
from turnbuckle.live.session import Session
from turnbuckle.run.assemble import assemble
from turnbuckle.run.pose import pose
from turnbuckle.scene.scene import Scene
from turnbuckle.step.simulation import Simulation

SUFFIXES = (".yaml", ".yml", ".gascuel")


class Poser:
    """Drags bodies of a session's scene. Made in any thread; the work is done in the session's."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._held: tuple[str, np.ndarray] | None = None

    def begin(self) -> Any:
        """To the start of the scene, paused."""
        return self._session.reset()

    def assemble(self) -> Any:
        """Close all joints; what cannot close is told."""

        def close(scene: Scene, _: Simulation) -> Scene:
            found, report = assemble(scene)
            self._session.note(report.text())
            return found

        return self._session.renew(close)

    def grab(self, pick: Pick) -> Any:
        """Take hold of a body at a place."""

        def hold(simulation: Simulation) -> str:
            shape = simulation.model.shapes[pick.shape]
            b = int(simulation.model.body_of[pick.point])
            name = simulation.model.rigid.names[b] if b >= 0 else shape.name
            self._held = (name, local_place(self._session.scene, simulation, name, pick.place))
            return self._session.note(f"posing '{name}'")

        self._held = None
        return self._session.do(hold)

    def drag(self, target: np.ndarray) -> Any:
        """The mouse is there [m]; of several that wait only the last counts."""

        def move(scene: Scene, _: Simulation) -> Scene:
            if self._held is None:
                return scene
            name, local = self._held
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                moved = pose(scene, {(name, tuple(local)): target})
            for warning in told:
                self._session.note(str(warning.message))
            return moved

        return self._session.do(lambda s: self._session.become(move(self._session.scene, s)), key="pose")

    def let_go(self) -> Any:
        """Hold nothing."""
        return self._session.do(lambda _: setattr(self, "_held", None))

    def save(self, name: str, folder: Path) -> Any:
        """Write the scene as a file in ``folder``. Raises `InputError` by its future for a name that leads elsewhere."""

        def write(_: Simulation) -> Path:
            path = checked_name(name, folder)
            try:
                self._session.scene.save(path)
            except OSError as error:
                raise InputError(
                    f"{path}: cannot be written ({error.strerror or error}); choose another name"
                ) from None
            self._session.note(f"saved {path}")
            return path

        return self._session.do(write)


def checked_name(name: str, folder: Path) -> Path:
    """A file of that name in the folder. Raises `InputError`."""
    name = name.strip()
    if not name or Path(name).name != name or name.startswith(".") or "\x00" in name or "\\" in name:
        raise InputError(f"save as {name!r}: give the name of a file alone; it goes into {folder.absolute()}")
    if Path(name).suffix.lower() not in SUFFIXES:
        raise InputError(f"save as {name!r}: let the name end in {', '.join(SUFFIXES)}")
    return folder / name


def local_place(scene: Scene, simulation: Simulation, name: str, place: np.ndarray) -> np.ndarray:
    """A place in the world in a body's own frame (3,) [m], rigid or soft."""
    if name in simulation.model.rigid.names[1:]:
        origin, turn = simulation.pose(name)
        return np.asarray(Rotation.from_quat(turn).inv().apply(place - origin))
    body: Any = next((d for d in scene.definition.bodies if d.name == name), None)
    if body is None or not hasattr(body, "position"):
        raise InputError(f"'{name}' has no pose of its own and cannot be posed")
    return np.asarray(Rotation.from_rotvec(np.array(body.rotation)).inv().apply(place - np.array(body.position)))
