"""Fixed values, priors and bounds of the user, held against the data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ifrfit.inference.diagnostics.series_compared import WORTH_A_FIT, fitted_test, score_test
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text, plus_minus

_ON = 1e-6  # share of the domain within which a constant lies on a bound


def prior_conflict(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Set free each constant that was fixed, has a prior, or lies on a bound of the user, and test the gain.

    Tested is the fall of the weighted sum of squares, with the prior's part, at the noise of the wider model:
    by F, or by chi2 where sigma is known. p values are multiplied by the number of constants (Bonferroni).
    Where the score test sees nothing no fit is made. e_n is left to its readings where there are any.

    Returns
    -------
    Fact or None
        None where nothing was taken for known, or the data do not contradict it.

    References
    ----------
    Evans & Moshonov (2006), Bayesian Anal. 1, 893, on conflicts of prior and data.
    """
    taken = list(_taken(problem, found.optimum.theta))
    if not taken or not problem.error_model.is_plain:
        return None
    contradicted: dict[str, tuple[float, str]] = {}
    for each in taken:
        wider = problem.with_parameters([_free(each)])
        k = len(problem.series) if each.separate else 1
        p = score_test(problem, wider, found, k)
        if p is not None and p >= WORTH_A_FIT:
            continue
        fitted = fitted_test(problem, wider, found, k)
        if fitted is not None and len(taken) * fitted[1] < REFUTED:
            bound = _bound(each, problem, found.optimum.theta)
            contradicted[each.name] = len(taken) * fitted[1], _words(each, wider, *fitted, len(taken), bound)
    if not contradicted:
        return None
    figures = {"p": {name: p for name, (p, _) in contradicted.items()}}
    ordered = sorted(contradicted.values())
    says = "; or ".join(words for _, words in ordered)
    return Fact(False, f"the data contradict {says}", figures, FACTS["prior_conflict"])


def _taken(problem: Problem, theta: Array) -> Iterator[Parameter]:
    """Constants of which the user says more than the closure does, where that may decide."""
    for each in problem.parameters:
        has_readings = each.name == "e_n" and problem.rows.has_kind("normal")
        informed = each.fixed is not None or each.prior is not None
        if (informed and not has_readings) or _bound(each, problem, theta) is not None:
            yield each


def _bound(each: Parameter, problem: Problem, theta: Array) -> tuple[str, float] | None:
    """The user's bound that a constant lies on, within its passive domain, as a sign and a number."""
    if each.fixed is not None or each.passive is None:
        return None
    own = theta[problem.parameters.positions[each.name]]
    room = _ON * (each.prior_upper - each.lower)
    if each.lower > each.passive[0] and (own <= each.lower + room).any():
        return ">=", each.lower
    if each.upper < each.passive[1] and (own >= each.upper - room).any():
        return "<=", each.upper
    return None


def _free(taken: Parameter) -> Parameter:
    """Without what the user says of its value."""
    lower, upper = taken.passive or (taken.lower, taken.upper)
    low, high = min(lower, taken.lower), max(upper, taken.upper)
    return replace(taken, fixed=None, prior=None, lower=low, upper=high, passive=None)


def _words(
    taken: Parameter,
    wider: Problem,
    fit: LeastSquaresFit,
    p: float,
    count: int,
    bound: tuple[str, float] | None,
) -> str:
    if bound is not None:
        what, option = f"your bound {taken.name} {bound[0]} {bound[1]:g}", "--bounds"
    elif taken.fixed is not None:
        what, option = f"{taken.name} = {taken.fixed:g}, which you fixed", "--fix"
    else:
        assert taken.prior is not None
        mean, sd = taken.prior
        what, option = f"your prior {taken.name} = {mean:g} +- {sd:g}", "--prior"
    sds = fit.gaussian.theta_sd
    places = np.unique(wider.parameters.positions[taken.name])
    alone = " and ".join(plus_minus(float(fit.optimum.theta[i]), float(sds[i])) for i in places.tolist())
    return f"{what} (p = {p_text(count * p)}): without {option} {taken.name} they say {alone}"
