"""What studies share: their options, and independent tasks on several processes, with results in order."""

from __future__ import annotations

import argparse
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

DOCS = Path(__file__).resolve().parents[1] / "docs"


def study_parser(description: str | None, seed: int, writes: str = "") -> argparse.ArgumentParser:
    """Command line of a study that writes a page into docs, or none; one thread a worker from here on.

    The number of threads is heeded only if numpy has not been imported yet.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seed", type=int, default=seed)
    if writes:
        parser.add_argument("--out", type=Path, default=DOCS, help=f"folder of {writes}")
    return parser


def in_order(function: Callable[[T], R], tasks: Sequence[T], workers: int) -> Iterator[R]:
    """Results of a function, in the order of the tasks; the same for any number of workers."""
    if workers == 1:
        yield from map(function, tasks)
        return
    # fresh interpreters: the same on every system, and they heed the number of threads
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(function, tasks, chunksize=max(1, min(20, len(tasks) // (4 * workers))))
