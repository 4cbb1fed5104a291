"""A process of this machine that does runs: a job as a line of JSON in, its outcome as a line of JSON out.

Started as `python -m turnbuckle.sweeps.worker`, and not by `multiprocessing`, so that a script that calls `sweep` needs
no guard for its main module. Whatever libraries print goes to the error stream.
"""

import json
import os
import sys

from turnbuckle.sweeps.job import execute


def main() -> None:
    """Until the input ends."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    for line in sys.stdin:
        answers.write(json.dumps(execute(json.loads(line))) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
