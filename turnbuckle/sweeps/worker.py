"""A process of this machine that does runs: a job as a line of JSON in, its outcome as a line of JSON out.

Started as `python -m turnbuckle.sweeps.worker`, and not by `multiprocessing`, so that a script that calls `sweep` needs
no guard for its main module. Whatever libraries print goes to the error stream. When the input ends in the middle of a run,
the sweep is gone (killed, perhaps), and so is the process.
"""

import json
import os
import queue
import sys
import threading

from turnbuckle.sweeps.job import execute


def main() -> None:
    """Until the input ends."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    at_work = threading.Event()
    threading.Thread(target=_listen, args=(jobs, at_work), daemon=True).start()
    while (line := jobs.get()) is not None:
        answer = json.dumps(execute(json.loads(line))) + "\n"
        at_work.clear()
        answers.write(answer)
        answers.flush()


def _listen(jobs: "queue.SimpleQueue[str | None]", at_work: threading.Event) -> None:
    for line in sys.stdin:
        at_work.set()
        jobs.put(line)
    if at_work.is_set():
        os._exit(1)
    jobs.put(None)


if __name__ == "__main__":
    main()
