"""Least squares where constants are tied to one another: from many starts, without a certificate."""

from __future__ import annotations

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.multistart import distinct, starts
from ifrfit.inference.optimize.optimum import Array, Optimum, objective_at

TIED = "constants tied"  # how the method of such an optimum ends
_FOLLOWED = 12  # of the best starts
_OUTSIDE = 1e3  # per unit of the domain's width: residual of a tied constant beyond its domain
_LARGEST = 1e12  # residual, whose square a sum still holds beside others
_STEPS = 30  # of the noise, until the search from its mode takes over


def tied_search(problem: Problem, sigma: Array, near: Array | None = None) -> Optimum:
    """Bounded local least squares over the free entries of theta from the best of many starts.

    Parameters
    ----------
    problem : Problem
    sigma : ndarray, (n,)
    near : ndarray, (p,), optional
        theta of a neighbouring problem: the only start then.

    Raises
    ------
    UsageError
        Where no constants within the domain obey the ties.
    """
    from scipy import optimize  # no other fit needs it

    parameters = problem.parameters
    places = np.array(starts(problem) if near is None else [near])
    theta = parameters.theta(places[:, parameters.free])
    theta = theta[np.isfinite(theta).all(axis=1)]
    if not theta.size:
        raise UsageError(f"{_said(problem)}: has no value anywhere in the domain. Mend the expression.")
    residual = _Residual(problem, sigma)
    value = np.array([float(np.sum(np.square(residual(own[parameters.free])))) for own in theta])
    found: list[tuple[float, Array]] = []
    low, high = (ends[parameters.free] for ends in parameters.bounds())
    width = _widths(problem)[parameters.free]
    for place in np.argsort(value, kind="stable")[:_FOLLOWED]:
        start = np.clip(theta[place][parameters.free], low, high)
        if not start.size:  # every constant is fixed or follows from such
            found.append((float(value[place]), theta[place]))
            break
        ended = optimize.least_squares(
            residual, start, bounds=(low, high), x_scale=width, xtol=1e-14, ftol=1e-14, gtol=1e-12
        )
        at = parameters.theta(ended.x[None])[0]
        if np.isfinite(at).all():
            found.append((float(2.0 * ended.cost), at))
    found.sort(key=lambda pair: pair[0])
    if found and width.size:
        found.insert(0, _polished(problem, residual, found[0][1]))
    kept = [
        (objective_at(problem, sigma, at), at)
        for at in (_drawn_in(problem, each) for _, each in found)
        if parameters.ties_inside(at[None])[0]
    ]
    kept.sort(key=lambda pair: pair[0])
    if not kept:
        raise UsageError(
            f"{_said(problem)}: leads out of the domain wherever the data are described. Widen it "
            "with --bounds, or mend the expression."
        )
    method = f"best of {len(starts(problem))} starts, {TIED}"
    return Optimum(
        kept[0][1], kept[0][0], None, distinct(problem, sigma, kept), method, is_local=near is not None
    )


def searched_sigma(problem: Problem) -> Array:
    """Sigma of each row at the mode of the likelihood over constants and unknown noises, by a search."""
    groups, base = problem.noise_groups(), problem.noise.base
    sigma = base.copy()
    for rows in groups.values():
        sigma[rows] = base[rows] * max(float(np.std(problem.rows.value[rows] / base[rows])), 1e-6)
    theta: Array | None = None
    for _ in range(_STEPS):
        theta = tied_search(problem, sigma, theta).theta
        residual = problem.residual(theta) / base
        new = sigma.copy()
        for rows in groups.values():
            new[rows] = base[rows] * max(float(np.sqrt(np.mean(residual[rows] ** 2))), 1e-12)
        change = float(np.abs(np.log(new / sigma)).max())
        sigma = new
        if change < 1e-6:
            break
    return sigma


def _polished(problem: Problem, residual: _Residual, theta: Array) -> tuple[float, Array]:
    """The same minimum without derivatives, which kinks of the transition mislead by some 1e-3 sd."""
    from scipy import optimize

    parameters = problem.parameters

    def objective(free: Array) -> float:
        return float(np.sum(np.square(residual(free))))

    start = theta[parameters.free]
    low, high = (ends[parameters.free] for ends in parameters.bounds())
    steps = 1e-4 * _widths(problem)[parameters.free]
    simplex = np.clip(start + steps * np.eye(start.size + 1, start.size, -1), low, high)
    ended = optimize.minimize(
        objective,
        start,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={"initial_simplex": simplex, "xatol": 1e-10, "fatol": 1e-10, "maxfev": 2000},
    )
    before = objective(start)
    if not ended.fun < before:
        return before, theta
    return float(ended.fun), parameters.theta(np.asarray(ended.x)[None])[0]


class _Residual:
    """Standardised residuals of rows and priors, by the free entries, with walls for the tied ones."""

    def __init__(self, problem: Problem, sigma: Array) -> None:
        self._problem, self._sigma = problem, sigma

    def __call__(self, free: Array) -> Array:
        parameters = self._problem.parameters
        theta = parameters.theta(free[None])[0]
        tied = parameters.ties.tied
        low, high = parameters.bounds()
        inside = np.where(tied, np.clip(theta, low, high), theta)
        beyond = _OUTSIDE * (theta - inside)[tied] / _widths(self._problem)[tied]
        residual = self._problem.residual(inside) / self._sigma
        prior = parameters.prior_residuals(inside)
        each = np.concatenate((residual, prior, beyond))
        return np.asarray(np.clip(np.nan_to_num(each, nan=1e6), -_LARGEST, _LARGEST))


def _drawn_in(problem: Problem, theta: Array) -> Array:
    """theta with tied entries that lie beyond their domain by rounding alone on its end."""
    low, high = problem.parameters.bounds()
    near = 1e-6 * np.where(np.isfinite(high - low), high - low, 1.0)
    beyond = (theta < low) & (theta >= low - near) | (theta > high) & (theta <= high + near)
    return np.asarray(np.where(problem.parameters.ties.tied & beyond, np.clip(theta, low, high), theta))


def _widths(problem: Problem) -> Array:
    """Finite widths of the domains of all entries."""
    return np.array([each.domain.prior_upper - each.lower for each in problem.parameters.entries])


def _said(problem: Problem) -> str:
    name, text = next(iter(problem.parameters.ties.expressions.items()))
    return f"--tie '{name}={text}'"
