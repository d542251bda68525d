"""Certified optimum and posterior of many small groups at once, in closed form but for the transition.

With known noise, uniform priors and a closure whose transition does not depend on its constant, kappa alone
decides which impacts slide. Given kappa the closure constant c is a normal law cut off at its bounds; e_n is
independent of both, but for the Jacobian 1/(1 + e_n) of mu = kappa/(1 + e_n). So the posterior is an integral
over kappa, smooth between the transitions at the measured tau, times one over e_n. Groups that this does not
settle with digits to spare, as where a bound is near, are for the general code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.parameters import Domain
from ifrfit.inference.optimize.transition_cells import N_BELOW, SIZE, quadratic_matrix
from ifrfit.physics.impulse_laws import ROUNDING, Coefficients

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

E_N, OWN, MU, KAPPA = range(4)  # quantities; OWN is the closure constant

_NEAR = 48.0  # of chi2 above the best within which the sharpness of kappa is looked at
_LOST = math.log(1e-6)  # of the variance of kappa, at most, beyond where the panels end
_PANELS = 44  # besides those that end at transitions
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True)).T  # values at the nodes @ this: coefficients
_E_NODES, _E_WEIGHTS = np.polynomial.legendre.leggauss(40)
_E_SPAN = 6.5  # sd of e_n on either side
_STEPS = 12
_EXACT = 1e-8  # error of a probability at which a quantile is there
_Z = np.array([-1.959964, -0.994458, 0.0, 0.994458, 1.959964])  # of `LEVELS`, where the search begins
_FROM_BOUNDS = 3.5  # sd between a determined constant and its bounds; the rule asks for less than 2
_FROM_ENDS = 6.0  # sd of e_n between which and 0 or 1 nothing is cut off
_STEPLESS = 0.6  # sd of kappa over that of e_n times mu
_NARROW = 0.9  # of the sd below which a constant counts as determined
_WIDEST = 0.6  # sd of a panel


@dataclass(frozen=True)
class GroupPosteriors:
    """What was found of each group; (groups,) each.

    Attributes
    ----------
    resolved : ndarray of bool
        Whether all constants are well inside their bounds; the others are for the general code.
    sliding : ndarray of int
        Impacts that slide at the certified optimum.
    chi2 : ndarray
        Of the optimum.
    sd : ndarray, (groups, 4)
        Of e_n, the closure constant, mu and kappa.
    quantiles : ndarray, (groups, 4, 5)
        At `LEVELS`.
    correlation : ndarray, (groups, 3, 3)
        Of e_n, the closure constant and mu.
    """

    resolved: Bool
    sliding: Index
    chi2: Array
    sd: Array
    quantiles: Array
    correlation: Array


@dataclass(frozen=True)
class Tangential:
    """Values of each group in the order of tau, (groups, most); the weight of what a group lacks is zero.

    Attributes
    ----------
    tau : ndarray
        Infinite where there is no value.
    factor : ndarray
        Impulse factor z = r/s that a value stands for.
    weight : ndarray
        s^2/sigma^2.
    """

    tau: Array
    factor: Array
    weight: Array


def group_posteriors(
    tangential: Tangential,
    e_n: Array,
    e_n_weight: Array,
    law: Coefficients,
    domains: Sequence[Domain],
) -> GroupPosteriors:
    """Certified optimum and posterior of each group.

    Parameters
    ----------
    tangential : Tangential
    e_n, e_n_weight : ndarray, (groups, most)
        Measured values of e_n, and sigma^-2, zero where a group lacks one.
    law : Coefficients
        With b1 = 0.
    domains : sequence of Domain
        Of e_n, the closure constant and mu.
    """
    domain = domains[OWN].lower, domains[OWN].upper
    with np.errstate(all="ignore"):  # what is not finite is not resolved
        cells = _Cells.of(tangential, law)
        optimum = cells.optimum(domain)
        e_hat, e_sd, e_chi2 = _normal(e_n, e_n_weight)
        panels = _Panels.of(cells, optimum, domain, 2.0 * domains[MU].prior_upper)
        panels = panels.where(optimum.proper & panels.fine)
        own_sd, own = _own(panels, domain)
        kappa_sd, kappa = panels.kappa()
        e_nodes, e_mass = _e_n_nodes(e_hat, e_sd)
        e_n_sd, e_n_quantiles = _e_n(e_hat, e_sd)
        mu_sd, mu = _mu(panels, e_nodes, e_mass)
        sd = np.stack((e_n_sd, own_sd, mu_sd, kappa_sd), axis=1)
        quantiles = np.stack((e_n_quantiles, own, mu, kappa), axis=1)
        resolved = (
            optimum.proper
            & panels.fine
            & np.isfinite(sd).all(axis=1)
            & np.isfinite(quantiles).all(axis=(1, 2))
        )
        resolved &= panels.edges[:, -1] < domains[MU].prior_upper
        # the nodes of e_n would see steps where kappa is known much better
        resolved &= kappa_sd > _STEPLESS * quantiles[:, MU, 2] * e_n_sd
        for quantity, clear in ((E_N, _FROM_ENDS), (OWN, _FROM_BOUNDS), (MU, _FROM_BOUNDS)):
            middle, away, bounds = quantiles[:, quantity, 2], clear * sd[:, quantity], domains[quantity]
            resolved &= (middle - away > bounds.lower) & (middle + away < bounds.prior_upper)
            resolved &= sd[:, quantity] < _NARROW * HALF * bounds.prior_sd
        correlation = _correlation(panels, domain, sd, e_nodes, e_mass)
    return GroupPosteriors(resolved, optimum.sliding, optimum.chi2 + e_chi2, sd, quantiles, correlation)


@dataclass(frozen=True)
class _Cells:
    """The quadratics in (c, kappa) of each set of impacts that may stick: the first k by tau, k = 0, 1, ...

    Attributes
    ----------
    walls : ndarray, (groups, most + 2)
        kappa between the cells, from 0 to infinity.
    count : ndarray of int, (groups,)
    forms : ndarray, (6, groups, most + 1)
        chi2 = f0 + f1 c + f2 kappa + f3 c^2 + f4 c kappa + f5 kappa^2.
    """

    walls: Array
    count: Index
    forms: Array

    @classmethod
    def of(cls, rows: Tangential, law: Coefficients) -> _Cells:
        tau, z, w = rows.tau, rows.factor, rows.weight
        x = 1.0 / tau
        terms = np.stack((w, w * z, w * z * z, w * x, w * x * x, w * z * x))  # as `row_products` has them
        none = np.zeros((*terms.shape[:2], 1))
        # not as what is left of all: where 1/tau is large the difference would lose its digits
        above = np.cumsum(terms[..., ::-1], axis=2)[..., ::-1]
        below = np.concatenate((none[:N_BELOW], np.cumsum(terms[:N_BELOW], axis=2)), axis=2)
        sums = np.concatenate((below, np.concatenate((above, none), axis=2)))
        cc, ck, kk, c, k, one = np.tensordot(quadratic_matrix(law)[:SIZE], sums, 1)
        forms = np.stack((one, -2.0 * c, -2.0 * k, cc, 2.0 * ck, kk))
        edge = np.zeros((tau.shape[0], 1))
        walls = np.concatenate((edge, law.b0 * tau, edge + np.inf), axis=1)
        return cls(walls, np.isfinite(tau).sum(axis=1), forms)

    def optimum(self, domain: tuple[float, float]) -> _Optimum:
        """The least chi2 of each cell, with the closure constant in its domain, and the least of all."""
        f0, f1, f2, f3, f4, f5 = self.forms
        low, high = self.walls[:, :-1], self.walls[:, 1:]
        there = np.arange(low.shape[1]) <= self.count[:, None]
        det = 4.0 * f3 * f5 - f4 * f4
        c, kappa = (f4 * f2 - 2.0 * f5 * f1) / det, (f4 * f1 - 2.0 * f3 * f2) / det
        value = f0 + 0.5 * (f1 * c + f2 * kappa)
        inner = there & (kappa > low) & (kappa < high) & (c > domain[0]) & (c < domain[1])
        value = np.where(inner & (det > 1e-10 * 4.0 * f3 * f5), value, np.inf)
        # else it lies on a wall, where an impact is on the transition, or at an end of the domain
        above = np.where(np.isfinite(high), high, low)
        for wall in (low, above):
            own = -(f1 + f4 * wall) / (2.0 * f3)
            kink = there & (wall > 0.0) & (own > domain[0]) & (own < domain[1])
            on_wall = np.where(kink, self.at(wall, domain), np.inf)
            value, kappa = np.minimum(value, on_wall), np.where(on_wall < value, wall, kappa)
        border, where = np.full_like(value, np.inf), low
        for own in domain:
            along = np.clip(-(f2 + f4 * own) / (2.0 * f5), low, above)
            along = np.where(np.isfinite(along), along, low)
            other = f0 + f1 * own + f2 * along + f3 * own**2 + f4 * own * along + f5 * along**2
            border, where = np.minimum(border, other), np.where(other < border, along, where)
        border = np.where(there, border, np.inf)
        best, cell = value.min(axis=1), value.argmin(axis=1)
        proper = np.isfinite(best) & (border.min(axis=1) > best)
        # what is on the transition itself sticks
        place = np.take_along_axis(kappa, cell[:, None], axis=1) * (1.0 + ROUNDING)
        sliding = self.count - (self.walls[:, 1:-1] <= place).sum(axis=1)
        return _Optimum(
            best, sliding, proper, np.minimum(value, border), np.where(value < border, kappa, where)
        )

    def at(self, kappa: Array, domain: tuple[float, float]) -> Array:
        """Least chi2 over the closure constant in each cell, at a kappa for each, (groups, most + 1)."""
        f0, f1, f2, f3, f4, f5 = self.forms
        own = np.clip(-(f1 + f4 * kappa) / (2.0 * f3), *domain)
        return np.asarray(f0 + f1 * own + f2 * kappa + f3 * own**2 + f4 * own * kappa + f5 * kappa**2)


@dataclass(frozen=True)
class _Optimum:
    """The best of all cells, and the least of each.

    Attributes
    ----------
    chi2, sliding : ndarray, (groups,)
        The least, and how many impacts slide there.
    proper : ndarray of bool, (groups,)
        Whether it is the minimum inside a cell, or on a wall, with the closure constant inside its domain.
    least, kappa : ndarray, (groups, most + 1)
        The least of each cell, and where it is.
    """

    chi2: Array
    sliding: Index
    proper: Bool
    least: Array
    kappa: Array


@dataclass(frozen=True)
class _Panels:
    """Nodes in kappa, and what the closure constant is there.

    Attributes
    ----------
    edges : ndarray, (groups, panels + 1)
    nodes : ndarray, (groups, panels, 6)
    density : ndarray, (groups, panels, 6)
        Of kappa, over the whole mass.
    middle, width : ndarray, (groups, panels, 6)
        Of the normal law of the closure constant given kappa.
    height : ndarray, (groups, panels, 6)
        Mass of each node over what its normal law holds between the bounds.
    fine : ndarray of bool, (groups,)
        Whether the panels are narrow, and hold everything.
    """

    edges: Array
    nodes: Array
    density: Array
    middle: Array
    width: Array
    height: Array
    fine: Bool

    @classmethod
    def of(cls, cells: _Cells, optimum: _Optimum, domain: tuple[float, float], highest: float) -> _Panels:
        best = optimum.chi2
        low, high, sd, closed = _ends_of(cells, optimum, domain, highest)
        inside = (cells.walls > low[:, None]) & (cells.walls < high[:, None])
        most = int(inside.sum(axis=1).max(initial=0))
        kinks = np.sort(np.where(inside, cells.walls, np.inf), axis=1)[:, :most]
        even = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, _PANELS + 1)
        edges = np.sort(np.minimum(np.concatenate((kinks, even), axis=1), high[:, None]), axis=1)
        half = 0.5 * np.diff(edges, axis=1)
        middle = edges[:, :-1] + half
        nodes = middle[:, :, None] + half[:, :, None] * _NODES
        cell = (cells.walls[:, None, 1:-1] < middle[:, :, None]).sum(axis=2)
        f = [np.take_along_axis(form, cell, axis=1)[:, :, None] for form in cells.forms]
        own = -(f[1] + f[4] * nodes) / (2.0 * f[3])
        width = np.broadcast_to(1.0 / np.sqrt(f[3]), own.shape)
        chi2 = f[0] + f[2] * nodes + f[5] * nodes**2 - f[3] * own**2
        height = width * np.exp(-0.5 * (chi2 - best[:, None, None]))
        held = ndtr((domain[1] - own) / width) - ndtr((domain[0] - own) / width)
        weights = half[:, :, None] * _WEIGHTS
        mass = _sum(weights * height * held)[:, None, None]
        fine = closed & ((high - low) < _WIDEST * _PANELS * sd)
        density = height * held / mass
        return cls(edges, nodes, density, own, width, weights * height / mass, fine)

    def where(self, asked: Bool) -> _Panels:
        """The same, and nan in the groups that are not asked for."""
        blank = np.where(asked, 1.0, np.nan)[:, None, None]
        return replace(self, density=self.density * blank, height=self.height * blank)

    def powers(self) -> Array:
        """Coefficients of the mass up to a place in each panel, from its middle on, (groups, panels, 7)."""
        half = 0.5 * np.diff(self.edges, axis=1)[:, :, None]
        inner = (self.density[..., None] * _TO_POWERS).sum(axis=2) * half / np.arange(1.0, _NODES.size + 1.0)
        first = -(inner * (-1.0) ** np.arange(1, _NODES.size + 1)).sum(axis=2, keepdims=True)
        return np.concatenate((first, inner), axis=2)

    def below(self, kappa: Array, powers: Array, upto: Array) -> tuple[Array, Array]:
        """Share of the mass below some kappa, and the density there, (groups, n) each."""
        panel = (self.edges[:, None, 1:-1] < kappa[:, :, None]).sum(axis=2)
        low, high = (np.take_along_axis(self.edges[:, k:], panel, axis=1) for k in (0, 1))
        half = 0.5 * (high - low)
        place = np.clip((kappa - low - half) / half, -1.0, 1.0)
        of = np.take_along_axis(powers, panel[:, :, None], axis=1)
        share, slope = np.zeros_like(place), np.zeros_like(place)
        for k in range(_NODES.size, -1, -1):
            slope = slope * place + share
            share = share * place + of[:, :, k]
        outside = (kappa < self.edges[:, :1]) | (kappa > self.edges[:, -1:])
        density = np.where(outside, 0.0, slope / half)
        return share + np.take_along_axis(upto, panel, axis=1), density

    def upto(self) -> Array:
        """Share of the mass below each panel, (groups, panels)."""
        mass = (self.density * _WEIGHTS).sum(axis=2) * 0.5 * np.diff(self.edges, axis=1)
        return np.asarray(np.cumsum(mass, axis=1) - mass)

    def moments(self) -> tuple[Array, Array]:
        """Mean and sd of kappa."""
        weights = self.density * _WEIGHTS * 0.5 * np.diff(self.edges, axis=1)[:, :, None]
        mean = _sum(weights * self.nodes)
        spread = _sum(weights * (self.nodes - mean[:, None, None]) ** 2)
        return mean, np.sqrt(spread)

    def kappa(self) -> tuple[Array, Array]:
        """sd and quantiles of kappa."""
        powers, upto = self.powers(), self.upto()
        mean, sd = self.moments()
        ends = self.edges[:, 0], self.edges[:, -1]
        return sd, _quantiles(lambda x: self.below(x, powers, upto), mean, sd, ends)


def _sum(values: Array) -> Array:
    """Sum of each group one value after the other: zeros, where other groups are longer, change no bit."""
    return np.asarray(np.cumsum(values.reshape(values.shape[0], -1), axis=1)[:, -1])


def _ends_of(
    cells: _Cells, optimum: _Optimum, domain: tuple[float, float], highest: float
) -> tuple[Array, Array, Array, Bool]:
    """Ends of kappa between which the mass is, its least sd there, and whether both ends are inside.

    kappa may be `highest` at most.
    """
    _, _, _, f3, f4, f5 = cells.forms
    low, high = cells.walls[:, :-1], cells.walls[:, 1:]
    best, inner = optimum.chi2, optimum.kappa
    # how sharply a cell's chi2 rises with kappa, were the closure constant free
    bend = f5 - f4**2 / (4.0 * f3)
    sd = 1.0 / np.sqrt(np.where(optimum.least < best[:, None] + _NEAR, bend, 0.0).max(axis=1))
    # a plateau as long as all that kappa may be, and what it adds to the variance
    above = 2.0 * (3.0 * np.log(highest / sd) - _LOST)
    edge = (best + above)[:, None]
    holds = optimum.least < edge
    first, last = holds.argmax(axis=1), holds.shape[1] - 1 - holds[:, ::-1].argmax(axis=1)
    closed = holds.any(axis=1) & (last < cells.count) & (cells.at(low, domain)[:, :1] > edge)[:, 0]
    ends = []
    for cell, walls in ((first, low), (last, high)):
        own = _Cells(cells.walls, cells.count, np.take_along_axis(cells.forms, cell[None, :, None], axis=2))
        far, near = (np.take_along_axis(each, cell[:, None], axis=1) for each in (walls, inner))
        for _ in range(30):
            half = 0.5 * (far + near)
            is_far = own.at(half, domain) > edge
            far, near = np.where(is_far, half, far), np.where(is_far, near, half)
        ends.append(far[:, 0])
    return ends[0], ends[1], sd, closed


def _normal(e_n: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Mean, sd and chi2 of the measured e_n."""
    total = _sum(weight)
    mean = _sum(weight * e_n) / total
    return mean, 1.0 / np.sqrt(total), _sum(weight * (e_n - mean[:, None]) ** 2)


