"""From a problem, its optimum and an estimation to the result of a fit."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ifrfit._version import __version__
from ifrfit.data.common_errors import loadings_of
from ifrfit.inference.diagnostics.angle_scatter import angle_scatter
from ifrfit.inference.diagnostics.causes import causes_of
from ifrfit.inference.diagnostics.friction_beyond_prior import friction_beyond_prior
from ifrfit.inference.diagnostics.omitted_effects.dimensionless_criteria import effect_lines
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting
from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine
from ifrfit.inference.diagnostics.optimum_facts import (
    angle_offset,
    at_bound,
    few_degrees_of_freedom,
    global_optimum,
    identifiable,
    several_modes,
    tiny_friction,
)
from ifrfit.inference.diagnostics.precedence import in_order, misfit_facts, subordinate
from ifrfit.inference.diagnostics.predictive_checks import predictive
from ifrfit.inference.diagnostics.residuals import Residuals, residuals_of
from ifrfit.inference.diagnostics.scatter_too_large import scatter_too_large
from ifrfit.inference.diagnostics.uncounted_uncertainties import uncounted_uncertainties
from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.distributions.truncated_gaussian import TruncatedGaussian
from ifrfit.inference.model.apply_error_model import reported_policy
from ifrfit.inference.model.common_errors import whitening
from ifrfit.inference.model.entry_names import entry_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, at_fitted_offset, fitted_constants
from ifrfit.inference.optimize.noise_modes import likely_sigma
from ifrfit.inference.profile.least_squares_estimates import estimates_of_optimum
from ifrfit.inference.profile.profile_all import estimates_of_profiles
from ifrfit.inference.result.assumptions import assumed_of, with_size_of_spin
from ifrfit.inference.result.constants_table import ConstantsTable
from ifrfit.inference.result.deferred import Deferred, Postponed
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.state import state_of
from ifrfit.inference.result.types import (
    Angles,
    CommonErrorSummary,
    Constants,
    Correlation,
    Derived,
    Estimate,
    Fact,
    FitStatistics,
    NoiseSummary,
    State,
    by_entry,
)
from ifrfit.inference.summary.derived import derived_of, transitions_of
from ifrfit.inference.summary.estimates import angle_offset_of, correlation_of, estimates_of, noise_of
from ifrfit.inference.summary.gaussian import truncated_gaussian
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd


DRAWS = 2000  # kept in the result, for predictions
# what other angles would not mend
_MISFIT = ("unrelated_readings", "beyond_closure", "lack_of_fit", "normal_restitution")
_CHECKED = 300  # draws behind the posterior predictive checks


@dataclass(frozen=True)
class OptimumSummary:
    """Everything that is said of an optimum, whatever method goes on from it.

    Attributes
    ----------
    problem : Problem
        At the fitted offset of the angles, where there is one.
    optimum : LeastSquaresFit
    conditions : Setting or None
        The scene of the data, for the effects' criteria.
    gaussian : TruncatedGaussian
        Gaussian approximation about the optimum.
    residuals : Residuals
    statistics : FitStatistics
    sticks : ndarray of bool, (n,)
        Which rows stick at the optimum.
    beside_marginals : bool
        As `estimates_of_optimum`.
    """

    problem: Problem
    optimum: LeastSquaresFit
    conditions: Setting | None
    gaussian: TruncatedGaussian
    residuals: Residuals
    statistics: FitStatistics
    sticks: NDArray[np.bool_]
    beside_marginals: bool = False

    @cached_property
    def _estimates(self) -> tuple[Constants, Mapping[str, Estimate]]:
        return estimates_of_optimum(
            self.problem, self.optimum, self.gaussian, beside_marginals=self.beside_marginals
        )

    @property
    def constants(self) -> Constants:
        """Estimates of least squares, by constant; a posterior has its own and may never ask."""
        return self._estimates[0]

    @property
    def kappas(self) -> Mapping[str, Estimate]:
        """Kappa of least squares, by series."""
        return self._estimates[1]

    def effects(self) -> tuple[EffectLine, ...]:
        """Criteria on the scene of the data; none without one."""
        if self.conditions is None:
            return ()
        transitions = transitions_of(self.problem, self.gaussian, self.constants, self.kappas)
        derived = derived_of(self.problem, self.constants, self.kappas, transitions)
        return effect_lines(self.problem, self.optimum, self.conditions, derived)


def summarize_optimum(
    problem: Problem, optimum: LeastSquaresFit, conditions: Setting | None = None
) -> OptimumSummary:
    """What is said of an optimum: as `OptimumSummary` has it.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquaresFit
    conditions : Setting, optional
        The scene of the data, for the effects' criteria.
    """
    problem = at_fitted_offset(problem, optimum)
    e_n, c, mu = problem.per_row(optimum.optimum.theta)
    _, sticks = problem.impulse(e_n, c, mu)
    residuals = residuals_of(problem, optimum)
    statistics = statistics_of(problem, optimum, residuals, sticks)
    gaussian = truncated_gaussian(problem, optimum)
    return OptimumSummary(problem, optimum, conditions, gaussian, residuals, statistics, sticks)


def _points(problem: Problem, optimum: LeastSquaresFit, about: OptimumSummary) -> pd.DataFrame:
    """The rows used, with fitted values and residuals; the fitted ones are off by the errors in common."""
    import pandas as pd

    table, residuals = problem.observations.table, about.residuals
    there = at_fitted_offset(problem, optimum)
    columns = {
        "sigma_used": optimum.sigma,
        "fitted": problem.rows.value - residuals.raw,
        "residual": residuals.raw,
        "standardised": residuals.studentised,
        "tau": there.rows.tau,
        "sticking": about.sticks,
    }
    return pd.concat([table, pd.DataFrame(columns, index=table.index, copy=False)], axis=1)


def build_result(
    problem: Problem,
    optimum: LeastSquaresFit,
    estimation: Estimation,
    *,
    seed: int = 0,
    command: str = "",
    conditions: Setting | None = None,
    assumed: tuple[str, ...] = (),
    brief: bool = False,
    compared: bool = False,
    summary: OptimumSummary | None = None,
) -> FitResult:
    """The result of a fit.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquaresFit
        Of the problem; where it has an unknown offset of the set angles, all that is said of the rows is said
        at the offset of this optimum.
    estimation : Estimation
        What the method found beyond the optimum.
    seed : int
        Of the draws and bands.
    command : str
        The command line, for the record.
    conditions : Setting, optional
        The scene of the data, for the effects' criteria.
    assumed : tuple of str
        What was taken of ball and impacts although nobody said so, in words.
    brief : bool
        Leave out what takes further fits and serves readers of this one alone: outliers, remedies, effects.
    compared : bool
        Brief, and the facts do not say what the data determine of each constant: profiles tell that, and
        comparisons of closures do not. Constants are worked out when they are first read.
    summary : OptimumSummary, optional
        As `summarize_optimum` gives it, where it was made before.

    Returns
    -------
    FitResult
    """
    asked = problem
    problem = at_fitted_offset(asked, optimum)
    about = summary or summarize_optimum(asked, optimum, conditions)
    own = estimation.distribution
    about = replace(about, beside_marginals=own is not None)
    found = Postponed(partial(_estimates, problem, about, estimation))
    brief = brief or compared or problem.parameters.is_tied  # other fits of the rows do not know the ties
    names = problem.parameters.moving_names
    distribution: Distribution = about.gaussian if own is None else own
    noise = NoiseSummary(
        reported_policy(problem),
        optimum.noise,
        error_model=asked.error_model,
        separate=problem.noise.has_unknown and problem.noise.separate,
        angle_offset=angle_offset_of(optimum.angle_offset, distribution) if optimum.angle_offset else None,
        given=_given(problem),
        common_errors=_common_errors(asked, optimum),
    )
    if own is not None:
        bounds = problem.noise_bounds() if estimation.is_posterior else {}
        noise = noise_of(problem, own, noise, bounds)
    drawn = Postponed(partial(_drawn, own, seed))
    said = (*_warnings(problem), *_of_common_errors(noise), *estimation.warnings)
    if not estimation.is_posterior:
        said += _beyond_ends(problem, found.value.constants)

    def state() -> State:
        kept = drawn.value if estimation.predicts else None
        return state_of(problem, about.gaussian, distribution, kept)

    def taken() -> tuple[str, ...]:
        constants, kappas = found.value.constants, found.value.kappas
        unsaid = assumed if problem.has_oblique else ()
        unsaid = with_size_of_spin(unsaid, problem, optimum, constants, kappas)
        return *unsaid, *assumed_of(problem, optimum, constants, kappas, noise)

    constants = Postponed(lambda: ConstantsTable(found.value.constants))
    derived = Postponed(lambda: derived_of(problem, *found.value))

    return FitResult(
        closure=problem.closure.name,
        inertia_factor=float(problem.inertia_factor),
        method=estimation.method,
        inputs=problem.observations.sources,
        noise=noise,
        constants=cast("ConstantsTable", constants) if compared else constants.value,
        derived=cast("Derived", derived) if compared else derived.value,
        correlation=Correlation(names, correlation_of(distribution, names)),
        fit=replace(about.statistics, log_evidence=estimation.log_evidence),
        facts=Deferred(
            partial(
                _facts,
                asked,
                optimum,
                about,
                estimation,
                None if compared else found.value.constants,
                drawn,
                conditions,
                brief=brief,
            )
        ),
        warnings=said,
        state=cast("State", Postponed(state)),
        points=cast("pd.DataFrame", Postponed(partial(_points, asked, optimum, about))),
        seed=seed,
        command=command,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=_versions() | dict(estimation.versions),
        asked=problem.parameters.asked,
        assumed=cast("tuple[str, ...]", Postponed(taken)),
        effort=estimation.effort,
        scene=None if conditions is None else conditions.scene,
        effects=about.effects(),
        problem=asked,
        least_squares=optimum,
        distribution=distribution,
        profiles=estimation.profiles,
        files=estimation.files,
    )


def _with_ties(problem: Problem, constants: Constants) -> Constants:
    """The constants, those that are tied with their expression as the reason of their status."""
    if not problem.parameters.is_tied:
        return constants
    reasons = {name: f"tied: {text}" for name, text in problem.parameters.ties.expressions.items()}

    def with_reason(name: str, found: Estimate) -> Estimate:
        return replace(found, reason=reasons[name]) if name in reasons else found

    return {
        name: with_reason(name, found)
        if isinstance(found, Estimate)
        else {series: with_reason(entry_name(name, series), own) for series, own in found.items()}
        for name, found in constants.items()
    }


def _drawn(distribution: Distribution | None, seed: int) -> Mapping[str, Any] | None:
    """Draws that a result keeps of what a method found; None where it found no distribution."""
    if distribution is None:
        return None
    return distribution.draws(int(min(DRAWS, distribution.n_draws)), np.random.default_rng(seed))


class _Estimates(NamedTuple):
    """Constants, kappa of each series, and transition angles."""

    constants: Constants
    kappas: Mapping[str, Estimate]
    transitions: Mapping[str, Angles]


def _estimates(problem: Problem, about: OptimumSummary, estimation: Estimation) -> _Estimates:
    """Estimates from profiles, from the distribution, or from the Gaussian."""
    if estimation.profiles:
        found = estimates_of_profiles(problem, estimation.profiles, about.gaussian, about.kappas)
        return _Estimates(_with_ties(problem, found[0]), *found[1:])
    constants, kappas = about.constants, about.kappas
    if estimation.distribution is not None or estimation.unresolved:
        constants, kappas = estimates_of(
            problem, estimation.distribution, constants, kappas, estimation.unresolved, estimation.local
        )
    transitions = transitions_of(problem, about.gaussian, constants, kappas, estimation.distribution)
    return _Estimates(_with_ties(problem, constants), kappas, transitions)


def _facts(
    problem: Problem,
    optimum: LeastSquaresFit,
    about: OptimumSummary,
    estimation: Estimation,
    constants: Constants | None,
    draws: Postponed[Mapping[str, Any] | None],
    conditions: Setting | None,
    *,
    brief: bool,
) -> dict[str, Fact]:
    """Findings on the optimum, on the estimates (None: not asked for) and on the method, as in the report."""
    asked, problem = problem, at_fitted_offset(problem, optimum)
    offset, domain = optimum.angle_offset, asked.offset
    several, few = several_modes(problem, optimum), few_degrees_of_freedom(problem, optimum)
    causes = {} if brief else causes_of(problem, optimum, conditions, about.constants)
    found = _misfit(problem, optimum, about, causes, conditions, brief=brief)
    # a slip says more than that velocities and spins do not close
    by_hand = (
        "left_out_readings",
        "unrelated_readings",
        "duplicates",
        "second_readings",
        "repeated_number",
        "censoring",
        "slips",
        "angle_scatter",
        "angular_momentum",
        "rounded_readings",
        "truncation",
        "sigma_of_few",
        "scatter_too_small",
    )
    slips = {name: found[name] for name in by_hand if name in found}
    first = {name: fact for name, fact in slips.items() if not fact.ok}  # before what follows from them
    beyond = (
        friction_beyond_prior(asked, optimum) if estimation.is_posterior and "slips" not in first else None
    )
    facts = {
        **first,
        # what refutes the closure comes first: no remedy of what follows would help
        **{name: fact for name, fact in found.items() if name == "beyond_closure"},
        **({} if beyond is None else {"friction_beyond_prior": beyond}),
        "converged": estimation.diagnostics["converged"],
        "global_optimum": global_optimum(optimum, bilinear=problem.closure.bilinear),
        **({} if several is None else {"noise_modes": several}),
        **({} if few is None else {"noise_dof": few}),
        **({} if offset is None or domain is None else {"angle_offset": angle_offset(offset, domain)}),
        **({} if constants is None else _of_constants(problem, optimum, about, constants, found)),
        **found,
    }
    drawn = draws.value if estimation.is_posterior else None
    if drawn is not None:
        facts["predictive"] = predictive(asked, {name: x[:_CHECKED] for name, x in drawn.items()})
    return subordinate(facts | dict(estimation.diagnostics))


def _of_constants(
    problem: Problem,
    optimum: LeastSquaresFit,
    about: OptimumSummary,
    constants: Constants,
    found: Mapping[str, Fact],
) -> dict[str, Fact]:
    """What the data determine of the constants; `found` is what the residuals say."""
    counts, small = about.statistics, found.get("scatter_too_small")
    too_large = 1.0 if small is None or small.ok else small.figures["factor"]
    tiny = tiny_friction(problem, constants)
    return {
        "identifiable": identifiable(
            problem,
            optimum,
            constants,
            counts.n_sticking,
            counts.n_sliding,
            slip="slips" in found and not found["slips"].ok,
            too_large=too_large,
            misfit=any(name in found and not found[name].ok for name in _MISFIT),
        ),
        "at_bound": at_bound(constants),
        **({} if tiny is None else {"tiny_friction": tiny}),
    }


def _misfit(
    problem: Problem,
    optimum: LeastSquaresFit,
    about: OptimumSummary,
    causes: Mapping[str, Fact],
    conditions: Setting | None,
    *,
    brief: bool,
) -> dict[str, Fact]:
    """What the residuals say; at the noise that the values show, where angles scatter or sigma is small."""
    turned = angle_scatter(problem, optimum, causes)
    if turned is not None:
        left = causes if brief else causes_of(turned.problem, turned.fit, conditions, about.constants)
        if all(fact.ok for name, fact in left.items() if name not in turned.beside):
            known = {**left, "angle_scatter": turned.fact}
            others = misfit_facts(turned.problem, turned.fit, turned.residuals, known, brief=brief)
            return in_order({**others, **turned.beside})
    found = misfit_facts(problem, optimum, about.residuals, causes, brief=brief)
    wide = scatter_too_large(problem, optimum, about.residuals, found)
    if wide is not None:
        causes = {} if brief else causes_of(wide.problem, wide.fit, conditions, about.constants)
        if all(fact.ok for fact in causes.values()):
            others = misfit_facts(wide.problem, wide.fit, wide.residuals, causes, brief=brief)
            of_sigma = {name: found[name] for name in ("sigma_of_few",) if name in found}
            found = in_order({**others, **of_sigma, "scatter_too_large": wide.fact})
    return found


def _warnings(problem: Problem) -> tuple[str, ...]:
    said = list(problem.observations.notes)
    if problem.parameters.is_tied:
        each = (f"{name} = {text}" for name, text in problem.parameters.ties.expressions.items())
        said.append(
            f"Tied: {', '.join(each)}. The optimum is the best of many starts, not proven; slips, outliers, "
            "effects, sharing, profiles and other closures are not looked for beside ties."
        )
    ignored = uncounted_uncertainties(problem)
    if ignored:
        said.append(f"Not propagated: {' and '.join(ignored)}; angles and spins are taken as exact.")
    if not problem.error_model.is_plain:
        said.append(
            f"Scatter: {problem.error_model.words}. chi2, residuals and what is said of misfit and outliers "
            "are those of the reweighted rows."
        )
    if problem.closure.caveat:
        said.append(problem.closure.caveat)
    return (*said, *_sigma_not_used(problem))


def _beyond_ends(problem: Problem, constants: Constants) -> tuple[str, ...]:
    """Which intervals of tied constants a Gaussian draws beyond what an end of another's domain leaves."""
    if not problem.parameters.is_tied:
        return ()
    flat = by_entry(constants)
    open_ = [name for name, own in flat.items() if own.status in ("one_sided", "not_determined")]
    others = [name for name, own in flat.items() if own.status in ("determined", "prior")]
    if not open_ or not others:
        return ()
    return (
        f"The domain of {joined(open_)} ends within reach, and the tie may end {joined(others)} there, "
        "too, which intervals of least squares do not know: they may reach beyond. --method mcmc knows it.",
    )


