"""One group whose e_n is measured both directly and through friction: a search over e_n, and its proof.

For a given e_n every row is linear, so the certified solver gives the best of everything else; what is left
is a search over e_n alone. Where the rows split into two sides that meet in one quantity, the Lagrangian
bound over that quantity proves the result: eqs. (10) and (11) of docs/theory/certificate.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.rows import LOWEST
from ifrfit.inference.optimize.branch_and_bound import minimise, minimise_batch
from ifrfit.inference.optimize.decomposition import PiecewiseMember, lagrangian_bound
from ifrfit.inference.optimize.linear_families import LinearForm, kappa_form, linear_form
from ifrfit.inference.optimize.parameter_group import (
    Array,
    Constants,
    GroupOptimum,
    ParameterGroup,
    direct_sums,
    kappa_range,
    restitution_sums,
)
from ifrfit.inference.optimize.piecewise import NEAR, PiecewiseBatch
from ifrfit.inference.optimize.scalar_search import bounded_minimum, scalar_minima
from ifrfit.inference.optimize.transition_search import least_chi2, optimum_in_c_and_kappa

_REBOUND_SEEDS = 40
_MOST_ROWS = 20_000  # of a batch, whose sums are not taken about the optimum


def solve_over_e_n(group: ParameterGroup) -> GroupOptimum:
    """Optimum over e_n of the certified optima at given e_n, with the Lagrangian bound where there is one."""
    low, high = _range_of_e_n(group)
    many = ManyRestitutions.of(group, high)

    def constants_at(e_n: float) -> Constants:
        plain = optimum_in_c_and_kappa(_with_fixed_restitution(group, e_n))
        if plain is not None:
            return plain.constants
        form = at_restitution(group, e_n)
        return form.to_constants(minimise(form.problem).t)

    def value_at(e_n: float) -> float:
        least = least_chi2(_with_fixed_restitution(group, e_n))
        if least is None:
            least = minimise(at_restitution(group, e_n).problem).chi2
        return least + float(_of_prior(group, e_n))

    def objective_at(e_n: Array) -> Array:
        if many is None or e_n.size == 1:
            return np.array([value_at(each) for each in e_n.tolist()])
        return many.objective(e_n)

    # over the outgoing velocity the scale is 1/e_n: small values need a closer look
    seeds = np.geomspace(low, high, _REBOUND_SEEDS).tolist() if group.rows.measures_scale("rebound") else []
    found = scalar_minima(objective_at, low, high, seeds)
    objective = found[0][0]
    minima = tuple((value, constants_at(e_n)) for value, e_n in found if value <= objective + NEAR)
    constants = minima[0][1]
    bound = _bound(group, constants)
    gap = max(0.0, objective - bound) if math.isfinite(bound) else None
    return GroupOptimum(constants, objective, gap, minima, method="all partitions at each e_n")


def at_restitution(group: ParameterGroup, e_n: float) -> LinearForm:
    """The group where e_n is known: a problem in its closure constant and kappa."""
    return kappa_form(_with_fixed_restitution(group, e_n))


def _with_fixed_restitution(group: ParameterGroup, e_n: float) -> ParameterGroup:
    return replace(group, e_n=replace(group.e_n, fixed=e_n, prior=None))


def _of_prior(group: ParameterGroup, e_n: Array | float) -> Array:
    """What the prior of e_n adds to the objective."""
    mean, sd = (0.0, np.inf) if group.e_n.prior is None else group.e_n.prior
    return np.square((np.asarray(e_n) - mean) / sd)


@dataclass(frozen=True)
class ManyRestitutions:
    """A group at many given e_n at once: each has the same rows, times a factor and with other targets.

    Attributes
    ----------
    group : ParameterGroup
    e_n : float
        Of `form`.
    form : LinearForm
        With its rows in ascending order of tau.
    """

    group: ParameterGroup
    e_n: float
    form: LinearForm

    @classmethod
    def of(cls, group: ParameterGroup, e_n: float) -> ManyRestitutions | None:
        """None where limits of mu make the domain of kappa another at each e_n, and for very many rows."""
        free = group.mu.fixed is None and group.mu.lower == 0.0 and math.isinf(group.mu.upper)
        if not free or group.rows.tau.size > _MOST_ROWS:
            return None
        form = at_restitution(group, e_n)
        order = np.argsort(form.problem.tau, kind="stable")
        return cls(
            group, e_n, replace(form, problem=form.problem.take(order), switching=form.switching[order])
        )

    def objective(self, e_n: Array) -> Array:
        """The least objective at each e_n, (m,)."""
        rows, form, mu = self.group.rows, self.form, self.group.mu
        e = e_n[:, None]
        by_impulse, by_rebound = (1.0 + self.e_n) / (1.0 + e), self.e_n / np.maximum(e, LOWEST)
        factor = np.where(rows.of_scale("impulse") | rows.of_kind("friction"), by_impulse, 1.0)
        factor = np.where(rows.of_scale("rebound"), by_rebound, factor)
        # a row times the factor has the target of before if its value is divided by it
        shift = rows.value * self.group.weight * (1.0 / factor - 1.0)
        normal = rows.of_kind("normal")
        shift[:, normal] = rows.normal_factor(normal) * self.group.weight[normal] * (self.e_n - e)
        mean, sd = (0.0, 1.0) if mu.prior is None else mu.prior
        # rows behind those of the group: the priors of mu, c and e_n, found from the end by -3, -2 and -1
        one, nothing = np.ones((e_n.size, 2)), np.zeros((e_n.size, 2))
        squared = np.concatenate((factor, by_impulse, one), axis=1) ** 2
        shift = np.concatenate((shift, mean / sd * (1.0 / by_impulse - 1.0), nothing), axis=1)
        switching, always = form.switching, form.always
        batch = PiecewiseBatch(
            form.problem, squared[:, switching], squared[:, always], shift[:, switching], shift[:, always]
        )
        return minimise_batch(batch).values + _of_prior(self.group, e_n)


def _range_of_e_n(group: ParameterGroup) -> tuple[float, float]:
    lower = group.e_n.lower
    if group.rows.measures_scale("rebound"):
        lower = max(lower, LOWEST)  # tan_psi_out has no value at e_n = 0
    if math.isfinite(group.e_n.upper):
        return lower, group.e_n.upper
    return lower, max(1.0, 2.0 * lower)


def _bound(group: ParameterGroup, constants: Constants) -> float:
    """Lower bound over everything, where the rows split into two sides; -inf where they do not."""
    impulse, rebound = group.rows.of_scale("impulse"), group.rows.of_scale("rebound")
    if not (impulse.any() or rebound.any()):
        return _bound_over_kappa(group, constants)
    others = group.rows.of_kind("tangential") & ~impulse
    if others.any() or group.c.prior is not None:
        return -math.inf
    return _bound_over_w(group, constants)


def _bound_over_kappa(group: ParameterGroup, constants: Constants) -> float:
    """Tangential rows know (c, kappa), the others (e_n, mu); they meet in kappa: eq. (10)."""
    e_n, _, mu = constants
    other = _RestitutionAndFriction.of(group)
    multiplier = 2.0 * (other.p * mu - other.q) / (1.0 + e_n)  # stationarity in mu
    tangential = _of_rows(group, "tangential")
    tangential = replace(
        tangential,
        e_n=replace(group.e_n, fixed=0.0, lower=0.0, prior=None),  # so that mu is kappa
        mu=Parameter("mu", 0.0, math.inf),
    )
    members = PiecewiseMember(kappa_form(tangential).problem, int(group.c.fixed is None)), other
    _, end = kappa_range([tangential])
    below = lagrangian_bound(members, (multiplier, -multiplier), 0.0, end)
    above = lagrangian_bound(members, (0.0, 0.0), end, math.inf)  # every row sticks: kappa changes none
    return min(below, above)


def _bound_over_w(group: ParameterGroup, constants: Constants) -> float:
    """mu_app and mu know (w, c w, mu), the others e_n; they meet in w = 1/(1 + e_n): eq. (11)."""
    e_n = constants[0]
    other = _Restitution(*restitution_sums(group), group.e_n.lower, group.e_n.upper)
    multiplier = -2.0 * (other.a * e_n - other.b) * (1.0 + e_n) ** 2  # stationarity in e_n
    impulse = _of_rows(group, "tangential", "friction")
    form = linear_form(replace(impulse, e_n=replace(group.e_n, prior=None)))
    if form is None:
        return -math.inf
    first = PiecewiseMember(form.problem, 0)
    return lagrangian_bound((first, other), (multiplier, -multiplier), -math.inf, math.inf)


def _of_rows(group: ParameterGroup, *kinds: str) -> ParameterGroup:
    at = np.flatnonzero(group.rows.of_kind(*kinds))
    return replace(group, rows=group.rows.take(at), sigma=group.sigma[at])


@dataclass(frozen=True)
class _RestitutionAndFriction:
    """a e^2 - 2 b e + s + p mu^2 - 2 q mu + r at given kappa = mu (1 + e): direct measurements of both."""

    a: float
    b: float
    s: float
    p: float
    q: float
    r: float
    e_n: tuple[float, float]
    mu: tuple[float, float]

    @classmethod
    def of(cls, group: ParameterGroup) -> _RestitutionAndFriction:
        at = group.rows.of_kind("friction")
        of_mu = direct_sums(group.mu, group.weight[at], group.rows.value[at] * group.weight[at])
        return cls(*restitution_sums(group), *of_mu, (group.e_n.lower, group.e_n.upper), group.mu.ends)

    def lower_bound(self, low: float, high: float, multiplier: float) -> float:
        """Minimum with the multiplier over all kappa, or over those above `low`, whatever `high` is.

        A second multiplier pulls kappa up to `low`: the largest of the bounds that it gives is taken.
        """
        if low <= 0.0:
            return self._minimum(multiplier)
        steepest = max(0.0, multiplier + 2.0 * math.sqrt(self.a * self.p))  # beyond it nothing is convex
        least, _ = bounded_minimum(
            lambda pull: -self._minimum(multiplier - pull) - pull * low, 0.0, steepest, 1e-9 * steepest
        )
        return max(self._minimum(multiplier), -least)

    def _minimum(self, multiplier: float) -> float:
        """Minimum with the multiplier over the box of e_n and mu; -inf where it is not convex."""
        a, b, p, q = self.a, self.b, self.p, self.q
        if not 4.0 * a * p > multiplier * multiplier:
            return -math.inf

        def value(e: float, mu: float) -> float:
            normal, friction = a * e * e - 2 * b * e + self.s, p * mu * mu - 2 * q * mu + self.r
            return normal + friction + multiplier * mu * (1.0 + e)

        def best_mu(e: float) -> float:
            return (2 * q - multiplier * (1 + e)) / (2 * p)

        e = (2 * b - multiplier * (2 * q - multiplier) / (2 * p)) / (2 * a - multiplier**2 / (2 * p))
        mu = best_mu(e)
        if self.e_n[0] <= e <= self.e_n[1] and self.mu[0] <= mu <= self.mu[1]:
            return value(e, mu)
        edges = [value(end, _clip(best_mu(end), self.mu)) for end in self.e_n if math.isfinite(end)]
        edges += [
            value(_clip((2 * b - multiplier * end) / (2 * a), self.e_n), end)
            for end in self.mu
            if math.isfinite(end)
        ]
        return min(edges)


@dataclass(frozen=True)
class _Restitution:
    """a e^2 - 2 b e + s at given w = 1/(1 + e): direct measurements of e_n."""

    a: float
    b: float
    s: float
    lower: float
    upper: float

    def lower_bound(self, low: float, high: float, multiplier: float) -> float:
        """Minimum with the multiplier over all w: at an end, or where a cubic in 1 + e has a root."""
        roots = np.roots([2.0 * self.a, -2.0 * (self.a + self.b), 0.0, -multiplier])
        inside = [float(r.real) - 1.0 for r in roots if abs(r.imag) < 1e-9 * (1.0 + abs(r.real))]
        candidates = [e for e in inside if self.lower < e < self.upper]
        candidates += [e for e in (self.lower, self.upper) if math.isfinite(e)]
        return min(self.a * e * e - 2 * self.b * e + self.s + multiplier / (1.0 + e) for e in candidates)


def _clip(x: float, ends: tuple[float, float]) -> float:
    return min(max(x, ends[0]), ends[1])