def _e_n_nodes(mean: Array, sd: Array) -> tuple[Array, Array]:
    """Nodes of e_n, and their masses under the normal law with the Jacobian, (groups, 40) each."""
    nodes = mean[:, None] + _E_SPAN * sd[:, None] * _E_NODES
    mass = _E_WEIGHTS * np.exp(-0.5 * (_E_SPAN * _E_NODES) ** 2) / (1.0 + nodes)
    return nodes, mass / mass.sum(axis=1, keepdims=True)


def _e_n(mean: Array, sd: Array) -> tuple[Array, Array]:
    """sd and quantiles of e_n: the normal law with the Jacobian 1/(1 + e_n)."""
    nodes, mass = _e_n_nodes(mean, sd)
    own = (mass * nodes).sum(axis=1)
    own_sd = np.sqrt((mass * (nodes - own[:, None]) ** 2).sum(axis=1))
    scale = (np.exp(-0.5 * (_E_SPAN * _E_NODES) ** 2) * _E_WEIGHTS / (1.0 + nodes)).sum(axis=1) * _E_SPAN
    span = _E_SPAN * sd[:, None, None]

    def below(x: Array) -> tuple[Array, Array]:
        half = 0.5 * (x[:, :, None] - (mean[:, None, None] - span))
        at = mean[:, None, None] - span + half * (1.0 + _E_NODES)
        z = (at - mean[:, None, None]) / sd[:, None, None]
        share = (_E_WEIGHTS * np.exp(-0.5 * z * z) / (1.0 + at)).sum(axis=2) * half[:, :, 0]
        own_z = (x - mean[:, None]) / sd[:, None]
        density = np.exp(-0.5 * own_z**2) / (1.0 + x)
        whole = (scale * sd)[:, None]
        return share / whole, density / whole

    return own_sd, _quantiles(below, own, own_sd, (mean - span[:, 0, 0], mean + span[:, 0, 0]))


