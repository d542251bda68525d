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
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.rows import LOWEST, Index
from ifrfit.inference.optimize.parameter_group import Array, Bool, Constants, ParameterGroup
from ifrfit.inference.optimize.piecewise import LinearRows, PiecewiseProblem

_PRIORS = {"e_n": -1, "mu": -3}  # in `LinearForm.always`; the closure constant has -2

_TINY = 1e-300


@dataclass(frozen=True)
class LinearForm:
    """A group restated.

    Attributes
    ----------
    problem : PiecewiseProblem
        In the free unknowns.
    to_constants : callable
        The way back to the constants.
    switching, always : ndarray of int
        The group's row behind each row of the problem, of those with two forms and of the rest; -1, -2 and -3
        stand for the prior of e_n, of the closure constant and of mu.
    """

    problem: PiecewiseProblem
    to_constants: Callable[[Array], Constants]
    switching: Index
    always: Index


def _weighted(columns: list[Array | None], mix: Array, weight: Array) -> Array | None:
    """A combination of columns times the weight; None where it is empty."""
    mixed: Array | None = None
    for column, x in zip(columns, mix, strict=True):
        if column is not None and x != 0.0:
            part = column if x == 1.0 else x * column
            mixed = part if mixed is None else mixed + part
    return None if mixed is None else weight * mixed


class Frame:
    """The affine map from free unknowns t to all three: full = base + columns @ t."""

    def __init__(self, *constants: Parameter | None) -> None:
        # fixed constants stay as they are; None stands for an unknown that is no constant
        fixed = [None if c is None else c.fixed for c in constants]
        self.base = np.array([0.0 if value is None else value for value in fixed])
        self.columns = np.eye(3)
        self.free = [value is None for value in fixed]

    def tie(self, unknown: int, constant: float, factor: float) -> None:
        """Make one unknown a function of the first: constant + factor * first."""
        self.free[unknown] = False
        self.base[unknown] = constant + (0.0 if self.free[0] else factor * self.base[0])
        if self.free[0]:
            self.columns[unknown, 0] = factor

    def matrix(self) -> Array:
        """Columns of the free unknowns, (3, q)."""
        return self.columns[:, self.free]


class Domain:
    """Collects constraints: normal @ full <= limit."""

    def __init__(self) -> None:
        self.constraints: list[list[float]] = []
        self.limits: list[float] = []

    def constraint(self, normal: list[float], limit: float) -> None:
        """Add normal @ full <= limit."""
        self.constraints.append(normal)
        self.limits.append(limit)

    def between(self, unknown: int, constant: Parameter) -> None:
        """Add the constant's own bounds, unless it is fixed."""
        if constant.fixed is not None:
            return
        unit = [0.0, 0.0, 0.0]
        unit[unknown] = -1.0
        self.constraint(list(unit), -constant.lower)
        if math.isfinite(constant.upper):
            unit[unknown] = 1.0
            self.constraint(list(unit), constant.upper)


