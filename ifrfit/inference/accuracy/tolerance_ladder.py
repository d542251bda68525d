"""The exact posterior at the tolerance that is asked for, or at the finest that there is time for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ifrfit.inference.accuracy.request import Request
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.posterior.adaptive_quadrature import GridTooLargeError

LADDER = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
_GROWTH = 4.0  # of the time from one tolerance to the next, where it has not been seen to grow faster

_NEAR = 1.5  # factor within which a tolerance is as good as the asked one

Integrate = Callable[..., Any]


def refine(
    problem: Problem,
    start: LeastSquaresFit,
    request: Request,
    integrate: Integrate = integrate,
    *,
    must: bool = False,
) -> QuadraturePosterior | None:
    """Integrate the posterior as exactly as asked, or as the budget allows.

    With a budget the tolerance goes down in steps, as long as the next one, foreseen from the last ones,
    fits into what is left; a step that takes longer than foreseen is cut short. Where a tolerance is not
    reached the next one is tried all the same: it begins with finer rules, which come through where coarse
    ones get stuck.

    Parameters
    ----------
    problem : Problem
    start : LeastSquaresFit
    request : Request
    integrate : callable
        As `ifrfit.inference.posterior.adaptive_quadrature`.
    must : bool
        Whether the coarsest tolerance is worked out however long it takes.

    Returns
    -------
    Posterior or None
        The one with the least error; None where the budget ended before any error was small.

    Raises
    ------
    UsageError, DataError
        As `integrate`; a grid too large for memory only where the coarsest tolerance needs it.
    """
    best: QuadraturePosterior | None = None
    latest: QuadraturePosterior | None = None
    last = before = 0.0
    for tolerance in ladder(request.accuracy, request.budget is not None):
        if latest is not None and (_enough(latest, request) or foreseen(latest, last, before) > request.left):
            break
        first = must and best is None
        if request.over and not first:
            break
        begin = request.clock()
        try:
            latest = integrate(problem, tolerance, start, over=None if first else lambda: request.over)
        except TimeoutError:
            break
        except GridTooLargeError:  # a first grid grows as its tolerance falls
            if best is None:
                raise
            break
        last, before = request.clock() - begin, last
        is_better = best is None or latest.error <= best.error
        if not is_better and not latest.converged:
            break
        best = latest if is_better else best
    if best is None or (request.budget is not None and not must and best.error > LADDER[0]):
        return None
    if request.accuracy is not None and _enough(best, request):
        return replace(best, tolerance=max(best.tolerance, request.accuracy))
    return best


def ladder(accuracy: float | None, from_the_top: bool) -> tuple[float, ...]:
    """Tolerances from coarse to fine: to the asked accuracy, and further where it is not reached there."""
    if accuracy is None:
        return LADDER
    coarser = tuple(tolerance for tolerance in LADDER if tolerance > _NEAR * accuracy)
    finer = tuple(tolerance for tolerance in LADDER if tolerance < accuracy / _NEAR)
    return (*(coarser if from_the_top else ()), accuracy, *finer)


def foreseen(found: QuadraturePosterior, last: float, before: float) -> float:
    """Seconds that the next tolerance will take.

    Parameters
    ----------
    found : QuadraturePosterior
        The last one.
    last, before : float
        Seconds that it took, and the one before; 0 where there was none.
    """
    if not found.converged:  # it was given up, which takes longest
        return last
    return last * max(_GROWTH, last / before if before > 0.0 else 0.0)


def _enough(found: QuadraturePosterior, request: Request) -> bool:
    return request.accuracy is not None and max(found.error, found.error_evidence) <= request.accuracy
