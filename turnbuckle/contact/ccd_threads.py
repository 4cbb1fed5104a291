"""One kernel over many items, cut over threads, without recording: for lists whose length changes from call to call."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import warp as wp

from turnbuckle.compute.program import default_threads, free_processors

PIECE = 4096  # items below which a thread of its own does not pay
PIECES = 8  # a thread, so that one which meets the costly items does not keep the others waiting

_pools: dict[int, ThreadPoolExecutor] = {}


def launch_over_threads(kernel: wp.Kernel, n: int, inputs: Sequence, device: str, threads: int | None = None) -> None:
    """Run ``kernel`` (first parameter ``begin``) over ``n`` items; on return the results are there."""
    if n == 0:
        return
    on = wp.get_device(device)
    threads = 1 if on.is_cuda else threads or min(default_threads(), free_processors())
    pieces = min(n // PIECE, threads * PIECES)
    if threads == 1 or pieces < 2:
        wp.launch(kernel, n, inputs=[0, *inputs], device=device)
        if on.is_cuda:
            wp.synchronize_device(device)
        return
    kernel.module.load(on, block_dim=1)
    if threads not in _pools:
        _pools[threads] = ThreadPoolExecutor(threads, thread_name_prefix="turnbuckle-ccd")
    cuts = [n * k // pieces for k in range(pieces + 1)]

    def part(k: int) -> None:
        wp.launch(kernel, cuts[k + 1] - cuts[k], inputs=[cuts[k], *inputs], device=device)

    for _ in _pools[threads].map(part, range(pieces)):
        pass


def on_device(values: np.ndarray, dtype: type, device: str) -> wp.array:
    """The values, flat, for a kernel: on the CPU a view where type and layout allow, so keep ``values`` alive."""
    flat = np.ascontiguousarray(values, dtype=wp.dtype_to_numpy(dtype)).reshape(-1)
    if flat.size == 0:
        return wp.zeros(0, dtype=dtype, device=device)
    return wp.array(flat, dtype=dtype, device=device, copy=not wp.get_device(device).is_cpu)
