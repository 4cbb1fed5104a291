"""Runs on the workers of a Dask scheduler that the user runs."""

import contextlib
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from turnbuckle.data.errors import InputError, StepError
from turnbuckle.sweeps.job import FAR, Job, Outcome, bring_home, execute, failed, record_failure

if TYPE_CHECKING:
    from dask.distributed import Future

PATIENCE = 10.0  # seconds to wait for the scheduler


def run_cluster(jobs: Sequence[Job], address: str) -> Iterator[tuple[int, Outcome]]:
    """Do all jobs on the workers of the scheduler at ``address``; yields each as it ends.

    A run whose worker is lost goes to another worker; where that happens three times it has failed. Closing the iterator
    cancels what has not begun. Raises `InputError` where there is no scheduler, `StepError` where it is lost.
    """
    try:
        from dask.distributed import Client, as_completed
    except ImportError:
        raise InputError("--cluster needs Dask; run: pip install 'turnbuckle[sweep]'") from None
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"--cluster {address}: there is no Dask scheduler ({error or 'no answer'})") from None
    lost = f"--cluster {address}: the scheduler was lost; run the same again to go on"
    # What is lost is told in a sentence; Dask would print the traceback of its attempts to reconnect.
    loggers = {logging.getLogger(name): logging.getLogger(name).level for name in ("distributed", "distributed.client")}
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    futures: dict[Future, int] = {}
    try:
        for number, job in enumerate(jobs):
            futures[client.submit(execute, job, pure=False, key=f"turnbuckle-{number}-{job['folder']}")] = number
        left, ending = len(jobs), as_completed(list(futures), loop=client.loop)
        for future in ending:
            number = futures[future]
            if future.status in ("cancelled", "lost"):  # nobody here cancels while runs are waited for
                raise StepError(lost)
            outcome = _outcome(future, jobs[number])
            if outcome["status"] == FAR:  # no file system in common: the files travel
                folder = Path(jobs[number]["folder"])
                files = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
                again = client.submit(execute, {**jobs[number], "files": files}, pure=False, key=f"{future.key}-files")
                futures[again] = number
                ending.add(again)
                continue
            left -= 1
            yield number, outcome
        if left:
            raise StepError(lost)
    except OSError:  # of communication
        raise StepError(lost) from None
    finally:
        with contextlib.suppress(OSError, TimeoutError):
            client.cancel(list(futures))
            client.close(timeout=PATIENCE)
        for logger, level in loggers.items():
            logger.setLevel(level)


def _outcome(future: "Future", job: Job) -> Outcome:
    """What became of a run, or why it has nothing to show."""
    if future.status == "finished":
        outcome = dict(future.result())
        try:
            return bring_home(job, outcome) if "files" in outcome else outcome
        except OSError as error:
            return failed(job, f"the folder of the run cannot be written ({error.strerror or error})")
    cause = future.exception() if future.status == "error" else None
    reason = f"the cluster could not run it ({type(cause).__name__ if cause else future.status})"
    try:
        return record_failure(job, reason, "look at the log of its workers, which may be short of memory")
    except OSError:
        return failed(job, reason)
