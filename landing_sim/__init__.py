"""landing-sim: vision-based landing with pixels in the loop."""

import os

# One thread a process: threaded BLAS under contention once cost 16 ms for a 6x6 matrix exponential, and the
# summation order of threaded kernels would break "same seed, same bits". Must precede numpy's import.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

__version__ = "0.1.0"
