"""Reading and writing device arrays from the host."""

import numpy as np
import warp as wp


def host(array: wp.array) -> np.ndarray:
    """The array's values: on the CPU a view of it (made once, since making one costs as much as a small kernel)."""
    if not array.device.is_cpu:
        return array.numpy()
    view = getattr(array, "_turnbuckle_view", None)
    if view is None:
        view = array.numpy()
        array._turnbuckle_view = view
    return view


def write(array: wp.array, values: np.ndarray) -> None:
    """Values into the first places of an array, whatever the device."""
    if array.device.is_cpu:
        host(array)[: len(values)] = values
    elif len(values):
        array[: len(values)].assign(np.ascontiguousarray(values))
