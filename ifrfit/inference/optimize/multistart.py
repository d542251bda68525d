"""Search from many starts, for problems that no certified road covers. What it finds is not proven."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.batched_search import BatchedSearch
from ifrfit.inference.optimize.optimum import Array, Optimum
from ifrfit.inference.optimize.piecewise import NEAR

_TRANSITIONS = 9
_REFINED = 32  # starts that are followed down to their minimum


def multistart(problem: Problem, sigma: Array, near: Array | None = None) -> Optimum:
    """Bounded local least squares from the best of a grid of constants and transitions.

    With `near` only that start is followed: a profile moves along from one optimum to the next.
    """
    free = problem.parameters.free
    search = BatchedSearch.of(problem, sigma)
    no_noise = np.empty(0)
    chosen = search.lowest(starts(problem) if near is None else [near], no_noise, _REFINED)
    if not free.any():
        value, _ = search.objective(chosen, no_noise)
        return Optimum(
            chosen[0], float(value[0]), 0.0, ((float(value[0]), chosen[0]),), "all constants fixed"
        )
    ends = search.run(chosen, no_noise)
    order = np.argsort(ends.value, kind="stable")
    polished = search.polish(ends.take(order[:1]), no_noise)
    found = [(float(ends.value[i]), ends.theta[i]) for i in order]
    found[0] = float(polished.value[0]), polished.theta[0]
    method = f"best of {1 if near is not None else len(starts(problem))} starts"
    minima = distinct(problem, sigma, found)
    return Optimum(found[0][1], found[0][0], None, minima, method, is_local=near is not None)


def best_start(problem: Problem, sigma: Array) -> Array:
    """The lowest of the places that a search begins from."""
    return np.asarray(BatchedSearch.of(problem, sigma).lowest(starts(problem), np.empty(0), 1)[0])


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


def distinct(
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
