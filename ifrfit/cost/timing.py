"""One measurement of a cost: how long, how far off, and on what machine."""

from __future__ import annotations

import math
import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

from ifrfit.physics.compiling import available

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["inference", "physics", "arithmetic"]
KINDS: tuple[Kind, ...] = get_args(Kind)
T = TypeVar("T")
K = TypeVar("K")


@dataclass(frozen=True)
class Timing:
    """Seconds of several runs of the same thing.

    Attributes
    ----------
    median, low, high : float
        Seconds: the median, the least and the most.
    repeats : int
    """

    median: float
    low: float
    high: float
    repeats: int

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Timing:
        """Of the seconds of each run."""
        return cls(statistics.median(seconds), min(seconds), max(seconds), len(seconds))

    def per(self, count: int) -> Timing:
        """Per one of `count` equal things done in each run."""
        return Timing(self.median / count, self.low / count, self.high / count, self.repeats)


@dataclass(frozen=True)
class Cost:
    """What one choice costs, and how exact it is.

    Attributes
    ----------
    kind : str
    method : str
        As exact, mcmc, closure, memory function, float32.
    setting : str
        As ``tolerance 1e-3``; may be empty.
    quantity : str
        What the error is that of: mean, sd, interval95, beta, ...
    time : Timing
        Of the whole answer (inference) or of one impact (physics, arithmetic).
    error : float
        Largest error of the quantity against the reference, 0 or more; nan where there is none to state.
    error_unit : str
        As ``posterior sd``, ``1``.
    """

    kind: Kind
    method: str
    setting: str
    quantity: str
    time: Timing
    error: float
    error_unit: str


def timed(call: Callable[[], object], *, repeats: int = 5, enough: float = 0.05) -> Timing:
    """Wall time of a call; parameters as `in_turns`."""
    return in_turns({"": call}, repeats=repeats, enough=enough)[""][1]


def in_turns(
    calls: Mapping[K, Callable[[], T]], *, repeats: int = 5, enough: float = 0.05, most: float = math.inf
) -> dict[K, tuple[T, Timing]]:
    """What calls give, and their wall times, taken in turns: what else the machine does meets all alike.

    Parameters
    ----------
    calls : mapping of callable
        Each is run twice before, so that imports and caches are not what is measured.
    repeats : int
        Runs that count.
    enough : float
        Seconds: a shorter call is run several times a repeat, until a repeat lasts this long.
    most : float
        Seconds: of a call that takes longer the first run is the only one, and counts.
    """
    found: dict[K, tuple[T, Timing]] = {}
    numbers: dict[K, int] = {}
    for name, call in calls.items():
        given, first = timed_result(call)
        found[name] = given, Timing.of([first])
        if first <= most:
            numbers[name] = max(1, round(enough / max(seconds_of(call), 1e-9)))
    seconds: dict[K, list[float]] = {name: [] for name in numbers}
    for _ in range(repeats):
        for name, number in numbers.items():
            seconds[name].append(seconds_of(calls[name], number))
    return {
        name: (given, Timing.of(seconds[name]) if name in seconds else once)
        for name, (given, once) in found.items()
    }


def timed_result(call: Callable[[], T]) -> tuple[T, float]:
    """What one call gives, and its wall time."""
    start = time.perf_counter()
    return call(), time.perf_counter() - start


def seconds_of(call: Callable[[], object], number: int = 1) -> float:
    """Wall time of a call, on average over so many."""
    start = time.perf_counter()
    for _ in range(number):
        call()
    return (time.perf_counter() - start) / number


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


def machine() -> dict[str, int | str]:
    """What times depend on, enough to judge them: number of cores, architecture and system."""
    return {
        "cores": os.cpu_count() or 1,
        "architecture": platform.machine(),
        "system": platform.system(),
    }


def table_of(costs: Iterable[Cost]) -> pd.DataFrame:
    """Costs as a table.

    Returns
    -------
    DataFrame
        kind, method, setting, time_s (median), error, error_unit, repeats, quantity, time_low_s, time_high_s
        (least and most).
    """
    import pandas as pd

    rows = [
        {
            "kind": cost.kind,
            "method": cost.method,
            "setting": cost.setting,
            "time_s": cost.time.median,
            "error": cost.error,
            "error_unit": cost.error_unit,
            "repeats": cost.time.repeats,
            "quantity": cost.quantity,
            "time_low_s": cost.time.low,
            "time_high_s": cost.time.high,
        }
        for cost in costs
    ]
    return pd.DataFrame(rows)
