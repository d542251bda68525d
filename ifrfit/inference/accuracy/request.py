"""What the user asks, an accuracy, a time or both, and what came of it, in words."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from ifrfit.errors import UsageError
from ifrfit.text import duration, power_of_ten

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


@dataclass(frozen=True)
class Effort:
    """What a fit with --accuracy or --budget asked, picked and reached.

    Attributes
    ----------
    accuracy : float or None
        Asked: largest error of a mean, an sd or an end of an interval, in posterior standard deviations.
    budget : float or None
        Asked: seconds from the call of `fit`, reading the data included; not the start of the program, nor
        figures and files.
    method : str
        Picked: exact, mcmc or lsq.
    tolerance : float or None
        Of exact.
    steps : int or None
        Of mcmc, each ensemble's.
    reached : float or None
        exact: the largest last change of a result; mcmc: the largest standard error; None for lsq, whose
        distance from the posterior nobody knows without the posterior.
    seconds : float
        What it took, counted as the budget is.
    why : str
        Why not exact, or not as asked; empty where there is nothing to explain.
    """

    accuracy: float | None
    budget: float | None
    method: str
    tolerance: float | None
    steps: int | None
    reached: float | None
    seconds: float
    why: str = ""

    @property
    def met(self) -> bool:
        """Whether the asked accuracy was reached, as far as one was asked."""
        return self.accuracy is None or (self.reached is not None and self.reached <= self.accuracy)

    @property
    def says(self) -> str:
        """Method and setting, what was reached, in which time, and what was asked."""
        taken = f"in {duration(self.seconds)}"
        why = f" ({self.why})" if self.why else ""
        asked = [power_of_ten(self.accuracy)] if self.accuracy is not None else []
        if self.budget is not None:
            asked.append(f"{'at most' if asked else 'the best in'} {duration(self.budget)}")
        if self.method == "lsq":
            found = f"least squares {taken}{why}; how far from the posterior is not known"
        else:
            found = f"{self._setting} reached {self._reached} {taken}{why}"
        return f"{found}; asked: {', '.join(asked)}"

    @property
    def missed(self) -> str:
        """That the accuracy was not reached."""
        assert self.accuracy is not None
        within = "" if self.budget is None else f" within {duration(self.budget)}"
        start = f"the asked accuracy of {power_of_ten(self.accuracy)} of an sd was not reached{within}"
        if self.method == "lsq":
            return f"{start}: least squares do not tell how far they are from the posterior"
        return f"{start}: {self._setting} came to {self._reached}"

    @property
    def _setting(self) -> str:
        if self.tolerance is not None:
            return f"exact, tolerance {power_of_ten(self.tolerance)},"
        return f"mcmc, {self.steps:,} steps,"

    @property
    def _reached(self) -> str:
        if self.reached is None:
            return "no standard error yet"
        kind = "a standard error of " if self.method == "mcmc" else ""
        return f"{kind}{power_of_ten(self.reached)} of an sd"
