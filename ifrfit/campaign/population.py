"""The groups of a campaign as members of one population: partial pooling of each constant.

Each group's constant, in a coordinate without ends, is drawn from a normal distribution over groups, and its
posterior stands for a normal likelihood. The population's mean is integrated out in closed form, its standard
deviation tau numerically (Gelman et al., Bayesian Data Analysis, 3rd ed., section 5.4; uniform prior of tau,
Gelman 2006, Bayesian Anal. 1, 515). A group is shrunk towards the mean by what its own data leave open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit, ndtr

from ifrfit.campaign.group_fit import FAILURE, KAPPA
from ifrfit.inference.model.parameters import Parameter

Array = NDArray[np.float64]

FEWEST = 3  # groups: of fewer the posterior of tau is not proper
_NODES = 1201  # of log tau
_DECADES = 14.0  # e-folds of tau below and above the scale of the groups
_KEPT = 96  # nodes of tau, by mass, that the quantiles are taken over
_ENDS = (0.025, 0.16, 0.5, 0.84, 0.975)
_BISECTIONS = 60
_BLOCK = 2_000_000  # numbers at once


@dataclass(frozen=True)
class Coordinate:
    """A coordinate without ends for a constant: the logit of its share of the domain, its log, or itself."""

    lower: float
    upper: float

    def to(self, x: Array) -> Array:
        """The coordinate of values; infinite at the ends of the domain."""
        if math.isfinite(self.lower) and math.isfinite(self.upper):
            share = np.clip((x - self.lower) / (self.upper - self.lower), 0.0, 1.0)
            return np.asarray(logit(share))
        if math.isfinite(self.lower):
            with np.errstate(divide="ignore"):
                return np.log(np.maximum(x - self.lower, 0.0))
        return np.asarray(x, dtype=float)

    def back(self, y: Array) -> Array:
        """The values at coordinates."""
        if math.isfinite(self.lower) and math.isfinite(self.upper):
            return np.asarray(self.lower + (self.upper - self.lower) * expit(y))
        if math.isfinite(self.lower):
            return np.asarray(self.lower + np.exp(y))
        return np.asarray(y, dtype=float)


@dataclass(frozen=True)
class Quantiles:
    """Median and central 68 and 95 % intervals, (n,) each."""

    lo95: Array
    lo68: Array
    median: Array
    hi68: Array
    hi95: Array

    @classmethod
    def of(cls, five: Array) -> Quantiles:
        """From an array (5, n)."""
        return cls(*five)


@dataclass(frozen=True)
class Population:
    """What the groups have in common in one constant.

    Attributes
    ----------
    name : str
        The constant.
    groups : ndarray of int, (n,)
        Which rows of the table were pooled: those that determine the constant.
    left_out : int
        Groups with a fit that do not determine it.
    centre, new, tau : Quantiles
        One number each: of the median group, of a group that is not among these, and of the standard
        deviation over groups in the coordinate.
    members : Quantiles
        Of each group, shrunk, (n,).
    shrinkage : ndarray, (n,)
        Share of the way to the population's mean, 0 to 1.
    """

    name: str
    groups: NDArray[np.intp]
    left_out: int
    centre: Quantiles
    new: Quantiles
    tau: Quantiles
    members: Quantiles = field(repr=False)
    shrinkage: Array = field(repr=False)


@dataclass(frozen=True)
class NormalHierarchy:
    """The posterior of a normal population of n groups, over nodes of its standard deviation tau.

    Attributes
    ----------
    y, s : ndarray, (n,)
        What each group says by itself, and with which standard deviation.
    tau, weight : ndarray, (m,)
        Nodes and their probabilities.
    mean, sd : ndarray, (m,)
        Of the population's mean, given tau.
    """

    y: Array
    s: Array
    tau: Array
    weight: Array
    mean: Array
    sd: Array

    @classmethod
    def of(cls, y: Array, s: Array) -> NormalHierarchy:
        """Integrate over tau on a grid of its logarithm.

        Raises
        ------
        ValueError
            For fewer than `FEWEST` groups, or a standard deviation that is not positive and finite.
        """
        if y.size < FEWEST or not (np.isfinite(y).all() and np.isfinite(s).all() and (s > 0.0).all()):
            raise ValueError(f"at least {FEWEST} groups with positive standard deviations are needed")
        scale = float(np.sqrt(np.mean(s**2) + np.var(y)))
        log_tau = math.log(scale) + np.linspace(-_DECADES, _DECADES, _NODES)
        log_p, mean, variance = (np.empty(_NODES) for _ in range(3))
        step = max(1, _BLOCK // y.size)
        for first in range(0, _NODES, step):
            at = slice(first, first + step)
            total = s**2 + np.exp(2.0 * log_tau[at])[:, None]
            precision = (1.0 / total).sum(axis=1)
            mean[at] = (y / total).sum(axis=1) / precision
            variance[at] = 1.0 / precision
            misfit = ((y - mean[at][:, None]) ** 2 / total + np.log(total)).sum(axis=1)
            log_p[at] = 0.5 * np.log(variance[at]) - 0.5 * misfit + log_tau[at]
        weight = np.exp(log_p - log_p.max())
        return cls(y, s, np.exp(log_tau), weight / weight.sum(), mean, np.sqrt(variance))

    def tau_quantiles(self) -> Array:
        """Quantiles of tau, (5,)."""
        return np.interp(_ENDS, np.cumsum(self.weight) - 0.5 * self.weight, self.tau)

    def thinned(self) -> NormalHierarchy:
        """The same over fewer nodes, each with the mass about it: for quantiles of many groups."""
        place = np.minimum((np.cumsum(self.weight) * _KEPT).astype(int), _KEPT - 1)
        weight: Array = np.bincount(place, self.weight, _KEPT).astype(float)
        seen = weight > 0.0

        def average(x: NDArray[Any]) -> Array:
            summed = np.bincount(place, self.weight * x, _KEPT)[seen]
            return np.asarray(summed / weight[seen])

        return NormalHierarchy(
            self.y, self.s, average(self.tau), weight[seen], average(self.mean), average(self.sd)
        )

    def shrinkage(self) -> Array:
        """Mean share of the way to the population's mean, (n,)."""
        few = self.thinned()
        share = few.s**2 / (few.s**2 + few.tau[:, None] ** 2)
        return np.asarray(few.weight @ share)

    def member_quantiles(self) -> Array:
        """Quantiles of each group's constant, (5, n)."""
        few = self.thinned()
        share = few.s**2 / (few.s**2 + few.tau[:, None] ** 2)
        mean = few.y + share * (few.mean[:, None] - few.y)
        variance = few.s**2 * (1.0 - share) + (share * few.sd[:, None]) ** 2
        return _mixture_quantiles(few.weight, mean, np.sqrt(variance))

    def centre_quantiles(self) -> Array:
        """Quantiles of the population's mean, (5,)."""
        return _mixture_quantiles(self.weight, self.mean[:, None], self.sd[:, None])[:, 0]

    def new_quantiles(self) -> Array:
        """Quantiles of the constant of a new group, (5,)."""
        wide = np.hypot(self.sd, self.tau)
        return _mixture_quantiles(self.weight, self.mean[:, None], wide[:, None])[:, 0]


