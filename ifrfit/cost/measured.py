"""One measurement of a cost: how long, how far off."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

Kind = Literal["inference", "physics", "arithmetic"]
T = TypeVar("T")


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


def timed(
    call: Callable[[], object], *, repeats: int = 5, enough: float = 0.05, most: float = math.inf
) -> Timing:
    """Wall time of a call; parameters as `answered`."""
    return answered(call, repeats=repeats, enough=enough, most=most)[1]


def answered(
    call: Callable[[], T], *, repeats: int = 5, enough: float = 0.05, most: float = math.inf
) -> tuple[T, Timing]:
    """What a call gives, and its wall time.

    Parameters
    ----------
    call : callable
        Run once before, so that imports and caches are not what is measured.
    repeats : int
        Runs that count.
    enough : float
        Seconds: a shorter call is run several times a repeat, until a repeat lasts this long.
    most : float
        Seconds: of a call that takes longer the first run is the only one, and counts.
    """
    start = time.perf_counter()
    given = call()
    first = time.perf_counter() - start
    if first > most:
        return given, Timing.of([first])
    start = time.perf_counter()
    call()
    number = max(1, round(enough / max(time.perf_counter() - start, 1e-9)))
    found = []
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(number):
            call()
        found.append((time.perf_counter() - start) / number)
    return given, Timing.of(found)
