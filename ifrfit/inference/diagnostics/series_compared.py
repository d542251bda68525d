"""Do the series share their constants, and their noise? Asked of every fit of several series."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, group_dof, refit, satterthwaite
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text, plus_minus

_MOST_SERIES = 30  # beyond, constants of each series are a question of their own
_MOST_NAMED = 4
WORTH_A_FIT = 0.1  # p of the score test below which a constant of each series is fitted
_FEWEST = 2.0  # degrees of freedom of a series whose noise is compared


@dataclass(frozen=True)
class Pooling:
    """Whether the series share their constants.

    Attributes
    ----------
    fact : Fact
    constants : str
        Those that they do not share, in words.
    problem : Problem
        With one of each series of these.
    fit : LeastSquaresFit
        Of that.
    """

    fact: Fact
    constants: str
    problem: Problem
    fit: LeastSquaresFit

    def after_slip(self) -> Fact:
        """The fact where a slip explains decisively more."""
        says = f"as the table stands, the series do not share {self.constants}: mend the slip in it first"
        return replace(self.fact, says=says)

    def or_slip(self, slip: str) -> Pooling:
        """With a slip of each series that explains as much as constants of each: it is looked at first."""
        says = f"the series do not share {self.constants}, or {slip}; only then {self.remedy}"
        return replace(self, fact=replace(self.fact, says=says))

    @property
    def remedy(self) -> str:
        """The options that part the constants."""
        return " ".join(f"--separate {name}" for name in self.fact.figures["separate"])

    def beside(self, slip: str) -> Fact:
        """The fact with a slip that explains as much."""
        return replace(self.fact, says=f"{self.fact.says}; or {slip}") if slip else self.fact


def pooling(problem: Problem, found: LeastSquaresFit) -> Pooling | None:
    """Test one constant for all series against one each, of every free constant that they share.

    The constant whose separation gains most is parted first, and the others are tested beside it. Tested is
    the fall of the weighted sum of squares, at the noise of the wider model: by F, or by chi2 where sigma is
    known. p values are multiplied by the number of constants (Bonferroni). Where the score test, which takes
    the expansion about the shared constants in the place of a fit, sees nothing, its p value stands.

    Returns
    -------
    Pooling or None
        None where there is nothing to ask: one series, or very many, or no shared constant.
    """
    names = [c.name for c in problem.parameters if c.fixed is None and not c.separate]
    if not 2 <= len(problem.series) <= _MOST_SERIES or not names:
        return None
    count = len(names)
    parted: list[_Parted] = []
    smallest: dict[str, float] = {}
    now = problem
    while names:
        tested = []
        for name in names:
            wider = now.with_parameters([replace(now.parameters[name], separate=True)])
            p = score_test(now, wider, found, len(now.series) - 1)
            if p is None or p < WORTH_A_FIT:
                fitted = fitted_test(now, wider, found, len(now.series) - 1)
                if fitted is not None:
                    p = fitted[1]
                    tested.append(_Parted(name, wider, fitted[0], p))
            if p is not None:
                smallest.setdefault(name, min(1.0, count * p))
        # rows that know kappa alone cannot tell e_n from mu: friction, the last, differs more often
        best = min(reversed(tested), key=lambda one: round(math.log(max(one.p, 1e-300)), 3), default=None)
        if best is None or count * best.p >= REFUTED:
            break
        parted.append(best)
        now, found = best.problem, best.fit
        names.remove(best.name)
    if not smallest:
        return None
    figures = {"p": smallest, "separate": [one.name for one in parted]}
    rule = FACTS["pooling"]
    if not parted:
        p = min(smallest.values())
        says = f"one {joined(list(smallest))} for all series (p = {p_text(p)})"
        return Pooling(Fact(True, says, figures, rule), "", now, found)
    constants = joined([_words(now, one, parted[-1].fit, count) for one in parted])
    remedy = " ".join(f"--separate {one.name}" for one in parted)
    fact = Fact(False, f"the series do not share {constants}: {remedy}", figures, rule)
    return Pooling(fact, constants, now, found)


@dataclass(frozen=True)
class _Parted:
    """The test of one constant: the wider problem with its fit, and the p value."""

    name: str
    problem: Problem
    fit: LeastSquaresFit
    p: float


def _words(problem: Problem, one: _Parted, fit: LeastSquaresFit, count: int) -> str:
    """A constant with its value in each series by the widest fit, as far as they can be listed."""
    p = f"p = {p_text(count * one.p)}"
    if len(problem.series) > _MOST_NAMED:
        return f"{one.name} ({p})"
    places = problem.parameters.positions[one.name]
    sd = fit.gaussian.theta_sd
    if not fit.gaussian.tells(places):  # of products and ratios alone a value is arbitrary
        return f"{one.name} (values not determined one by one; {p})"
    each = [
        f"{plus_minus(float(fit.optimum.theta[i]), float(sd[i]))} in {series}"
        for series, i in zip(problem.series, places.tolist(), strict=True)
    ]
    return f"{one.name} ({', '.join(each)}; {p})"


def score_test(problem: Problem, wider: Problem, found: LeastSquaresFit, k: int) -> float | None:
    """p value of a problem wider by k numbers, to first order about a fit; None without degrees of freedom.

    A bound is not looked at: what it forbids counts as gained, and is left to a fit.
    """
    theta = np.empty(len(wider.parameters.names))
    for name, places in wider.parameters.positions.items():
        theta[places] = found.optimum.theta[problem.parameters.positions[name]]
    expansion = gaussian_approximation(wider, found.sigma, theta)
    before = problem.parameters.prior_residuals(found.optimum.theta)
    after = wider.parameters.prior_residuals(theta)
    gained = max(expansion.decrease + float(before @ before - after @ after), 0.0)
    if problem.noise.is_known:
        return float(special.chdtrc(k, gained))
    dof = len(problem.rows) - float(expansion.leverage.sum())
    z = problem.residual(found.optimum.theta) / found.sigma
    left = float(z @ z) - expansion.decrease
    if dof <= 1.0 or left <= 0.0:
        return None
    return float(special.fdtrc(k, dof, gained / k / (left / dof)))


def fitted_test(
    problem: Problem, wider: Problem, found: LeastSquaresFit, k: int
) -> tuple[LeastSquaresFit, float] | None:
    """Fit and p value of a problem wider by k numbers, at its noise; None where there are too few rows."""
    try:
        fit = refit(wider, found.sigma)
    except DataError:
        return None
    # at the same noise the optimum is known
    narrow = found.optimum if np.array_equal(fit.sigma, found.sigma) else solve(problem, fit.sigma)
    gained = max(narrow.objective - fit.optimum.objective, 0.0)
    dof = fit.noise_dof
    if problem.noise.is_mixed:
        dof = _dof_behind(wider, fit, problem.residual(narrow.theta))
    if math.isinf(dof):
        return fit, float(special.chdtrc(k, gained))
    if dof > 1.0:
        return fit, float(special.fdtrc(k, dof, gained / k))
    return None


def _dof_behind(wider: Problem, fit: LeastSquaresFit, before: Array) -> float:
    """Degrees of freedom behind what a fit gains over residuals: each noise by its share of the gain."""
    after = wider.residual(fit.optimum.theta)
    gained = (before**2 - after**2) / fit.sigma**2
    each = np.abs([float(gained[rows].sum()) for rows in wider.noise_groups().values()])
    whole = max(float(gained.sum()), float(each.sum()), 1e-300)
    return satterthwaite(each / whole, group_dof(wider, fit))


def unequal_noise(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Compare the scatter of the series that share an unknown noise, by Bartlett's test.

    Returns
    -------
    Fact or None
        None where no noise is shared by series, or the test is passed.

    References
    ----------
    Bartlett (1937), Proc. R. Soc. A 160, 268.
    """
    if not problem.noise.has_unknown or problem.noise.separate or len(problem.series) < 2:
        return None
    compared: dict[str, Mapping[str, float]] = {}
    smallest = 1.0
    for name, rows in problem.noise_groups().items():
        scatter = _scatter_by_series(problem, found, rows)
        if len(scatter) < 2:
            continue
        p = _bartlett([pair for _, pair in scatter])
        smallest = min(smallest, p)
        if p < REFUTED:
            compared[name] = {series: math.sqrt(square / dof) for series, (square, dof) in scatter}
    p = min(1.0, smallest * max(len(problem.noise_groups()), 1))
    if not compared or p >= REFUTED:
        return None
    words = [
        f"that of {name} is "
        + ", ".join(f"{s:.2g} in {series}" for series, s in list(own.items())[:_MOST_NAMED])
        for name, own in compared.items()
    ]
    says = f"the series do not share their noise (p = {p_text(p)}): {'; '.join(words)}; --separate noise"
    return Fact(False, says, {"p": p, "noise": compared}, FACTS["unequal_noise"])


def _scatter_by_series(
    problem: Problem, found: LeastSquaresFit, rows: np.ndarray
) -> list[tuple[str, tuple[float, float]]]:
    """Sum of squares and degrees of freedom of the rows of each series."""
    residual = problem.residual(found.optimum.theta)
    made = []
    for number, series in enumerate(problem.series):
        own = rows[problem.rows.series[rows] == number]
        dof = own.size - float(found.gaussian.leverage[own].sum())
        if dof >= _FEWEST:
            made.append((series, (float(residual[own] @ residual[own]), dof)))
    return made


def _bartlett(scatter: list[tuple[float, float]]) -> float:
    """p value of equal variances, from sums of squares and degrees of freedom."""
    squares, dof = np.array(scatter).T
    if (squares <= 0.0).any():
        return 1.0
    pooled = squares.sum() / dof.sum()
    statistic = float(dof.sum() * math.log(pooled) - dof @ np.log(squares / dof))
    correction = 1.0 + (float((1.0 / dof).sum()) - 1.0 / float(dof.sum())) / (3.0 * (dof.size - 1))
    return float(special.chdtrc(dof.size - 1, max(statistic, 0.0) / correction))