def _own(panels: _Panels, domain: tuple[float, float]) -> tuple[Array, Array]:
    """sd and quantiles of the closure constant: a mixture of cut normal laws."""
    groups = panels.middle.shape[0]
    middle, width, height = (
        each.reshape(groups, 1, -1) for each in (panels.middle, panels.width, panels.height)
    )
    low, high = ((end - middle) / width for end in domain)
    under, held = ndtr(low), ndtr(high) - ndtr(low)
    slope, lean = (
        (np.exp(-0.5 * low**2) * a - np.exp(-0.5 * high**2) * b) / math.sqrt(2.0 * math.pi)
        for a, b in ((1.0, 1.0), (low, high))
    )
    first = _sum(height * (middle * held + width * slope))[:, None]
    offset = middle - first[:, :, None]
    second = height * ((offset**2 + width**2) * held + width**2 * lean + 2.0 * offset * width * slope)
    sd = np.sqrt(_sum(second))

    def below(x: Array) -> tuple[Array, Array]:
        z = (x[:, :, None] - middle) / width
        share = np.cumsum(height * (ndtr(z) - under), axis=2)[:, :, -1]
        density = np.cumsum(height * np.exp(-0.5 * z * z) / width, axis=2)[:, :, -1] / math.sqrt(
            2.0 * math.pi
        )
        return share, density

    ends = (np.full(groups, domain[0]), np.full(groups, domain[1]))
    return sd, _quantiles(below, first[:, 0], sd, ends)


