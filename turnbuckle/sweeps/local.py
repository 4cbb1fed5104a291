"""Runs in processes of this machine, one thread here for each, which hands out jobs and waits for outcomes."""

import json
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import turnbuckle.data as below
from turnbuckle.sweeps.job import Job, Outcome, failed, record_failure

TRIES = 2  # of a run whose process died
Ended = tuple[int, Outcome]  # number of the job, what became of it


def processors() -> int:
    """Processors this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_local(jobs: Sequence[Job], processes: int | None = None) -> Iterator[Ended]:
    """Do all jobs in ``processes`` processes (as many as processors); yields each as it ends.

    A process that dies takes no other run with it: its run is tried once more, then it has failed. Closing the iterator
    ends the processes.
    """
    count = max(1, min(processes or processors(), len(jobs)))
    threads = max(1, processors() // count)
    waiting: queue.SimpleQueue[int | None] = queue.SimpleQueue()
    ended: queue.SimpleQueue[Ended] = queue.SimpleQueue()
    for number in range(len(jobs)):
        waiting.put(number)
    for _ in range(count):
        waiting.put(None)
    hands = [_Hand(jobs, waiting, ended, threads) for _ in range(count)]
    try:
        for hand in hands:
            hand.start()
        for _ in jobs:
            yield ended.get()
    finally:
        for hand in hands:
            hand.end()
        for hand in hands:
            hand.join()


class _Hand(threading.Thread):
    """Feeds one process."""

    def __init__(
        self,
        jobs: Sequence[Job],
        waiting: "queue.SimpleQueue[int | None]",
        ended: "queue.SimpleQueue[Ended]",
        threads: int,
    ) -> None:
        super().__init__(daemon=True, name="turnbuckle sweep")
        self._jobs, self._waiting, self._ended = jobs, waiting, ended
        own = str(Path(below.__file__).resolve().parents[2])  # where this very Turnbuckle is found again
        paths = [own, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._environment = {
            "TURNBUCKLE_THREADS": str(threads), **os.environ, "PYTHONPATH": os.pathsep.join(paths)
        }  # fmt: skip
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self._over = False

    def run(self) -> None:
        """Until the jobs are done."""
        while not self._over and (number := self._waiting.get()) is not None:
            try:
                outcome = self._done(self._jobs[number])
            except OSError as error:
                outcome = failed(self._jobs[number], f"no process could be started ({error.strerror or error})")
            self._ended.put((number, outcome))
        self._quit(gently=not self._over)

    def end(self) -> None:
        """No further job; the one under way is broken off."""
        self._over = True
        self._quit(gently=False)

    def _done(self, job: Job) -> Outcome:
        code: int | None = None
        for _ in range(TRIES):
            process = self._alive()
            if process is None:
                break
            try:
                assert process.stdin is not None and process.stdout is not None
                process.stdin.write(json.dumps(job) + "\n")
                process.stdin.flush()
                answer = process.stdout.readline()
                if answer.endswith("\n"):
                    return dict(json.loads(answer))
            except (OSError, ValueError):
                pass
            code = process.wait()
        if self._over:
            return failed(job, "the sweep was stopped")
        return record_failure(job, f"its process died ({_why(code)}), {TRIES} times", "it may be short of memory")

    def _alive(self) -> "subprocess.Popen[str] | None":
        """The process, a new one where it died; none when the sweep is over."""
        with self._lock:
            if self._over:
                return None
            if self._process is None or self._process.poll() is not None:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "turnbuckle.sweeps.worker"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    text=True,
                    encoding="utf-8",
                    env=self._environment,
                    start_new_session=True,  # Ctrl-C is for the sweep, which ends its processes
                )
            return self._process

    def _quit(self, gently: bool) -> None:
        with self._lock:
            process = self._process
        if process is None:
            return
        if gently and process.stdin is not None:
            process.stdin.close()
        else:
            process.kill()
        process.wait()


def _why(code: int | None) -> str:
    if code is not None and code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    return f"exit code {code}"
