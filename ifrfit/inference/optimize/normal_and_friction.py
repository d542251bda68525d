"""One set of constants where e_n is measured both directly and through friction.

For a given e_n every row is linear again, so the certified solver gives the best of everything else; what is
left is a search over e_n alone. Where the rows split into two groups that meet in one quantity, Lagrange's
dual proves the result: each side is minimised on its own, exactly, with the multiplier of the optimum, and
the sum is a lower bound over everything.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ifrfit.inference.model.parameters import Constant
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.linear_families import kappa_form, linear_form
from ifrfit.inference.optimize.parameter_group import GroupOptimum, ParameterGroup, restitution_sums
from ifrfit.inference.optimize.piecewise import PiecewiseOptimum
from ifrfit.inference.optimize.scalar_search import dips


def solve_coupled(block: ParameterGroup) -> GroupOptimum:
    """Optimum over e_n of the certified optima at given e_n, and the dual bound where there is one."""
    low, high = _range_of_e_n(block)

    def at(e_n: float) -> PiecewiseOptimum:
        return minimise(kappa_form(_held(block, e_n)).problem)

    def value(e_n: float) -> float:
        return at(e_n).chi2 + _prior(block, e_n)

    # over the outgoing velocity the scale is 1/e_n: small values need a closer look
    seeds = np.geomspace(low, high, 40).tolist() if block.of_scale("rebound").any() else []
    found = dips(lambda e_n: np.array([value(float(e)) for e in e_n]), low, high, seeds)
    objective = found[0][0]
    minima = tuple(
        (v, kappa_form(_held(block, e)).to_constants(at(e).t)) for v, e in found if v <= objective + 4.0
    )
    constants = minima[0][1]
    bound = _dual_bound(block, constants)
    gap = None if bound is None else max(0.0, objective - bound)
    return GroupOptimum(constants, objective, gap, minima, method="all partitions at each e_n")


def _range_of_e_n(block: ParameterGroup) -> tuple[float, float]:
    lower = block.e_n.lower
    if block.of_scale("rebound").any():
        lower = max(lower, 1e-3)  # tan_psi_out has no value at e_n = 0
    if math.isfinite(block.e_n.upper):
        return lower, block.e_n.upper
    return lower, max(1.0, 2.0 * lower)


def _held(block: ParameterGroup, e_n: float) -> ParameterGroup:
    return replace(block, e_n=replace(block.e_n, fixed=e_n, prior=None))


def _prior(block: ParameterGroup, e_n: float) -> float:
    return 0.0 if block.e_n.prior is None else ((e_n - block.e_n.prior[0]) / block.e_n.prior[1]) ** 2


def _dual_bound(block: ParameterGroup, constants: tuple[float, float, float]) -> float | None:
    """Lower bound over everything, where the rows split into two sides; None where they do not."""
    impulse, rebound = block.of_scale("impulse"), block.of_scale("rebound")
    weight, product, square = restitution_sums(block)
    plain = replace(block.e_n, prior=None)
    if not (impulse.any() or rebound.any()):
        return _friction_bound(replace(block, e_n=plain), constants, (weight, product, square))
    others = block.of_kind("tangential") & ~impulse
    if others.any() or block.c.prior is not None:
        return None
    return _impulse_bound(replace(block, e_n=plain), constants, (weight, product, square))


def _friction_bound(
    block: ParameterGroup, constants: tuple[float, float, float], normal: tuple[float, float, float]
) -> float | None:
    """Tangential rows know (c, kappa), the others (e_n, mu); they meet in kappa = mu (1 + e_n)."""
    e_n, _, mu = constants
    friction = block.of_kind("friction")
    w_mu = block.weight[friction]
    m = (float(w_mu @ w_mu), float((w_mu * w_mu) @ block.rows.value[friction]))
    m_square = float((w_mu * block.rows.value[friction]) @ (w_mu * block.rows.value[friction]))
    if block.mu.prior is not None:
        mean, sd = block.mu.prior
        m, m_square = (m[0] + sd**-2, m[1] + mean * sd**-2), m_square + (mean / sd) ** 2
    # stationarity in mu gives the multiplier: d/dmu (sum of squares of mu) = pull (1 + e_n)
    pull = 2.0 * (m[0] * mu - m[1]) / (1.0 + e_n)
    at = np.flatnonzero(block.of_kind("tangential"))
    free = Constant("mu", 0.0, math.inf)
    sliding = replace(
        block,
        rows=block.rows.take(at),
        weight=block.weight[at],
        e_n=replace(block.e_n, fixed=0.0, lower=0.0, prior=None),
        mu=free,
    )
    form = kappa_form(sliding)
    first = minimise(replace(form.problem, linear=pull * form.problem.kappa))
    second = _bilinear_minimum(block, normal, (*m, m_square), pull)
    if second is None or first.gap > 0.0:
        return None
    return first.chi2 + second


def _bilinear_minimum(
    block: ParameterGroup,
    normal: tuple[float, float, float],
    friction: tuple[float, float, float],
    pull: float,
) -> float | None:
    """Least value of N(e_n) + M(mu) - pull mu (1 + e_n) over the domain, where it is convex."""
    (a, b, s), (p, q, r) = normal, friction
    if not 4.0 * a * p > pull * pull:
        return None

    def value(e: float, m: float) -> float:
        return a * e * e - 2 * b * e + s + p * m * m - 2 * q * m + r - pull * m * (1.0 + e)

    lo_e, hi_e = block.e_n.lower, block.e_n.upper
    lo_m, hi_m = block.mu.lower, block.mu.upper
    if block.mu.fixed is not None:
        lo_m = hi_m = block.mu.fixed
    e = (2 * b + pull * (2 * q + pull) / (2 * p)) / (2 * a - pull * pull / (2 * p))
    m = (2 * q + pull * (1 + e)) / (2 * p)
    if lo_e <= e <= hi_e and lo_m <= m <= hi_m:
        return value(e, m)
    edges = []
    for edge in (lo_e, hi_e):
        if math.isfinite(edge):
            edges.append(value(edge, min(max((2 * q + pull * (1 + edge)) / (2 * p), lo_m), hi_m)))
    for edge in (lo_m, hi_m):
        if math.isfinite(edge):
            edges.append(value(min(max((2 * b + pull * edge) / (2 * a), lo_e), hi_e), edge))
    return min(edges)


def _impulse_bound(
    block: ParameterGroup, constants: tuple[float, float, float], normal: tuple[float, float, float]
) -> float | None:
    """mu_app and mu know (w, c w, mu), the others e_n; they meet in w = 1/(1 + e_n)."""
    e_n = constants[0]
    a, b, s = normal
    # stationarity in e_n gives the multiplier: dN/de_n = -pull/(1 + e_n)^2
    pull = -2.0 * (a * e_n - b) * (1.0 + e_n) ** 2
    at = np.flatnonzero(~block.of_kind("normal"))
    form = linear_form(replace(block, rows=block.rows.take(at), weight=block.weight[at]))
    if form is None:
        return None
    direction = np.zeros(form.problem.kappa.size)
    direction[0] = pull
    first = minimise(replace(form.problem, linear=direction))
    # N(e) - pull/(1 + e): its stationary points are roots of a cubic in 1 + e
    roots = np.roots([2.0 * a, -2.0 * (a + b), 0.0, pull])
    inside = [float(r.real) - 1.0 for r in roots if abs(r.imag) < 1e-9 * (1.0 + abs(r.real))]
    candidates = [e for e in inside if block.e_n.lower < e < block.e_n.upper]
    candidates += [e for e in (block.e_n.lower, block.e_n.upper) if math.isfinite(e)]
    second = min(a * e * e - 2 * b * e + s - pull / (1.0 + e) for e in candidates)
    return None if first.gap > 0.0 else first.chi2 + second
