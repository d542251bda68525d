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

from ifrfit.campaign.normal_hierarchy import FEWEST, NormalHierarchy
from ifrfit.inference.diagnostics.thresholds import REFUTED

Array = NDArray[np.float64]

_ALL = 1500  # groups, of which each is looked at; of more one alone does not move the posterior of tau much,
_NEAR = 3.0  # so that those within so many sd at all its nodes are well within
_BLOCK = 500_000  # numbers at once


def outlying_groups(hierarchy: NormalHierarchy) -> dict[int, float] | None:
    """Groups that are not of the population of the others.

    Returns
    -------
    dict of int to float or None
        Places of the groups, by their p-values, which are two-sided and times the number of groups, below
        `REFUTED`. None for fewer groups than `FEWEST` and one: without one of them there is no population.
    """
    n = hierarchy.y.size
    if n <= FEWEST:
        return None
    chosen = np.arange(n) if n <= _ALL else _far(hierarchy)
    p = np.minimum(predictive_p_values(hierarchy, chosen) * n, 1.0)
    order = np.argsort(p, kind="stable")
    return {int(chosen[at]): float(p[at]) for at in order if p[at] < REFUTED}


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
        found[places == sharpest] = _by_a_fit_of_the_others(hierarchy, sharpest)
    return found


def _by_a_fit_of_the_others(hierarchy: NormalHierarchy, place: int) -> float:
    """The same of one group, without divisions by its density."""
    others = NormalHierarchy.of(np.delete(hierarchy.y, place), np.delete(hierarchy.s, place))
    sd = np.sqrt(hierarchy.s[place] ** 2 + others.tau**2 + others.sd**2)
    distance = (hierarchy.y[place] - others.mean) / sd
    return 2.0 * min(float(others.weight @ ndtr(side * distance)) for side in (-1.0, 1.0))


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
