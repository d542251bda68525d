"""What the benchmarks share: one thread, paired timing, and the machine in generic words."""

from __future__ import annotations

import os

# one thread for every library, so that ratios compare work and not the number of cores
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import contextlib
import csv
import ctypes
import importlib.metadata
import platform
import resource
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"
README = Path(__file__).parent / "README.md"
_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of prctl


def machine(*packages: str) -> str:
    """Processor count and versions: enough to judge the figures, nothing that identifies the machine.

    Further packages are named where they are installed.
    """
    parts = [f"{os.cpu_count()} cores ({platform.machine()}, {platform.system()})"]
    parts.append(f"Python {platform.python_version()}")
    parts += [f"{name} {importlib.metadata.version(name)}" for name in ("numpy", "scipy", "lmfit", "pandas")]
    for name in packages:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            parts.append(f"{name} {importlib.metadata.version(name)}")
    return ", ".join(parts)


def benchmark_parser(description: str | None, quick: str = "") -> argparse.ArgumentParser:
    """Options of a benchmark; `quick` says what --quick does, where there is one."""
    parser = argparse.ArgumentParser(description=description)
    if quick:
        parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the CSV and of any plot")
    parser.add_argument("--readme", action="store_true", help="put the table into the README, too")
    return parser


def adopt_orphans() -> None:
    """Let what a command leaves behind, as what its workers are forked from, become a child (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SUBREAPER, 1, 0, 0, 0)


def cpu_of_children() -> float:
    """CPU seconds of all children, those adopted too; waits until none is left."""
    with contextlib.suppress(ChildProcessError):
        while True:
            os.wait()
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


Row = Mapping[str, Any]
Columns = Mapping[str, str | Callable[[Row], str]]  # title to a format of a row, as "{time_s:.2f} s"


def publish(
    options: argparse.Namespace,
    name: str,
    rows: Sequence[Row],
    table: Sequence[Sequence[str]],
    goals: Sequence[str] = (),
    about: str = "",
) -> None:
    """Print a table and its goals, write the rows as CSV, and both into the README where that is asked."""
    print_table(table)
    print(*(f"goal: {goal}" for goal in goals), sep="\n")
    write_csv(options.out / f"{name.replace(' ', '_')}.csv", rows)
    if options.readme:
        listed = ["", *(f"- {goal}" for goal in goals)] if goals else []
        put_into_readme(name, [about or machine(), "", *markdown_table(table), *listed])


def cells(rows: Sequence[Row], columns: Columns) -> list[list[str]]:
    """Cells of a table, the titles first."""
    made = [[f.format(**row) if isinstance(f, str) else f(row) for f in columns.values()] for row in rows]
    return [list(columns), *made]


@dataclass(frozen=True)
class OnNew:
    """A call on what is made anew each time, before the clock starts, and given up after it stopped."""

    make: Callable[[], Any]
    call: Callable[[Any], object]

    def __call__(self) -> object:
        return self.call(self.make())


def seconds_of(call: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Time of one call: wall time, or that of another clock."""
    if isinstance(call, OnNew):
        new = call.make()
        return seconds_of(lambda: call.call(new), clock)
    start = clock()
    call()
    return clock() - start


def rounds_of(
    calls: Mapping[str, Callable[[], object]], budget: float, least: int = 3, most: int = 31
) -> dict[str, list[float]]:
    """Time the calls in turns, so that whatever else the machine does meets all of them alike.

    Parameters
    ----------
    calls : mapping of str to callable
    budget : float
        Seconds after which no further round begins.
    least, most : int
        Rounds.

    Returns
    -------
    dict of str to list of float
        Seconds of each round.
    """
    for call in calls.values():
        call()  # imports and caches are not what is measured
    times: dict[str, list[float]] = {name: [] for name in calls}
    begin = time.perf_counter()
    for number in range(most):
        if number >= least and time.perf_counter() - begin > budget:
            break
        for name, call in calls.items():
            times[name].append(seconds_of(call))
    return times


def ratio_of(times: Sequence[float], reference: Sequence[float]) -> float:
    """Median over the rounds of the ratio within a round."""
    return statistics.median(a / b for a, b in zip(times, reference, strict=True))


def verdict(met: bool) -> str:
    """Word for a goal."""
    return "met" if met else "NOT MET"


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows of one shape."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def put_into_readme(mark: str, lines: Sequence[str], path: Path = README) -> None:
    """Replace what stands between ``<!-- mark -->`` and ``<!-- end mark -->`` in a file."""
    before, rest = path.read_text(encoding="utf-8").split(f"<!-- {mark} -->\n")
    _, after = rest.split(f"<!-- end {mark} -->\n")
    middle = "\n".join(["", *lines, "", ""])
    path.write_text(f"{before}<!-- {mark} -->\n{middle}<!-- end {mark} -->\n{after}", encoding="utf-8")


def markdown_table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows under the first one, as Markdown."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return [lines[0], "|" + "---|" * len(rows[0]), *lines[1:]]


def print_table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows under the first one, columns aligned to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for number, row in enumerate(rows):
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)))
        if number == 0:
            print("  ".join("-" * width for width in widths))


@dataclass(frozen=True)
class Curve:
    """Points of one label in a diagram, and how matplotlib draws them."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    style: Mapping[str, Any]


def draw(path: Path, panels: Mapping[str, Sequence[Curve]], x: str, y: str) -> None:
    """Curves over logarithmic axes, a panel a title; the legend of all stands in a place of its own."""
    import matplotlib as mpl

    mpl.use("svg")
    import matplotlib.pyplot as plt

    columns = min(3, len(panels) + 1)
    lines = -(-(len(panels) + 1) // columns)
    size = (3.5 * columns, 3.1 * lines)
    with plt.rc_context({"svg.fonttype": "none", "svg.hashsalt": "ifrfit", "font.size": 9}):
        figure, grid = plt.subplots(
            lines, columns, figsize=size, sharex=True, sharey=True, squeeze=False, layout="constrained"
        )
        handles = {}
        for axes, (title, curves) in zip(grid.flat, panels.items(), strict=False):
            for curve in curves:
                (handles[curve.label],) = axes.loglog(curve.x, curve.y, **curve.style)
            axes.set_title(title, fontsize=8)
            axes.set(xlabel=x, ylabel=y)
        *_, legend = rest = list(grid.flat)[len(panels) :]
        for axes in rest:
            axes.set_axis_off()
        legend.legend(handles.values(), handles, loc="center", frameon=False)
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)
