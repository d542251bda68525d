"""One thread for the compiled loops, so that what is measured is the work and not the number of cores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ifrfit.physics.compiling import available


@contextmanager
def one_thread() -> Iterator[None]:
    """Run compiled loops on one thread while this lasts; nothing to do where numba is missing."""
    if not available():
        yield
        return
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
