"""Impacts of two kinds in one table, as of two balls that no column tells apart: a mixture of two laws."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.change_points import Run, best_runs, run_of_largest_sum
from ifrfit.inference.diagnostics.linear_mixture import (
    Linearised,
    LinearKinds,
    Start,
    confirmed_by_more,
    linear_kinds,
)
from ifrfit.inference.diagnostics.residuals import exclude_name
from ifrfit.inference.diagnostics.slips.nuisances import is_in_order
from ifrfit.inference.diagnostics.slips.refit import Misfit
from ifrfit.inference.diagnostics.thresholds import ALIKE, BESIDE, FACTS, REFUTED, TELLING
from ifrfit.inference.diagnostics.unimodal_errors import drop_of_unimodal_errors
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.noise_modes import likely_sigma
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text

_FEWEST = 10  # impacts below which no two kinds are looked for
_MOST = 20_000  # beyond, it would take more than seconds
_WAYS = 2  # in which two kinds are looked for: in any order, and in a run
_WORTH_A_TRY = 6.0  # fall of the linear law from which a mixture of two laws is fitted
_SUSPECT = 2.0  # standard deviations of overdispersion along a constant that are suspicious
_FLAT = 2.2  # fourth moment over the square of the second below which scatter is flatter than normal (3)
_STRONG = 0.1  # share of the strongest impact's information from which an impact tells of a constant
_SHARE = 0.07  # of the impacts that are at least of either kind
_LEAST = 3  # impacts of either kind
_ROUNDING = 0.3  # of an impact, in sums of probabilities
_FACTORS = np.array([0.65, 0.8, 1.0, 1.25, 1.5])  # of mu, from which two kinds start
_HINT = 3.0  # fall of the linear law by two kinds from which they show where a run may be
_RUNS = 2  # of which the law itself is asked
_ROUNDS = 4  # in which a run finds its ends
_STEPS = 30
_PARTS = (1.0, 0.5, 0.25, 0.125)  # of a step, of which the first is taken that leads no further away
_AT_REST = 1e-3  # fall of -2 log likelihood below which the search ends
_SPREADS = 25  # of a constant, at which the likelihood of its scatter is compared at a time
_LOOSE = 1e-6
_LISTED = 6  # impacts of the second kind whose lines are named


@dataclass(frozen=True)
class _Kinds:
    """Two kinds that were fitted: constants of both, and the probability of the second one by impact."""

    name: str
    first: Array
    second: Array
    of_second: Array
    drop: float
    proven: str = ""  # over what, in words
    of_run: float = 0.0  # fall with the impact that speaks most, where those of the second kind are a run


def mixture(problem: Problem, fit: LeastSquaresFit, places: Sequence[int] | None = None) -> Fact | None:
    """Look for two kinds of impacts that differ in one constant.

    Impacts of two kinds in any order are looked for by a mixture of two laws, first linear in the constants.
    It counts where -2 log likelihood falls by `TELLING` without the impact that speaks most, as far as the
    constants leave degrees of freedom, and by `ALIKE` more than for a constant that scatters normally, which
    is how errors look that grow where it acts, and than for skewed or heavy-tailed errors of one hump. In a
    table whose order is that of the readings a run of impacts of a kind of its own is looked for, too.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    places : sequence of int, optional
        In theta, of the constants that are looked at; by default of all free ones.

    Returns
    -------
    Fact or None
        None where one kind suffices.
    """
    count = int(problem.rows.impacts.max(initial=-1)) + 1
    if not _FEWEST <= count <= _MOST or not problem.error_model.is_plain:
        return None
    linear = Linearised.of(problem, fit.optimum.theta)
    free = np.flatnonzero(problem.parameters.free)
    asked = free if places is None else np.asarray(places, dtype=np.intp)
    columns = np.flatnonzero(np.isin(free, asked) & (linear.slopes**2).any(axis=0))
    if not columns.size:
        return None
    thinned = linear.thinned()
    kinds = linear_kinds(thinned, columns, _of_unlike_mu(problem, thinned))
    kinds = confirmed_by_more(problem, linear, kinds, _HINT)
    mixed = _mixed_kinds(problem, fit, linear, kinds)
    runs = [] if is_in_order(problem) else best_runs(linear, columns)
    run = _kind_in_a_run(problem, fit, linear, runs, kinds)
    # a run is one of many, where a mixture has had its choice of each impact
    if run is not None and (mixed is None or run.drop - 2.0 * math.log(runs[0].looks) > mixed.drop):
        return _fact(problem, run)
    return None if mixed is None else _fact(problem, mixed)


def _fact(problem: Problem, found: _Kinds) -> Fact:
    place = problem.parameters.names.index(found.name)
    values = float(found.first[place]), float(found.second[place])
    own = np.flatnonzero(found.of_second > 0.5).tolist()
    many, count = len(own), found.of_second.size
    where = f"for {many}"
    if found.of_run > 0.0:
        where = f"for the {many} from {_line(problem, own[0])} to {_line(problem, own[-1])}"
    elif many <= _LISTED:
        where = f"for {many} ({', '.join(_line(problem, one) for one in own)})"
    says = (
        f"the table looks as if it held impacts of two kinds: {found.name} {values[0]:.3g} for some "
        f"{count - many} of them and {values[1]:.3g} {where} (-2 log likelihood falls by "
        f"{found.drop:.3g}{found.proven}): tell balls, walls or days apart in a column series, and try "
        f"--separate {quantity_of(found.name)}"
    )
    figures = {"constant": found.name, "values": list(values), "drop": found.drop, "of_second": many}
    figures["rows"] = [_line(problem, one) for one in own]
    figures["run"] = found.of_run > 0.0
    return Fact(False, says, figures, FACTS["mixture"])


def _line(problem: Problem, impact: int) -> str:
    """The line of the table that an impact stands in, with its file where there are several."""
    return exclude_name(problem, int(np.flatnonzero(problem.rows.impacts == impact)[0]))


def _of_dof(problem: Problem, more: int) -> float:
    """Share of a fall of -2 log likelihood that counts, where unknown noises are fitted to few rows."""
    if problem.noise.is_known:
        return 1.0
    rows = len(problem.rows)
    return max(rows - int(problem.parameters.free.sum()) - more, 0) / rows


def _of_unlike_mu(problem: Problem, linear: Linearised) -> list[Start]:
    """Two kinds of unlike mu to start from: where impacts slide changes with it, which no slope tells."""
    names = problem.parameters.names
    own = [i for i, place in enumerate(linear.free.tolist()) if quantity_of(names[place]) == "mu"]
    still, found = np.zeros(linear.free.size + 1), []
    for column in own:
        thetas = np.repeat(linear.theta[None], len(_FACTORS), axis=0)
        thetas[:, linear.free[column]] *= _FACTORS
        every = linear.about(problem, thetas)
        for i, j in itertools.combinations(range(len(every)), 2):
            found.append(Start(column, every[i], every[j], still, 0.5))
    return found


def _mixed_kinds(
    problem: Problem, fit: LeastSquaresFit, linear: Linearised, found: Sequence[LinearKinds]
) -> _Kinds | None:
    """Two kinds in any order that explain more than scatter of one kind does."""
    share = _of_dof(problem, 2)
    fitted = (_fitted(problem, fit, linear, one) for one in found if one.drop > _WORTH_A_TRY)
    best = max((one for one in fitted if one is not None), key=lambda one: one.drop, default=None)
    if best is None or share * best.drop < TELLING:
        return None
    free = np.flatnonzero(problem.parameters.free).tolist()
    place = problem.parameters.names.index(best.name)
    along = np.empty(len(problem.rows))
    residual = np.empty_like(along)
    along[linear.rows], residual[linear.rows] = linear.slopes[:, free.index(place)], linear.residual
    spread = abs(float(best.second[place] - best.first[place]))
    if best.drop < _drop_of_normal(problem, along, residual, spread) + ALIKE:
        return None
    more = best.drop - drop_of_unimodal_errors(problem, linear)
    proven = f", {more:.3g} more than for errors of one hump, skewed or with tails"
    return replace(best, proven=proven) if more >= ALIKE else None


def _kind_in_a_run(
    problem: Problem,
    fit: LeastSquaresFit,
    linear: Linearised,
    runs: Sequence[Run],
    kinds: Sequence[LinearKinds],
) -> _Kinds | None:
    """A run of impacts that has a constant of its own; p times the number of runs and constants."""
    if not runs:
        return None
    looks = _WAYS * runs[0].looks
    likely = {(run.first, run.last) for run in runs[:_RUNS] if run.looks * special.chdtrc(1, run.chi2) < 1.0}
    likely |= {_run_of(problem, fit, linear, one) for one in kinds if one.drop > _HINT}
    before = _log_likelihood(problem, fit.optimum.theta)
    best: _Kinds | None = None
    # of another constant than that whose slopes show it, too: one mu in the place of two moves the others
    for ends, run in itertools.product(sorted(likely), runs):
        found = _grown(problem, fit, int(linear.free[run.column]), ends, before)
        if best is None or found.drop > best.drop:
            best = found
    if best is None:
        return None
    p, p_rest = looks * special.chdtrc(1, _of_dof(problem, 1) * np.maximum([best.of_run, best.drop], 0.0))
    proven = f", p = {p_text(float(p))} of the best of {runs[0].looks} runs and constants"
    return replace(best, proven=proven) if p < REFUTED and p_rest < BESIDE else None


def _run_of(
    problem: Problem, fit: LeastSquaresFit, linear: Linearised, kinds: LinearKinds
) -> tuple[int, int]:
    """The run of impacts that is most of the second of two kinds."""
    both = np.stack((fit.optimum.theta, fit.optimum.theta))
    both[:, linear.free] = kinds.first, kinds.second
    square = problem.residual(both) ** 2
    return run_of_largest_sum(_by_impact(problem, (square[0] - square[1]) / fit.sigma**2))


def _grown(
    problem: Problem, fit: LeastSquaresFit, place: int, ends: tuple[int, int], before: Array
) -> _Kinds:
    """The best of runs with a constant of their own, from one on, each that of the constants before it."""
    found: list[_Kinds] = []
    for _ in range(_ROUNDS):
        of_second = np.zeros(before.size)
        of_second[slice(*ends)] = 1.0
        first, second, total, sides = _of_known_kinds(problem, fit, place, of_second)
        gain = 2.0 * (total - before)
        name, fall = problem.parameters.names[place], float(gain.sum())
        drop = fall - float(gain.max())
        found.append(_Kinds(name, first, second, of_second, drop, of_run=fall))
        again = run_of_largest_sum(sides)
        if again == ends:
            break
        ends = again
    return max(found, key=lambda one: one.drop)


def suspicious_constants(problem: Problem, jacobian: Array, residual: Array) -> list[int]:
    """Places in theta of constants along which residuals scatter so that two kinds are looked for.

    Parameters
    ----------
    problem : Problem
    jacobian : ndarray, (n, k)
        By the free constants, in units of the noise.
    residual : ndarray, (n,)
        Likewise.
    """
    places = np.flatnonzero(problem.parameters.free).tolist()
    pairs = zip(places, jacobian.T, strict=True)
    return [place for place, along in pairs if _spread(problem, along, residual) is not None]


def drop_of_scattering_constant(problem: Problem, jacobian: Array, residual: Array) -> float:
    """Fall of -2 log likelihood with the one constant that explains most scattering from impact to impact.

    Arguments as `suspicious_constants`.
    """
    found = [0.0]
    for along in jacobian.T:
        strength = _by_impact(problem, along**2)
        if strength.max(initial=0.0) > 0.0:
            spread = float(np.sqrt((residual**2).sum() / strength.sum()))
            found.append(_drop_of_normal(problem, along, residual, spread))
    return max(found)


def _by_impact(problem: Problem, of_rows: Array) -> Array:
    return np.bincount(problem.rows.impacts, of_rows).astype(float)


def _spread(problem: Problem, along: Array, residual: Array) -> float | None:
    """Scatter of a constant from impact to impact; None where nothing speaks for two kinds.

    Two things do: more scatter where the constant acts more, and scatter that is flatter than normal.
    """
    strength = _by_impact(problem, along**2)
    product = _by_impact(problem, along * residual)
    strong = strength > _STRONG * strength.max(initial=0.0)
    if strong.sum() < _FEWEST // 2:
        return None
    weight = strength / strength.max()
    # chi2 of one degree of freedom each, where the constant acts; the others are the yardstick
    count = _by_impact(problem, np.ones(residual.size))
    rest = _by_impact(problem, residual**2) - np.where(
        strong, product**2 / np.where(strong, strength, 1.0), 0.0
    )
    square = np.where(strong, product**2 / np.where(strong, strength, 1.0), rest / count)
    lean = weight - (0.0 if problem.noise.is_known else weight.mean())
    excess = float(lean @ (square - 1.0))
    size = math.sqrt(2.0 * float(lean @ lean))
    shift = product[strong] / strength[strong]
    shift = shift - np.average(shift, weights=strength[strong])
    variance = float((shift**2).mean())
    flat = float((shift**4).mean()) / variance**2 < _FLAT if variance > 0.0 else False
    if not flat and not excess > _SUSPECT * max(size, _LOOSE):
        return None
    return math.sqrt(max(variance, 1e-12))


def _drop_of_normal(problem: Problem, along: Array, residual: Array, spread: float) -> float:
    """Fall of -2 log likelihood with a constant that scatters normally from impact to impact."""
    strength, product = _by_impact(problem, along**2), _by_impact(problem, along * residual)
    total, n = float(residual @ residual), residual.size

    def minus(log_spread: float) -> float:
        # residuals of an impact have covariance s^2 (1 + t^2 g g'), whose inverse is known in closed form
        t2 = math.exp(2.0 * log_spread)
        square = total - float((t2 * product**2 / (1.0 + t2 * strength)).sum())
        logs = float(np.log1p(t2 * strength).sum())
        return logs + (square if problem.noise.is_known else n * math.log(square / n) + n)

    places = math.log(spread) + np.linspace(-4.0, 3.0, _SPREADS)
    for _ in range(2):  # the second time between the neighbours of the best
        values = [minus(place) for place in places.tolist()]
        best = int(np.argmin(values))
        places = np.linspace(places[max(best - 1, 0)], places[min(best + 1, _SPREADS - 1)], _SPREADS)
    without = total if problem.noise.is_known else n * math.log(total / n) + n
    return max(without - min(values), 0.0)


def _fitted(problem: Problem, fit: LeastSquaresFit, linear: Linearised, start: LinearKinds) -> _Kinds | None:
    """The best mixture of two kinds that differ in one constant, from that of the linear law."""
    place, both = int(linear.free[start.column]), np.stack((fit.optimum.theta, fit.optimum.theta))
    both[:, linear.free] = start.first, start.second
    first, second = np.clip(both, *problem.parameters.bounds())
    sigma = likely_sigma(problem, fit.optimum.theta)
    for rows, noise in zip(problem.noise_groups().values(), start.noises, strict=True):
        sigma[rows] *= noise
    found = [_search(problem, place, first, second, start.share, sigma)]
    if start.about[0] is not start.about[1]:  # where the law bends, its slopes may have led astray
        found.append(_search(problem, place, *start.about, start.share, sigma))
    total, first, second, of_second = max(found, key=lambda one: float(one[0].sum()))
    count = of_second.size
    few = min(float(of_second.sum()), count - float(of_second.sum()))
    if few + _ROUNDING < max(_LEAST, _SHARE * count):
        return None
    if of_second.sum() > 0.5 * count:
        first, second, of_second = second, first, 1.0 - of_second
    gain = 2.0 * (total - _log_likelihood(problem, fit.optimum.theta))
    drop = float(gain.sum() - gain.max())
    return _Kinds(problem.parameters.names[place], first, second, of_second, drop)


def _log_likelihood(problem: Problem, theta: Array) -> Array:
    """Of each impact of one kind, (impacts,), but for a constant."""
    sigma = likely_sigma(problem, theta)
    return _by_impact(problem, -0.5 * (problem.residual(theta) / sigma) ** 2 - np.log(sigma))


def _mixed(
    problem: Problem, first: Array, second: Array, share: float, sigma: Array
) -> tuple[Array, Array, Array]:
    """Log likelihood of each impact under the mixture, the probability of the second kind, and sigma."""
    left, misfit = problem.residual(np.stack((first, second))), Misfit.of(problem)
    for _ in range(3 if misfit.groups else 1):  # noises at their best for these kinds
        each = -0.5 * (left / sigma) ** 2 - np.log(sigma)
        logs = np.stack([_by_impact(problem, one) for one in each])
        logs = logs + np.log([[1.0 - share], [share]])
        total = np.logaddexp(logs[0], logs[1])
        of_second = np.exp(logs[1] - total)
        weight = of_second[problem.rows.impacts]
        square = (1.0 - weight) * left[0] ** 2 + weight * left[1] ** 2
        sigma = misfit.sigma(np.sqrt(square))
    return total, of_second, sigma


def _search(
    problem: Problem, place: int, first: Array, second: Array, share: float, sigma: Array
) -> tuple[Array, Array, Array, Array]:
    """Log likelihood of each impact, both kinds, and the probability of the second one.

    Expectation and maximisation, by one step of Gauss and Newton each.
    """
    total, of_second, sigma = _mixed(problem, first, second, share, sigma)
    for _ in range(_STEPS):
        whole = _moved(problem, place, first, second, of_second, sigma)
        share = float(np.clip(of_second.mean(), 1e-3, 1.0 - 1e-3))
        for part in _PARTS:
            moved = first + part * (whole[0] - first), second + part * (whole[1] - second)
            after, other, noise = _mixed(problem, *moved, share, sigma)
            gained = 2.0 * float(after.sum() - total.sum())
            if gained >= 0.0:
                break
        if gained < _AT_REST:
            break
        (first, second), total, of_second, sigma = moved, after, other, noise
    return total, first, second, of_second


def _moved(
    problem: Problem, place: int, first: Array, second: Array, of_second: Array, sigma: Array
) -> tuple[Array, Array]:
    """Constants of both kinds after a step of Gauss and Newton, by the probability of the second kind."""
    lower, upper = problem.parameters.bounds()
    free = np.flatnonzero(problem.parameters.free)
    others = free[free != place]
    weight = of_second[problem.rows.impacts]
    blocks, left = [], []
    for theta, w, column in ((first, 1.0 - weight, 0), (second, weight, 1)):
        root = np.sqrt(w) / sigma
        jacobian = problem.jacobian(theta) * root[:, None]
        own = np.zeros((len(root), others.size + 2))
        own[:, :-2] = jacobian[:, others]
        own[:, -2 + column] = jacobian[:, place]
        blocks.append(own)
        left.append(problem.residual(theta) * root)
    step = np.linalg.lstsq(np.concatenate(blocks), np.concatenate(left), rcond=_LOOSE)[0]
    moved = first.copy(), second.copy()
    for theta, column in zip(moved, (-2, -1), strict=True):
        theta[others] += step[:-2]
        theta[place] += step[column]
        np.clip(theta, lower, upper, out=theta)
    return moved


def _of_known_kinds(
    problem: Problem, fit: LeastSquaresFit, place: int, of_second: Array
) -> tuple[Array, Array, Array, Array]:
    """Constants of both kinds, where it is known which impact is of which.

    Besides, the log likelihood of each impact, and by how much that of the second kind is larger.
    """
    misfit, own = Misfit.of(problem), of_second[problem.rows.impacts] > 0.5
    first = second = fit.optimum.theta
    best = math.inf, first, second, np.empty(0), np.empty(0)
    for _ in range(_STEPS):
        of_first, of_other = problem.residual(np.stack((first, second)))
        left: Array = np.where(own, of_other, of_first)
        sigma = misfit.sigma(left)
        total = _by_impact(problem, -0.5 * (left / sigma) ** 2 - np.log(sigma))
        now = -2.0 * float(total.sum())
        if not best[0] - now >= _AT_REST:
            break
        sides = _by_impact(problem, 0.5 * (of_first**2 - of_other**2) / sigma**2)
        best = now, first, second, total, sides
        first, second = _moved(problem, place, first, second, of_second, sigma)
    return best[1:]
