"""Do the stated uncertainties go up and down like those of few readings each? Then each is a guess."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.thresholds import FACTS, FEWEST_BENDS, ROUGH_SIGMA
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined

_OF_NORMAL = float(special.ndtri(0.75))  # median of the absolute value of a standard normal number
_MOST = 8  # degrees of freedom that are told apart


def sigma_of_few(problem: Problem) -> Fact | None:
    """Look at how the stated sigmas change from one angle to the next, beyond any slope.

    The standard deviation of n normal readings scatters, in its logarithm, by half the root of
    trigamma((n - 1)/2): 0.64 of three readings, 0.40 of five. Over its own standard error the mean of n has
    Student's t of n - 1 degrees of freedom for its law.

    Returns
    -------
    Fact or None
        None where no sigma is used as given, or they change smoothly.
    """
    if problem.noise.is_unknown or not problem.error_model.is_plain:
        return None
    bends: list[Array] = []
    names: list[str] = []
    for name, own in _log_sigmas(problem):
        bends.append(np.abs(own[:-2] - 2.0 * own[1:-1] + own[2:]) / math.sqrt(6.0))
        names.append(name)
    every = np.concatenate([np.empty(0), *bends])
    if every.size < FEWEST_BENDS:
        return None
    rough = float(np.median(every)) / _OF_NORMAL
    if rough < ROUGH_SIGMA:
        return None
    dof = np.arange(1, _MOST + 1)
    near = int(dof[np.argmin(np.abs(0.5 * np.sqrt(special.polygamma(1, 0.5 * dof)) - rough))])
    tails = f"; --tails student-t --dof {near} takes each as such a guess" if problem.closure.bilinear else ""
    who, times = joined(list(dict.fromkeys(names))), math.exp(rough)
    says = (
        f"the sigmas of {who} go up and down by a factor of {times:.2g} from row to row, as those of some "
        f"{near + 1} readings do: each is a guess then, the small ones weigh too much, and intervals are too "
        f"short. --noise unknown takes one size for all{tails}"
    )
    return Fact(False, says, {"scatter": rough, "dof": near}, FACTS["sigma_of_few"])


def _log_sigmas(problem: Problem) -> Iterator[tuple[str, Array]]:
    """Logarithms of the given sigmas of each observable of each series, by the angle, where they differ."""
    rows, noise = problem.rows, problem.noise
    used = noise.is_given if noise.is_mixed else np.ones(len(rows), dtype=bool)
    for name in rows.names:
        for number in range(len(problem.series)):
            own = rows.rows_of(name)
            own = own[(rows.series[own] == number) & used[own]]
            order = own[np.argsort(rows.gamma_deg[own], kind="stable")]
            # two instruments have two sigmas, however they take turns
            if order.size > 2 and np.unique(noise.base[order]).size > 0.5 * order.size:
                yield name, np.log(noise.base[order])