def _common_errors(asked: Problem, optimum: LeastSquaresFit) -> CommonErrorSummary | None:
    """Errors that rows have in common, counted or not."""
    if asked.common is not None and optimum.common is not None:
        return CommonErrorSummary(asked.common.numbers, tuple(optimum.common.value.tolist()))
    _, _, numbers = loadings_of(asked.observations.stored)
    return CommonErrorSummary(numbers) if numbers else None


def _of_common_errors(noise: NoiseSummary) -> tuple[str, ...]:
    """What becomes of errors that rows have in common, in a sentence."""
    common = noise.common_errors
    if common is None:
        return ()
    if not common.are_counted:
        return (f"Ignored: {common.words}. Intervals are too short by what these add.",)
    return (
        f"Counted: {common.words}, integrated out of every interval. Residuals, and what is said of misfit "
        "and outliers, are those at their fitted values.",
    )


def _given(problem: Problem) -> tuple[str, ...]:
    """Each "series/observable" whose sigma is taken as given while others are not."""
    if not problem.noise.is_mixed:
        return ()
    return tuple(name for name, rows in problem.groups().items() if problem.noise.is_given[rows].all())


def _sigma_not_used(problem: Problem) -> tuple[str, ...]:
    """Which given sigmas are not used, why, and what would have them used."""
    if not problem.noise.is_unknown:
        return ()
    given = np.isfinite(problem.observations.table["sigma"].to_numpy(dtype=float))
    if not given.any():
        return ()
    return (
        f"sigma is given in {int(given.sum())} of {given.size} rows, and is not used: the noise comes "
        "from the misfit. Give every row a sigma, or choose --noise.",
    )


