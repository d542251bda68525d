"""Does the scatter go with the slope of the values in the angle? Errors of the angles do that."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.angle_error_size import (
    AngleSlopes,
    FittedErrors,
    careful_p,
    deviance_of,
    fitted_errors,
)
from ifrfit.inference.diagnostics.growing_scatter import growing_scatter
from ifrfit.inference.diagnostics.lack_of_fit import lack_of_fit
from ifrfit.inference.diagnostics.mixture import drop_of_scattering_constant, mixture, suspicious_constants
from ifrfit.inference.diagnostics.normal_restitution import OF_SPEEDS, hides_speeds
from ifrfit.inference.diagnostics.residuals import Residuals, residuals_of
from ifrfit.inference.diagnostics.rival_scatter import (
    drop_of_angle,
    drop_of_even,
    drop_of_growth,
    drop_of_level,
    fall_of_outliers,
)
from ifrfit.inference.diagnostics.rounded_angles import rounding_errors, step_of_angles
from ifrfit.inference.diagnostics.rounding_step import step_of_readings
from ifrfit.inference.diagnostics.thresholds import ALIKE, DECISIVE, FACTS, REFUTED
from ifrfit.inference.model.noise import NoiseModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, group_sigma, refit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_FEWEST = 8  # impacts below which no errors of angles are looked for
_TREND = 0.01  # p of a lack of fit that is left, from which the law is not the reason
_WIDEST = 10.0  # degrees beyond which it is no error of reading
_LEAST = 0.1  # share of an observable's scatter below which the noise that is left is no number to give
_ROUNDS = 2  # in which the constants are fitted with the errors, and the errors about the constants
_SPEEDS = f", as where {OF_SPEEDS} and no column holds speeds"
# what explains the residuals as well, in words
_ALIKE = {
    "mixture": "impacts of two kinds",
    "growing_scatter": "errors of velocities",
    "slips": "a slip in the table",
    "effects": "a further effect",
    "sigma": "a sigma that is too small (--noise scaled)",
    "constants": "a constant that differs from impact to impact",
    "level": "errors of one size, whatever sigma says (--noise unknown)",
    "growth": "errors that grow with the value",
    "angle": "errors whose size changes with the angle",
    "outliers": "outliers",
}


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
    problem: Problem, fit: LeastSquaresFit, causes: Mapping[str, Fact]
) -> WithAngleErrors | None:
    """Whether independent errors of the angles explain the scatter: one of each impact, all of one size.

    The test is that of `careful_p`, or, where all angles are multiples of a step, a fall of -2 log likelihood
    of `DECISIVE` for angles that were rounded to it. Where it is positive the size, unless it is that of the
    rounding, is fitted with noises and constants, and counts where no lack of fit is left (p >= 0.01; of a
    rounding 0.001) and nothing else explains more by `ALIKE`: a sigma that is too small, a scatter that grows
    with the value or changes with the angle, slips and effects that were found, impacts of two kinds. What
    explains as much is named beside it. Errors of one size that sigma does not have are told first where they
    explain as much: with them the angles are asked again.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    causes : mapping of str to Fact
        What the residuals call for without errors of the angles, where tested: ``slips``, ``effects``.

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
    p, before = careful_p(slopes, unknown), deviance_of(slopes, unknown)
    found = rounding_errors(problem, fit, slopes, before, unknown)
    rounded, alone = (None, None) if found is None or found[0].drop < DECISIVE else found
    if p >= REFUTED and rounded is None:
        return None
    errors, with_factor = fitted_errors(slopes, before, unknown), False
    if problem.noise.is_known:
        everything = (np.arange(len(problem.rows)),)
        scaled = fitted_errors(slopes, before, everything)
        # beside a factor on sigma the scatter itself has to show them
        if scaled.drop > errors.drop + ALIKE and careful_p(slopes, everything) < REFUTED:
            errors, unknown, with_factor = scaled, everything, True
    step = 0.0
    if rounded is not None and rounded.drop > errors.drop - ALIKE:
        errors, with_factor, step = rounded, False, step_of_angles(problem)
        p = min(p, math.exp(-0.5 * rounded.drop))
    try:
        for _ in range(_ROUNDS):
            if not 0.0 < errors.size < _WIDEST:
                return None
            sigma = fit.sigma * errors.widening
            wide = problem.with_noise(NoiseModel("scaled", sigma))
            again = refit(wide, sigma, fit.optimum.theta)
            at_theta = AngleSlopes.of(problem, again.optimum.theta, fit.sigma)
            if step == 0.0:
                errors = fitted_errors(at_theta, before, unknown)
        if _rounds(problem, fit, fit.sigma * errors.noise):
            return None  # equal readings where no angle matters are those of one cell
        rivals = _rivals(problem, fit, slopes, causes, errors)
        if any(excess > ALIKE for excess, _ in rivals.values()):
            return None
        left = residuals_of(wide, again)
        without = at_theta.without(errors)
        # one error of the angle makes those of an impact alike
        left = replace(left, standardised=alone if step and alone is not None else without.left)
        trend = lack_of_fit(wide, again, left, remedy=False)
        if not trend.ok or (step == 0.0 and (trend.figures["p"] or 1.0) < _TREND):
            return None
        places = suspicious_constants(wide, without.by_constant, without.left)
        if places:
            rivals |= _of_mixture(problem, fit, errors.drop, places)
    except DataError:
        return None
    if any(excess > ALIKE for excess, _ in rivals.values()):
        return None
    beside = {name: other for name, (excess, other) in rivals.items() if excess > -ALIKE}
    fact = _fact(problem, fit, errors, p, list(beside), with_factor=with_factor, step=step)
    kept = {name: other for name, other in beside.items() if other is not None}
    return WithAngleErrors(fact, wide, again, left, kept)


