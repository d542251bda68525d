"""Problems that are linear once the regimes are known: restated for the certified solver.

With suitable unknowns each cell is an ordinary linear least-squares problem in at most three of them:

=========  ==========================  ==================================================================
family     unknowns                    rows it takes
=========  ==========================  ==================================================================
kappa      e_n, c, kappa               tangential, e_n, v_n; with e_n fixed also mu_app, tan_psi_out and mu
friction   mu, c, kappa                tangential and mu, with nothing that measures e_n
impulse    w, c w, mu; w = 1/(1+e_n)   mu_app and mu only
rebound    w, c w, kappa w; w = 1/e_n  tan_psi_out only
=========  ==========================  ==================================================================

c is the closure's own constant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.block import Array, Block, Bool, Constants
from ifrfit.inference.constants import Constant
from ifrfit.inference.piecewise import PiecewiseProblem, Rows

_TINY = 1e-300
_LOWEST = 1e-3  # e_n below which a value over the outgoing normal velocity is not meant seriously


@dataclass(frozen=True)
class LinearForm:
    """A block restated: the piecewise problem in its free unknowns, and the way back to the constants."""

    problem: PiecewiseProblem
    to_constants: Callable[[Array], Constants]


def linear_form(block: Block) -> LinearForm | None:
    """Restate the block in the family that takes its rows; None if it is not linear in any."""
    scaled = block.of_scale("impulse"), block.of_scale("rebound")
    friction = bool(block.of_kind("friction").any()) or block.mu.prior is not None
    normal = bool(block.of_kind("normal").any()) or block.e_n.prior is not None
    if block.of_kind("curved").any():
        return None
    if block.e_n.fixed is not None or not (scaled[0].any() or scaled[1].any() or friction):
        return kappa_form(block)
    if normal or (block.c.prior is not None and (scaled[0].any() or scaled[1].any())):
        return None
    if not (scaled[0].any() or scaled[1].any()):
        return _friction_family(block)
    if (scaled[0] | block.of_kind("friction")).all():
        return _impulse_family(block)
    if scaled[1].all() and not friction:
        return _rebound_family(block)
    return None


def kappa_form(block: Block) -> LinearForm:
    """Restate in e_n, c and kappa: any block without curved rows whose e_n is fixed, and some others."""
    e = block.e_n.fixed
    factor = np.ones(block.rows.tau.size)
    if e is not None:
        factor[block.of_scale("impulse")] = 1.0 / (1.0 + e)
        factor[block.of_scale("rebound")] = 1.0 / max(e, _TINY)
    offset, slope = block.linear_parts()
    k = block.coefficients
    tangential = block.of_kind("tangential")
    forms = _Forms(block, tangential)
    forms.stick[1] = forms.of(slope * factor * (k.a1 + k.b1))
    forms.stick0 = forms.of(factor * (offset + slope * (k.a0 + k.b0)))
    forms.slide[1] = forms.of(slope * factor * k.a1)
    forms.slide[2] = forms.of(_over_tau(slope * factor, block.rows.tau))
    forms.slide0 = forms.of(factor * (offset + slope * k.a0))
    forms.add_normal(0)
    if e is not None:
        forms.add_friction(2, 1.0 / (1.0 + e))
        forms.add_prior(block.mu, 2, 1.0 / (1.0 + e))
    forms.add_prior(block.e_n, 0)
    forms.add_prior(block.c, 1)
    frame = _Frame.of(block.e_n, block.c, None)
    if block.mu.fixed is not None:
        frame.tie(2, block.mu.fixed, 0, block.mu.fixed)  # kappa = mu + mu e_n
    domain = _Domain()
    domain.between(0, block.e_n)
    domain.between(1, block.c)
    domain.wall([block.mu.lower, 0.0, -1.0], -block.mu.lower)  # kappa >= mu_lo (1 + e_n)
    if math.isfinite(block.mu.upper):
        domain.wall([-block.mu.upper, 0.0, 1.0], block.mu.upper)

    def back(full: Array) -> Constants:
        return full[0], full[1], full[2] / (1.0 + full[0])

    return forms.finish(frame, domain, [0.0, 0.0, 1.0], [0.0, k.b1, 0.0], k.b0, back)


def _friction_family(block: Block) -> LinearForm:
    """Unknowns mu, c, kappa; e_n = kappa/mu - 1."""
    offset, slope = block.linear_parts()
    k = block.coefficients
    tangential = block.of_kind("tangential")
    forms = _Forms(block, tangential)
    forms.stick[1] = forms.of(slope * (k.a1 + k.b1))
    forms.stick0 = forms.of(offset + slope * (k.a0 + k.b0))
    forms.slide[1] = forms.of(slope * k.a1)
    forms.slide[2] = forms.of(_over_tau(slope, block.rows.tau))
    forms.slide0 = forms.of(offset + slope * k.a0)
    forms.add_friction(0, 1.0)
    forms.add_prior(block.mu, 0)
    forms.add_prior(block.c, 1)
    domain = _Domain()
    domain.between(0, block.mu)
    domain.between(1, block.c)
    domain.wall([1.0 + block.e_n.lower, 0.0, -1.0], 0.0)
    domain.wall([-1.0 - block.e_n.upper, 0.0, 1.0], 0.0)
    middle = 0.5 * (block.e_n.lower + block.e_n.upper)

    def back(full: Array) -> Constants:
        e_n = full[2] / full[0] - 1.0 if full[0] > 0.0 else middle
        return min(max(e_n, block.e_n.lower), block.e_n.upper), full[1], full[0]

    frame = _Frame.of(block.mu, block.c, None)
    return forms.finish(frame, domain, [0.0, 0.0, 1.0], [0.0, k.b1, 0.0], k.b0, back)


def _impulse_family(block: Block) -> LinearForm:
    """Unknowns w = 1/(1 + e_n), c w, mu."""
    _, slope = block.linear_parts()
    tangential = block.of_kind("tangential")
    forms = _Forms(block, tangential)
    k = block.coefficients
    forms.stick[0] = forms.of(slope * (k.a0 + k.b0))
    forms.stick[1] = forms.of(slope * (k.a1 + k.b1))
    forms.slide[0] = forms.of(slope * k.a0)
    forms.slide[1] = forms.of(slope * k.a1)
    forms.slide[2] = forms.of(_over_tau(slope, block.rows.tau))
    forms.add_friction(2, 1.0)
    forms.add_prior(block.mu, 2)
    domain = _Domain()
    domain.wall([1.0, 0.0, 0.0], 1.0 / (1.0 + block.e_n.lower))
    domain.wall([-1.0, 0.0, 0.0], -1.0 / (1.0 + block.e_n.upper))
    _product_walls(domain, block.c)
    domain.between(2, block.mu)

    def back(full: Array) -> Constants:
        return 1.0 / full[0] - 1.0, full[1] / full[0], full[2]

    frame = _Frame.of(None, None, block.mu)
    if block.c.fixed is not None:
        frame.tie(1, 0.0, 0, block.c.fixed)
    return forms.finish(frame, domain, [0.0, 0.0, 1.0], [k.b0, k.b1, 0.0], 0.0, back)


def _rebound_family(block: Block) -> LinearForm:
    """Unknowns w = 1/e_n, c w, kappa w."""
    offset, slope = block.linear_parts()
    forms = _Forms(block, np.ones(block.rows.tau.size, dtype=bool))
    k = block.coefficients
    forms.stick[0] = _cleared(offset, slope * (k.a0 + k.b0))
    forms.stick[1] = slope * (k.a1 + k.b1)
    forms.slide[0] = _cleared(offset, slope * k.a0)
    forms.slide[1] = slope * k.a1
    forms.slide[2] = _over_tau(slope, block.rows.tau)
    domain = _Domain()
    domain.wall([-1.0, 0.0, 0.0], -1.0 / max(block.e_n.upper, _LOWEST))
    domain.wall([1.0, 0.0, 0.0], 1.0 / max(block.e_n.lower, _LOWEST))
    _product_walls(domain, block.c)
    domain.wall([block.mu.lower, 0.0, -1.0], -block.mu.lower)  # kappa w >= mu_lo (1 + w)
    if math.isfinite(block.mu.upper):
        domain.wall([-block.mu.upper, 0.0, 1.0], block.mu.upper)

    def back(full: Array) -> Constants:
        return 1.0 / full[0], full[1] / full[0], full[2] / (full[0] + 1.0)

    frame = _Frame.of(None, None, None)
    if block.c.fixed is not None:
        frame.tie(1, 0.0, 0, block.c.fixed)
    if block.mu.fixed is not None:
        frame.tie(2, block.mu.fixed, 0, block.mu.fixed)
    return forms.finish(frame, domain, [0.0, 0.0, 1.0], [k.b0, k.b1, 0.0], 0.0, back)


def _product_walls(domain: _Domain, c: Constant) -> None:
    """c_lo w <= c w <= c_hi w."""
    if c.fixed is None:
        domain.wall([c.lower, -1.0, 0.0], 0.0)
        domain.wall([-c.upper, 1.0, 0.0], 0.0)


def _cleared(offset: Array, part: Array) -> Array:
    """offset + part, without what rounding leaves where they cancel."""
    total = offset + part
    return np.asarray(np.where(np.abs(total) <= 1e-12 * np.abs(offset), 0.0, total))


def _over_tau(slope: Array, tau: Array) -> Array:
    """slope/tau, where rows without slip have no slope either."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(slope == 0.0, 0.0, slope / tau))


