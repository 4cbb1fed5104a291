"""Runs on the workers of a Dask scheduler that the user runs."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from turnbuckle.data.errors import InputError, StepError
from turnbuckle.sweeps.job import Job, Outcome, execute, failed, record_failure

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
    futures: dict[Future, int] = {}
    try:
        for number, job in enumerate(jobs):
            futures[client.submit(execute, job, pure=False, key=f"turnbuckle-{number}-{job['folder']}")] = number
        left = len(jobs)
        for future in as_completed(list(futures)):
            number = futures[future]
            left -= 1
            yield number, _outcome(future, jobs[number])
        if left:
            raise StepError(f"--cluster {address}: the scheduler was lost; run the same again to go on")
    except OSError:  # of communication
        raise StepError(f"--cluster {address}: the scheduler was lost; run the same again to go on") from None
    finally:
        client.cancel(list(futures))
        client.close(timeout=PATIENCE)


def _outcome(future: "Future", job: Job) -> Outcome:
    """What became of a run, or why it has nothing to show."""
    if future.status == "finished":
        return dict(future.result())
    error = future.exception() if future.status == "error" else None
    reason = f"the cluster could not run it ({type(error).__name__ if error else future.status})"
    try:
        return record_failure(job, reason, "look at the log of its workers, which may be short of memory")
    except OSError:
        return failed(job, reason)
