"""Search from many starts, for problems that no certified road covers. What it finds is not proven."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.optimum import Array, Optimum
from ifrfit.inference.optimize.piecewise import NEAR

_TRANSITIONS = 9
_REFINED = 8  # starts that are followed down to their minimum
_ROUGH, _FINE = 1e-8, 1e-14  # relative change of the sum, and of the constants, at which a search ends
_ROUGH_STEPS = 40


def multistart(problem: Problem, sigma: Array, near: Array | None = None) -> Optimum:
    """Bounded local least squares from the best of a grid of constants and transitions.

    With `near` only that start is followed: a profile moves along from one optimum to the next.
    """
    from scipy.optimize import least_squares

    free = problem.parameters.free
    lower, upper = problem.parameters.bounds()
    held = np.array([math.nan if c.fixed is None else c.fixed for c in problem.parameters.entries])

    def full(x: Array) -> Array:
        theta = held.copy()
        theta[free] = x
        return theta

    def residuals(x: Array) -> Array:
        theta = full(x)
        data = (problem.rows.value - problem.predict(theta)) / sigma
        return np.concatenate((data, problem.parameters.prior_residuals(theta)))

    def jacobian(x: Array) -> Array:
        data = -problem.jacobian(full(x)) / sigma[:, None]
        return np.concatenate((data, _prior_jacobian(problem)))[:, free]

    if not free.any():
        value = float((residuals(np.empty(0)) ** 2).sum())
        return Optimum(held, value, 0.0, ((value, held),), "all constants fixed")
    chosen = [near] if near is not None else starts(problem)
    chosen.sort(key=lambda theta: float((residuals(theta[free]) ** 2).sum()))

    def followed(start: Array, tolerance: float, steps: int | None = None) -> tuple[float, Array]:
        x0 = np.clip(start[free], lower[free] + 1e-9, np.minimum(upper[free], 1e9) - 1e-9)
        result = least_squares(
            residuals,
            x0,
            jacobian,
            bounds=(lower[free], upper[free]),
            xtol=tolerance,
            ftol=tolerance,
            gtol=tolerance,
            max_nfev=steps,
        )
        return float(2.0 * result.cost), full(result.x)

    if near is None:  # along a flat valley the last digits take hundreds of steps: the best place needs them
        found = [followed(start, _ROUGH, _ROUGH_STEPS) for start in chosen[:_REFINED]]
        found.sort(key=lambda pair: pair[0])
        found[0] = min(found[0], followed(found[0][1], _FINE), key=lambda pair: pair[0])
    else:
        found = [followed(near, _FINE)]
    best, theta = found[0]
    method = f"best of {len(chosen)} starts"
    minima = _distinct(problem, sigma, found)
    return Optimum(theta, best, None, minima, method, is_local=near is not None)


def best_start(problem: Problem, sigma: Array) -> Array:
    """The lowest of the places that a search begins from."""
    chosen = np.array(starts(problem))
    free = problem.parameters.free
    chosen[:, ~free] = np.array([0.0 if c.fixed is None else c.fixed for c in problem.parameters.entries])[
        ~free
    ]
    z = (problem.rows.value - problem.predict(chosen)) / sigma
    return np.asarray(chosen[int((z * z).sum(axis=1).argmin())])


def starts(problem: Problem) -> list[Array]:
    """Constants spread over the domain, with transitions spread over the data's own slip ratios."""
    # repeats of few angles would make most quantiles, and so most starts, the same
    tau = np.unique(problem.rows.tau[np.isfinite(problem.rows.tau) & (problem.rows.tau > 0.0)])
    quantiles = np.quantile(tau, np.linspace(0.05, 0.95, _TRANSITIONS)) if tau.size else np.array([0.3])
    law = problem.closure.law(problem.inertia_factor)
    spread = {c.name: _spread(c.lower, c.upper, c.fixed) for c in problem.parameters if c.name != "mu"}
    places = problem.parameters.positions
    out = []
    for values in itertools.product(*spread.values()):
        chosen = dict(zip(spread, values, strict=True))
        c = chosen.get(problem.closure.constant or "", 0.0)
        for tau_t in quantiles:
            theta = np.zeros(len(problem.parameters.names))
            for name, value in chosen.items():
                theta[places[name]] = value
            theta[places["mu"]] = max(float(law.bound(c)), 0.01) * tau_t / (1.0 + chosen["e_n"])
            out.append(theta)
    return out


def _spread(lower: float, upper: float, fixed: float | None) -> tuple[float, ...]:
    if fixed is not None:
        return (fixed,)
    width = (upper if math.isfinite(upper) else lower + 1.0) - lower
    return (lower + 0.1 * width, lower + 0.5 * width, lower + 0.9 * width)


def _prior_jacobian(problem: Problem) -> Array:
    entries = problem.parameters.entries
    rows = [(i, c.prior[1]) for i, c in enumerate(entries) if c.prior is not None]
    out = np.zeros((len(rows), len(entries)))
    for row, (i, sd) in enumerate(rows):
        out[row, i] = 1.0 / sd
    return out


def _distinct(
    problem: Problem, sigma: Array, found: list[tuple[float, Array]]
) -> tuple[tuple[float, Array], ...]:
    """Local minima at different places within `NEAR`; starts that stopped on the way to a better one too.

    Places whose rows have the same values are one: a valley along which the data do not tell the constants.
    """
    best = found[0][0]
    kept: list[tuple[float, Array]] = []
    values: list[Array] = []
    for value, theta in found:
        if value > best + NEAR or any(np.abs(theta - other).max() <= 1e-3 for _, other in kept):
            continue
        fitted = np.concatenate((problem.predict(theta) / sigma, problem.parameters.prior_residuals(theta)))
        if all(np.abs(fitted - other).max() > 1e-3 for other in values):
            kept.append((value, theta))
            values.append(fitted)
    return tuple(kept)
