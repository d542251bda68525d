"""Groups of one normal population, each known with an error: the posterior of its sd tau, mean and members.

The population's mean is integrated out in closed form, its standard deviation tau numerically (Gelman et al.,
Bayesian Data Analysis, 3rd ed., section 5.4; uniform prior of tau, Gelman 2006, Bayesian Anal. 1, 515).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from ifrfit.campaign.many_groups.group_law import NormalMixture
from ifrfit.campaign.population.limits import Limits
from ifrfit.inference.distributions.protocol import LEVELS

Array = NDArray[np.float64]
Index = NDArray[np.intp]

FEWEST = 3  # groups: of fewer the posterior of tau is not proper
_NODES, _FINE = 1201, 301  # of log tau, and of its peak
_COARSE, _AWAY, _PEAK = 8, 400.0, 40.0  # nodes of which one is looked at first; log p below the best
_DECADES = 14.0  # e-folds of tau below and above the scale of the groups
_KEPT = 96  # nodes of tau, by mass, that the quantiles are taken over
_SHARP, _KEPT_OF_SHARP = 0.05, 12  # sd of log tau below which its shape plays no part, and nodes then
_STEPS, _STILL = 30, 1e-6  # of Newton's method, and sd at which it is there
_BLOCK = 100_000  # numbers at once


@dataclass(frozen=True)
class NormalHierarchy:
    """The posterior of a normal population of n groups, over nodes of its standard deviation tau.

    Attributes
    ----------
    y, s : ndarray, (n,)
        What each group says by itself, and with which standard deviation.
    tau, log_weight : ndarray, (m,)
        Nodes, and the logarithms of their probabilities.
    mean, sd : ndarray, (m,)
        Of the population's mean, given tau.
    limits : Limits
        What further groups say that leave the constant open on one side.
    """

    y: Array
    s: Array
    tau: Array
    log_weight: Array
    mean: Array
    sd: Array
    limits: Limits

    @property
    def weight(self) -> Array:
        """Probabilities of the nodes, (m,)."""
        return np.exp(self.log_weight)

    @classmethod
    def of(cls, y: Array, s: Array, limits: Limits | None = None) -> NormalHierarchy:
        """Integrate over tau on a grid of its logarithm.

        With limits the mean given tau has no normal law, but one with a single peak: Laplace's approximation
        about it, node by node.

        Raises
        ------
        ValueError
            For fewer than `FEWEST` groups, or a standard deviation that is not positive and finite.
        """
        if y.size < FEWEST or not (np.isfinite(y).all() and np.isfinite(s).all() and (s > 0.0).all()):
            raise ValueError(f"at least {FEWEST} groups with positive standard deviations are needed")
        scale = float(np.sqrt(np.mean(s**2) + np.var(y)))
        limits = Limits.none() if limits is None else limits
        log_tau = math.log(scale) + np.linspace(-_DECADES, _DECADES, _NODES)
        found = np.full((3, _NODES), np.nan)
        some = np.arange(0, _NODES, _COARSE)
        found[:, some] = _given_tau(y, s, log_tau[some], limits)
        # of many groups most nodes are far away, even without one of them
        near = _with_neighbours(found[0, some] > found[0, some].max() - _AWAY)
        rest = np.flatnonzero(np.repeat(near, _COARSE)[_COARSE // 2 :][:_NODES] & np.isnan(found[0]))
        found[:, rest] = _given_tau(y, s, log_tau[rest], limits)
        known = ~np.isnan(found[0])
        log_tau, found = log_tau[known], found[:, known]
        peak = np.flatnonzero(_with_neighbours(found[0] > found[0].max() - _PEAK))
        if peak[-1] - peak[0] < _FINE // 2:  # and tau is known so well that it lies between few of them
            between = np.linspace(log_tau[peak[0]], log_tau[peak[-1]], _FINE)[1:-1]
            log_tau = np.append(log_tau, between)
            found = np.append(found, _given_tau(y, s, between, limits), axis=1)
            order = np.argsort(log_tau, kind="stable")
            log_tau, found = log_tau[order], found[:, order]
        middles = 0.5 * (log_tau[1:] + log_tau[:-1])
        width = np.diff(middles, prepend=log_tau[0], append=log_tau[-1])
        log_p, mean, variance = found
        log_p = log_p + np.log(width)
        return cls(y, s, np.exp(log_tau), log_p - logsumexp(log_p), mean, np.sqrt(variance), limits)

    def without(self, places: Index) -> NormalHierarchy:
        """The posterior of the other groups."""
        return NormalHierarchy.of(np.delete(self.y, places), np.delete(self.s, places), self.limits)

    def tau_quantiles(self) -> Array:
        """Quantiles of tau, (5,)."""
        weight = self.weight
        return np.interp(LEVELS, np.cumsum(weight) - 0.5 * weight, self.tau)

    def thinned(self) -> NormalHierarchy:
        """The same over fewer nodes, each with the mass about it: for quantiles of many groups."""
        mass, log_tau = self.weight, np.log(self.tau)
        spread = math.sqrt(float(mass @ (log_tau - mass @ log_tau) ** 2))
        kept = _KEPT if spread > _SHARP else _KEPT_OF_SHARP
        place = np.minimum((np.cumsum(mass) * kept).astype(int), kept - 1)
        weight: Array = np.bincount(place, mass, kept).astype(float)
        seen = weight > 0.0

        def average(x: NDArray[Any]) -> Array:
            summed = np.bincount(place, mass * x, kept)[seen]
            return np.asarray(summed / weight[seen])

        return NormalHierarchy(
            self.y,
            self.s,
            average(self.tau),
            np.log(weight[seen]),
            average(self.mean),
            average(self.sd),
            self.limits,
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


def _with_neighbours(chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.asarray(chosen | np.append(chosen[1:], False) | np.append(False, chosen[:-1]))


def _given_tau(y: Array, s: Array, log_tau: Array, limits: Limits) -> Array:
    """Of each tau its log p, but for a constant, and mean and variance of the population's mean, (3, m)."""
    found = np.empty((3, log_tau.size))
    step = max(1, _BLOCK // (y.size + limits.place.size))
    for first in range(0, log_tau.size, step):
        at = slice(first, first + step)
        spread = np.exp(2.0 * log_tau[at])
        total = s**2 + spread[:, None]
        precision = (1.0 / total).sum(axis=1)
        own = (y / total).sum(axis=1) / precision
        mean, variance, censored = _peak(own, precision, spread, limits)
        misfit = ((y - mean[:, None]) ** 2 / total + np.log(total)).sum(axis=1)
        found[:, at] = 0.5 * np.log(variance) - 0.5 * misfit + censored + log_tau[at], mean, variance
    return found


def _peak(own: Array, precision: Array, variance: Array, limits: Limits) -> tuple[Array, Array, Array]:
    """Mean and variance of the population's mean given tau, and what the limits add to log p there.

    Parameters
    ----------
    own, precision : ndarray, (m,)
        Of the normal law that the other groups leave of the mean.
    variance : ndarray, (m,)
        tau^2.
    limits : Limits
    """
    mean = own.copy()
    if limits.place.size:
        for _ in range(_STEPS):  # log p is concave
            _, first, second = limits.log_likelihood(mean, variance)
            slope, bend = first - precision * (mean - own), precision - second
            step = slope / bend
            mean = mean + step
            if (np.abs(step) * np.sqrt(bend) < _STILL).all():
                break
    added, _, second = limits.log_likelihood(mean, variance)
    return mean, 1.0 / (precision - second), added


def _mixture_quantiles(weight: Array, mean: Array, sd: Array) -> Array:
    """Quantiles `LEVELS` of mixtures of normals, (5, n); mean and sd (m, n)."""
    counts = weight > 1e-12 * weight.max()
    weight = weight[counts] / weight[counts].sum()
    middle, width = mean[counts].T, sd[counts].T
    mixture = NormalMixture.of(middle, width, np.broadcast_to(weight, middle.shape))
    return mixture.quantiles(np.array(LEVELS)).T
