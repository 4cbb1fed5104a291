"""Ready scenes: each a function with parameters that returns a `Scene`.

`REGISTRY` maps names to functions. A scene's file is imported when its function is first asked for, so that importing
this package costs nothing.
"""

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from turnbuckle.scene.scene import Scene


class _Registry(Mapping[str, "Callable[..., Scene]"]):
    """Names to functions; the scene NAME is the function NAME in the file NAME.py of this package."""

    def __init__(self, *names: str) -> None:
        self._names = names

    def __getitem__(self, name: str) -> "Callable[..., Scene]":
        if name not in self._names:
            raise KeyError(name)
        return getattr(import_module(f"{__name__}.{name}"), name)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


REGISTRY: Mapping[str, "Callable[..., Scene]"] = _Registry(
    "curtain",
    "robot_on_ropes",
    "net_to_bridge",
    "self_assembly",
    "soft_mesh",
    "closed_chain",
    "four_bars",
    "bricard",
    "monocycle",
    "snake",
    "otary",
    "puppet",
    "falling_cloth",
    "letters",
    "mixed_stack",
    "dancer",
    "local_global",
    "hung_and_hit",
)
