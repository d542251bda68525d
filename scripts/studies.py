"""What studies share: options, independent tasks on several processes, progress, pages from templates.

Importing it first sets one thread for every library, so that workers are what runs side by side.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import multiprocessing
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

import jinja2

T = TypeVar("T")
R = TypeVar("R")

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = Path(__file__).with_name("pages")


def study_parser(description: str | None, seed: int, writes: str = "") -> argparse.ArgumentParser:
    """Command line of a study that writes a page into docs, or none."""
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


def watched(results: Iterable[R], total: int, what: str) -> Iterator[R]:
    """Pass the results on, with a progress bar where somebody looks."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(results, what, total, console=console, disable=not console.is_terminal)


def versions(*packages: str) -> str:
    """What ran: Python, ifrfit, numpy, scipy and further packages."""
    named = (f"{name} {version(name)}" for name in ("ifrfit", "numpy", "scipy", *packages))
    return ", ".join((platform.python_version(), *named))


def render(template: str, **given: object) -> str:
    """Fill in a template of `PAGES`."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(PAGES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return environment.get_template(template).render(given)


def markdown(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Rows under their head as a table; a column whose title ends with a colon is aligned to the right."""
    titles = [title.removesuffix(":") for title in head]
    rule = ["---:" if title.endswith(":") else "---" for title in head]
    lines = [f"| {' | '.join(map(str, row))} |" for row in (titles, *rows)]
    return "\n".join([lines[0], f"|{'|'.join(rule)}|", *lines[1:]])


def bold(text: str, *, when: bool) -> str:
    """Bold in Markdown, where it is called for."""
    return f"**{text}**" if when else text


def publish(path: Path, text: str, wrong: Sequence[str], good: str) -> int:
    """Write a page and say how the study came out; the exit status is 1 if something is wrong."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    print("\n".join(wrong) or good)
    print(f"written: {path}")
    return 1 if wrong else 0