def _mu(panels: _Panels, e_nodes: Array, e_mass: Array) -> tuple[Array, Array]:
    """sd and quantiles of mu = kappa/(1 + e_n)."""
    powers, upto = panels.powers(), panels.upto()
    scale = 1.0 + e_nodes
    mean, sd = panels.moments()
    first = mean * (e_mass / scale).sum(axis=1)
    second = (mean**2 + sd**2) * (e_mass / scale**2).sum(axis=1)
    own_sd = np.sqrt(second - first**2)

    def below(x: Array) -> tuple[Array, Array]:
        kappa = x[:, :, None] * scale[:, None, :]
        share, density = panels.below(kappa.reshape(kappa.shape[0], -1), powers, upto)
        share, density = share.reshape(kappa.shape), density.reshape(kappa.shape)
        return (share * e_mass[:, None]).sum(axis=2), (density * (e_mass * scale)[:, None]).sum(axis=2)

    ends = panels.edges[:, 0] / scale.max(axis=1), panels.edges[:, -1] / scale.min(axis=1)
    return own_sd, _quantiles(below, first, own_sd, ends)


def _correlation(
    panels: _Panels, domain: tuple[float, float], sd: Array, e_nodes: Array, e_mass: Array
) -> Array:
    """Correlations of e_n, the closure constant and mu = kappa/(1 + e_n), (groups, 3, 3)."""
    mean, _ = panels.moments()
    low, high = ((end - panels.middle) / panels.width for end in domain)
    held = ndtr(high) - ndtr(low)
    slope = (np.exp(-0.5 * low**2) - np.exp(-0.5 * high**2)) / math.sqrt(2.0 * math.pi)
    own = panels.height * (panels.middle * held + panels.width * slope)
    with_kappa = _sum(own * (panels.nodes - mean[:, None, None]))
    inverse = e_mass / (1.0 + e_nodes)
    e_n = (e_mass * e_nodes).sum(axis=1)
    with_e_n = mean * (inverse * (e_nodes - e_n[:, None])).sum(axis=1)
    found = np.tile(np.eye(3), (mean.size, 1, 1))
    found[:, OWN, MU] = found[:, MU, OWN] = with_kappa * inverse.sum(axis=1) / (sd[:, OWN] * sd[:, MU])
    found[:, E_N, MU] = found[:, MU, E_N] = with_e_n / (sd[:, E_N] * sd[:, MU])
    return found


def _quantiles(
    below: Callable[[Array], tuple[Array, Array]], mean: Array, sd: Array, ends: tuple[Array, Array]
) -> Array:
    """Quantiles at `LEVELS`, (groups, 5), by Newton's method between ends; nan where it does not settle."""
    low, high = (np.repeat(end[:, None], len(LEVELS), axis=1) for end in ends)
    x = np.clip(mean[:, None] + sd[:, None] * _Z, low, high)
    share = np.full_like(x, np.nan)
    for _ in range(_STEPS):
        share, density = below(x)
        miss = share - LEVELS
        if not (np.abs(miss) >= _EXACT).any():  # nan is nobody's
            break
        low, high = np.where(miss < 0.0, x, low), np.where(miss > 0.0, x, high)
        step = x - miss / density
        step = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
        x = np.where(np.abs(miss) < _EXACT, x, step)  # what is there stays, whatever others need
    return np.where(np.abs(share - LEVELS) < 100.0 * _EXACT, x, np.nan)
