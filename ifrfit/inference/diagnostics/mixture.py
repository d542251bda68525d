"""Impacts of two kinds in one table, as of two balls that no column tells apart: a mixture of two laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.diagnostics.slips.refit import Misfit
from ifrfit.inference.diagnostics.thresholds import ALIKE, DECISIVE, FACTS
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.noise_modes import likely_sigma
from ifrfit.inference.result.types import Fact

_FEWEST = 12  # impacts below which no two kinds are looked for
_MOST = 20_000  # beyond, it would take more than seconds
_SUSPECT = 2.0  # standard deviations of overdispersion along a constant from which a mixture is fitted
_FLAT = 2.2  # fourth moment over the square of the second below which scatter is flatter than normal (3)
_STRONG = 0.1  # share of the strongest impact's information from which an impact tells of a constant
_SHARE = 0.1  # of the impacts that are at least of either kind
_LEAST = 3  # impacts of either kind
_STARTS = (0.7, 1.4)  # differences of the kinds, in the scatter of the constant from impact to impact
_STEPS = 30
_AT_REST = 1e-3  # fall of -2 log likelihood below which the search ends
_SPREADS = 25  # of a constant, at which the likelihood of its scatter is compared at a time
_LOOSE = 1e-6


@dataclass(frozen=True)
class _Kinds:
    """A mixture that was fitted: constants of both kinds, and the probability of the second one by impact."""

    name: str
    first: Array
    second: Array
    second_share: Array
    drop: float


def mixture(problem: Problem, fit: LeastSquaresFit, places: Sequence[int] | None = None) -> Fact | None:
    """Look for two kinds of impacts that differ in one constant.

    For each constant the scatter of residuals along it is held against the rest (a score test of a constant
    that varies from impact to impact); where it is suspicious, a mixture of two laws is fitted. It counts
    where -2 log likelihood falls by more than `DECISIVE` without the impact that speaks most, and by `ALIKE`
    more than for a constant that scatters normally, which is how errors look that grow where it acts.

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
    sigma = likely_sigma(problem, fit.optimum.theta)
    jacobian = problem.jacobian(fit.optimum.theta) / sigma[:, None]
    residual = problem.residual(fit.optimum.theta) / sigma
    best: _Kinds | None = None
    for place in np.flatnonzero(problem.parameters.free).tolist() if places is None else places:
        spread = _spread(problem, jacobian[:, place], residual)
        if spread is None:
            continue
        found = _fitted(problem, fit, place, spread)
        if found is None or found.drop < max(DECISIVE, best.drop if best else 0.0):
            continue
        if found.drop >= _drop_of_normal(problem, jacobian[:, place], residual, spread) + ALIKE:
            best = found
    if best is None:
        return None
    place = problem.parameters.names.index(best.name)
    values = float(best.first[place]), float(best.second[place])
    many = int(np.round(best.second_share.sum()))
    says = (
        f"the table looks as if it held impacts of two kinds: {best.name} {values[0]:.3g} for some "
        f"{count - many} of them and {values[1]:.3g} for {many} (-2 log likelihood falls by "
        f"{best.drop:.3g}): tell balls, walls or days apart in a column series, and try "
        f"--separate {quantity_of(best.name)}"
    )
    figures = {"constant": best.name, "values": list(values), "drop": best.drop, "of_second": many}
    return Fact(False, says, figures, FACTS["mixture"])


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


def _fitted(problem: Problem, fit: LeastSquaresFit, place: int, spread: float) -> _Kinds | None:
    """The best mixture of two kinds that differ in one constant."""
    lower, upper = (ends[place] for ends in problem.parameters.bounds())
    value = float(fit.optimum.theta[place])
    best: tuple[float, Array, Array, Array] | None = None
    for size in _STARTS:
        for share in (0.5, 0.25):
            for sign in (1.0, -1.0):
                first, second = fit.optimum.theta.copy(), fit.optimum.theta.copy()
                first[place] = np.clip(value - sign * 2.0 * share * size * spread, lower, upper)
                second[place] = np.clip(value + sign * 2.0 * (1.0 - share) * size * spread, lower, upper)
                found = _search(problem, fit, place, first, second, share)
                if best is None or found[0] < best[0]:
                    best = found
    if best is None:
        return None
    _, first, second, of_second = best
    count = of_second.size
    few = min(float(of_second.sum()), count - float(of_second.sum()))
    if few < max(_LEAST, _SHARE * count):
        return None
    sigma = likely_sigma(problem, fit.optimum.theta)
    before = _by_impact(problem, -0.5 * (problem.residual(fit.optimum.theta) / sigma) ** 2 - np.log(sigma))
    after, *_ = _mixed(problem, first, second, float(of_second.mean()), fit.sigma)
    gain = 2.0 * (after - before)
    drop = float(gain.sum() - gain.max())
    return _Kinds(problem.parameters.names[place], first, second, of_second, drop)


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
    problem: Problem, fit: LeastSquaresFit, place: int, first: Array, second: Array, share: float
) -> tuple[float, Array, Array, Array]:
    """Expectation and maximisation, by one step of Gauss and Newton each."""
    lower, upper = problem.parameters.bounds()
    free = np.flatnonzero(problem.parameters.free)
    others = free[free != place]
    total, of_second, sigma = _mixed(problem, first, second, share, fit.sigma)
    now = -2.0 * float(total.sum())
    for _ in range(_STEPS):
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
        share = float(np.clip(of_second.mean(), 1e-3, 1.0 - 1e-3))
        total, of_second, sigma = _mixed(problem, *moved, share, sigma)
        after = -2.0 * float(total.sum())
        if now - after < _AT_REST:
            break
        first, second, now = *moved, after
    return now, first, second, of_second