def _rivals(
    problem: Problem,
    fit: LeastSquaresFit,
    slopes: AngleSlopes,
    causes: Mapping[str, Fact],
    errors: FittedErrors,
) -> dict[str, tuple[float, Fact | None]]:
    """What else may be the reason: by how much more it takes off -2 log likelihood, and its fact."""
    drop = errors.drop
    of_constants = drop_of_scattering_constant(problem, slopes.by_constant, slopes.left)
    rivals: dict[str, tuple[float, Fact | None]] = {
        "sigma": (drop_of_even(problem, slopes) - drop, None),
        "growth": (drop_of_growth(problem, fit, slopes) - drop, None),
        "angle": (drop_of_angle(problem, slopes) - drop, None),
        # a look-alike that takes nothing from the remedy: rows count by what scatters in them
        "constants": (min(of_constants - drop, ALIKE), None),
        "outliers": (fall_of_outliers(problem, slopes) - errors.fall, None),
    }
    _, level = drop_of_level(problem, slopes, fit.sigma)
    if level > drop_of_even(problem, slopes) + ALIKE:
        rivals["level"] = level - drop + 2.0 * ALIKE, None
    growing = growing_scatter(problem, fit, residuals_of(problem, fit))
    if growing is not None:
        rivals["growing_scatter"] = float(growing.fact.figures["drop"]) - drop, growing.fact
    for name in ("slips", "effects"):
        if name in causes and not causes[name].ok:
            figures = causes[name].figures
            tests = figures.get("tests", {})
            drops = [tests[one].get("drop") for one in figures["called"] if one in tests]
            explained = max((float(x) for x in drops if x is not None), default=0.0)
            rivals[name] = explained - drop, causes[name]
    return rivals


def _of_mixture(
    problem: Problem, fit: LeastSquaresFit, drop: float, places: Sequence[int]
) -> dict[str, tuple[float, Fact | None]]:
    """Impacts of two kinds; where sigma is known, both are compared with a factor on it."""
    if problem.noise.is_known:
        problem = problem.with_noise(replace(problem.noise, policy="scaled"))
        fit = refit(problem, fit.sigma, fit.optimum.theta)
        everything = tuple(problem.noise_groups().values())
        slopes = AngleSlopes.of(problem, fit.optimum.theta, fit.sigma)
        drop = fitted_errors(slopes, deviance_of(slopes, everything), everything).drop
    kinds = mixture(problem, fit, places)
    return {} if kinds is None else {"mixture": (float(kinds.figures["drop"]) - drop, kinds)}


