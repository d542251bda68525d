"""Problems that are linear once the regimes are known: restated for the certified solver.

With suitable unknowns each cell is an ordinary linear least-squares problem in at most three of them:

=========  ==========================  ==================================================================
family     unknowns                    rows it takes
=========  ==========================  ==================================================================
kappa      e_n, c, kappa               tangential, e_n, v_n; with e_n fixed also mu_app, tan_psi_out and mu
friction   mu, c, kappa                tangential and mu, with nothing that measures e_n
impulse    w, c w, mu; w = 1/(1+e_n)   mu_app and mu only
rebound    w, c w, kappa w; w = 1/e_n  tan_psi_out only
direct     e_n, c, mu                  e_n, v_n and mu, where no row is oblique
=========  ==========================  ==================================================================

c is the closure's own constant.
"""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.rows import LOWEST
from ifrfit.inference.optimize.design import Domain, Forms, Frame, LinearForm
from ifrfit.inference.optimize.parameter_group import Array, Constants, ParameterGroup

_TINY = 1e-300


def linear_form(group: ParameterGroup) -> LinearForm | None:
    """Restate the group in the family that takes its rows; None if it is not linear in any family."""
    scaled = group.rows.of_scale("impulse"), group.rows.of_scale("rebound")
    friction = bool(group.rows.of_kind("friction").any()) or group.mu.prior is not None
    normal = bool(group.rows.of_kind("normal").any()) or group.e_n.prior is not None
    if group.rows.of_kind("curved").any():
        return None
    if not group.rows.of_kind("tangential").any():
        return _direct_family(group)
    if group.e_n.fixed is not None or not (scaled[0].any() or scaled[1].any() or friction):
        return kappa_form(group)
    if normal or (group.c.prior is not None and (scaled[0].any() or scaled[1].any())):
        return None
    if not (scaled[0].any() or scaled[1].any()):
        return _friction_family(group)
    if (scaled[0] | group.rows.of_kind("friction")).all():
        return _impulse_family(group)
    if scaled[1].all() and not friction:
        return _rebound_family(group)
    return None


def kappa_form(group: ParameterGroup) -> LinearForm:
    """Restate in e_n, c and kappa: any group without curved rows whose e_n is fixed, and some others."""
    e = group.e_n.fixed
    factor = np.ones(group.rows.tau.size)
    if e is not None:
        factor[group.rows.of_scale("impulse")] = 1.0 / (1.0 + e)
        factor[group.rows.of_scale("rebound")] = 1.0 / max(e, _TINY)
    forms = _rows_of_kappa(group, factor)
    forms.add_normal()
    if e is not None:
        forms.add_friction(2, 1.0 / (1.0 + e))
        forms.add_prior(group.mu, 2, 1.0 / (1.0 + e))
    forms.add_prior(group.e_n, 0)
    forms.add_prior(group.c, 1)
    frame = Frame(group.e_n, group.c, None)
    if group.mu.fixed is not None:
        frame.tie(2, group.mu.fixed, group.mu.fixed)  # kappa = mu + mu e_n
    domain = Domain()
    domain.between(0, group.e_n)
    domain.between(1, group.c)
    _friction_bounds(domain, group.mu)

    def back(full: Array) -> Constants:
        return full[0], full[1], full[2] / (1.0 + full[0])

    return forms.finish(frame, domain, [0.0, group.coefficients.b1, 0.0], group.coefficients.b0, back)


def _friction_family(group: ParameterGroup) -> LinearForm:
    """Unknowns mu, c, kappa; e_n = kappa/mu - 1."""
    forms = _rows_of_kappa(group, 1.0)
    forms.add_friction(0, 1.0)
    forms.add_prior(group.mu, 0)
    forms.add_prior(group.c, 1)
    domain = Domain()
    domain.between(0, group.mu)
    domain.between(1, group.c)
    domain.constraint([1.0 + group.e_n.lower, 0.0, -1.0], 0.0)
    domain.constraint([-1.0 - group.e_n.upper, 0.0, 1.0], 0.0)
    middle = 0.5 * (group.e_n.lower + group.e_n.upper)

    def back(full: Array) -> Constants:
        e_n = full[2] / full[0] - 1.0 if full[0] > 0.0 else middle
        return min(max(e_n, group.e_n.lower), group.e_n.upper), full[1], full[0]

    frame = Frame(group.mu, group.c, None)
    return forms.finish(frame, domain, [0.0, group.coefficients.b1, 0.0], group.coefficients.b0, back)


