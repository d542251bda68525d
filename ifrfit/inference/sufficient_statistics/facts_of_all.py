"""What is said of all impacts: statistics, lack of fit of the means, and facts of a sample beside them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ifrfit.data.observations import Source
from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.friction_beyond_prior import friction_beyond_prior
from ifrfit.inference.diagnostics.nested_models import pooling, unequal_noise
from ifrfit.inference.diagnostics.optimum_facts import (
    at_bound,
    few_degrees_of_freedom,
    global_optimum,
    identifiable,
    several_modes,
    tiny_friction,
)
from ifrfit.inference.diagnostics.predictive_checks import predictive
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.noise import Policy
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, refit
from ifrfit.inference.result.assumptions import assumed_of, with_size_of_spin
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, Fact, FitStatistics
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.inference.sufficient_statistics.copied_impacts import CopiedImpacts
from ifrfit.inference.sufficient_statistics.moments import S_1, S_Z, S_ZZ, N
from ifrfit.inference.sufficient_statistics.scatter_of_all import scatter_of_all, scatter_of_each
from ifrfit.text import joined

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_LAST_DIGITS = 4.0  # units of its last digit that a sum of squares is known to
_OF_ITS_SD = 0.1  # of the sd of a sum of squares, which it may be wrong by
_OF_CUT = "may follow from the readings that were left out: mend that first"
_CHECKED = 300  # draws behind the posterior predictive checks


@dataclass(frozen=True)
class Correction:
    """What is added to the log likelihood and to the log evidence of condensed rows to be those of all."""

    of_likelihood: float
    of_evidence: float


def likelihood_correction(problem: Problem, optimum: LeastSquaresFit, of: Accumulated) -> Correction:
    """Condensed rows have other norms than the measurements they stand for; their squares are the same."""
    half_log_2pi = 0.5 * math.log(2.0 * math.pi)
    noise = problem.noise
    n = noise.count(np.arange(len(problem.rows)))
    ours = float(np.log(noise.base).sum())
    if noise.is_known:
        theirs = sum(known.log_sigma.high for known in of.groups)
        both = ours - theirs - (n - len(problem.rows)) * half_log_2pi
        return Correction(both, both)
    likelihood = float(np.log(noise.base).sum()) - (n - len(problem.rows)) * half_log_2pi
    for rows in problem.noise_groups().values():
        square = float(((problem.residual(optimum.optimum.theta) / noise.base)[rows] ** 2).sum())
        log_noise = 0.5 * math.log(square / noise.count(rows))
        likelihood -= (noise.count(rows) - rows.size) * log_noise
    return Correction(likelihood, ours)


def statistics_of_all(
    problem: Problem, optimum: LeastSquaresFit, result: FitResult, of: Accumulated, correction: Correction
) -> FitStatistics:
    """The statistics of all measurements."""
    counts = problem.noise.counts
    assert counts is not None
    theta = optimum.optimum.theta
    n = round(float(counts.sum()))
    dof = n - round(float(optimum.gaussian.leverage.sum()))
    _, sticks = problem.impulse(*problem.per_row(theta))
    oblique = problem.rows.is_oblique
    log_l = result.fit.log_likelihood + correction.of_likelihood
    k = optimum.gaussian.rank + len(problem.noise_groups())
    chi2 = result.fit.chi2
    known = problem.noise.is_known
    # sums are weighted: they tell the unweighted one where sigma is the same throughout a group
    is_even = not of.weighted or all(known.smallest_sigma >= known.largest_sigma for known in of.groups)
    residual = problem.residual(theta) / (problem.noise.scale if problem.noise.scale is not None else 1.0)
    return replace(
        result.fit,
        n=n,
        n_sticking=round(float(counts[oblique & sticks].sum())),
        n_sliding=round(float(counts[oblique & ~sticks].sum())),
        dof=dof,
        reduced_chi2=chi2 / dof if known and dof > 0 else None,
        p_value=float(chdtrc(dof, chi2)) if known and dof > 0 else None,
        rmse=float(np.sqrt((residual**2).sum() / n)) if is_even else math.nan,
        log_likelihood=log_l,
        aic=2.0 * k - 2.0 * log_l,
        bic=k * math.log(n) - 2.0 * log_l,
    )


def refuse_lost_digits(of: Accumulated, problem: Problem, theta: Array) -> None:
    """Refuse values so much more precise than large that the digits of their sums do not hold their scatter.

    The scatter of an interval is a difference of sums, each known to some units of its last digit. What that
    leaves open adds up, of either sign, and of one sign where no scatter is left. It may be a tenth of what
    the scatter of so many impacts is uncertain by.

    Raises
    ------
    DataError
        With what there is, and the remedy.
    """
    squares = (problem.residual(theta) / problem.noise.base) ** 2
    names = problem.observations.table["observable"].to_numpy(dtype=object)
    for number, name in enumerate(of.stream.observables):
        own = of.sums[number :: len(of.stream.observables)]
        own = own[(own[..., N] > 0.0) & (own[..., S_1] > 0.0)]
        count = float(own[:, N].sum())
        lost = _LAST_DIGITS * np.finfo(float).eps * own[:, S_ZZ]
        is_scatter = own[:, S_ZZ] - own[:, S_Z] ** 2 / own[:, S_1] > lost
        unknown = float(lost[~is_scatter].sum()) + math.sqrt(float((lost[is_scatter] ** 2).sum()))
        square = float(squares[names == name].sum())
        told = max(square, count) if problem.noise.is_known else square
        if unknown > _OF_ITS_SD * math.sqrt(2.0 / max(count, 1.0)) * told:
            raise DataError(
                f"{of.stream.path}: {name} scatters so little against its size that sums of squares in "
                "double precision do not tell by how much. Fit a part of the data that is held in memory."
            )


def _fit_of_rows(statistics: FitStatistics, sample: FitResult | DataError, of_means: Fact) -> Fact | None:
    """What rows say of the fit beside the means; None for nothing more than these.

    Impacts that are all in the sample say it themselves: means of few tell little, and copies of a row, which
    do not scatter, make any departure large. Under a closure without hope no row is looked at: chi2 is.
    """
    if isinstance(sample, DataError):
        p = statistics.p_value
        if not of_means.ok or p is None or p >= REFUTED:
            return None
        says = f"the data contradict one set of constants (p = {p:.2g}, chi2)"
        return Fact(False, says, {"p": p, "test": "chi2"}, FACTS["lack_of_fit"])
    own = sample.facts.get("lack_of_fit")
    return own if sample.fit.n == statistics.n else None


def _shared_constants(
    problem: Problem, optimum: LeastSquaresFit, statistics: FitStatistics, of_means: Fact
) -> Fact | None:
    """Whether the series share their constants; None where there is nothing to ask.

    Where values scatter by more than their sigma and nothing else is amiss, the noise of the scatter judges,
    as in memory (`ifrfit.inference.diagnostics.scatter_too_large`): by a sigma that is k times too small what
    is gained looks k^2 times as large.
    """
    shared = pooling(problem, optimum)
    p = statistics.p_value
    if shared is None or p is None or p >= REFUTED or not of_means.ok:
        return None if shared is None else shared.fact
    wide = {name: found for name, found in scatter_of_each(problem, optimum).items() if found.is_wide}
    times = np.ones(len(problem.rows))
    for name, found in wide.items():
        times[problem.rows.rows_of(name)] = found.factor
    if not wide:
        return shared.fact
    policy: Policy = "scaled" if len(wide) == len(problem.rows.names) else "unknown"
    scattered = problem.with_noise(replace(problem.noise, policy=policy, prior_bounds={}))
    again = pooling(scattered, refit(scattered, optimum.sigma * times))
    return again.fact if again is not None and again.fact.ok else shared.fact


def facts_of_all(
    problem: Problem,
    optimum: LeastSquaresFit,
    result: FitResult,
    statistics: FitStatistics,
    estimation: Estimation,
    sample: FitResult | DataError,
    of_means: Fact,
    copied: CopiedImpacts | None,
    cut: Fact | None,
    seed: int,
) -> dict[str, Fact]:
    """Of the optimum and of the method those of all impacts, the others those of the sample.

    `result` is that of condensed rows, `statistics` are those of all impacts, as are `of_means` (whether
    these follow the closure), `copied`, and `cut` (readings that were left out for their size).
    """
    shared = _shared_constants(problem, optimum, statistics, of_means)
    if not isinstance(sample, DataError) and _has_slipped(sample):
        shared = None  # single rows tell whether the slip explains as much as series that differ
    asked = {
        "pooling": shared,
        "unequal_noise": unequal_noise(problem, optimum),
        "noise_modes": several_modes(problem, optimum),
        "noise_dof": few_degrees_of_freedom(problem, optimum),
        "tiny_friction": tiny_friction(problem, result.constants),
        "friction_beyond_prior": friction_beyond_prior(problem, optimum) if estimation.is_posterior else None,
    }
    own = {name: fact for name, fact in asked.items() if fact is not None} | dict(estimation.diagnostics)
    own["global_optimum"] = global_optimum(optimum, bilinear=True)
    own["identifiable"] = identifiable(
        problem, optimum, result.constants, result.fit.n_sticking, result.fit.n_sliding
    )
    own["at_bound"] = at_bound(result.constants)
    own["lack_of_fit"] = _fit_of_rows(statistics, sample, of_means) or of_means
    first = {} if cut is None else {"truncation": cut}
    if isinstance(sample, DataError):
        return {**first, **own}
    scatter = sample.facts.get("lack_of_fit")
    if scatter is not None and not scatter.ok and own["lack_of_fit"].ok:
        del own["lack_of_fit"]  # means of many values do not tell how far single ones scatter
    of_rows = dict(sample.facts)
    if copied is not None and sample.fit.n < statistics.n:
        first |= {"duplicates": copied.fact}
        of_rows.pop("duplicates", None)
    checked = _predictive(sample, estimation, seed)
    if checked is not None:
        of_rows["predictive"] = checked
    is_whole = all(fact.ok for name, fact in of_rows.items() if name != "predictive") and copied is None
    if statistics.p_value is not None and sample.fit.n < statistics.n and of_means.ok and is_whole:
        first |= scatter_of_all(problem, optimum)
    looked = {
        name: replace(fact, says=f"in a sample of {len(sample.points):,} values: {fact.says}")
        for name, fact in of_rows.items()
        if name not in own and name not in first
    }
    failing = {k: f for k, f in looked.items() if not f.ok}
    if cut is not None:
        failing = {k: replace(f, says=f"{f.says}; {_OF_CUT}") for k, f in failing.items()}
    return {
        **first,  # whatever else misfits may follow from it
        **failing,
        **own,
        **{k: f for k, f in looked.items() if f.ok},
    }


def _predictive(sample: FitResult, estimation: Estimation, seed: int) -> Fact | None:
    """Whether the posterior of all impacts predicts the rows of a sample; None where it cannot tell."""
    if not estimation.is_posterior or estimation.distribution is None:
        return None
    problem, _ = sample.problem_and_optimum()
    drawn = estimation.distribution.draws(_CHECKED, np.random.default_rng(seed))
    if any(name not in drawn for name in Density(problem).names):
        return None  # a series is not in the sample
    return predictive(problem, drawn)


def _has_slipped(sample: FitResult) -> bool:
    return "slips" in sample.facts and not sample.facts["slips"].ok


def assumed_by(sample: FitResult, result: FitResult, assumed: tuple[str, ...]) -> tuple[str, ...]:
    """What is taken for granted, by rows as they were measured; sizes over the sd of the result of all.

    Sizes of what `assumed` says from the first are added to it.

    An error that all rows share moves the constants of a sample as far as those of all: the condensed rows
    have angles of their own, which say nothing of it.
    """
    problem, fit = sample.problem_and_optimum()
    kappa = result.derived.get("kappa")
    kappas = kappa if isinstance(kappa, Mapping) else dict.fromkeys(problem.series, kappa)
    known = {name: found for name, found in kappas.items() if isinstance(found, Estimate)}
    sized = with_size_of_spin(assumed, problem, fit, result.constants, known)
    return *sized, *assumed_of(problem, fit, result.constants, known, result.noise)


def warnings_of(of: Accumulated, source: Source) -> list[str]:
    """What was left out, with the first places."""
    said = list(of.stream.notes)
    for reason, places in of.tally.places.items():
        count = source.rows_skipped.get(reason, 0)
        first = " (the first of them)" if count > len(places) else ""
        said.append(f"{count:,} value{'s' if count > 1 else ''} left out, {reason}: {joined(places)}{first}")
    return said
