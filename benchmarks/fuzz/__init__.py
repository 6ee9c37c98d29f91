"""Hostile files and words at every door of the commands: python -m benchmarks.fuzz."""

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # before NumPy is imported
    os.environ.setdefault(name, "1")  # a fork has one thread, and a core is a worker's
