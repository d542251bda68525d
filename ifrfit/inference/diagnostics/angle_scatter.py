"""Does the scatter go with the slope of the values in the angle? Angles that were read with errors do that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.angle_error_size import (
    AngleErrors,
    AngleSlopes,
    careful_p,
    deviance_of,
    fitted_errors,
)
from ifrfit.inference.diagnostics.lack_of_fit import lack_of_fit
from ifrfit.inference.diagnostics.mixture import mixture
from ifrfit.inference.diagnostics.residuals import Residuals, residuals_of
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.model.noise import NoiseModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, group_sigma, refit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_FEWEST = 8  # impacts below which no errors of angles are looked for
_EXPLAINED = 0.01  # p of a trend that the errors of angles leave, from which nothing else speaks
_WIDEST = 20.0  # degrees beyond which it is no error of reading
_ROUNDS = 2  # in which the constants are fitted with the errors, and the errors about the constants
_STATED = 0.01  # relative sd of a sigma in words


@dataclass(frozen=True)
class WithAngleErrors:
    """What is said of the angles, and the question and fit with their errors in the noise.

    `beside` are facts of the table without them that explain it as well.
    """

    fact: Fact
    problem: Problem
    fit: LeastSquaresFit
    residuals: Residuals
    beside: dict[str, Fact]


def angle_scatter(
    problem: Problem, fit: LeastSquaresFit, found: Mapping[str, Fact]
) -> WithAngleErrors | None:
    """Whether independent errors of the angles explain the scatter: one of each impact, all of one size.

    The test is that of `careful_p`. Where it is positive the size is fitted with noises and constants, and
    counts where no trend is left (p >= 0.01) and nothing else explains more by `ALIKE`: a sigma that is too
    small, a scatter that grows, slips and effects that were found, impacts of two kinds. What explains as
    much is named beside it.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    found : mapping of str to Fact
        What the residuals say without errors of the angles.

    Returns
    -------
    WithAngleErrors or None
        None where the angles are as good as exact, or have errors in the question already.
    """
    model = problem.error_model
    if not model.is_plain or model.propagates or not problem.rows.has_angle.any():
        return None
    if int(problem.rows.impacts.max(initial=-1)) + 1 < _FEWEST:
        return None
    slopes = AngleSlopes.of(problem, fit.optimum.theta, fit.sigma)
    unknown = tuple(problem.noise_groups().values())
    p = careful_p(slopes, unknown)
    if p >= REFUTED:
        return None
    with_factor = False
    before = deviance_of(slopes, unknown)
    errors = fitted_errors(slopes, before, unknown)
    if problem.noise.is_known:
        everything = (np.arange(len(problem.rows)),)
        scaled = fitted_errors(slopes, before, everything)
        with_factor = scaled.drop > errors.drop + ALIKE
        if with_factor:
            errors, unknown = scaled, everything
    even = fitted_errors(slopes, before, _even_groups(problem), exact=True).drop
    if even > errors.drop + ALIKE:
        return None
    try:
        for _ in range(_ROUNDS):
            if not 0.0 < errors.size < _WIDEST:
                return None
            sigma = fit.sigma * errors.widening
            wide = problem.with_noise(NoiseModel("scaled", sigma))
            again = refit(wide, sigma, fit.optimum.theta)
            at_theta = AngleSlopes.of(problem, again.optimum.theta, fit.sigma)
            errors = fitted_errors(at_theta, before, unknown)
    except DataError:
        return None
    left = residuals_of(wide, again)
    trend = lack_of_fit(wide, again, left, remedy=False).figures["p"]
    if trend is None or trend < _EXPLAINED:
        return None
    rivals = _rivals(problem, fit, found)
    if any(drop > errors.drop + ALIKE for _, drop in rivals.values()):
        return None
    beside = {name: fact for name, (fact, drop) in rivals.items() if drop > errors.drop - ALIKE}
    alike = [*beside, *(["sigma"] if even > errors.drop - ALIKE else [])]
    fact = _fact(problem, fit, errors, p, trend, alike, with_factor=with_factor)
    return WithAngleErrors(fact, wide, again, left, beside)


def _even_groups(problem: Problem) -> tuple[Index, ...]:
    """Rows that would share a noise if sigma were wrong by a factor for each observable."""
    given = problem.noise.is_given
    found = list(problem.noise_groups().values())
    for name in problem.rows.names:
        rows = problem.rows.rows_of(name)
        found.append(rows[given[rows]])
    return tuple(rows for rows in found if rows.size)


def _rivals(
    problem: Problem, fit: LeastSquaresFit, found: Mapping[str, Fact]
) -> dict[str, tuple[Fact, float]]:
    """Other findings with their fall of -2 log likelihood."""
    rivals = {}
    kinds = mixture(problem, fit)
    if kinds is not None:
        rivals["mixture"] = kinds, float(kinds.figures["drop"])
    growing = found.get("growing_scatter")
    if growing is not None and not growing.ok:
        rivals["growing_scatter"] = growing, float(growing.figures["drop"])
    for name in ("slips", "effects"):
        if name in found and not found[name].ok:
            figures = found[name].figures
            tests = figures.get("tests", {})
            drops = [tests[one].get("drop") for one in figures["called"] if one in tests]
            rivals[name] = found[name], max((float(x) for x in drops if x is not None), default=0.0)
    return rivals


def _fact(
    problem: Problem,
    fit: LeastSquaresFit,
    errors: AngleErrors,
    p: float,
    trend: float,
    alike: list[str],
    *,
    with_factor: bool,
) -> Fact:
    size = float(f"{errors.size:.2g}")
    noise = group_sigma(problem, fit.sigma * errors.noise)
    words = {
        "mixture": "impacts of two kinds",
        "growing_scatter": "errors of velocities",
        "slips": "a slip in the table",
        "effects": "a further effect",
        "sigma": "a sigma that is too small (--noise scaled)",
    }
    like = f", not told apart from {joined([words[name] for name in alike], 'or')}" if alike else ""
    says = (
        f"the values scatter as if every angle of incidence were off by an error of its own, some {size:.2g} "
        f"degrees (p = {p_text(p)}; -2 log likelihood falls by {errors.drop:.3g}{like}): "
        f"{_remedy(problem, size, noise, with_factor=with_factor)}"
    )
    figures = {
        "p": p,
        "size": size,
        "drop": errors.drop,
        "p_trend": trend,
        "noise": noise,
        "alike": alike,
    }
    return Fact(False, says, figures, FACTS["angle_scatter"])


def _remedy(problem: Problem, size: float, noise: Mapping[str, float], *, with_factor: bool) -> str:
    """The options that count errors of this size, with what they need."""
    stated = problem.rows.sigma_gamma_deg[problem.rows.has_angle]
    options = "--angle-errors effective"
    if np.isfinite(stated).all():
        options = f"{options} takes the sigma_gamma_deg of the table, {np.median(stated):.2g}"
    else:
        options = f"{options} --sigma-gamma {size:.2g}"
    if not problem.closure.bilinear:
        return f"{options} counts them, with another closure than {problem.closure.title}"
    if problem.error_model.offset is not None:
        return f"{options} counts them, without --angle-offset"
    if problem.noise.is_mixed or len(problem.noise_groups()) > 1:
        each = joined([f"{sigma:.2g} for {name}" for name, sigma in noise.items()])
        return f"{options} --noise scaled counts them, with a sigma in every row: {each}"
    return f"{options}{' --noise scaled' if with_factor else ''} counts them, or --angle-errors set"
