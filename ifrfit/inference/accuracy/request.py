"""What the user asks: an accuracy, a time, or both."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from ifrfit.errors import UsageError
from ifrfit.text import power_of_ten

MOST, LEAST = 0.5, 1e-9  # accuracies that can be asked for: below, rounding is in the way

_UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "": 1.0}
_RESERVED = 0.1  # of the budget, for statuses, draws and checks after the search

Clock = Callable[[], float]

CLOCK: Clock = time.perf_counter


@dataclass(frozen=True)
class Request:
    """Accuracy and time, and since when the time runs.

    Attributes
    ----------
    accuracy : float or None
        In posterior standard deviations.
    budget : float or None
        Seconds.
    clock : callable
        Seconds.
    begin : float
        What the clock showed when `fit` was called.
    """

    accuracy: float | None
    budget: float | None
    clock: Clock
    begin: float

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return self.clock() - self.begin

    @property
    def left(self) -> float:
        """Seconds that a search may still take; infinite without a budget."""
        return math.inf if self.budget is None else (1.0 - _RESERVED) * self.budget - self.seconds

    @property
    def over(self) -> bool:
        """Whether the time of searching has run out."""
        return self.left <= 0.0


def check_request(accuracy: float | None, budget: float | str | None) -> None:
    """Refuse an accuracy or a time that makes no sense.

    Parameters
    ----------
    accuracy : float, optional
        1e-9 to 0.5.
    budget : float or str, optional
        Seconds, or text as `seconds_of` reads it.

    Raises
    ------
    UsageError
    """
    if accuracy is not None and not LEAST <= accuracy <= MOST:
        raise UsageError(
            f"--accuracy {accuracy:g}: choose from {power_of_ten(LEAST)} to {MOST:g} of a posterior standard "
            "deviation."
        )
    if budget is not None:
        seconds_of(budget)


def make_request(
    accuracy: float | None,
    budget: float | str | None,
    started: float | None = None,
    clock: Clock | None = None,
) -> Request:
    """A request whose time runs.

    Parameters
    ----------
    accuracy, budget
        As `check_request`.
    started : float, optional
        What the clock showed when the user asked; by default it is asked now.
    clock : callable, optional
        Seconds, by default of this machine.

    Raises
    ------
    UsageError
        As `check_request`.
    """
    check_request(accuracy, budget)
    own = CLOCK if clock is None else clock
    seconds = None if budget is None else seconds_of(budget)
    return Request(accuracy, seconds, own, own() if started is None else started)


def now() -> float:
    """Seconds that the clock shows."""
    return CLOCK()


def seconds_of(budget: float | str) -> float:
    """Seconds from a number, or from text as 2s, 500ms, 3min, 1h.

    Raises
    ------
    UsageError
        If it is no positive time.
    """
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([a-z]*)\s*", str(budget))
    try:
        seconds = float(found[1]) * _UNITS[found[2]] if found else math.nan
    except (KeyError, ValueError):
        seconds = math.nan
    if not 0.0 < seconds < math.inf:
        raise UsageError(f"--budget {budget}: write a time, as 2s, 500ms or 3min; a plain number is seconds.")
    return seconds
