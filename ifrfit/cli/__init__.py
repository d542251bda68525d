"""The command line: one module a command, each a call of the library."""

import atexit
import gc
import os

# The tables of a command are narrow: threads of BLAS would only wait for one another, at twice the seconds of
# the processor. Said before numpy is imported, which reads it then; who sets the variable keeps their number.
for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

# A command lives for seconds and drops little: looking for garbage took a fifth of its time, and the last
# looks as the interpreter ends, among objects that the system takes back anyway, another fifth.
gc.set_threshold(500_000, 20, 50)
atexit.register(gc.freeze)
