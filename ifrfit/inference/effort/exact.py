"""The exact posterior at the tolerance that is asked for, or at the finest that there is time for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ifrfit.inference.effort.wanted import Wanted
from ifrfit.inference.least_squares import LeastSquares
from ifrfit.inference.posterior import Posterior, explore
from ifrfit.inference.problem import Problem

LADDER = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
_GROWTH = 4.0  # of the time from one tolerance to the next, where it has not been seen to grow faster

Explore = Callable[..., Any]


def refine(
    problem: Problem, start: LeastSquares, wanted: Wanted, explore: Explore = explore
) -> Posterior | None:
    """Integrate the posterior as exactly as asked, or as the budget allows.

    With a budget the tolerance goes down in steps, as long as the next one, foreseen from the last ones,
    fits into what is left; a step that takes longer than foreseen is cut short.

    Parameters
    ----------
    problem : Problem
    start : LeastSquares
    wanted : Wanted
    explore : callable
        As `ifrfit.inference.posterior.explore`.

    Returns
    -------
    Posterior or None
        The one with the least error; None where not even the coarsest came to an end in time.

    Raises
    ------
    UsageError, DataError
        As `explore`.
    """
    if wanted.budget is None:
        return explore(problem, wanted.accuracy, start)  # type: ignore[no-any-return]
    best: Posterior | None = None
    last = before = 0.0
    for tolerance in ladder(wanted.accuracy):
        grows = max(_GROWTH, last / before if before > 0.0 else 0.0)
        if wanted.over or (best is not None and last * grows > wanted.left):
            break
        begin = wanted.clock()
        found = explore(problem, tolerance, start, over=lambda: wanted.over)
        last, before = wanted.clock() - begin, last
        if best is None or found.error < best.error:
            best = found
        if not found.converged:
            break
    return best if best is not None and best.error <= LADDER[0] else None


def ladder(accuracy: float | None) -> tuple[float, ...]:
    """Tolerances from coarse to fine; down to the asked accuracy, where one is asked for."""
    if accuracy is None:
        return LADDER
    return (*(tolerance for tolerance in LADDER if tolerance > 1.5 * accuracy), accuracy)
