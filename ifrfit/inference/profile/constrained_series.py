"""Series that share a parameter, some entries of theta fixed: exact in each, a search over what is shared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.optimum import Array, theta_of
from ifrfit.inference.optimize.parameter_group import Constants, ParameterGroup, restitution_sums
from ifrfit.inference.optimize.scalar_search import minimum_near
from ifrfit.inference.optimize.shared_parameter import LinkedGroups, fix_restitution
from ifrfit.inference.optimize.solve import series_groups, whole_group

_SHARE = 0.02  # of the domain about the neighbour's shared value, where the best one is sought first
_GRID = 9  # values over the whole domain that are looked at where it is not there
_XATOL = 1e-8  # of the domain


@dataclass(frozen=True)
class ConstrainedSeries:
    """Series with some entries of theta fixed, that share one parameter at the most.

    Attributes
    ----------
    problem : Problem
        With several series, and constants separate by series.
    at : mapping
        Place in theta to the value there.
    whole : ParameterGroup
    groups : list of ParameterGroup
        One a series, e_n fixed.
    mu_fixed : mapping
        Series to its mu, where that is fixed and e_n is free.
    shared : Parameter or None
        What the series share.
    linked : LinkedGroups or None
        The groups linked by it.
    """

    problem: Problem
    at: Mapping[int, float]
    whole: ParameterGroup
    groups: list[ParameterGroup]
    mu_fixed: Mapping[int, float]
    shared: Parameter | None
    linked: LinkedGroups | None

    @classmethod
    def of(cls, problem: Problem, sigma: Array, at: Mapping[int, float]) -> ConstrainedSeries | None:
        """The same for a problem; None if more than one parameter is shared, or a series is not linear."""
        whole = whole_group(problem, sigma)
        if not problem.closure.bilinear or whole.rows.of_kind("curved").any():
            return None
        own = series_groups(
            problem.with_fixed({problem.parameters.names[i]: x for i, x in at.items()}), sigma
        )
        fixed = fix_restitution(own, whole)
        if fixed is None:
            return None
        groups = list(fixed[0])
        mu_fixed = _mu_fixed_under_free_e_n(problem, whole, at)
        for number, mu in mu_fixed.items():
            measured = own[number] if whole.e_n.separate else whole
            groups[number] = _with_kappa_for_e_n(groups[number], measured, mu)
        places = problem.parameters.positions
        shared = [x for x in (whole.c, whole.mu) if not x.separate and x.fixed is None]
        shared = [x for x in shared if int(places[x.name][0]) not in at or (x is whole.mu and mu_fixed)]
        if len(shared) > 1:
            return None
        if not shared:
            return cls(problem, at, whole, groups, mu_fixed, None, None)
        (parameter,) = shared
        prior = groups[0].mu.prior if parameter is whole.mu and mu_fixed else parameter.prior
        linked = LinkedGroups.of(groups, parameter.name, prior)
        return None if linked is None else cls(problem, at, whole, groups, mu_fixed, parameter, linked)

    def best(self, near: Array) -> Array:
        """theta with the rest at its best; `near` is a theta nearby."""
        theta = theta_of(self.problem, _with_e_n_of_kappa(self.whole, self._constants(near), self.mu_fixed))
        for place, value in self.at.items():
            theta[place] = value
        return theta

    def _constants(self, near: Array) -> list[Constants]:
        """Best constants of each series."""
        if self.shared is None or self.linked is None:
            forms = [kappa_form(group) for group in self.groups]
            return [form.to_constants(minimise(form.problem).t) for form in forms]
        start = float(near[self.problem.parameters.positions[self.shared.name][0]]) * self.linked.unit
        total = self.linked.decomposition
        high = total.high
        if self.shared is self.whole.mu and math.isinf(self.groups[0].mu.upper):
            high = max(high, 1.01 * start)
        _, x = minimum_near(
            lambda x: float(total.profile(np.array([x]))[0]),
            start,
            total.low,
            high,
            share=_SHARE,
            n_grid=_GRID,
            xatol=_XATOL * (high - total.low),
        )
        return self.linked.constants(x)


def _mu_fixed_under_free_e_n(
    problem: Problem, whole: ParameterGroup, at: Mapping[int, float]
) -> dict[int, float]:
    """Series to its mu, where that is fixed and e_n is free: e_n is then a matter of kappa = mu (1 + e_n)."""
    places = problem.parameters.positions
    if whole.e_n.fixed is not None:
        return {}
    return {
        number: at[i_mu]
        for number, (i_e, i_mu) in enumerate(zip(places["e_n"].tolist(), places["mu"].tolist(), strict=True))
        if i_e not in at and at.get(i_mu, 0.0) > 0.0
    }


def _with_kappa_for_e_n(group: ParameterGroup, measured: ParameterGroup, mu: float) -> ParameterGroup:
    """The group with kappa = mu (1 + e_n) as the free unknown in the place of e_n, at fixed mu.

    A group knows kappa as m (1 + e) with a free m and its fixed e. So m = mu (1 + e_n)/(1 + e) takes the
    bounds of e_n, and what measures e_n directly (rows and prior of `measured`) becomes the prior of m, which
    leaves the same sum of squares.
    """
    factor = mu / (1.0 + (group.e_n.fixed or 0.0))
    weight, product, _ = restitution_sums(measured)
    prior = None if weight == 0.0 else (factor * (1.0 + product / weight), factor / math.sqrt(weight))
    low, high = (factor * (1.0 + end) for end in (measured.e_n.lower, measured.e_n.upper))
    return replace(group, mu=replace(group.mu, lower=low, upper=high, fixed=None, prior=prior))


def _with_e_n_of_kappa(
    whole: ParameterGroup, found: list[Constants], mu_fixed: Mapping[int, float]
) -> list[Constants]:
    """Constants with the e_n that kappa says at fixed mu, and kappa kept in every series that shares e_n."""
    out = list(found)
    for number, mu in mu_fixed.items():
        e_n_of_group, c, free_mu = found[number]
        e_n = min(max(free_mu * (1.0 + e_n_of_group) / mu - 1.0, whole.e_n.lower), whole.e_n.upper)
        if not whole.e_n.separate and whole.mu.separate:
            out = [(e_n, c, m * (1.0 + e) / (1.0 + e_n)) for e, c, m in out]
        out[number] = e_n, c, mu
    return out
