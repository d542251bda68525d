"""What chains say of themselves: autocorrelation, R-hat over ensembles, effective draws.

arviz-stats is imported where it is asked: processes that only walk start a fifth sooner without it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from emcee.autocorr import integrated_time
from numpy.typing import NDArray
from scipy import special, stats

Array = NDArray[np.float64]

_DISCARDED = 10.0  # autocorrelation times after which the starts are forgotten
_TAILS = (0.05, 0.95)
_WITNESSES = 16  # walkers of each ensemble that the autocorrelation time is taken from: known to some 8 %


@dataclass(frozen=True)
class Evidence:
    """Diagnostics of chains, each worked out when it is asked for.

    An ensemble is one chain. Its walkers see one another, so R-hat over them says nothing: a mode that all of
    them missed is missed by each. Between ensembles nothing is shared, and R-hat compares these: the draws of
    all walkers of an ensemble, ordered in time, split into an earlier and a later half.

    Attributes
    ----------
    quantities : mapping of str to ndarray, (ensembles, steps, walkers)
        All steps from the first one on.
    """

    quantities: Mapping[str, Array]

    @property
    def steps(self) -> int:
        """Steps of each ensemble."""
        return int(next(iter(self.quantities.values())).shape[1])

    @cached_property
    def late_tau(self) -> Mapping[str, float]:
        """Autocorrelation time of each quantity over the later half of all steps, in steps."""
        return {name: autocorrelation_time(x[:, self.steps // 2 :]) for name, x in self.quantities.items()}

    @cached_property
    def discarded(self) -> int:
        """Steps at the beginning that count for nothing: 10 autocorrelation times, at most half of all."""
        longest = max(self.late_tau.values())
        half = self.steps // 2
        return min(math.ceil(_DISCARDED * longest), half) if math.isfinite(longest) else half

    @cached_property
    def kept(self) -> Mapping[str, Array]:
        """What is left."""
        return {name: x[:, self.discarded :] for name, x in self.quantities.items()}

    @cached_property
    def tau(self) -> Mapping[str, float]:
        """Autocorrelation time of each quantity over what is kept, in steps."""
        return {name: autocorrelation_time(x) for name, x in self.kept.items()}

    @cached_property
    def rhat(self) -> Mapping[str, float]:
        """Rank-normalised split R-hat over the ensembles."""
        return {name: rhat(x) for name, x in self.kept.items()}

    @cached_property
    def bulk(self) -> Mapping[str, float]:
        """Effective draws in the bulk."""
        return {name: effective_bulk(x) for name, x in self.kept.items()}

    @cached_property
    def tail(self) -> Mapping[str, float]:
        """Effective draws in the tails."""
        return {name: effective_tail(x) for name, x in self.kept.items()}


def autocorrelation_time(x: Array) -> float:
    """Integrated autocorrelation time in steps, from the mean autocorrelation function of 16 walkers each.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)

    Returns
    -------
    float
        Infinite where nothing moved.

    Notes
    -----
    By emcee, with the window of Sokal (1989), 5 autocorrelation times.
    """
    series = np.moveaxis(x[:, :, :_WITNESSES], 1, 0).reshape(x.shape[1], -1)
    series = series[:, np.ptp(series, axis=0) > 0.0]  # a walker that stood still has no autocorrelation
    if x.shape[1] < 4 or series.shape[1] == 0:
        return math.inf
    return float(integrated_time(series, tol=0)[0])


def rhat(x: Array) -> float:
    """Rank-normalised split R-hat over the ensembles; infinite where it is not defined.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)

    References
    ----------
    Vehtari et al. (2021), Bayesian Analysis 16, 667.
    """
    if x.shape[1] < 4 or np.ptp(x) == 0.0:
        return math.inf
    from arviz_stats.base.array import array_stats

    with np.errstate(all="ignore"):
        found = float(array_stats.rhat(x.reshape(x.shape[0], -1), method="rank"))
    return found if math.isfinite(found) else math.inf


def effective_bulk(x: Array) -> float:
    """Effective number of draws for the mean of the rank-normalised quantity.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)
    """
    ranks = stats.rankdata(x.reshape(-1))
    z = special.ndtri((ranks - 0.375) / (ranks.size + 0.25))
    return effective(z.reshape(x.shape))


def effective_tail(x: Array) -> float:
    """Effective number of draws for the shares below the 5 and the 95 % quantile, the smaller of the two.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)
    """
    return min(effective((x <= edge).astype(float)) for edge in np.quantile(x, _TAILS))


def effective(z: Array) -> float:
    """Number of independent draws with which the mean of z would be known as well as from these chains.

    The walkers of an ensemble depend on one another, so neither can each count as a chain, nor can their
    draws be put into one row: in such a row an autocorrelation begins only after as many places as there are
    walkers, and estimators that stop at the first small one overlook it. What is sound is the series of the
    means over the walkers (Goodman & Weare 2010, section 3): of each ensemble one series in time, whose own
    effective number N and variance v give the error of the overall mean, v/N, with every correlation between
    walkers in it. Then var(z)/(v/N) is the number wanted.

    Parameters
    ----------
    z : ndarray, (ensembles, steps, walkers)

    Returns
    -------
    float
        0 where it is not defined.
    """
    means = z.mean(axis=2)
    if means.shape[1] < 4 or np.ptp(means) == 0.0:
        return 0.0
    from arviz_stats.base.array import array_stats

    with np.errstate(all="ignore"):
        of_means = float(array_stats.ess(means, method="mean"))
    found = float(z.var()) / float(means.var()) * of_means
    return found if math.isfinite(found) else 0.0
