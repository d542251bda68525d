"""The optimum of one group: directly where it is linear, over e_n where it is not."""

from __future__ import annotations

import math
from dataclasses import replace

from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.design import LinearForm
from ifrfit.inference.optimize.linear_families import linear_form
from ifrfit.inference.optimize.parameter_group import (
    Constants,
    GroupOptimum,
    ParameterGroup,
    is_separable,
    range_of_e_n,
    restitution_optimum,
    without_normal_rows,
)
from ifrfit.inference.optimize.piecewise import PiecewiseOptimum
from ifrfit.inference.optimize.restitution_and_friction import solve_over_e_n


def solve_group(group: ParameterGroup, near: float | None = None) -> GroupOptimum | None:
    """Optimum of rows that share one set of constants; None where only a search can find it.

    Parameters
    ----------
    group : ParameterGroup
    near : float, optional
        e_n of a neighbouring problem: where it is searched for, it is looked for there first.
    """
    if group.rows.of_kind("curved").any():
        return None
    if group.e_n.fixed is None and is_separable(group):
        e_n, objective = restitution_optimum(group)
        rest = without_normal_rows(group, e_n)
        found = solve_group(rest)
        return None if found is None else raised(found, objective)
    form = linear_form(group)
    if form is None:
        return solve_over_e_n(group, near)
    optimum = minimise(form.problem)
    minima = tuple((value, center_free_e_n(group, form.to_constants(t))) for value, t in optimum.optima)
    return GroupOptimum(minima[0][1], optimum.chi2, optimum.gap, minima, _extremes(group, form, optimum))


def _extremes(group: ParameterGroup, form: LinearForm, optimum: PiecewiseOptimum) -> tuple[Constants, ...]:
    """Outlying constants that describe the data as well; infinite where no oblique row sets a limit."""
    found = [form.to_constants(t) for t in optimum.extremes]
    if not group.rows.of_kind("tangential").any():
        return tuple(found)
    e_n, c, mu = form.to_constants(optimum.t)
    if optimum.all_stick and group.mu.fixed is None:
        found.append((e_n, c, math.inf))
    if optimum.all_slide and group.coefficients.a1 == 0.0 and group.c.fixed is None:
        found.append((e_n, math.inf, mu))  # a constant that shows in sticking only
    return tuple(found)


def raised(found: GroupOptimum, by: float) -> GroupOptimum:
    """The same optimum with something added to every objective."""
    minima = tuple((value + by, constants) for value, constants in found.minima)
    return replace(found, objective=found.objective + by, minima=minima)


def center_free_e_n(group: ParameterGroup, constants: Constants) -> Constants:
    """Put e_n into the middle of what bounds of mu allow, where nothing measures it."""
    e_n, c, mu = constants
    touched = (
        group.e_n.fixed is not None
        or group.e_n.prior is not None
        or group.rows.of_kind("normal", "friction").any()
        or group.rows.of_scale("impulse").any()
        or group.rows.of_scale("rebound").any()
        or group.mu.fixed is not None
        or group.mu.prior is not None
    )
    kappa = mu * (1.0 + e_n)
    if touched or kappa <= 0.0:
        return constants
    low, high = range_of_e_n(kappa, group.mu)
    middle = 0.5 * (max(group.e_n.lower, low) + min(group.e_n.upper, high))
    return middle, c, kappa / (1.0 + middle)
