"""One thread for BLAS: tests run side by side, and their matrices are small. Set before anything imports NumPy."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