def _impulse_family(group: ParameterGroup) -> LinearForm:
    """Unknowns w = 1/(1 + e_n), c w, mu."""
    forms = _rows_of_reciprocal(group)
    forms.add_friction(2, 1.0)
    forms.add_prior(group.mu, 2)
    domain = Domain()
    domain.constraint([1.0, 0.0, 0.0], 1.0 / (1.0 + group.e_n.lower))
    domain.constraint([-1.0, 0.0, 0.0], -1.0 / (1.0 + group.e_n.upper))
    _product_bounds(domain, group.c)
    domain.between(2, group.mu)

    def back(full: Array) -> Constants:
        return 1.0 / full[0] - 1.0, full[1] / full[0], full[2]

    frame = Frame(None, None, group.mu)
    if group.c.fixed is not None:
        frame.tie(1, 0.0, group.c.fixed)
    return forms.finish(frame, domain, [group.coefficients.b0, group.coefficients.b1, 0.0], 0.0, back)


def _rebound_family(group: ParameterGroup) -> LinearForm:
    """Unknowns w = 1/e_n, c w, kappa w."""
    forms = _rows_of_reciprocal(group)
    domain = Domain()
    domain.constraint([-1.0, 0.0, 0.0], -1.0 / max(group.e_n.upper, LOWEST))
    domain.constraint([1.0, 0.0, 0.0], 1.0 / max(group.e_n.lower, LOWEST))
    _product_bounds(domain, group.c)
    _friction_bounds(domain, group.mu)

    def back(full: Array) -> Constants:
        return 1.0 / full[0], full[1] / full[0], full[2] / (full[0] + 1.0)

    frame = Frame(None, None, None)
    if group.c.fixed is not None:
        frame.tie(1, 0.0, group.c.fixed)
    if group.mu.fixed is not None:
        frame.tie(2, group.mu.fixed, group.mu.fixed)
    return forms.finish(frame, domain, [group.coefficients.b0, group.coefficients.b1, 0.0], 0.0, back)


def _direct_family(group: ParameterGroup) -> LinearForm:
    """Unknowns e_n, c, mu: without oblique rows nothing ties one to another."""
    forms = Forms(group, np.zeros(group.rows.tau.size, dtype=bool))
    domain = Domain()
    forms.add_normal()
    forms.add_friction(2, 1.0)
    for unknown, constant in enumerate((group.e_n, group.c, group.mu)):
        forms.add_prior(constant, unknown)
        domain.between(unknown, constant)
    frame = Frame(group.e_n, group.c, group.mu)

    def back(full: Array) -> Constants:
        return full[0], full[1], full[2]

    return forms.finish(frame, domain, [0.0, 0.0, 0.0], 0.0, back)


def _rows_of_kappa(group: ParameterGroup, factor: Array | float) -> Forms:
    """Tangential rows, each times a factor; c and kappa are the last two unknowns."""
    offset, slope = group.rows.linear_parts(group.inertia_factor)
    k, forms = group.coefficients, Forms(group, group.rows.of_kind("tangential"))
    forms.stick[1] = forms.of(slope * factor * (k.a1 + k.b1))
    forms.stick0 = forms.of(factor * (offset + slope * (k.a0 + k.b0)))
    forms.slide[1] = forms.of(slope * factor * k.a1)
    forms.slide[2] = forms.of(_over_tau(slope * factor, group.rows.tau))
    forms.slide0 = forms.of(factor * (offset + slope * k.a0))
    return forms


def _rows_of_reciprocal(group: ParameterGroup) -> Forms:
    """Tangential rows that are divided by 1 + e_n or e_n; w, c w and kappa w are the unknowns."""
    offset, slope = group.rows.linear_parts(group.inertia_factor)
    k, forms = group.coefficients, Forms(group, group.rows.of_kind("tangential"))
    forms.stick[0] = forms.of(_cleared(offset, slope * (k.a0 + k.b0)))
    forms.stick[1] = forms.of(slope * (k.a1 + k.b1))
    forms.slide[0] = forms.of(_cleared(offset, slope * k.a0))
    forms.slide[1] = forms.of(slope * k.a1)
    forms.slide[2] = forms.of(_over_tau(slope, group.rows.tau))
    return forms


def _friction_bounds(domain: Domain, mu: Parameter) -> None:
    """mu_lo (1 + e_n) <= kappa <= mu_hi (1 + e_n), or the same times w = 1/e_n."""
    domain.constraint([mu.lower, 0.0, -1.0], -mu.lower)
    if math.isfinite(mu.upper):
        domain.constraint([-mu.upper, 0.0, 1.0], mu.upper)


def _product_bounds(domain: Domain, c: Parameter) -> None:
    """c_lo w <= c w <= c_hi w."""
    if c.fixed is None:
        domain.constraint([c.lower, -1.0, 0.0], 0.0)
        domain.constraint([-c.upper, 1.0, 0.0], 0.0)


def _cleared(offset: Array, part: Array) -> Array:
    """offset + part, without what rounding leaves where they cancel."""
    total = offset + part
    return np.asarray(np.where(np.abs(total) <= 1e-12 * np.abs(offset), 0.0, total))


def _over_tau(slope: Array, tau: Array) -> Array:
    """slope/tau, where rows without slip have no slope either."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(slope == 0.0, 0.0, slope / tau))
