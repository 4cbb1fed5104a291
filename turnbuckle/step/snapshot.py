"""A copy of all that a step may change, for going back by more than one step."""

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
import warp as wp

from turnbuckle.data.state import State

VALUES = (
    "time", "steps", "dt", "stale", "work", "dissipation", "dissipation_power", "field_power", "energies", "activated",
    "owner", "domain_use", "impulse", "active", "contact_keys", "contact_impulse", "contact_sliding", "contact_yielding", "script_delay",
    "contact_found",
)  # fmt: skip


class Snapshot:
    """The state as it was when this was made."""

    def __init__(self, state: State) -> None:
        self._arrays = [array.numpy().copy() for array in _arrays(state)]
        self._values = {name: _copy(getattr(state, name)) for name in VALUES}
        self._groups = {name: (g.acting, g.broken.copy()) for name, g in state.groups.items()}
        self._joints = {name: (j.acting, j.broken) for name, j in state.joints.items()}

    def restore(self, state: State) -> None:
        """Put everything back; what was recorded or uploaded for the state is made anew."""
        for array, values in zip(_arrays(state), self._arrays, strict=True):
            array.assign(values)
        for name, value in self._values.items():
            setattr(state, name, _copy(value))
        for name, (acting, broken) in self._groups.items():
            state.groups[name].acting, state.groups[name].broken = acting, broken.copy()
        for name, (acting, broken) in self._joints.items():
            state.joints[name].acting, state.joints[name].broken = acting, broken
        state.layout += 1


def _arrays(state: State) -> Iterator[wp.array]:
    """All device arrays that evolve, in an order that stays."""
    for part in (state.now, state.rigid, *state.tables.by_kind().values()):
        for column in fields(part):
            value = getattr(part, column.name)
            if column.name == "ramp":
                yield from (getattr(value, f.name) for f in fields(value))
            elif isinstance(value, wp.array):
                yield value
    yield from (array for array in (state.nailed, state.external) if array is not None)


def _copy(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray | dict) else value
