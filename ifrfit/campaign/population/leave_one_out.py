"""Whether each group is of the population of the others: its leave-one-out predictive p-value.

Given tau and the other groups, y_i is normal about their mean m_-i with variance s_i^2 + tau^2 + var(m_-i).
The posterior of tau without group i is that with all, divided by the density of y_i, node by node (checks of
hierarchies by cross-validation: Marshall & Spiegelhalter 2007, Bayesian Anal. 2, 409).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr

from ifrfit.campaign.population.normal_hierarchy import FEWEST, NormalHierarchy
from ifrfit.inference.diagnostics.thresholds import REFUTED

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# groups from which on more than one odd group at once is looked for: several that hide one another, or a
# second population (`ifrfit.campaign.population.two_populations`)
FEWEST_OF_SEVERAL = 10
_ALL = 1500  # groups, of which each is looked at; of more one alone does not move the posterior of tau much,
_NEAR = 3.0  # so that those within so many sd at all its nodes are well within
_BLOCK = 500_000  # numbers at once
_MOST_OF_SEVERAL = 200  # of more groups some odd ones hide nobody, or are a second population
_MOST_SUSPECTS = 12
_SUSPECT = 3.5  # robust standard deviations
_MAD = 1.4826  # of a normal law, sd over the median distance from the median


def membership_p_values(hierarchy: NormalHierarchy) -> Array | None:
    """With what probability a group of the population of the others lies so far from them; (n,).

    Two-sided, and times the number of groups, 1 at most. Where several odd ones hide one another
    (`groups_that_hide`), theirs are given all but these. 1 for groups of many that are near.

    Returns
    -------
    ndarray or None
        None for fewer groups than `FEWEST` and one: without one of them there is no population.
    """
    n = hierarchy.y.size
    if n <= FEWEST:
        return None
    chosen = np.arange(n) if n <= _ALL else _far(hierarchy)
    p = np.ones(n)
    p[chosen] = np.minimum(predictive_p_values(hierarchy, chosen) * n, 1.0)
    odd = groups_that_hide(hierarchy)
    if odd.size > 1 and np.isin(np.flatnonzero(p < REFUTED), odd).all():
        p[odd] = np.minimum(_given_the_others(hierarchy, odd) * n, 1.0)
    return p


def limit_p_values(hierarchy: NormalHierarchy) -> dict[int, float]:
    """With what probability a group of the population of the others gives such a limit, by its row.

    Times the number of groups, 1 at most.
    """
    limits = hierarchy.limits
    log_chance = limits.log_chance(hierarchy.mean, hierarchy.tau**2 + hierarchy.sd**2)
    # the posterior of tau without the group is that with all, divided by what it says at each node
    log_p = -logsumexp(hierarchy.log_weight[:, None] - log_chance, axis=0)
    p = np.minimum(np.exp(log_p) * (hierarchy.y.size + limits.groups), 1.0)
    return {row: float(p[k]) for k, rows in enumerate(limits.rows) for row in rows}


def outlying_groups(hierarchy: NormalHierarchy) -> dict[int, float] | None:
    """Groups that are not of the population of the others.

    Returns
    -------
    dict of int to float or None
        Places of the groups, by their p-values, those of `membership_p_values` below `REFUTED`; None where
        these are.
    """
    p = membership_p_values(hierarchy)
    return None if p is None else below_threshold(p)


def below_threshold(p: Array) -> dict[int, float]:
    """Places of the groups that are named, by their p-values."""
    return {int(at): float(p[at]) for at in np.argsort(p, kind="stable") if p[at] < REFUTED}


def groups_that_hide(hierarchy: NormalHierarchy) -> Index:
    """Places of several odd groups, which make the standard deviation over all so large that none is named.

    Those that lie far from the median, on the scale of the median distance, a quarter at most, are left out;
    then they are taken in again from the nearest on, until one is not of the population of those within
    (outward testing, Barnett & Lewis 1994, Outliers in Statistical Data, section 4.4).
    """
    y, s = hierarchy.y, hierarchy.s
    n = y.size
    none = np.empty(0, dtype=np.intp)
    if not FEWEST_OF_SEVERAL <= n <= _MOST_OF_SEVERAL:
        return none
    away = np.abs(y - np.median(y))
    spread = (_MAD * float(np.median(away))) ** 2
    distance = away / np.sqrt(s**2 + max(spread - float(np.median(s)) ** 2, 0.0))
    order = np.argsort(distance, kind="stable")
    suspects = order[max(int((distance[order] <= _SUSPECT).sum()), n - min(n // 4, _MOST_SUSPECTS)) :]
    if suspects.size < 2:
        return none
    for taken in range(suspects.size):
        odd = suspects[taken:]
        if _given_the_others(hierarchy, odd)[0] * n < REFUTED:
            return odd
    return none


def predictive_p_values(hierarchy: NormalHierarchy, places: NDArray[np.intp]) -> Array:
    """Two-sided p-values of some groups, each given the others; (k,).

    Parameters
    ----------
    hierarchy : NormalHierarchy
        Of all groups.
    places : ndarray of int, (k,)
    """
    found = np.empty(places.size)
    step = max(1, _BLOCK // hierarchy.tau.size)
    for first in range(0, places.size, step):
        part = places[first : first + step]
        distance, log_density = _predicted(hierarchy, part)
        log_weight = hierarchy.log_weight[:, None] - log_density
        weight = np.exp(log_weight - logsumexp(log_weight, axis=0))
        above, below = ((weight * ndtr(side * distance)).sum(axis=0) for side in (-1.0, 1.0))
        found[first : first + step] = 2.0 * np.minimum(above, below)
    sharpest = int(
        np.argmin(hierarchy.s)
    )  # it alone can outweigh the others, whose sums are then lost in its own
    if sharpest in places:
        # without divisions by its density
        found[places == sharpest] = _given_the_others(hierarchy, np.array([sharpest]))
    return found


def _given_the_others(hierarchy: NormalHierarchy, places: Index) -> Array:
    """Two-sided p-values of some groups, given those that are none of them; (k,)."""
    others = hierarchy.without(places)
    sd = np.sqrt(hierarchy.s[places, None] ** 2 + others.tau**2 + others.sd**2)
    distance = (hierarchy.y[places, None] - others.mean) / sd
    return np.asarray(2.0 * np.minimum(*(ndtr(side * distance) @ others.weight for side in (-1.0, 1.0))))


def _far(hierarchy: NormalHierarchy) -> NDArray[np.intp]:
    """Places of groups beyond `_NEAR` at a node of tau."""
    few = hierarchy.thinned()
    step = max(1, _BLOCK // few.tau.size)
    places = np.arange(few.y.size)
    parts = [places[first : first + step] for first in range(0, places.size, step)]
    far = [np.abs(_predicted(few, part)[0]).max(axis=0) > _NEAR for part in parts]
    return np.flatnonzero(np.concatenate(far))


def _predicted(hierarchy: NormalHierarchy, places: NDArray[np.intp]) -> tuple[Array, Array]:
    """How many sd groups lie from what the others predict, and the log density there; (m, k) each."""
    y = hierarchy.y[places]
    total = hierarchy.s[places] ** 2 + hierarchy.tau[:, None] ** 2
    # with precisions P of the mean: y_i - m_-i = (y_i - m) P / P_-i, and its variance is total P / P_-i
    share = np.minimum(hierarchy.sd[:, None] ** 2 / total, 1.0 - 1e-12)
    variance = total / (1.0 - share)
    distance = (y - hierarchy.mean[:, None]) / (1.0 - share) / np.sqrt(variance)
    return distance, -0.5 * (distance**2 + np.log(2.0 * math.pi * variance))
