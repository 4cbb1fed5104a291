"""Kernel launches recorded once and replayed every step, on all threads or on the GPU.

A Warp launch from Python costs microseconds and runs on one thread. A step has dozens of small launches, so they
are recorded: on the CPU every launch is cut into one contiguous range per thread, each thread replays its own
captured graph in one native call, and threads meet at barriers inside the graphs; on CUDA the same calls become one
CUDA graph. The numbers a kernel needs anew each step (dt, time, ...) therefore live in arrays, not in arguments.

Results do not depend on the number of threads: an item is computed by one thread, in the item's own order.
"""

import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import warp as wp

from turnbuckle.compute.host import host
from turnbuckle.compute.start import start_warp

start_warp()
wp.set_module_options({"enable_backward": False})

SMALL = 512  # items below which a launch is not worth cutting
LOOK = 0.02  # [s] between two looks at how many processes want to run
LOAD = Path("/proc/loadavg")
PARALLEL = 8192  # a program whose largest launch is smaller runs on one thread: meeting costs more than it saves


@wp.func_native(
    """
#if defined(__CUDA_ARCH__)
    return 0;
#else
    unsigned threads_u = (unsigned)threads;
    unsigned arrived = (unsigned)__atomic_add_fetch(&meet.data[0], 1, __ATOMIC_ACQ_REL);
    unsigned goal = ((arrived - 1u) / threads_u + 1u) * threads_u;
    for (unsigned spins = 0; (int)((unsigned)__atomic_load_n(&meet.data[0], __ATOMIC_ACQUIRE) - goal) < 0; ++spins) {
        if (__atomic_load_n(&meet.data[16], __ATOMIC_RELAXED)) return 1;
#if defined(__linux__)
        int let_others_run(void) __asm__("sched_yield");
        if (spins > 200u) let_others_run();  // someone needs this processor, perhaps the thread we wait for
#endif
    }
    return 0;
#endif
"""
)
def wait_for_all(meet: wp.array(dtype=int), threads: int) -> int: ...


@wp.func_native(
    """
#if defined(__CUDA_ARCH__)
    unsigned long long ticks;
    asm volatile("mov.u64 %0, %globaltimer;" : "=l"(ticks));
    return (double)ticks;
#else
    return (double)__builtin_readcyclecounter();
#endif
"""
)
def clock_ticks() -> wp.float64: ...


@wp.kernel
def barrier(begin: int, meet: wp.array(dtype=int), threads: int):
    """Wait until every thread has come here. ``meet[0]`` counts arrivals, ``meet[16]`` is set to give up."""
    wait_for_all(meet, threads)


@wp.kernel
def stamp(begin: int, slot: int, ticks_out: wp.array(dtype=wp.float64)):
    """Write the clock into ``ticks_out[slot]``."""
    ticks_out[slot] = clock_ticks()


def default_threads() -> int:
    """Threads a CPU step may use: ``TURNBUCKLE_THREADS``, else the processors this process may run on, at most 8."""
    asked = asked_threads()
    if asked:
        return asked
    return min(_processors(), 8)


