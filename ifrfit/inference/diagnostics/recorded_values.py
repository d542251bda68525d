"""Values as they were written down: rounded to steps in which they scatter little.

Rounding errors of readings y that differ by several steps are as good as independent: part of the scatter.
Readings of one true value m that scatter by less than about half a step all lie on the same side of it: the
likelihood is that of counts in cells, prod [Phi((y + h/2 - m)/s) - Phi((y - h/2 - m)/s)], for steps h and a
scatter s (Heitjan 1989, Statistical Science 4, 164), and no number of readings narrows m below a cell.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.rounding_step import step_of_readings
from ifrfit.inference.diagnostics.thresholds import COARSE, FACTS, TOO_NARROW
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact

_FEWEST_OF_ONE = 4  # readings of one true value
_ONE_VALUE = 0.1  # steps within which values of the law are one
_LEVELS, _SCATTERS = 321, 48  # nodes of m and s
_MARGIN = 1.5  # steps beyond the readings up to which m is looked for
_LEAST_SCATTER, _LARGEST_SCATTER = 0.02, 3.0  # steps
_TINY = 1e-300


@dataclass(frozen=True)
class _Plateau:
    """Readings that the law has at one value.

    Attributes
    ----------
    observable : str
    rows : ndarray of int
    step : float
        Greatest decimal step that all readings are multiples of.
    scatter : float
        Of one reading, as the fit takes it.
    mean, sd : float
        Mean and its standard deviation, by that scatter.
    mean_rounded, sd_rounded : float
        Of the true value, by the counts in the cells.
    """

    observable: str
    rows: Index
    step: float
    scatter: float
    mean: float
    sd: float
    mean_rounded: float
    sd_rounded: float

    @property
    def ratio(self) -> float:
        """How many times too small `sd` is, for the distance between the two means as well."""
        return math.hypot(self.sd_rounded, self.mean_rounded - self.mean) / self.sd


def rounded_readings(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Look for readings of one value whose rounding is coarser than their scatter.

    Returns
    -------
    Fact or None
        None where rounding narrows nothing.
    """
    worst = max(_plateaus(problem, found), key=lambda each: each.ratio, default=None)
    if worst is None or worst.ratio < TOO_NARROW:
        return None
    figures = {
        "observable": worst.observable,
        "step": worst.step,
        "scatter": worst.scatter,
        "sd": worst.sd,
        "mean_rounded": worst.mean_rounded,
        "sd_rounded": worst.sd_rounded,
    }
    value = f"{worst.mean_rounded:.4g}"
    what = "e_n" if worst.observable == "e_n" else f"the one value that {worst.rows.size} of them are of"
    says = (
        f"readings of {worst.observable} stand in steps of {worst.step:g} and scatter by "
        f"{worst.scatter:.2g}: their rounding errors are common to them, and leave {what} "
        f"{value} +- {worst.sd_rounded:.2g}, not +- {worst.sd:.2g}. Read them to more decimals"
    )
    others = [name for name in problem.rows.names if name != worst.observable]
    if worst.observable == "e_n" and others:
        kept = " ".join(f"--observable {name}" for name in others)
        says += f", or give the value in their place: {kept} --prior e_n={value},{worst.sd_rounded:.2g}"
    return Fact(False, says, figures, FACTS["rounded_readings"])


def is_coarse(problem: Problem, found: LeastSquaresFit) -> bool:
    """Whether any observable scatters by less than a step of its readings: they fall into few cells."""
    every = (problem.rows.rows_of(name) for name in problem.rows.names)
    return any(_rms(found.sigma[own]) < step_of_readings(problem, own) for own in every if own.size)


def _plateaus(problem: Problem, found: LeastSquaresFit) -> Iterator[_Plateau]:
    fitted, value = problem.predict(found.optimum.theta), problem.rows.value
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        step = step_of_readings(problem, own)
        if _rms(found.sigma[own]) >= COARSE * step:
            continue
        level = np.round(fitted[own] / (_ONE_VALUE * step))
        for one in np.unique(level):
            rows = own[level == one]
            if rows.size < _FEWEST_OF_ONE or np.ptp(value[rows]) > 2.0 * _LARGEST_SCATTER * step:
                continue
            sigma = found.sigma[rows]
            known = _rms(sigma) if problem.noise.is_given[rows].all() else None
            mean, sd = _mean_of_cells(value[rows], step, known)
            weight = sigma**-2.0
            average, own_sd = float(np.average(value[rows], weights=weight)), float(weight.sum() ** -0.5)
            yield _Plateau(name, rows, step, _rms(sigma), average, own_sd, mean, sd)


def _mean_of_cells(value: Array, step: float, sigma: float | None) -> tuple[float, float]:
    """Mean and standard deviation of the true value of rounded readings; flat in it and an unknown scatter.

    Parameters
    ----------
    value : ndarray, (n,)
    step : float
    sigma : float or None
        None where it is unknown.
    """
    cells, counts = np.unique(np.round(value / step), return_counts=True)
    m = np.linspace(cells[0] - _MARGIN, cells[-1] + _MARGIN, _LEVELS)[:, None, None]
    largest = _LARGEST_SCATTER
    s = np.geomspace(_LEAST_SCATTER, largest, _SCATTERS) if sigma is None else np.array([sigma / step])
    upper = (cells + 0.5 - m) / s[:, None]
    lower = (cells - 0.5 - m) / s[:, None]
    # the tail that is the smaller one keeps its digits
    share = np.where(
        lower > 0.0, special.ndtr(-lower) - special.ndtr(-upper), special.ndtr(upper) - special.ndtr(lower)
    )
    log = (counts * np.log(np.maximum(share, _TINY))).sum(axis=-1) + np.log(s)
    weight = np.exp(log - log.max()).sum(axis=1)
    weight /= weight.sum()
    at = m[:, 0, 0]
    mean = float(weight @ at)
    return mean * step, math.sqrt(float(weight @ (at - mean) ** 2)) * step


def _rms(sigma: Array) -> float:
    return float(np.sqrt((sigma**2).mean()))
