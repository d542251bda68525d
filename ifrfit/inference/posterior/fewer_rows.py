"""Evidences of a problem less some of its rows, by points that were drawn once for the whole of it.

A law that is near to the posterior of all impacts, with wide components beside, is near enough to that of all
but one: its points get other weights. Section 9 of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior.factorised_sampling import EvidenceBySeries
from ifrfit.inference.posterior.importance_sampling import EvidenceByImportance
from ifrfit.inference.posterior.series_factors import factorises


class FewerRows:
    """Evidences of parts of a problem's rows, each beside that of all of them.

    Parameters
    ----------
    problem : Problem
        With a free constant at least.
    optimum : LeastSquaresFit
        Of all rows.
    """

    def __init__(self, problem: Problem, optimum: LeastSquaresFit) -> None:
        self._problem, self._optimum = problem, optimum

    def log_density_of_others(self, kept: Index) -> tuple[float, float]:
        """Log density of the rows of an impact, as all others predict it, and its standard error.

        The noise keeps the prior that it has with all rows. The error is the larger one of both evidences:
        infinite where few points carry the weight of all rows or of the kept ones, or coordinates differ.

        Parameters
        ----------
        kept : ndarray of int
            Rows of the other impacts.
        """
        rest = with_kept_rows(self._problem, kept)
        if not factorises(self._problem):
            whole, found = self._together.evidence(), self._together.evidence_of(rest)
        else:
            lost = np.unique(np.delete(self._problem.rows.series, kept))
            if lost.size > 1:
                return math.nan, math.inf
            whole, found = self._by_series.evidence(), self._by_series.evidence_of(rest, int(lost[0]))
        return whole[0] - found[0], max(whole[1], found[1])

    @cached_property
    def _together(self) -> EvidenceByImportance:
        return EvidenceByImportance(self._problem, self._optimum)

    @cached_property
    def _by_series(self) -> EvidenceBySeries:
        return EvidenceBySeries(self._problem, self._optimum)


def with_kept_rows(problem: Problem, kept: Index) -> Problem:
    """Some of a problem's rows; each noise keeps the prior that it has with all of them."""
    rest = problem.with_rows(kept)
    groups = rest.noise_groups()
    bounds = {name: ends for name, ends in problem.noise_bounds().items() if name in groups}
    return rest.with_noise(rest.noise.with_bounds(bounds))
