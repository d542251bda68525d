"""Offsets of the angles of each series, which feign constants that differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ifrfit.inference.diagnostics.slips.compared_fit import ComparedFit
from ifrfit.inference.diagnostics.slips.flawed_readings import Flaw, readings
from ifrfit.inference.diagnostics.slips.nuisances import nuisances
from ifrfit.inference.diagnostics.slips.refit import search
from ifrfit.inference.diagnostics.slips.slip import LARGEST
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

MOST_SERIES = 12  # beyond, none is looked for in single series
_PLACES = np.linspace(-4.0, 4.0, 17)  # degrees, from which offsets of series are looked for


@dataclass(frozen=True)
class Offsets:
    """Offsets of the angles of each series, beside constants that all share.

    Attributes
    ----------
    drop : float
        Fall of -2 log likelihood with them.
    size : ndarray, (n_series,)
        Degrees by which the true angles exceed the given ones.
    """

    drop: float
    size: Array


def offsets_by_series(problem: Problem, fit: LeastSquaresFit) -> Offsets | None:
    """Fit an offset of the angles of each series; None without angles, or where one is no slip."""
    count = len(problem.series)
    named = [each for each in nuisances(problem) if each.name == "angle-offset"]
    plain = problem.error_model.is_plain and fit.angle_offset is None
    if not named or not plain or not 1 < count <= MOST_SERIES:
        return None
    whole, offset = ComparedFit.of(problem, fit), named[0]
    lower, upper = problem.parameters.bounds()
    ends = (np.full(count, end) for end in offset.limits)
    bounds = tuple(np.append(*both) for both in zip((lower, upper), ends, strict=True))

    def values(x: Array, _: Index) -> Array:
        by_row = x[0, :, lower.size :][:, problem.rows.series]
        return readings(problem, x[0, :, : lower.size], Flaw(offset=by_row))[None]

    x, after = search(
        values,
        whole.misfit,
        problem.rows.value,
        np.append(fit.optimum.theta, _nearest_offsets(problem, fit))[None],
        (bounds[0], bounds[1]),
    )
    drop = whole.likelihood - float(whole.misfit.likelihood(after[0]))
    size = x[0, lower.size :]
    return Offsets(drop, size) if np.abs(size).max() <= LARGEST * offset.usual else None


def _nearest_offsets(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Of a few offsets of the angles the best of each series, at the constants of a fit."""
    theta = np.tile(fit.optimum.theta, (_PLACES.size, 1))
    residual = problem.rows.value - readings(problem, theta, Flaw(offset=_PLACES[:, None]))
    square = np.nan_to_num((residual / fit.sigma) ** 2, nan=1e6)
    owners = problem.rows.series == np.arange(len(problem.series))[:, None]
    return np.asarray(_PLACES[np.argmin(square @ owners.T, axis=0)])
