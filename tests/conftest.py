"""One thread for BLAS, whose matrices are small here; tests that run side by side take one thread each for kernels, too.

Threads wait for each other by spinning: more of them than cores would make small steps a thousand times slower. Tests of
threads set their number themselves.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before anything imports NumPy
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("TURNBUCKLE_THREADS", "1")