def _fact(
    problem: Problem,
    fit: LeastSquaresFit,
    errors: FittedErrors,
    p: float,
    alike: list[str],
    *,
    with_factor: bool,
    step: float,
) -> Fact:
    size = float(f"{errors.size:.2g}")
    noise = _noise_of_each(problem, fit.sigma * errors.noise)
    words = [
        _ALIKE[name] + (_SPEEDS if name == "constants" and hides_speeds(problem) else "") for name in alike
    ]
    like = f", not told apart from {joined(words, 'or')}" if words else ""
    of_rounding = f", as where they are rounded to {step:.0f} degrees" if step else ""
    says = (
        f"the values scatter as if each angle of incidence were off by an error of its own, some {size:.2g} "
        f"degrees{of_rounding}{like} (p = {p_text(p)}; -2 log likelihood falls by {errors.drop:.3g}): "
        f"{_remedy(problem, fit, size, _sigma_words(problem, fit, noise), with_factor=with_factor)}"
    )
    figures = {
        "p": p,
        "size": size,
        "drop": errors.drop,
        "step": step,
        "noise": noise,
        "alike": alike,
    }
    return Fact(False, says, figures, FACTS["angle_scatter"])


def _rounds(problem: Problem, fit: LeastSquaresFit, noise: Array) -> bool:
    """Whether readings that scatter by less than their last decimal are left next to no noise."""
    for rows in problem.groups().values():
        step = step_of_readings(problem, rows)
        scatter, left = (float(np.sqrt((each[rows] ** 2).mean())) for each in (fit.sigma, noise))
        if scatter < step and left < _LEAST * scatter:
            return True
    return False


def _sigma_words(problem: Problem, fit: LeastSquaresFit, noise: Mapping[str, float]) -> str:
    """A sigma of each observable; where next to nothing is left, a share of all its scatter."""
    of_all = _noise_of_each(problem, fit.sigma)
    least = {name: _LEAST * of_all[name] for name in noise}
    return joined(
        [
            f"{sigma:.2g} for {name}" if sigma >= least[name] else f"{least[name]:.1g} or less for {name}"
            for name, sigma in noise.items()
        ]
    )


def _noise_of_each(problem: Problem, sigma: Array) -> dict[str, float]:
    """Noise of each observable without that of the angles; of each series, where it is one of each."""
    if problem.noise.separate:
        return group_sigma(problem, sigma)
    rows = {name: problem.rows.rows_of(name) for name in problem.rows.names}
    return {name: float(np.sqrt((sigma[own] ** 2).mean())) for name, own in rows.items()}


def _remedy(problem: Problem, fit: LeastSquaresFit, size: float, sigmas: str, *, with_factor: bool) -> str:
    """The options that count errors of this size, with what they need."""
    stated = problem.rows.sigma_gamma_deg[problem.rows.has_angle]
    several = problem.noise.is_mixed or len(problem.noise_groups()) > 1
    options, needs = ["--angle-errors effective"], []
    if np.isfinite(stated).all():
        needs.append(f"by the sigma_gamma_deg of the table ({np.median(stated):.2g})")
    else:
        options.append(f"--sigma-gamma {size:.2g}")
    if several:
        needs.append(f"with a sigma in every row, as {sigmas}")
    if several or with_factor:
        options.append("--noise scaled")
    if fit.angle_offset is not None:
        needs.append("without --angle-offset")
    if not problem.closure.bilinear:
        needs.append(f"with another closure than {problem.closure.title}")
    return f"{' '.join(options)} counts them{''.join(f', {need}' for need in needs)}"