def _weighted(columns: list[Array | None], mix: Array, weight: Array) -> Array | None:
    """A combination of columns times the weight; None where it is empty."""
    mixed: Array | None = None
    for column, x in zip(columns, mix, strict=True):
        if column is not None and x != 0.0:
            part = column if x == 1.0 else x * column
            mixed = part if mixed is None else mixed + part
    return None if mixed is None else weight * mixed


class _Frame:
    """The affine map from free unknowns t to all three: full = base + columns @ t."""

    def __init__(self, fixed: tuple[float | None, float | None, float | None]) -> None:
        self.base = np.array([0.0 if value is None else value for value in fixed])
        self.columns = np.eye(3)
        self.free = [value is None for value in fixed]

    @classmethod
    def of(cls, *constants: Constant | None) -> _Frame:
        first, second, third = (None if c is None else c.fixed for c in constants)
        return cls((first, second, third))

    def tie(self, unknown: int, constant: float, to: int, factor: float) -> None:
        """Make one unknown a function of another: constant + factor * other."""
        self.free[unknown] = False
        self.base[unknown] = constant + (0.0 if self.free[to] else factor * self.base[to])
        if self.free[to]:
            self.columns[unknown, to] = factor

    def matrix(self) -> Array:
        return self.columns[:, self.free]


