"""Lack of fit from sums: whether the means of narrow intervals of tau follow the closure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.inference.sufficient_statistics.transition_window import MEAN, SCATTER
from ifrfit.text import joined

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_MANY = 30.0  # different impacts, from which on their copies count as on average
_ANGLES = 8  # true angles that a rounded one is the mean of
_OFF_CENTRE = 1.0 / 12.0  # steps that the mean of the angles behind a rounded one may lie off it
_HARMONICS = np.arange(1.0, 5.0)


@dataclass(frozen=True)
class Rounding:
    """Decimal steps in which readings stand.

    Attributes
    ----------
    gamma : float
        Degrees.
    values : mapping of str to float
        By observable.
    """

    gamma: float
    values: Mapping[str, float]

    @classmethod
    def of(cls, of: Accumulated) -> Rounding:
        """That of all rows."""
        names = of.stream.observables
        values = {
            name: min(known.last_decimal for known in of.groups[number :: len(names)])
            for number, name in enumerate(names)
        }
        return cls(min(known.last_decimal_of_gamma for known in of.groups), values)

    def words(self, names: list[str]) -> str:
        """Of the angle and of some observables."""
        steps = [f"{name} in steps of {self.values[name]:g}" for name in names]
        return joined([f"angles in steps of {self.gamma:g} degrees", *steps])

    def leaves(self, problem: Problem, optimum: LeastSquaresFit, rows: Index, scatter: float) -> Array:
        """How far rounding alone may move the mean of many values off the closure at their angle, (m,).

        An angle stands for all within half a step, of which the closure has another mean, and which lie a
        twelfth of a step off on average where their density changes by itself from one step to the next; at
        the least and the largest angle by half a step at most. A value that
        scatters by s about m, rounded to steps of h, has one that is off m by up to h/pi times the sum of
        exp(-2 pi^2 k^2 s^2/h^2)/k over k = 1, 2, ... (Fourier series of the rounding error, times the
        characteristic function of the scatter), and by h/2 at most.

        Parameters
        ----------
        problem, optimum
        rows : ndarray of int, (m,)
        scatter : float
            Of values over their sigma.
        """
        part, theta = problem.with_rows(rows), optimum.optimum.theta
        steps = (np.arange(_ANGLES) + 0.5) / _ANGLES - 0.5
        gamma = part.rows.gamma_deg
        at_end = (gamma < gamma.min() + 0.5 * self.gamma) | (gamma > gamma.max() - 0.5 * self.gamma)
        # an angle of 0 or 90 degrees stands for one side
        off = (np.clip(gamma + self.gamma * step, 0.0, 90.0) - gamma for step in steps)
        smeared = np.mean([part.at_offset(each).predict(theta) for each in off], axis=0)
        fitted, side = part.predict(theta), self.gamma * np.where(at_end, 0.5, _OFF_CENTRE)
        moved = [
            part.at_offset(np.clip(gamma + each, 0.0, 90.0) - gamma).predict(theta) for each in (side, -side)
        ]
        left = np.abs(smeared - fitted) + np.max(np.abs(np.subtract(moved, fitted)), axis=0)
        names = problem.observations.table["observable"].to_numpy(dtype=object)
        for name in dict.fromkeys(names[rows].tolist()):
            h, every = self.values[name], np.flatnonzero(names == name)
            spread = scatter * problem.noise.per_measurement(optimum.sigma, every)
            # what scatters has the rounding in it
            over = max(spread**2 - h * h / 12.0, 0.0) / (h * h)
            waves = np.exp(-2.0 * math.pi**2 * _HARMONICS**2 * over) / _HARMONICS
            left[names[rows] == name] += h * min(float(waves.sum()) / math.pi, 0.5)
        return np.asarray(left)


def lack_of_fit_of_means(
    problem: Problem,
    optimum: LeastSquaresFit,
    kinds: NDArray[np.object_],
    rounding: Rounding,
    effect: float = 1.0,
) -> Fact:
    """Whether the means of narrow intervals of tau follow the closure, by what values scatter about them.

    An F test, of all impacts but those about the transition, of which none is a mean. What rounding may leave
    of a mean is none of a departure.

    Parameters
    ----------
    problem, optimum
        Of condensed rows.
    kinds : ndarray of object, (n,)
        What these are.
    rounding : Rounding
    effect : float
        Variance of a mean over that of one of as many independent impacts: more than 1 where impacts are
        copied. Intervals are then put together until so many impacts are in each that it holds.
    """
    means = _Means.of(problem, optimum, kinds)
    if effect > 1.0:
        means = means.together(effect)
    dof = means.z.size - optimum.gaussian.rank
    rest = means.n - effect * means.z.size
    if dof < 1.0 or rest < 1.0 or means.within <= 0.0:
        says = "too few impacts away from the transition to look for lack of fit"
        return Fact(True, says, {"p": None, "tested": False}, FACTS["lack_of_fit"])
    scatter = means.within / rest

    def test(z: Array) -> tuple[float, float]:
        """p, and the departure over the noise of one value."""
        between = float(z @ z)
        departure = math.sqrt(max(between / scatter - effect * dof, 0.0) / means.n)
        return float(fdtrc(dof, rest / effect, between / effect / dof / scatter)), departure

    p, departure = test(means.z)
    beyond = ""
    if p < REFUTED:
        left = rounding.leaves(problem, optimum, means.row, math.sqrt(scatter)) / means.sigma
        again, departure = test(np.maximum(np.abs(means.z) - left, 0.0))
        if again >= REFUTED:
            table = problem.observations.table["observable"].to_numpy(dtype=object)
            names = list(dict.fromkeys(table[means.row].tolist()))
            beyond = f" beyond what rounding leaves open, of {rounding.words(names)}"
        p = again
    figures = {"p": p, "dof": dof, "departure_over_noise": departure}
    if p < REFUTED:
        says = (
            f"the closure does not describe these data (p = {p:.2g}, means of narrow intervals of tau): they "
            f"depart from it by {departure:.2g} times the noise of one value. ifrfit compare on a part of "
            "the data shows which closure does"
        )
        return Fact(False, says, figures, FACTS["lack_of_fit"])
    says = f"no lack of fit{beyond} (p = {p:.2g}, means of narrow intervals of tau)"
    return Fact(True, says, figures, FACTS["lack_of_fit"])


@dataclass(frozen=True)
class _Means:
    """Residuals of means, and what values scatter about these.

    Attributes
    ----------
    z : ndarray, (m,)
        Over their sigma.
    sigma : ndarray, (m,)
        Of a mean.
    count : ndarray, (m,)
        Impacts behind it.
    row : ndarray of int, (m,)
        Condensed row that has its angle.
    group : ndarray of int, (m,)
        Number of series and observable.
    tau : ndarray, (m,)
    within : float
        Sum of squares about the means, over sigma squared.
    n : float
        Impacts.
    """

    z: Array
    sigma: Array
    count: Array
    row: Index
    group: Index
    tau: Array
    within: float
    n: float

    @classmethod
    def of(cls, problem: Problem, optimum: LeastSquaresFit, kinds: NDArray[np.object_]) -> _Means:
        """Of condensed rows."""
        counts = problem.noise.counts
        assert counts is not None
        z = problem.residual(optimum.optimum.theta) / optimum.sigma
        is_tangential = problem.rows.of_kind("tangential")
        means = np.flatnonzero((kinds == MEAN) & is_tangential)
        # a pair stands about its mean: what it has in common is that of the mean, its difference is scatter
        pairs = np.flatnonzero((kinds == SCATTER) & is_tangential).reshape(-1, 2)
        apart = np.diff(z[pairs], axis=1)[:, 0] / math.sqrt(2.0)
        row = np.append(means, pairs[:, 0])
        count = np.append(counts[means], counts[pairs].sum(axis=1))
        return cls(
            np.append(z[means], z[pairs].sum(axis=1) / math.sqrt(2.0)),
            np.append(optimum.sigma[means], optimum.sigma[pairs[:, 0]] / math.sqrt(2.0)),
            count,
            row,
            problem.rows.series[row] * len(problem.rows.names) + problem.rows.which[row],
            problem.rows.tau[row],
            float(apart @ apart),
            float(count.sum()),
        )

    def together(self, effect: float) -> _Means:
        """Means of neighbouring intervals of one series and observable, of many impacts each."""
        order = np.lexsort((self.tau, self.group))
        number = np.empty(self.z.size, dtype=np.intp)
        made = -1
        for group in np.unique(self.group):
            own = order[self.group[order] == group]
            places = np.floor((np.cumsum(self.count[own]) - 0.5 * self.count[own]) / (_MANY * effect))
            _, among = np.unique(places, return_inverse=True)
            number[own] = made + 1 + among
            made = int(number[own].max())
        weight = self.sigma**-2.0
        whole = np.bincount(number, weight)
        mean = np.bincount(number, weight * self.z * self.sigma) / whole
        first = np.unique(number, return_index=True)[1]
        z = mean * np.sqrt(whole)
        return _Means(
            z,
            np.asarray(whole**-0.5, dtype=float),
            np.asarray(np.bincount(number, self.count), dtype=float),
            self.row[first],
            self.group[first],
            self.tau[first],
            self.within + float(self.z @ self.z) - float(z @ z),
            self.n,
        )