def _processors() -> int:
    """Those that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def asked_threads() -> int:
    """``TURNBUCKLE_THREADS``, 0 where it is not set."""
    asked = os.environ.get("TURNBUCKLE_THREADS", "")
    return int(asked) if asked.isdigit() else 0


_free = [0.0, 0]  # when it was last looked at, and what was seen


def free_processors() -> int:
    """Processors that no other process wants right now, at least one; looked at anew every `LOOK` seconds.

    Threads that meet at barriers wait for their turn where processes crowd the processors, and lose far more than they gain.
    """
    now = time.monotonic()
    if now - _free[0] > LOOK:
        try:
            running = int(LOAD.read_text().split()[3].split("/")[0]) - 1  # without us
        except (OSError, ValueError, IndexError):  # not Linux
            running = 0
        _free[:] = now, max(1, _processors() - max(running, 0))
    return _free[1]


class _Worker:
    """A thread that replays a graph when told to."""

    def __init__(self) -> None:
        self.go = threading.Semaphore(0)
        self.done = threading.Semaphore(0)
        self.graph = None
        threading.Thread(target=self._loop, daemon=True, name="turnbuckle").start()

    def _loop(self) -> None:
        while True:
            self.go.acquire()
            wp.capture_launch(self.graph)
            self.graph = None
            self.done.release()


_workers: list[_Worker] = []
_announced = False


def _load(kernel: wp.Kernel, device: str) -> None:
    """Compile or load the module of a kernel; say so once where compiling is to be expected."""
    global _announced
    if not _announced:
        _announced = True
        cache = Path(wp.config.kernel_cache_dir or "")
        if not any(cache.glob("wp_turnbuckle*")):
            print(
                "turnbuckle: compiling kernels for this machine (first run only, about half a minute) ...",
                file=sys.stderr,
            )
    on = wp.get_device(device)
    kernel.module.load(on, block_dim=256 if on.is_cuda else 1)


class Program:
    """A fixed sequence of kernel launches, host calls and time stamps.

    Launches between two calls of :meth:`barrier` must not depend on each other.
    """

    def __init__(self, device: str, threads: int | None = None) -> None:
        self.device = device
        self._on_gpu = wp.get_device(device).is_cuda
        self.threads = 1 if self._on_gpu else threads or default_threads()
        self._elastic = not threads and not asked_threads()  # fewer where others keep the processors busy
        self.ticks = wp.zeros(64, dtype=wp.float64, device=device)
        self.stages: list[str] = []
        self.seconds: dict[str, float] = {}
        self._segments: list[list] = [
            []
        ]  # each: a list of (kernel, n, inputs, outputs-free) and "barrier", or [callable]
        self._ready: dict[int, list] | None = None  # by the number of threads
        self._meet: dict[int, wp.array] = {}

    def launch(self, kernel: wp.Kernel, n: int, inputs: Sequence, grain: int = 1) -> None:
        """Record ``kernel`` over ``n`` items, each the work of about ``grain`` points.

        The kernel's first parameter, ``begin``, is given here.
        """
        if n > 0:
            _load(kernel, self.device)
            self._segments[-1].append((kernel, n, list(inputs), grain))

    def barrier(self) -> None:
        """What follows sees the results of all that came before."""
        if self._segments[-1] and self._segments[-1][-1] != "barrier":
            self._segments[-1].append("barrier")

    def host(self, function: Callable[[], None]) -> None:
        """Record a call of a Python function, which sees the results of all that came before."""
        self._segments += [[function], []]

    def stage(self, name: str) -> None:
        """All that follows is timed under ``name`` (read :attr:`seconds` after a run)."""
        self.barrier()
        _load(stamp, self.device)
        self._segments[-1].append(("stamp", len(self.stages)))
        self.stages.append(name)

    def finish(self, parallel_from: int = PARALLEL) -> "Program":
        """Capture the graphs. Nothing can be recorded afterwards.

        A program whose largest launch has less than ``parallel_from`` points to work on runs on one thread.
        """
        self.barrier()
        self._segments[-1].append(("stamp", len(self.stages)))
        _load(stamp, self.device)
        _load(barrier, self.device)
        launches = [op for s in self._segments for op in s if isinstance(op, tuple) and op[0] != "stamp"]
        largest = max((n * grain for _, n, _, grain in launches), default=0)
        if largest < parallel_from:
            self.threads = 1
        while len(_workers) < self.threads - 1:
            _workers.append(_Worker())
        self._ready = {}
        self._graphs(self.threads)
        return self

    def _graphs(self, threads: int) -> list:
        """Graphs, one a thread, and host calls, in turn."""
        assert self._ready is not None, "Program.finish() was not called"
        if threads not in self._ready:
            self._meet[threads] = wp.zeros(32, dtype=int, device="cpu")
            self._ready[threads] = [
                segment[0] if callable(segment[0]) else [self._capture(segment, k, threads) for k in range(threads)]
                for segment in self._segments
                if segment
            ]
        return self._ready[threads]

    def _capture(self, segment: list, thread: int, threads: int):
        with wp.ScopedCapture(device=self.device) as capture:
            count = 0
            for op in segment:
                if op == "barrier":
                    if threads > 1:
                        wp.launch(barrier, 1, inputs=[0, self._meet[threads], threads], device="cpu")
                elif op[0] == "stamp":
                    if thread == 0:
                        wp.launch(stamp, 1, inputs=[0, op[1], self.ticks], device=self.device)
                else:
                    kernel, n, inputs, grain = op
                    if n * grain < SMALL:  # whole, to one thread in turn
                        begin, end = (0, n) if count % threads == thread else (0, 0)
                        count += 1
                    else:
                        begin, end = n * thread // threads, n * (thread + 1) // threads
                    if end > begin:
                        wp.launch(kernel, end - begin, inputs=[begin, *inputs], device=self.device)
            if threads > 1:
                wp.launch(barrier, 1, inputs=[0, self._meet[threads], threads], device="cpu")
        return capture.graph

    def run(self, most: int | None = None) -> None:
        """Replay, on at most ``most`` threads. On return all results are visible to the host (on CUDA: once it synchronises)."""
        threads = min(self.threads, most or self.threads)
        if self._elastic and threads > 1:
            threads = min(threads, free_processors())
        began = time.perf_counter()
        for part in self._graphs(threads):
            if callable(part):
                part()
            else:
                self._replay(part)
        self._time(time.perf_counter() - began)

    def _replay(self, graphs: list) -> None:
        helpers = _workers[: len(graphs) - 1]
        started = 0
        try:
            for worker, graph in zip(helpers, graphs[1:], strict=True):
                worker.graph = graph
                worker.go.release()
                started += 1
            wp.capture_launch(graphs[0])
            for worker in helpers:
                worker.done.acquire()
                started -= 1
        except BaseException:  # an interrupt before our own part ran: release those who wait for us, then tell
            flags = self._meet[len(graphs)].numpy()
            flags[16] = 1
            for worker in helpers[len(helpers) - started :]:
                worker.done.acquire(timeout=5.0)
            flags[:] = 0
            raise

    def _time(self, wall: float) -> None:
        """Seconds by stage: the share of each in the clock ticks, times the wall time."""
        if not self.stages or self._on_gpu:
            return
        ticks = host(self.ticks)[: len(self.stages) + 1].tolist()
        total = ticks[-1] - ticks[0]
        self.seconds = {}
        for k, name in enumerate(self.stages):
            span = max(ticks[k + 1] - ticks[k], 0.0)
            self.seconds[name] = self.seconds.get(name, 0.0) + (wall * span / total if total > 0.0 else 0.0)