class Forms:
    """Collects the weighted rows of a group in three unknowns, then reduces them to the free ones."""

    def __init__(self, group: ParameterGroup, switching: Bool) -> None:
        self.group = group
        self.switching = switching
        self.all = bool(switching.all())
        self.stick: list[Array | None] = [None, None, None]
        self.slide: list[Array | None] = [None, None, None]
        self.stick0: Array | float = 0.0
        self.slide0: Array | float = 0.0
        self.rest: list[Array] = []  # design rows, weighted
        self.rest_target: list[Array] = []
        self.rest_of: list[Index] = []

    def of(self, values: Array) -> Array:
        """Values of the rows that switch."""
        return values if self.all else values[self.switching]

    def add_normal(self) -> None:
        """Rows of the normal kind, such as e_n and v_n = e_n cos gamma; e_n is the first unknown."""
        at = self.group.rows.of_kind("normal")
        if not at.any():
            return
        self._add(0, self.group.rows.normal_factor(at), np.flatnonzero(at))

    def add_friction(self, unknown: int, factor: float) -> None:
        """LinearRows of mu."""
        at = self.group.rows.of_kind("friction")
        if at.any():
            self._add(unknown, np.full(int(at.sum()), factor), np.flatnonzero(at))

    def add_prior(self, constant: Parameter, unknown: int, factor: float = 1.0) -> None:
        """Add an auxiliary measurement."""
        if constant.prior is not None and constant.fixed is None:
            mean, sd = constant.prior
            code = np.array([_PRIORS.get(constant.name, -2)])
            self._put(unknown, np.array([factor]), np.array([mean]), np.array([1.0 / sd]), code)

    def _add(self, unknown: int, factor: Array, at: Index) -> None:
        self._put(unknown, factor, self.group.rows.value[at], self.group.weight[at], at)

    def _put(self, unknown: int, factor: Array, value: Array, weight: Array, of: Index) -> None:
        design = np.zeros((value.size, 3))
        design[:, unknown] = factor * weight
        self.rest.append(design)
        self.rest_target.append(value * weight)
        self.rest_of.append(of)

    def finish(
        self,
        frame: Frame,
        domain: Domain,
        bound: list[float],
        bound0: float,
        back: Callable[[Array], Constants],
    ) -> LinearForm:
        """Reduce to the free unknowns; the last one is kappa, or what stands for it."""
        matrix, base = frame.matrix(), frame.base
        weight, value = self.of(self.group.weight), self.of(self.group.rows.value)
        tau = self.of(self.group.rows.tau)

        def rows(columns: list[Array | None], constant: Array | float) -> LinearRows:
            target = value - constant
            for column, x in zip(columns, base, strict=True):
                if column is not None and x != 0.0:
                    target = target - x * column
            return LinearRows(tuple(_weighted(columns, m, weight) for m in matrix.T), weight * target)

        stick, slide = rows(self.stick, self.stick0), rows(self.slide, self.slide0)
        rest = np.concatenate([np.zeros((0, 3)), *self.rest])
        rest_target = np.concatenate([np.zeros(0), *self.rest_target])
        always = LinearRows.of(rest @ matrix, rest_target - rest @ base)
        switching = np.flatnonzero(self.switching)
        always_of = np.concatenate([np.zeros(0, dtype=np.intp), *self.rest_of])
        grazing = np.isinf(tau)  # no transition can reach them: they slide whatever the constants
        if grazing.any():
            lost = slide.take(grazing)
            always = LinearRows.of(
                np.concatenate((always.design, lost.design)), np.concatenate((always.target, lost.target))
            )
            stick, slide, tau = stick.take(~grazing), slide.take(~grazing), tau[~grazing]
            always_of, switching = np.concatenate((always_of, switching[grazing])), switching[~grazing]
        constraints = np.array(domain.constraints).reshape(-1, 3)
        limits = np.array(domain.limits) - constraints @ base
        reduced = constraints @ matrix
        real = np.abs(reduced).max(axis=1, initial=0.0) > 0.0
        problem = PiecewiseProblem(
            tau,
            stick,
            slide,
            always,
            matrix[-1],
            float(base[-1]),
            np.array(bound) @ matrix,
            bound0 + float(np.array(bound) @ base),
            reduced[real],
            limits[real],
        )
        return LinearForm(problem, lambda t: back(base + matrix @ t), switching, always_of)


def linear_form(group: ParameterGroup) -> LinearForm | None:
    """Restate the group in the family that takes its rows; None if it is not linear in any family."""
    scaled = group.rows.of_scale("impulse"), group.rows.of_scale("rebound")
    friction = bool(group.rows.measures("friction")) or group.mu.prior is not None
    normal = bool(group.rows.measures("normal")) or group.e_n.prior is not None
    if group.rows.measures("curved"):
        return None
    if not group.rows.measures("tangential"):
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
