"""Whether all values of a stream scatter as their sigma says: chi2 of each observable, from both sides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtr, chdtrc

from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text, times_text


class Scatter(NamedTuple):
    """Of the values of one observable.

    Attributes
    ----------
    square : float
        Sum of squares of residuals over sigma.
    dof : float
        Values less the constants that they determine.
    """

    square: float
    dof: float

    @property
    def factor(self) -> float:
        """Noise over sigma."""
        return math.sqrt(self.square / self.dof)

    @property
    def is_wide(self) -> bool:
        """Whether sigma is too small."""
        return float(chdtrc(self.dof, self.square)) < REFUTED

    @property
    def is_narrow(self) -> bool:
        """Whether it is too large."""
        return float(chdtr(self.dof, self.square)) < REFUTED


def scatter_of_each(problem: Problem, optimum: LeastSquaresFit) -> dict[str, Scatter]:
    """Scatter of each observable that has more values than it determines constants, by condensed rows."""
    z2, counts = (problem.residual(optimum.optimum.theta) / optimum.sigma) ** 2, problem.noise.counts
    assert counts is not None
    found = {}
    for name in problem.rows.names:
        rows = problem.rows.rows_of(name)
        dof = float(counts[rows].sum() - optimum.gaussian.leverage[rows].sum())
        if dof > 1.0:
            found[name] = Scatter(float(z2[rows].sum()), dof)
    return found


def scatter_of_all(problem: Problem, optimum: LeastSquaresFit) -> dict[str, Fact]:
    """What chi2 of all values says of a given sigma, by so little that no sample shows it.

    Parameters
    ----------
    problem, optimum
        Of condensed rows, with a sigma that is known.

    Returns
    -------
    dict of str to Fact
        "scatter_too_large" and "scatter_too_small", as far as values do.
    """
    each = scatter_of_each(problem, optimum)
    wide = [name for name, found in each.items() if found.is_wide]
    narrow = [name for name, found in each.items() if found.is_narrow]
    facts = {}
    if wide:
        facts["scatter_too_large"] = _fact("scatter_too_large", each, wide)
    if narrow:
        facts["scatter_too_small"] = _fact("scatter_too_small", each, narrow)
    return facts


def _fact(name: str, each: dict[str, Scatter], of: Sequence[str]) -> Fact:
    square, dof = np.sum([each[one] for one in of], axis=0).tolist()
    if name == "scatter_too_large":
        p, factor, more = float(chdtrc(dof, square)), math.sqrt(square / dof), "more"
        why = "sigma is too small, or a few impacts scatter that no sample holds"
    else:
        p, factor, more = float(chdtr(dof, square)), math.sqrt(dof / max(square, 1e-300)), "less"
        why = "sigma is too large"
    which = f"the values of {joined(of)}" if len(of) < len(each) else "the values"
    says = (
        f"{which} scatter {times_text(factor)} times {more} than their sigma (chi2 of all = {square:.4g} for "
        f"{dof:.0f} degrees of freedom, p = {p_text(p)}), and means follow the closure: {why}; "
        "--noise unknown takes its size from the scatter"
    )
    figures = {"p": p, "chi2": square, "dof": dof, "factor": factor}
    return Fact(False, says, figures, FACTS[name])