def _mixture_quantiles(weight: Array, mean: Array, sd: Array) -> Array:
    """Quantiles `_ENDS` of mixtures of normals, (5, n); mean and sd (m, n), by bisection."""
    counts = weight > 1e-12 * weight.max()
    weight, mean, sd = weight[counts], mean[counts], sd[counts]
    ends = np.array(_ENDS)
    found = np.empty((ends.size, mean.shape[1]))
    step = max(1, _BLOCK // (mean.shape[0] * ends.size))
    for first in range(0, mean.shape[1], step):
        m, s = mean[:, None, first : first + step], sd[:, None, first : first + step]
        low = np.broadcast_to((m - 10.0 * s).min(axis=0), (ends.size, m.shape[2]))
        high = np.broadcast_to((m + 10.0 * s).max(axis=0), low.shape)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            below = np.tensordot(weight, ndtr((middle - m) / s), axes=1) < ends[:, None]
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        found[:, first : first + step] = 0.5 * (low + high)
    return found


def populations(rows: Sequence[Mapping[str, Any]], parameters: Sequence[Parameter]) -> list[Population]:
    """The population of each constant that enough groups determine, and of kappa.

    What a group says is taken from its 68 % interval, in the coordinate.

    Parameters
    ----------
    rows : sequence of mapping
        Of the campaign's table, see `ifrfit.campaign.group_fit.fit_group`.
    parameters : sequence of Parameter
        Of the model, whose domains make the coordinates.
    """
    domains = {p.name: Coordinate(p.lower, p.upper) for p in parameters} | {KAPPA: Coordinate(0.0, math.inf)}
    names = dict.fromkeys(
        key.removesuffix("_status") for row in rows for key in row if key.endswith("_status")
    )
    found = []
    for name in names:
        one = _population(name, rows, domains[name.partition("[")[0]])
        if one is not None:
            found.append(one)
    return found


def _population(name: str, rows: Sequence[Mapping[str, Any]], by: Coordinate) -> Population | None:
    fitted = [number for number, row in enumerate(rows) if not row[FAILURE] and f"{name}_status" in row]
    told = [number for number in fitted if rows[number][f"{name}_status"] == "determined"]
    if len(told) < FEWEST:
        return None
    low, high = (by.to(np.array([rows[n][f"{name}_{end}"] for n in told])) for end in ("lo68", "hi68"))
    with np.errstate(invalid="ignore"):
        y, s = 0.5 * (low + high), 0.5 * (high - low)
    fine = np.isfinite(y) & np.isfinite(s) & (s > 0.0)
    if fine.sum() < FEWEST:
        return None
    groups = np.array(told, dtype=np.intp)[fine]
    hierarchy = NormalHierarchy.of(y[fine], s[fine])

    def values(five: Array, to: Callable[[Array], Array] = by.back) -> Quantiles:
        return Quantiles.of(to(five))

    return Population(
        name,
        groups,
        len(fitted) - groups.size,
        values(hierarchy.centre_quantiles()),
        values(hierarchy.new_quantiles()),
        values(hierarchy.tau_quantiles(), np.asarray),
        values(hierarchy.member_quantiles()),
        hierarchy.shrinkage(),
    )
