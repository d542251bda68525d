"""Closures that describe a table as well as a slip of the hand does: no table is to be mended for these."""

from __future__ import annotations

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.diagnostics.slips.compared_fit import ComparedFit, Slip
from ifrfit.inference.diagnostics.thresholds import ALIKE
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.physics.closures import CLOSURES


def rival_closures(problem: Problem, fit: LeastSquaresFit, slip: Slip) -> list[str]:
    """Titles of other closures of no more constants that take as much off -2 log likelihood, the best first.

    Of those that are bilinear: the others have an effect of their own.
    """
    if problem.parameters.is_tied or not problem.closure.bilinear or not problem.error_model.is_plain:
        return []
    judged = ComparedFit.by_series(problem, fit) if slip.series else ComparedFit.of(problem, fit)
    free, found = int(problem.parameters.free.sum()), []
    for closure in CLOSURES.values():
        if closure.name == problem.closure.name or not closure.bilinear:
            continue
        try:
            other = problem.with_closure(closure)
            if int(other.parameters.free.sum()) > free:
                continue
            rival = ComparedFit(other, least_squares(other, proven=False), judged.misfit)
        except (UsageError, DataError):  # a choice of constants that it does not know
            continue
        found.append((judged.likelihood - rival.likelihood, closure.title))
    return [title for fall, title in sorted(found, reverse=True) if fall >= slip.rank - ALIKE]
