"""Do independent tasks on several processes, with results in order."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def in_order(function: Callable[[T], R], tasks: Sequence[T], workers: int) -> Iterator[R]:
    """Results of a function, in the order of the tasks; the same for any number of workers."""
    if workers == 1:
        yield from map(function, tasks)
        return
    # fresh interpreters: the same on every system, and they heed the number of threads
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(function, tasks, chunksize=max(1, min(20, len(tasks) // (4 * workers))))
