"""Repeats of one setting: their scatter is a yardstick in which no law has a part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.quadratic_forms import Array, orthonormal, smooth_departure, sum_exceeds
from ifrfit.inference.diagnostics.residuals import Residuals, exclude_name
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Index
from ifrfit.inference.optimize.angle_offset import slope_by_offset
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text, plus_minus

_FEWEST = 3  # degrees of freedom of repeats below which they are no yardstick
_MOST_EXACT = 1000  # settings whose form is worked out with what the constants take
_SUSPECT = 2.0  # standard deviations from which the exact p value is worked out
_EXPLAINED = 1e-9  # share of an error of the angle below which constants explain it, but for rounding
_SMOOTH = 0.01  # p of a smooth departure of the means below which the law is in question, not the settings
_FITS = 0.05  # p of all other settings from which one alone is off
_TELL = 10  # settings below which such an error looks like a law that does not hold
_MOST_NAMED = 6  # rows


@dataclass(frozen=True)
class Repeated:
    """Rows of one observable, and what they say of each of the k settings that they were measured at.

    Attributes
    ----------
    observable : str
    kind : str
        Of the observable.
    rows : ndarray of int, (n,)
    setting : ndarray of int, (n,)
        Number of each row's setting.
    weight : ndarray, (k,)
        Root of the sum of 1/sigma^2 of a setting's rows: what a change of its mean is in units of `mean`.
    mean : ndarray, (k,)
        Mean residual of each setting times `weight`; of variance 1 but for a factor.
    jacobian : ndarray, (k, p)
        Of `mean`, by the free constants.
    by_angle : ndarray, (k,)
        Change of `mean` by a degree.
    tau : ndarray, (k,)
    pure, dof_pure : float
        Sum of squares of the standardised residuals about the means, and its degrees of freedom.
    """

    observable: str
    kind: str
    rows: Index
    setting: Index
    weight: Array
    mean: Array
    jacobian: Array
    by_angle: Array
    tau: Array
    pure: float
    dof_pure: int

    def without(self, setting: int) -> tuple[float, float, float]:
        """p of `lack` of all other settings; how far this one is off what they say, and its sd."""
        kept = np.delete(np.arange(self.mean.size), setting)
        p = _lack(self.jacobian[kept], self.mean[kept], self.pure, self.dof_pure)
        coefficients = np.linalg.pinv(self.jacobian[kept], rcond=1e-9)
        slope = self.jacobian[setting] @ coefficients
        off = float(self.mean[setting] - slope @ self.mean[kept])
        sd = math.sqrt((1.0 + float(slope @ slope)) * self.pure / self.dof_pure)
        return p, off / float(self.weight[setting]), sd / float(self.weight[setting])

    @property
    def tests(self) -> dict[str, float]:
        """p that constants of its own describe the means of this observable: by F, and of angles set wrongly.

        The latter weighs each setting by what an error of its angle would do there (the score test of the
        variance of such errors): settings that the angle does not move have no part in it.
        """
        found = {self.observable: _lack(self.jacobian, self.mean, self.pure, self.dof_pure)}
        own = orthonormal(self.jacobian)
        if self.mean.size > own.shape[1] and self.by_angle.any():
            found[f"angles of {self.observable}"] = self._errors_of_angles(own)
        return found

    def _errors_of_angles(self, own: Array) -> float:
        d = self.by_angle / np.abs(self.by_angle).max()
        left = self.mean - own @ (own.T @ self.mean)
        found = float(((d * left) ** 2).sum()) / (self.pure / self.dof_pure)
        weights = _weights(d, own)
        if weights.max() < _EXPLAINED:
            return 1.0
        mean, square = float(weights.sum()), float(weights @ weights)
        if found < mean + _SUSPECT * math.sqrt(2.0 * (square + mean * mean / self.dof_pure)):
            return 1.0
        return sum_exceeds(np.append(weights, np.full(self.dof_pure, -found / self.dof_pure)))


def _weights(d: Array, own: Array) -> Array:
    """Eigenvalues of the form d P d, P what the columns `own` leave; of many settings those of d d.

    A few columns move each of these to its neighbour at the most.
    """
    if d.size > _MOST_EXACT:
        return d * d
    moved = d[:, None] * (np.eye(d.size) - own @ own.T)
    return np.asarray(np.linalg.eigvalsh(moved @ moved.T))


def _lack(jacobian: Array, mean: Array, pure: float, dof_pure: int) -> float:
    own = orthonormal(jacobian)
    dof = mean.size - own.shape[1]
    if dof < 1:
        return 1.0
    left = mean - own @ (own.T @ mean)
    return float(special.fdtrc(dof, dof_pure, float(left @ left) / dof / (pure / dof_pure)))


def repeated(problem: Problem, fit: LeastSquaresFit, r: Array) -> list[Repeated]:
    """The observables that were measured repeatedly at one setting, with standardised residuals `r`."""
    rows = problem.rows
    jacobian = problem.free_jacobian(fit.optimum.theta)
    by_angle = slope_by_offset(problem, fit.optimum.theta)
    found = []
    for observable in rows.observables:
        own = rows.rows_of(observable.name)
        _, first, setting = np.unique(rows.setting[own], return_index=True, return_inverse=True)
        count = first.size
        if own.size - count < _FEWEST:
            continue
        precision = 1.0 / fit.sigma[own]
        weight = np.sqrt(np.bincount(setting, precision**2))
        mean = np.bincount(setting, precision * r[own]) / weight
        pure = float(r[own] @ r[own] - mean @ mean)
        if pure <= 1e-12 * float(r[own] @ r[own]):
            continue
        found.append(
            Repeated(
                observable.name, observable.kind, own, setting, weight, mean,
                jacobian[own[first]] * weight[:, None], by_angle[own[first]] * weight, rows.tau[own[first]],
                pure, own.size - count,
            )
        )  # fmt: skip
    return found


@dataclass(frozen=True)
class _Scatter:
    """An observable whose settings differ by more than its repeats, in no smooth way.

    Attributes
    ----------
    of : Repeated
    p : float
        Of the settings against the repeats, corrected for the number of observables.
    p_smooth : float
        Of a smooth departure of the means beside their scatter.
    between, within : float
        Standard deviations of the settings beyond what their repeats explain, and of repeats, in units of the
        value.
    alone : int or None
        The one setting that is off.
    """

    of: Repeated
    p: float
    p_smooth: float
    between: float
    within: float
    alone: int | None


def settings_scatter(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> Fact | None:
    """Whether settings differ by more than their repeats, in a way that no smooth law of the angle explains.

    Then the law is not refuted, but repeats are no independent impacts: they share an angle that was set
    wrongly, or are readings of one impact. The means are held against constants of the observable's own (F,
    by the scatter of repeats, p corrected for the number of tests as in `lack_of_fit`), then against a smooth
    departure by their own scatter. A single setting counts that leaves no lack of fit without it, and
    that is the first or last in tau only where no smooth departure shows.

    Returns
    -------
    Fact or None
        None where they do not, or where it is not told from a law that does not hold.
    """
    if problem.noise.is_known:
        return None
    every = repeated(problem, fit, residuals.standardised)
    tests = [each.tests for each in every]
    count = 1 + sum(map(len, tests))  # with that of all together
    p = [count * min(own.values()) for own in tests]
    found = [_scatter(fit, each, one) for each, one in zip(every, p, strict=True) if one < REFUTED]
    scattered = [each for each in found if each is not None]
    if not scattered or len(scattered) < len(found):
        return None
    scattered.sort(key=lambda each: each.p)
    first = scattered[0]
    figures = {
        "p": first.p,
        "p_smooth": min(each.p_smooth for each in scattered),
        "observables": [each.of.observable for each in scattered],
        "between": first.between,
        "within": first.within,
    }
    if first.alone is not None and len(scattered) == 1:
        says = _one_setting(problem, first, first.alone)
    else:
        says = _many_settings(scattered, every)
    return Fact(False, says, figures, FACTS["repeats"])


def _scatter(fit: LeastSquaresFit, each: Repeated, p: float) -> _Scatter | None:
    order = np.argsort(each.tau, kind="stable")
    smooth = smooth_departure([order], each.tau, each.jacobian, each.mean, each.weight)
    own = orthonormal(each.jacobian)
    left = each.mean - own @ (own.T @ each.mean)
    free = 1.0 - (own**2).sum(axis=1)
    alone = int(np.argmax(np.where(free > 1e-6, left**2 / np.maximum(free, 1e-6), 0.0)))
    mended = each.without(alone)[0] >= _FITS
    at_end = alone in (int(order[0]), int(order[-1]))
    if smooth is None and (not mended or at_end):
        return None
    if smooth is not None and smooth.p < _SMOOTH and (not mended or at_end):
        return None
    within = each.pure / each.dof_pure
    dof = max(each.mean.size - own.shape[1], 1)
    between = float(left @ left) / dof if smooth is None else smooth.rest / smooth.dof
    between = max(between - within, 0.0) / float((each.weight**2).mean())
    sigma = float(np.sqrt((fit.sigma[each.rows] ** 2).mean()))
    return _Scatter(
        each, p, 1.0 if smooth is None else smooth.p, math.sqrt(between), math.sqrt(within) * sigma,
        alone if mended else None,
    )  # fmt: skip


def few_settings(problem: Problem, fit: LeastSquaresFit, r: Array) -> str:
    """What else may be the reason, where too few settings tell a law that fails from angles set wrongly."""
    few = [
        each.observable
        for each in repeated(problem, fit, r)
        if each.mean.size < _TELL and min(each.tests.values()) < REFUTED
    ]
    if not few:
        return ""
    return (
        f". {few[0]} has too few angles to tell a law that does not hold from an error that all repeats "
        "of an angle share, as of the angle that was set: then give the mean of each angle as one row"
    )


def _one_setting(problem: Problem, found: _Scatter, setting: int) -> str:
    rows = found.of.rows[found.of.setting == setting]
    gamma = problem.rows.gamma_deg[rows[0]]
    _, off, sd = found.of.without(setting)
    lines = [exclude_name(problem, int(row)) for row in rows]
    more = " and so on" if len(lines) > _MOST_NAMED else ""
    remedy = " ".join(f"--exclude {line}" for line in lines[:_MOST_NAMED])
    return (
        f"the {rows.size} repeats of {found.of.observable} at {gamma:g} degrees are off together, by "
        f"{plus_minus(off, sd)} (p = {p_text(found.p)}, pure error): look at how this angle was set, or "
        f"leave them out with {remedy}{more}"
    )


def _many_settings(found: Sequence[_Scatter], every: Sequence[Repeated]) -> str:
    names = joined([each.of.observable for each in found])
    sizes = joined([f"{each.between:.2g} beside {each.within:.2g}" for each in found])
    few = min(np.median(np.bincount(each.of.setting)) for each in found) <= 3
    of_angle = "the angle as it was set, by an error that all repeats share"
    of_impact = (
        "repeated readings of one impact are not repeats of an experiment: give them one number in a column "
        "impact_id, so that one of them counts, or give their mean"
    )
    says = (
        f"rows of one setting agree better with one another than settings do with any smooth law, in {names} "
        f"(settings scatter by {sizes} of the repeats, p = {p_text(found[0].p)}): errors of rows are not "
        "independent, and intervals too short. "
    )
    normal = any(each.of.kind not in OBLIQUE for each in found)
    others = any(each.kind not in OBLIQUE for each in every)
    if normal:  # the angle has no part in e_n
        return says + of_impact[0].upper() + of_impact[1:]
    mean = f"{of_angle}; give the mean of each angle as one row"
    if others or not few:
        return f"{says}Look at {mean}"
    return f"{says}{of_impact[0].upper()}{of_impact[1:]}. Or it is {mean}"
