"""A mixture of distributions, one at each place of a further quantity that is integrated out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.distributions.quantity_names import NamedQuantities
from ifrfit.inference.model.entry_names import quantity_of

Array = NDArray[np.float64]

_TABLE = 65  # places at which a distribution function is tabulated before its quantiles are looked for
_EXACT = 1e-7  # sd: how exactly quantiles are found
_NORMAL = np.linspace(-5.0, 5.0, 81)  # normal scores at which quantile functions are tabulated
_BELOW_ONE = float(np.nextafter(1.0, 0.0))
_EXTREME = 1e-12  # least probability of a quantile


@dataclass(frozen=True)
class Tabulated:
    """A distribution of one quantity by its distribution function at places, which rise.

    Attributes
    ----------
    places, below : ndarray, (k,)
        Places, and the probability below each, from 0 to 1.
    """

    places: Array
    below: Array

    def quantile(self, p: ArrayLike) -> Array:
        """Quantiles; p scalar or array, 0 to 1."""
        return np.asarray(np.interp(np.asarray(p, dtype=float), self.below, self.places))

    def cdf(self, value: ArrayLike) -> Array:
        """Probability below a value."""
        return np.asarray(np.interp(np.asarray(value, dtype=float), self.places, self.below))


@dataclass(frozen=True)
class Mixture(NamedQuantities):
    """Distributions given a further quantity, weighed by how probable its places are, as a `Distribution`.

    Attributes
    ----------
    name : str
        Of the further quantity.
    places : ndarray, (k,)
        Its values, nodes of a quadrature.
    weights : ndarray, (k,)
        Probability of each; sum 1.
    components : tuple of Distribution
        The others given each place; all know the same names.
    marginal : Tabulated
        The further quantity between its places.
    log_evidence : float
        Log of the integral over everything.
    error : float
        Largest error of a mean, standard deviation or quantile, in standard deviations.
    error_evidence : float
        Of the log evidence.
    tolerance : float
        Of both.
    """

    name: str
    places: Array
    weights: Array = field(repr=False)
    components: tuple[Distribution, ...] = field(repr=False)
    marginal: Tabulated = field(repr=False)
    log_evidence: float
    error: float
    error_evidence: float
    tolerance: float

    @property
    def names(self) -> tuple[str, ...]:
        """Those of the components, and the further quantity."""
        return (*self.components[0].names, self.name)

    @property
    def resolution(self) -> float:
        """The coarsest of the components."""
        return max(each.resolution for each in self.components)

    @property
    def n_draws(self) -> float:
        """There is no end to its draws, as long as there is none to the components'."""
        return min(each.n_draws for each in self.components)

    @property
    def converged(self) -> bool:
        """Whether the tolerance was reached."""
        return self.error <= self.tolerance and self.error_evidence <= self.tolerance

    @property
    def error_of_moments(self) -> float:
        """No less than that of means and standard deviations."""
        return self.error

    @property
    def is_falling(self) -> bool:
        """Whether its error fell to where it is: its step was halved until the densities overlapped."""
        return True

    @cached_property
    def _quantiles(self) -> dict[tuple[str, float], float]:
        return {}

    def _means(self, name: str) -> Array:
        """Mean of a quantity in each component."""
        if name == self.name:
            return self.places
        return np.array([each.mean(name) for each in self.components])

    def mean(self, name: str) -> float:
        """Mean."""
        return float(self.weights @ self._means(name))

    def sd(self, name: str) -> float:
        """Standard deviation, by the law of total variance."""
        means = self._means(name)
        within = np.zeros(means.size)
        if name != self.name:
            within = np.array([each.sd(name) for each in self.components])
        return math.sqrt(float(self.weights @ (within**2 + (means - self.weights @ means) ** 2)))

    def covariance(self, names: Sequence[str]) -> Array:
        """Covariance, by the law of total covariance, (n, n)."""
        means = np.array([self._means(name) for name in names]).reshape(len(names), self.places.size)
        centred = means - (means @ self.weights)[:, None]
        total = (centred * self.weights) @ centred.T
        own = [i for i, name in enumerate(names) if name != self.name]
        for weight, each in zip(self.weights, self.components, strict=True):
            total[np.ix_(own, own)] += weight * each.covariance([names[i] for i in own])
        return np.asarray(total)

    def cdf(self, name: str, value: ArrayLike) -> Array | float:
        """Probability below a value."""
        if name == self.name:
            found = self.marginal.cdf(value)
        else:
            at = np.atleast_1d(np.asarray(value, dtype=float))
            found = self.weights @ np.array([each.cdf(name, at) for each in self.components])
        return float(np.squeeze(found)) if np.ndim(value) == 0 else found

    def quantile(self, name: str, p: ArrayLike) -> Array | float:
        """Quantiles; p scalar or array, 0 to 1."""
        requested = np.atleast_1d(np.asarray(p, dtype=float))
        if name == self.name:
            found = self.marginal.quantile(requested)
        elif quantity_of(name) == "transition_tau":
            found = self._quantiles_by_quantiles(name, requested)
        else:
            known = self._quantiles
            new = np.array([each for each in requested if (name, each) not in known])
            if new.size:
                known |= zip(((name, each) for each in new), self._quantiles_by_cdf(name, new), strict=True)
            found = np.array([known[name, each] for each in requested])
        return float(found[0]) if np.ndim(p) == 0 else found

    def _quantiles_by_cdf(self, name: str, p: Array) -> Array:
        """Roots of the distribution function, between the places that a table of it gives."""
        from scipy.optimize.elementwise import find_root

        mean, sd = self.mean(name), self.sd(name)
        if sd == 0.0:
            return np.full(p.size, mean)
        p = np.clip(p, _EXTREME, 1.0 - _EXTREME)
        # no quantile lies farther from the mean (Cantelli)
        low = mean - sd * math.sqrt((1.0 - p.min()) / p.min())
        high = mean + sd * math.sqrt(p.max() / (1.0 - p.max()))
        middle = mean + sd * np.linspace(-4.0, 4.0, _TABLE)
        table = np.unique(np.concatenate(([low], middle[(middle > low) & (middle < high)], [high])))
        below = np.asarray(self.cdf(name, table))
        after = np.clip(np.searchsorted(below, p), 1, table.size - 1)

        def difference(x: Array, p: Array) -> Array:
            return np.asarray(self.cdf(name, x.ravel())).reshape(x.shape) - p

        ends = table[after - 1], table[after]
        return np.asarray(find_root(difference, ends, args=(p,), tolerances={"xatol": _EXACT * sd}).x)

    def _quantiles_by_quantiles(self, name: str, p: Array) -> Array:
        """Quantiles of what has no distribution function, and may be infinite: from tables of quantiles.

        x/(1 + x) is finite, and the normal score of its distribution function is nearly linear. What is
        infinite lies at 1, and nothing between 1 and the last finite place.
        """
        from scipy import special

        tables = []
        for each in self.components:
            x = np.asarray(each.quantile(name, special.ndtr(_NORMAL)))
            with np.errstate(invalid="ignore"):
                tables.append(np.where(np.isinf(x), 1.0, x / (1.0 + x)))
        places = np.unique([*np.ravel(tables), _BELOW_ONE])
        below = self.weights @ np.array([special.ndtr(_score(places, own)) for own in tables])
        share = np.interp(p, below, places)
        with np.errstate(divide="ignore"):
            return np.where(share >= 1.0, np.inf, share / (1.0 - share))

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """Independent draws of all quantities together; the further one takes the values of its places."""
        chosen = rng.choice(self.places.size, n, p=self.weights)
        found = {name: np.empty(n) for name in self.names}
        for number in np.unique(chosen):
            rows = np.flatnonzero(chosen == number)
            own = self.components[number].draws(rows.size, rng)
            for name, values in {**own, self.name: np.full(rows.size, self.places[number])}.items():
                found[name][rows] = values
        return found


def _score(places: Array, quantiles: Array) -> Array:
    """Normal score of a distribution function at places, from its quantiles at `_NORMAL`."""
    from scipy.interpolate import PchipInterpolator

    finite = quantiles < 1.0
    score = np.where(places < quantiles[0], -np.inf, np.inf)
    if not finite.any():
        return score
    table, normal = quantiles[finite], _NORMAL[finite]
    if not finite.all():
        score[(places > table[-1]) & (places < 1.0)] = normal[-1]
    rises = np.concatenate((np.diff(table) > 0.0, [True]))  # of equal ones the last
    inside = (places >= table[0]) & (places <= table[-1])
    if rises.sum() > 1:
        score[inside] = PchipInterpolator(table[rises], normal[rises])(places[inside])
    return np.asarray(score)
