"""Nested models: constants of each series, and ones set free of what the user said, against fewer of them.

Tested is the fall of the weighted sum of squares with a few numbers more; of constants that are separate for
each series also by the evidence. Beside them stand noises of each series.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.slips.compared_fit import ComparedFit
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.laplace import GaussianApproximation, gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, group_dof, refit, satterthwaite
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text, plus_minus

_MOST_SERIES = 30  # beyond, constants of each series are a question of their own
_MOST_NAMED = 4
WORTH_A_FIT = 0.1  # p of the score test below which a constant of each series is fitted
_FEWEST = 2.0  # degrees of freedom of a series whose noise is compared
INDIFFERENT = 3.0
DECIDED = 20.0

_MOST_ALONE = 3  # constants that are also tried one by one
_READABLE = 1e4  # factors beyond are written as powers of e
_ON = 1e-6  # share of the domain within which a constant lies on a bound


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
        remedy = " ".join(f"--separate {name}" for name in self.fact.figures["separate"])
        says = f"the series do not share {self.constants}, or {slip}; only then {remedy}"
        return replace(self, fact=replace(self.fact, says=says))

    def beside(self, slip: str) -> Fact:
        """The fact with a slip that explains as much."""
        return replace(self.fact, says=f"{self.fact.says}; or {slip}") if slip else self.fact


def pooling(problem: Problem, found: LeastSquaresFit) -> Pooling | None:
    """Test one constant for all series against one each, of every free constant that they share.

    The constant whose separation gains most is parted first, and the others are tested beside it; where none
    gains alone, all of them together. Tested is the fall of the weighted sum of squares, at the noise of the
    wider model: by F, or by chi2 where sigma is known. p values are multiplied by the number of constants
    (Bonferroni). Where the score test, which takes the expansion about the shared constants in the place of a
    fit, sees nothing, its p value stands.

    Returns
    -------
    Pooling or None
        None where there is nothing to ask: one series, or very many, or no shared constant.
    """
    problem, by_file = _by_file(problem)
    names = [c.name for c in problem.parameters if c.fixed is None and not c.separate]
    if not 2 <= len(problem.series) <= _MOST_SERIES or not names:
        return None
    count = len(names)
    parted: list[_Parted] = []
    smallest: dict[str, float] = {}
    determined: dict[str, int] = {}  # by the data, with constants of each series
    now = problem
    while names:
        tested = []
        for name in names:
            wider = _parting(now, [name])
            expansion = _expansion(now, wider, found)
            determined.setdefault(name, expansion.rank)
            p = score_test(now, wider, found, len(now.series) - 1, expansion)
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
    if not parted and len(names) > 1:
        parted = _parted_together(problem, names, found)
    if not smallest:
        return None
    figures = {"p": smallest, "separate": [one.name for one in parted]}
    rule = FACTS["pooling"]
    if not parted:
        p = min(smallest.values())
        # with one each there is more to determine, unless one series alone tells it
        compared = [name for name in smallest if determined[name] > found.gaussian.rank]
        rest = [name for name in smallest if name not in compared]
        says = f"one {joined(compared)} for all series (p = {p_text(p)})" if compared else ""
        if rest:
            each = "each of " if len(rest) > 1 else ""
            says += (
                f"{'; ' if says else ''}{each}{joined(rest)} is told by one series alone, and not compared"
            )
        return Pooling(Fact(True, says, figures, rule), "", now, found)
    constants = joined([_parted_words(parted[-1], one, count) for one in parted])
    remedy = " ".join(f"--separate {one.name}" for one in parted)
    if by_file:
        remedy = f"give those of different files different names in a column series, and {remedy}"
    fact = Fact(False, f"the series do not share {constants}: {remedy}", figures, rule)
    return Pooling(fact, constants, parted[-1].problem, parted[-1].fit)


def _by_file(problem: Problem) -> tuple[Problem, bool]:
    """With those of one name in several files as series of their own; whether there are any.

    Not where constants or noises are separate already, nor of files that share no observable.
    """
    table, rows = problem.observations.table, problem.rows
    if problem.noise.separate or any(c.separate for c in problem.parameters):
        return problem, False
    source, names = pd.factorize(table["source"], sort=True)
    if len(names) < 2:
        return problem, False
    series, label = rows.series.copy(), list(problem.series)
    for number, name in enumerate(problem.series):
        own = rows.series == number
        files = np.unique(source[own])
        if np.unique(source[own] * len(rows.names) + rows.which[own]).size == np.unique(rows.which[own]).size:
            continue
        for file in files[1:].tolist():
            series[own & (source == file)] = len(label)
            label.append(f"{name} of {names[file]}")
        label[number] = f"{name} of {names[files[0]]}"
    if len(label) == len(problem.series):
        return problem, False
    parameters = replace(problem.parameters, series=tuple(label))
    return replace(problem, rows=replace(rows, series=series), parameters=parameters), True


@dataclass(frozen=True)
class _Parted:
    """The test of one constant: the wider problem with its fit, and the p value."""

    name: str
    problem: Problem
    fit: LeastSquaresFit
    p: float


def _parted_together(problem: Problem, names: Sequence[str], found: LeastSquaresFit) -> list[_Parted]:
    """Constants that only together differ, as e_n and mu of one kappa; none where they do not.

    Of those that are parted, each that need not be is shared again.
    """
    more = len(problem.series) - 1
    wider = _parting(problem, names)
    p = score_test(problem, wider, found, more * len(names))
    if p is None or p >= WORTH_A_FIT:
        return []
    fitted = fitted_test(problem, wider, found, more * len(names))
    # one test more than there are constants
    p = 1.0 if fitted is None else fitted[1] * (len(names) + 1) / len(names)
    if fitted is None or len(names) * p >= REFUTED:
        return []
    widest, _ = fitted
    kept = list(names)
    for name in names:
        rest = [other for other in kept if other != name]
        if not rest:
            break
        shared = _parting(problem, rest)
        again = fitted_test(shared, _parting(problem, kept), refit(shared, widest.sigma), more)
        if again is not None and again[1] >= REFUTED:
            kept = rest
    parted = _parting(problem, kept)
    fit = refit(parted, widest.sigma)
    return [_Parted(name, parted, fit, p) for name in kept]


def _parting(problem: Problem, names: Sequence[str]) -> Problem:
    """With constants of each series."""
    return problem.with_parameters([replace(problem.parameters[name], separate=True) for name in names])


def _parted_words(widest: _Parted, one: _Parted, count: int) -> str:
    """A constant with its value in each series by the widest fit, as far as they can be listed."""
    problem, fit, p = widest.problem, widest.fit, f"p = {p_text(count * one.p)}"
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


def _theta_of(problem: Problem, wider: Problem, found: LeastSquaresFit) -> Array:
    """The optimum of a problem as constants of a wider one."""
    theta = np.empty(len(wider.parameters.names))
    for name, places in wider.parameters.positions.items():
        theta[places] = found.optimum.theta[problem.parameters.positions[name]]
    return theta


def _expansion(problem: Problem, wider: Problem, found: LeastSquaresFit) -> GaussianApproximation:
    """Of a wider problem at the optimum of a problem."""
    return gaussian_approximation(wider, found.sigma, _theta_of(problem, wider, found))


def score_test(
    problem: Problem,
    wider: Problem,
    found: LeastSquaresFit,
    k: int,
    expansion: GaussianApproximation | None = None,
) -> float | None:
    """p value of a problem wider by k numbers, to first order about a fit; None without degrees of freedom.

    A bound is not looked at: what it forbids counts as gained, and is left to a fit. The expansion is that of
    the wider problem, where it is known.
    """
    theta = _theta_of(problem, wider, found)
    expansion = expansion or _expansion(problem, wider, found)
    before = problem.parameters.prior_residuals(found.optimum.theta)
    after = wider.parameters.prior_residuals(theta)
    gained = max(expansion.decrease + float(before @ before - after @ after), 0.0)
    if problem.noise.is_known:
        return float(special.chdtrc(k, gained))
    dof = problem.noise.count(np.arange(len(problem.rows))) - float(expansion.leverage.sum())
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
    residual = problem.residual(found.optimum.theta) / problem.noise.base
    made = []
    for number, series in enumerate(problem.series):
        own = rows[problem.rows.series[rows] == number]
        dof = problem.noise.count(own) - float(found.gaussian.leverage[own].sum())
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


def sharing(
    problem: Problem,
    log_evidence: float,
    evidence_of: Callable[[Problem], float],
    names: Collection[str] = (),
) -> Fact | None:
    """Weigh constants that are separate for each series against ones that all series share.

    Parameters
    ----------
    problem : Problem
        The question as asked.
    log_evidence : float
        Its evidence.
    evidence_of : callable
        From another question to its log evidence. One that it refuses by `DataError` is passed over.
    names : collection of str
        Empty: the separate constants are tried shared, all at once and, where there are several, one by one.
        Else: the shared constants of these names are tried separate in the same way (fixed ones are passed
        over, and so are separate ones).

    Returns
    -------
    Fact or None
        None where there is nothing to ask: one series, no such constant, a series of a single row (which any
        constant of its own would meet), or no evidence. Figures: tested, direction, and models, the question
        as asked first: its separate constants, its log evidence, and the log Bayes factor of it over the
        question as asked; also preferred, the separate constants of the model that is favoured (None without
        a preference).

    Notes
    -----
    The evidence weighs fit against the room that the prior leaves (Jeffreys 1961; MacKay 2003, chapter 28):
    a constant of its own for each series costs a factor of about its posterior over its prior width, per
    series beyond the first. So a prior twice as wide favours sharing by twice as much a series.
    """
    free = [c for c in problem.parameters if c.fixed is None]
    if names:
        tested = [c.name for c in free if c.name in names and not c.separate]
    else:
        tested = [c.name for c in free if c.separate]
    alone = bool(names) and int(np.bincount(problem.rows.series).min()) < 2
    if len(problem.series) < 2 or not tested or alone or not math.isfinite(log_evidence):
        return None
    now = frozenset(c.name for c in problem.parameters if c.separate)
    models = [_Model(now, log_evidence)]
    for flipped in [tested, *([name] for name in tested[:_MOST_ALONE] if len(tested) > 1)]:
        try:
            other = _with_separate(problem, now ^ frozenset(flipped))
            models.append(_Model(now ^ frozenset(flipped), evidence_of(other)))
        except DataError:  # too few rows for so many constants
            continue
    models = [model for model in models if math.isfinite(model.log_evidence)]
    if len(models) < 2:
        return None
    return _sharing_fact(models, tested, separate=bool(names))


@dataclass(frozen=True)
class _Model:
    """Which constants are separate, and the evidence of that."""

    separate: frozenset[str]
    log_evidence: float

    def words(self, tested: Sequence[str]) -> str:
        shared = " and ".join(f"one {name}" for name in tested if name not in self.separate)
        own = " and ".join(name for name in tested if name in self.separate)
        parts = ([f"{shared} for all series"] if shared else []) + ([f"separate {own}"] if own else [])
        return " with ".join(parts)


def _with_separate(problem: Problem, separate: frozenset[str]) -> Problem:
    """The same question with these constants separate, and the unknown noises with them."""
    noise = replace(problem.noise, separate=bool(separate))
    return problem.with_noise(noise).with_parameters(
        replace(p, separate=p.name in separate) for p in problem.parameters
    )


def _sharing_fact(models: list[_Model], tested: list[str], *, separate: bool) -> Fact:
    now, others = models[0], models[1:]
    rival = max(others, key=lambda model: model.log_evidence)
    better, worse = (rival, now) if rival.log_evidence > now.log_evidence else (now, rival)
    gain = better.log_evidence - worse.log_evidence
    decided = gain >= math.log(INDIFFERENT)
    figures = {
        "tested": tested,
        "direction": "separate" if separate else "shared",
        "models": [
            {
                "separate": sorted(model.separate),
                "log_evidence": model.log_evidence,
                "log_bayes_factor": model.log_evidence - now.log_evidence,
            }
            for model in models
        ],
        "preferred": sorted(better.separate) if decided else None,
    }
    refuted = separate and better is rival and gain > math.log(DECIDED)
    first, second = better.words(tested), worse.words(tested)
    if not decided:
        says = f"the data have no preference between {now.words(tested)} and {rival.words(tested)}"
        return Fact(True, f"{says} ({_factor(gain)})", figures, FACTS["sharing"])
    says = f"the data favour {first} over {second} by {_factor(gain)}"
    if refuted:
        says += ": " + " ".join(f"--separate {name}" for name in tested if name in better.separate)
    return Fact(not refuted, says, figures, FACTS["sharing"])


def _factor(log_factor: float) -> str:
    """A factor as one says it."""
    if log_factor > math.log(_READABLE):
        return f"a factor e^{log_factor:.0f}"
    factor = math.exp(log_factor)
    return f"a factor {factor:.0f}" if factor >= 10.0 else f"a factor {factor:.2g}"


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
    whole, drop = ComparedFit.of(problem, found), 0.0
    for each in taken:
        wider = problem.with_parameters([_free(each)])
        k = len(problem.series) if each.separate else 1
        p = score_test(problem, wider, found, k)
        if p is not None and p >= WORTH_A_FIT:
            continue
        fitted = fitted_test(problem, wider, found, k)
        if fitted is not None and len(taken) * fitted[1] < REFUTED:
            bound = _bound(each, problem, found.optimum.theta)
            drop = max(drop, whole.likelihood - ComparedFit(wider, fitted[0], whole.misfit).likelihood)
            contradicted[each.name] = (
                len(taken) * fitted[1],
                _known_words(each, wider, *fitted, len(taken), bound),
            )
    if not contradicted:
        return None
    figures = {"p": {name: p for name, (p, _) in contradicted.items()}, "drop": drop}
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


def _known_words(
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
