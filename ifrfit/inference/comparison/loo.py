"""Leave-one-impact-out cross-validation from independent draws of the exact posterior."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.data.observations import word_of
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.comparison.result import Loo
from ifrfit.inference.diagnostics.thresholds import SAMPLING_ERROR
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, followed
from ifrfit.inference.posterior import TOLERANCE, ExactPosterior, log_evidence
from ifrfit.inference.posterior.importance_posterior import ImportancePosterior
from ifrfit.inference.posterior.importance_sampling import EvidenceByDraws, with_kept_rows
from ifrfit.inference.posterior.integrators import evidence_by_draws, evidence_is_sampled
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.restore import posterior_of

DRAWS = 4000
THRESHOLD = 0.7
MOST_REFITS = 20  # a closure; more say that the closure is wrong, not that the weights are

_SEVERAL = 5  # impacts left out from which on their optima take longer than points for all of them
_FEWEST = 1000  # draws below which the tail says too little
_LARGEST = 40_000_000  # log likelihoods held at once
_AT_ONCE = 200_000  # of which the density makes several arrays
_SAME = 1e-12  # relative spread of a tail that has one value


def loo_of(fit: FitResult, seed: np.random.SeedSequence, *, in_earnest: bool = True) -> Loo | None:
    """Cross-validate one closure; None for so many rows that draws and rows would not fit.

    The density that the other impacts predict for one is an average over the posterior with weights
    1/likelihood of that impact, whose tail is smoothed (PSIS). Draws are independent, so the relative
    effective sample size is 1. Where the Pareto k is over 0.7 the weights are not to be trusted: that impact
    is left out in earnest, and its log density is log evidence with it less log evidence without it; none is
    where more than `MOST_REFITS` would have to be, nor where it is not asked for.

    References
    ----------
    Vehtari, Gelman & Gabry (2017), Statistics and Computing 27, 1413; Vehtari, Simpson, Gelman, Yao & Gabry
    (2024), Journal of Machine Learning Research 25(72).
    """
    problem, optimum = fit.problem_and_optimum()
    posterior = posterior_of(fit)
    n_draws = min(DRAWS, _LARGEST // problem.rows.value.size)
    if n_draws < _FEWEST:
        return None
    density = Density(problem)
    draws = posterior.draws(n_draws, np.random.default_rng(seed))
    each = density.impacts_in_parts(density.points(draws, n_draws), _AT_ONCE)
    elpd, k = _smoothed(each)
    threshold = min(THRESHOLD, 1.0 - 1.0 / math.log10(n_draws))
    names = _impact_names(density)
    high = np.flatnonzero(~((k <= threshold) & np.isfinite(elpd)))
    refitted = []
    # where more are high the sum stays doubtful whatever becomes of some of them
    refits = high if in_earnest and high.size <= MOST_REFITS else high[:0]
    fewer = _points_of(problem, posterior, optimum, refits.size)
    for i in refits:
        exact = left_out(
            problem, posterior.log_evidence, density.impact != i, posterior.tolerance, optimum, fewer
        )
        if exact is not None:
            elpd[i] = exact
            refitted.append(names[i])
    for array in (elpd, k):
        array.flags.writeable = False
    return Loo(
        elpd=float(elpd.sum()),
        se=_standard_error(elpd),
        p_loo=float((_log_mean_exp(each) - elpd).sum()),
        difference=0.0,
        se_difference=0.0,
        pointwise=elpd,
        pareto_k=k,
        impacts=names,
        refitted=tuple(refitted),
        doubtful=tuple(names[i] for i in high if names[i] not in refitted),
        n_draws=n_draws,
        threshold=threshold,
    )


def _points_of(
    problem: Problem, posterior: ExactPosterior, optimum: LeastSquaresFit, refits: int
) -> EvidenceByDraws | None:
    """Points that serve each of several impacts that are left out; None where grids are quicker.

    A grid is more exact, but where noises are unknown it begins at an optimum that takes longer than itself.
    """
    is_sampled = isinstance(posterior, ImportancePosterior)
    is_slow = not problem.noise.is_known and refits >= _SEVERAL
    if refits > 1 and (is_sampled or is_slow or evidence_is_sampled(problem, posterior.tolerance, optimum)):
        return evidence_by_draws(problem, optimum)
    return None


def left_out(
    problem: Problem,
    whole: float,
    keep: NDArray[np.bool_],
    tolerance: float = TOLERANCE,
    optimum: LeastSquaresFit | None = None,
    fewer: EvidenceByDraws | None = None,
) -> float | None:
    """Log density of the rows that are not kept, as the kept ones predict it; None where these are too few.

    The noise keeps the prior that it has with all rows.

    Parameters
    ----------
    problem : Problem
    whole : float
        Log evidence of all rows.
    keep : ndarray of bool, (n,)
    tolerance : float
        Of the log evidence without them.
    optimum : LeastSquaresFit, optional
        Of all rows: the fit of the kept ones follows its modes, without a proof of its own.
    fewer : EvidenceByDraws, optional
        Points of all rows, which serve where they carry the weight of the kept ones.
    """
    kept = np.flatnonzero(keep)
    try:
        if fewer is not None:
            found, error = fewer.log_density_of_others(kept)
            if error <= SAMPLING_ERROR:
                return found
        rest = with_kept_rows(problem, kept)
        start = None if optimum is None else followed(rest, replace(optimum, sigma=optimum.sigma[keep]))
        return whole - log_evidence(rest, tolerance, start)
    except (DataError, UsageError):
        return None


def with_differences(found: Mapping[str, Loo]) -> dict[str, Loo]:
    """Put the differences from the best in, each with its standard error over the same impacts."""
    if not found:
        return {}
    best = max(found.values(), key=lambda one: one.elpd)
    return {
        name: replace(
            one,
            difference=one.elpd - best.elpd,
            se_difference=_standard_error(one.pointwise - best.pointwise),
        )
        for name, one in found.items()
    }


def _standard_error(each: Array) -> float:
    """Of a sum over impacts."""
    return math.sqrt(each.size * float(each.var(ddof=1))) if each.size > 1 else math.nan


def _smoothed(each: Array) -> tuple[Array, Array]:
    """Log density and Pareto k of each impact.

    Weights whose whole tail has one value are bounded: nothing is smoothed, and k is -inf.
    """
    from arviz_stats.base.array import array_stats

    smooth: Any = array_stats.loo
    n = each.shape[0]
    tail = np.partition(each, n_tail := math.ceil(3.0 * math.sqrt(n)), axis=0)[:n_tail]
    bounded = np.ptp(tail, axis=0) <= _SAME * (1.0 + np.abs(tail).max(axis=0))
    elpd = -_log_mean_exp(-each)
    k = np.full(each.shape[1], -np.inf)
    with np.errstate(all="ignore"):  # tails of few distinct values: k is nan, which counts as too large
        for i in np.flatnonzero(~bounded):
            log_density, shape, _ = smooth(each[:, i], chain_axis=None, draw_axis=-1)
            elpd[i], k[i] = float(log_density), float(shape)
    return elpd, k


def _log_mean_exp(x: Array) -> Array:
    return np.asarray(special.logsumexp(x, axis=0) - math.log(x.shape[0]))


def _impact_names(density: Density) -> tuple[str, ...]:
    """What each impact is called: its id, else the line of its row."""
    table = density.problem.observations.table
    _, first = np.unique(density.impact, return_index=True)
    rows = table.iloc[first]
    several, word = table["source"].nunique() > 1, word_of(density.problem.observations.sources)
    return tuple(
        (f"{source}: " if several else "") + (f"impact {own}" if own else f"{word} {row}")
        for source, own, row in zip(rows["source"], rows["impact_id"], rows["row"], strict=True)
    )