class _Domain:
    """Collects walls: normal @ full <= limit."""

    def __init__(self) -> None:
        self.walls: list[list[float]] = []
        self.limits: list[float] = []

    def wall(self, normal: list[float], limit: float) -> None:
        self.walls.append(normal)
        self.limits.append(limit)

    def between(self, unknown: int, constant: Constant) -> None:
        if constant.fixed is not None:
            return
        unit = [0.0, 0.0, 0.0]
        unit[unknown] = -1.0
        self.wall(list(unit), -constant.lower)
        if math.isfinite(constant.upper):
            unit[unknown] = 1.0
            self.wall(list(unit), constant.upper)


class _Forms:
    """Collects the weighted rows of a block in three unknowns, then reduces them to the free ones."""

    def __init__(self, block: Block, switching: Bool) -> None:
        self.block = block
        self.switching = switching
        self.all = bool(switching.all())
        self.stick: list[Array | None] = [None, None, None]
        self.slide: list[Array | None] = [None, None, None]
        self.stick0: Array | float = 0.0
        self.slide0: Array | float = 0.0
        self.rest: list[Array] = []  # design rows, weighted
        self.rest_target: list[Array] = []

    def of(self, values: Array) -> Array:
        """Values of the rows that switch."""
        return values if self.all else values[self.switching]

    def add_normal(self, unknown: int) -> None:
        """Rows e_n and v_n = e_n cos gamma."""
        at = self.block.of_kind("normal")
        if not at.any():
            return
        is_e_n = np.array([name == "e_n" for name in self.block.rows.names])[self.block.rows.which]
        factor = np.where(is_e_n, 1.0, self.block.rows.incidence.cosine)[at]
        self._add(unknown, factor, self.block.rows.value[at], self.block.weight[at])

    def add_friction(self, unknown: int, factor: float) -> None:
        """Rows of mu."""
        at = self.block.of_kind("friction")
        if at.any():
            count = int(at.sum())
            self._add(unknown, np.full(count, factor), self.block.rows.value[at], self.block.weight[at])

    def add_prior(self, constant: Constant, unknown: int, factor: float = 1.0) -> None:
        """Add an auxiliary measurement."""
        if constant.prior is not None and constant.fixed is None:
            mean, sd = constant.prior
            self._add(unknown, np.array([factor]), np.array([mean]), np.array([1.0 / sd]))

    def _add(self, unknown: int, factor: Array, value: Array, weight: Array) -> None:
        design = np.zeros((value.size, 3))
        design[:, unknown] = factor * weight
        self.rest.append(design)
        self.rest_target.append(value * weight)

    def finish(
        self,
        frame: _Frame,
        domain: _Domain,
        kappa: list[float],
        bound: list[float],
        bound0: float,
        back: Callable[[Array], Constants],
    ) -> LinearForm:
        """Reduce to the free unknowns."""
        matrix, base = frame.matrix(), frame.base
        weight, value = self.of(self.block.weight), self.of(self.block.rows.value)
        tau = self.of(self.block.rows.tau)

        def rows(columns: list[Array | None], constant: Array | float) -> Rows:
            target = value - constant
            for column, x in zip(columns, base, strict=True):
                if column is not None and x != 0.0:
                    target = target - x * column
            return Rows(tuple(_weighted(columns, m, weight) for m in matrix.T), weight * target)

        stick, slide = rows(self.stick, self.stick0), rows(self.slide, self.slide0)
        rest = np.concatenate([np.zeros((0, 3)), *self.rest])
        rest_target = np.concatenate([np.zeros(0), *self.rest_target])
        always = Rows.of(rest @ matrix, rest_target - rest @ base)
        grazing = np.isinf(tau)  # no transition can reach them: they slide whatever the constants
        if grazing.any():
            lost = slide.take(grazing)
            always = Rows.of(
                np.concatenate((always.design, lost.design)), np.concatenate((always.target, lost.target))
            )
            stick, slide, tau = stick.take(~grazing), slide.take(~grazing), tau[~grazing]
        walls = np.array(domain.walls).reshape(-1, 3)
        limits = np.array(domain.limits) - walls @ base
        reduced = walls @ matrix
        real = np.abs(reduced).max(axis=1, initial=0.0) > 0.0
        problem = PiecewiseProblem(
            tau,
            stick,
            slide,
            always,
            np.array(kappa) @ matrix,
            float(np.array(kappa) @ base),
            np.array(bound) @ matrix,
            bound0 + float(np.array(bound) @ base),
            reduced[real],
            limits[real],
        )
        return LinearForm(problem, lambda t: back(base + matrix @ t))