def _versions() -> dict[str, str]:
    import pandas
    import scipy

    return {
        "ifrfit": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "pandas": pandas.__version__,
    }


def statistics_of(
    problem: Problem, found: LeastSquaresFit, residuals: Residuals, sticks: NDArray[np.bool_]
) -> FitStatistics:
    """Count rows and sum up the misfit; the most likely noise goes into the likelihood."""
    r = residuals.raw
    n = r.size
    dof = n - round(fitted_constants(problem, found))
    yardstick = problem.noise.sigma if problem.noise.is_scaled else found.sigma
    common = found.common
    chi2 = float(((r / yardstick) ** 2).sum()) + (0.0 if common is None else common.square)
    is_chi2 = problem.noise.is_known and problem.error_model.is_plain
    prior = problem.parameters.prior_residuals(found.optimum.theta)
    offset = found.angle_offset
    known = problem.noise.is_known
    likely = problem.noise.sigma if known else likely_sigma(problem, found.optimum.theta)
    log_l = float(-0.5 * ((r / likely) ** 2).sum() - np.log(likely).sum() - 0.5 * n * math.log(2.0 * math.pi))
    if common is not None:  # the law of all rows together; its most likely noise is not worked out
        _, size = whitening(common.loadings, likely)
        log_l -= 0.5 * common.square + 0.5 * float(np.log1p(size**2).sum())
    if not problem.error_model.is_plain or (common is not None and not known):
        log_l = math.nan  # not Gaussian; the posterior's evidence is what compares
    k = found.gaussian.rank + len(problem.noise_groups()) + (offset is not None and offset.is_determined)
    regime = problem.rows.is_oblique
    return FitStatistics(
        n=n,
        n_sliding=int((regime & ~sticks).sum()),
        n_sticking=int((regime & sticks).sum()),
        rank=found.gaussian.rank,
        prior_chi2=float(prior @ prior) + (0.0 if offset is None else offset.pull**2),
        chi2=chi2,
        dof=dof,
        reduced_chi2=chi2 / dof if dof > 0 and not problem.noise.has_unknown else None,
        p_value=float(chdtrc(dof, chi2)) if dof > 0 and is_chi2 else None,
        rmse=float(np.sqrt((r * r).mean())),
        log_likelihood=log_l,
        aic=2.0 * k - 2.0 * log_l,
        bic=k * math.log(n) - 2.0 * log_l,
    )
