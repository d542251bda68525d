"""What is asked for one by one, got while one works with what came before."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from functools import lru_cache
from typing import TypeVar

Item = TypeVar("Item")


def read_ahead(items: Iterator[Item]) -> Iterator[Item]:
    """The same items in their order; the next one is got in a thread meanwhile.

    Worth it where that mostly needs no Python, as decoding columns does. What goes wrong with an item is
    raised where its turn comes.
    """
    thread, done = _thread(os.getpid()), object()
    coming = thread.submit(next, items, done)
    try:
        while (item := coming.result()) is not done:
            coming = thread.submit(next, items, done)
            yield item  # type: ignore[misc]  # what is not `done` is an item
    finally:
        wait([coming])  # nobody closes what is being read


@lru_cache(maxsize=1)
def _thread(process: int) -> ThreadPoolExecutor:
    """One thread for all that is read, which keeps its memory; a process that was forked off has none yet."""
    return ThreadPoolExecutor(1, thread_name_prefix="read-ahead")
