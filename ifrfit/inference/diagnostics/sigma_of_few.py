"""Do the stated uncertainties go up and down like those of few readings each? Then each is a guess."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.thresholds import FACTS, FEWEST_BENDS, ROUGH_SIGMA
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined

_OF_NORMAL = float(special.ndtri(0.75))  # median of the absolute value of a standard normal number
_MOST = 8  # degrees of freedom that are told apart
_EXPLAINED = 0.5  # share of the mean square of bends below which an explanation counts
_PER_REGRESSOR = 2  # bends left for each slope that is fitted to them
_RANK = 1e-9


def sigma_of_few(problem: Problem) -> Fact | None:
    """Look at how the stated sigmas change from one angle to the next, beyond any slope.

    What errors of one size explain is taken off first: velocities with one error have ratios whose sigmas go
    with one over the speed and over the denominator.

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
    for column in _columns(problem):
        bends.append(column.bends())
        names.append(column.name)
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


@dataclass(frozen=True)
class _Column:
    """Given sigmas of one observable in one series, in the order of the angle; m rows.

    Attributes
    ----------
    log_sigma : ndarray, (m,)
    regressors : ndarray, (m, k)
        Logarithms of what errors of one size are divided by, as they vary: speed, slip, cosine, sine, value.
    divided : ndarray, (m, h)
        `log_sigma` plus or less those, for errors that are exactly of one size.
    """

    name: str
    log_sigma: Array
    regressors: Array
    divided: Array

    def bends(self) -> Array:
        """Second differences of the logarithms, (m - 2,), beyond what errors of one size explain.

        An explanation counts where it leaves less than half of the mean square.
        """
        plain = _bends(self.log_sigma)
        best, least = plain, _EXPLAINED * float((plain**2).mean())
        for left in _bends(self.divided).T:
            if float((left**2).mean()) < least:
                best, least = left, float((left**2).mean())
        slopes = _bends(self.regressors)
        free = plain.size - slopes.shape[1]
        if slopes.shape[1] and free >= _PER_REGRESSOR * slopes.shape[1]:
            left = plain - slopes @ np.linalg.lstsq(slopes, plain, rcond=_RANK)[0]
            left = left * math.sqrt(plain.size / free)
            if float((left**2).mean()) < least:
                best = left
        return np.asarray(np.abs(best))


def _bends(values: Array) -> Array:
    """Second differences along the first axis, each of the standard deviation of the values."""
    return np.asarray((values[:-2] - 2.0 * values[1:-1] + values[2:]) / math.sqrt(6.0))


def _columns(problem: Problem) -> Iterator[_Column]:
    """The given sigmas of each observable of each series, by the angle, where they differ."""
    rows, noise = problem.rows, problem.noise
    used = noise.is_given if noise.is_mixed else np.ones(len(rows), dtype=bool)
    for name in rows.names:
        for number in range(len(problem.series)):
            own = rows.rows_of(name)
            own = own[(rows.series[own] == number) & used[own]]
            order = own[np.argsort(rows.gamma_deg[own], kind="stable")]
            # two instruments have two sigmas, however they take turns
            if order.size > 2 and np.unique(noise.base[order]).size > 0.5 * order.size:
                log_sigma = np.log(noise.base[order])
                yield _Column(name, log_sigma, *_explanations(problem, order, log_sigma))


def _explanations(problem: Problem, order: Index, log_sigma: Array) -> tuple[Array, Array]:
    """`_Column.regressors` and `_Column.divided`.

    Ratios of velocities have an error of one velocity, over the speed, over their denominator: that is the
    slip of beta, the cosine of e_n, the sine of beta_cm. An error in percent goes with the value.
    """
    incidence = problem.rows.incidence
    speed = _logs(problem.speeds[order])
    value = _logs(np.abs(problem.rows.value[order]))
    velocities = (_logs(each[order]) for each in (incidence.slip, incidence.cosine, incidence.sine))
    over = [each for each in velocities if each is not None]
    known = [each for each in (speed, *over, value) if each is not None]
    none = np.zeros(order.size)
    by_speed = [none] if speed is None else [none, speed]
    divisors = [one + other for one in by_speed for other in (none, *over)]
    tried = [log_sigma + each for each in divisors[1:]]
    tried += [] if value is None else [log_sigma - value]
    return _side_by_side(known, order.size), _side_by_side(tried, order.size)


def _logs(values: Array) -> Array | None:
    """Logarithms; None where some have none."""
    return np.log(values) if bool(np.isfinite(values).all() and (values > 0.0).all()) else None


def _side_by_side(columns: Sequence[Array], size: int) -> Array:
    """Columns as one array, (size, k), of k columns or none."""
    return np.column_stack([np.empty((size, 0)), *columns])
