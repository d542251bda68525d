"""Discriminators of the psi plane: the slope of sliding, and how far the slope of sticking lies below it.

In the plane Psi_1 = U_t/U_n = tau and Psi_2 = V_t/U_n, sticking is a line through the origin and sliding a
line with an intercept: Psi_2 = (S - D) tau where impacts stick, Psi_2 = S tau - I where they slide, and they
stick where D tau <= I. Since Psi_2 = (1 - (1 + J)/J k) tau, every observable that is linear in the impulse
factor k says the same as a point of the plane, with its own error bar.

References
----------
Foerster, Louge, Chang & Allia (1994), Physics of Fluids 6, 1108, for the plane; Doménech-Carbó (2023), Eqs
(36) and (37), for IFR in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from ifrfit.inference.comparison.result import PsiPlane, Slope
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.piecewise import LinearRows, PiecewiseOptimum, PiecewiseProblem
from ifrfit.inference.profile.curve import ProfileCurve, Resolution
from ifrfit.inference.result.types import Interval
from ifrfit.physics.closure import Closure, rotational_share
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import rebound

SLIDING, DIFFERENCE, INTERCEPT = 0, 1, 2  # places of S, D and I in t
STEEPEST = 10.0  # size of a slope beyond which nothing is looked for

_UNKNOWNS = 3
_FEWEST = 5  # rows: three unknowns, and two to tell the noise
_ITERATIONS = 100
_CONVERGED = 1e-8
_LEVEL = 0.95
_RESOLUTION = Resolution(scan=6, crossing=1e-6, between=False)  # of profiles
_SIXTEENTH = 1.0 / 16.0  # a distance to begin with where there is no standard error


@dataclass(frozen=True)
class PsiRows:
    """LinearRows of the plane.

    Attributes
    ----------
    tau : ndarray, (n,)
    value : ndarray, (n,)
        Observation less what the observable is without slip after.
    weight_of_psi : ndarray, (n,)
        Derivative of the observation by Psi_2/tau.
    base : ndarray, (n,)
        Its uncertainty, up to the unknown noise: sigma as given, or 1.
    group : ndarray of int, (n,)
        Unknown noise of each row; -1 where sigma is given.
    """

    tau: Array
    value: Array
    weight_of_psi: Array
    base: Array
    group: Index

    def weighted(self, sigma: Array) -> PiecewiseProblem:
        """The sum of squares with these uncertainties, in t = (S, D, I)."""
        w, y = self.weight_of_psi / sigma, self.value / sigma
        zero = np.zeros_like(w)
        with np.errstate(divide="ignore"):
            inverse = np.where(np.isinf(self.tau), 0.0, 1.0 / self.tau)
        stick = np.column_stack((w, -w, zero))
        slide = np.column_stack((w, zero, -w * np.where(np.isfinite(inverse), inverse, 0.0)))
        still, grazing = self.tau <= 0.0, np.isinf(self.tau)
        always = np.concatenate((stick[still], slide[grazing]))
        inner = ~(still | grazing)
        reach = float(self.tau[inner].max(initial=1.0))
        constraints = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
        # wide enough for slopes of sticking as steep, and for all impacts to stick
        limits = STEEPEST * np.array([1.0, 1.0, 2.0, 0.0, 4.0 * reach, 0.0])
        return PiecewiseProblem(
            self.tau[inner],
            LinearRows.of(stick[inner], y[inner]),
            LinearRows.of(slide[inner], y[inner]),
            LinearRows.of(always, np.concatenate((y[still], y[grazing]))),
            np.array([0.0, 0.0, 1.0]),
            0.0,
            np.array([0.0, 1.0, 0.0]),
            0.0,
            constraints,
            limits,
        )


def psi_rows(problem: Problem) -> tuple[PsiRows | None, dict[str, str]]:
    """LinearRows that can be restated, and why the others cannot.

    Returns
    -------
    PsiRows or None
        None where there are none.
    mapping
        Observable to the reason.
    """
    e_n = problem.parameters["e_n"].fixed
    share = rotational_share(problem.inertia_factor)
    left_out: dict[str, str] = {}
    parts: list[tuple[Index, Array, Array]] = []
    for name in problem.rows.names:
        at = problem.rows.rows_of(name)
        reason = _reason(name, e_n)
        if reason:
            left_out[name] = reason
            continue
        observable = OBSERVABLES[name]
        assert observable.linear is not None
        scale = {"one": 1.0, "impulse": 1.0 / (1.0 + (e_n or 0.0)), "rebound": 1.0 / (e_n or 1.0)}
        part = problem.rows.take(at)
        offset, slope = (
            scale[observable.scale] * x for x in observable.linear(part.incidence, problem.inertia_factor)
        )
        # k = share (1 - Psi_2/tau)
        told = np.isfinite(offset) & np.isfinite(slope) & (slope != 0.0)
        if told.any():
            rest = part.value[told] - offset[told] - share * slope[told]
            parts.append((at[told], rest, -share * slope[told]))
    if not parts:
        return None, left_out
    rows, value, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    base = problem.noise.base[rows]
    return PsiRows(problem.rows.tau[rows], value, weight, base, problem.noise_numbers[rows]), left_out


def _reason(name: str, e_n: float | None) -> str:
    """Why an observable is no point of the plane; empty if it is one."""
    observable = OBSERVABLES[name]
    if observable.kind in ("normal", "friction"):
        return "holds no tangential velocity"
    if observable.kind == "curved":
        return "is not linear in the tangential impulse"
    if observable.scale != "one" and not e_n:
        return "holds e_n too: fix it"
    return ""


@dataclass(frozen=True)
class _Fitted:
    """The free-slope fit: its sum of squares at the final noise, and the optimum."""

    problem: PiecewiseProblem
    optimum: PiecewiseOptimum
    dof: float  # of the noise; infinite where it is known

    @property
    def unit(self) -> float:
        """Variance of a weighted row: 1 where sigma is known, else by the misfit."""
        return 1.0 if math.isinf(self.dof) else max(self.optimum.chi2 / self.dof, np.finfo(float).tiny)

    def rise(self) -> float:
        """Of chi2 at the ends of an interval."""
        if math.isinf(self.dof):
            return float(special.chdtri(1.0, 1.0 - _LEVEL))
        return self.unit * float(special.fdtri(1.0, self.dof, _LEVEL))


def psi_plane(problems: Sequence[Problem]) -> PsiPlane:
    """Fit free slopes to the rows that can be restated in the plane.

    Parameters
    ----------
    problems : sequence of Problem
        The same rows for each closure. What each allows of the slopes, under its own bounds, is put beside.

    Notes
    -----
    The optimum is global, by the certified piecewise machinery; intervals are those of the profile, each
    point of which is a global optimum of the other two unknowns. Unknown noise comes from the misfit of this
    fit, not from that of any closure.
    """
    problem = problems[0]
    rows, left_out = psi_rows(problem)
    if any(c.separate for c in problem.parameters):
        return PsiPlane("constants are separate, and the lines of several series differ", left_out=left_out)
    if problem.common is not None:
        return PsiPlane("it knows no errors that rows have in common", left_out=left_out)
    if problem.offset is not None:
        return PsiPlane("the angles have another offset under each closure", left_out=left_out)
    if not problem.error_model.is_plain:
        return PsiPlane("it knows Gaussian errors of the values only", left_out=left_out)
    if rows is None:
        return PsiPlane(
            "no row is a point of it: " + "; ".join(f"{name} {why}" for name, why in left_out.items()),
            left_out=left_out,
        )
    n = rows.tau.size
    if n < _FEWEST:
        return PsiPlane(f"{n} row{'s' if n > 1 else ''} cannot tell two slopes", n=n, left_out=left_out)
    fitted = _fit(rows)
    if fitted is None:
        return PsiPlane("the rows leave no misfit to tell their noise from", n=n, left_out=left_out)
    t = fitted.optimum.t
    sticks = rows.tau * t[DIFFERENCE] <= t[INTERCEPT]
    errors = _standard_errors(fitted)
    slopes = [
        Slope(
            float(t[place]),
            errors[place],
            _interval(fitted, place, errors[place]),
            expected,
            {name: _p_value(fitted, place, ends) for name, ends in expected.items() if ends is not None},
        )
        for place, expected in zip((SLIDING, DIFFERENCE), _expected(problems), strict=True)
    ]
    n_sticking = int(sticks.sum())
    return PsiPlane("", n, n_sticking, n - n_sticking, slopes[0], slopes[1], left_out)


def _fit(rows: PsiRows) -> _Fitted | None:
    """Global optimum; unknown noises settle by iteration. None where a group has no misfit."""
    factor = np.ones(rows.tau.size)
    if (rows.group < 0).all():
        problem = rows.weighted(rows.base)
        return _Fitted(problem, minimise(problem), math.inf)
    share = 1.0 - _UNKNOWNS / rows.tau.size  # of the degrees of freedom that the rows keep
    for _ in range(_ITERATIONS):
        problem = rows.weighted(rows.base * factor)
        optimum = minimise(problem)
        square = (_residuals(rows, optimum.t) / rows.base) ** 2
        new = np.ones_like(factor)
        for group in np.unique(rows.group[rows.group >= 0]):
            own = rows.group == group
            new[own] = math.sqrt(float(square[own].mean()) / share)
        if not (new > 1e-12 * (1.0 + np.abs(rows.value / rows.base))).all():
            return None
        change = float(np.abs(new / factor - 1.0).max())
        factor = new
        if change <= _CONVERGED:
            break
    problem = rows.weighted(rows.base * factor)
    return _Fitted(problem, minimise(problem), rows.tau.size - _UNKNOWNS)


def _residuals(rows: PsiRows, t: Array) -> Array:
    """Residuals in the units of the observations."""
    sticks = rows.tau * t[DIFFERENCE] <= t[INTERCEPT]
    with np.errstate(divide="ignore"):
        line = np.where(sticks, t[SLIDING] - t[DIFFERENCE], t[SLIDING] - t[INTERCEPT] / rows.tau)
    return np.asarray(rows.value - rows.weight_of_psi * line)


def _standard_errors(fitted: _Fitted) -> tuple[float | None, ...]:
    """Of each unknown with the regimes held; None where the rows do not see it."""
    problem, t = fitted.problem, fitted.optimum.t
    sticks = problem.sticks(t)
    design = np.where(sticks[:, None], problem.stick.design, problem.slide.design)
    design = np.concatenate((design, problem.always.design))
    _, singular, right = np.linalg.svd(design, full_matrices=False)
    seen = singular > 1e-9 * singular.max(initial=0.0)
    found: list[float | None] = []
    for place in range(_UNKNOWNS):
        loading = right[:, place]
        if (np.abs(loading[~seen]) > 1e-9).any() or loading.size < _UNKNOWNS:
            found.append(None)
        else:
            found.append(
                math.sqrt(fitted.unit * float(((loading[seen] / singular[seen]) ** 2).sum())),
            )
    return tuple(found)


def _interval(fitted: _Fitted, place: int, error: float | None) -> Interval:
    """Where the profile lies below its rise; an end is infinite where it does not close."""
    best, least, rise = float(fitted.optimum.t[place]), fitted.optimum.chi2, fitted.rise()

    def above(x: Array) -> Array:
        return np.array(
            [minimise(fitted.problem.with_fixed(place, each)).chi2 - least for each in x.tolist()]
        )

    lower = 0.0 if place == DIFFERENCE else -STEEPEST
    curve = ProfileCurve(above, lower, STEEPEST, resolution=_RESOLUTION)
    curve.explore([best], error or _SIXTEENTH, rise)
    low, high = curve.pieces(rise)[0][0], curve.pieces(rise)[-1][1]
    return (-math.inf if low == lower else low), (math.inf if high == STEEPEST else high)


def _p_value(fitted: _Fitted, place: int, ends: Interval) -> float:
    """Of the slope that a closure allows nearest to the one found; 1 where it allows that."""
    best = float(fitted.optimum.t[place])
    nearest = min(max(best, ends[0]), ends[1])
    if nearest == best:
        return 1.0
    rise = minimise(fitted.problem.with_fixed(place, nearest)).chi2 - fitted.optimum.chi2
    if math.isinf(fitted.dof):
        return float(special.chdtrc(1.0, max(rise, 0.0)))
    return float(special.fdtrc(1.0, fitted.dof, max(rise, 0.0) / fitted.unit))


def _expected(
    problems: Sequence[Problem],
) -> tuple[dict[str, Interval | None], dict[str, Interval | None]]:
    """What each closure allows of both slopes, from its own rebounds."""
    sliding: dict[str, Interval | None] = {}
    difference: dict[str, Interval | None] = {}
    for problem in problems:
        closure = problem.closure
        constant = next((c for c in problem.parameters if c.name == closure.constant), None)
        if constant is None:
            ends: Sequence[float | None] = (None,)
        elif constant.fixed is not None:
            ends = (constant.fixed,)
        else:
            ends = (constant.lower, constant.upper)
        found = [_slopes(closure, c, problem.inertia_factor) for c in ends]
        slides = [slide for slide, _ in found]
        gaps = [slide - stick for slide, stick in found if stick is not None]
        sliding[closure.name] = (min(slides), max(slides))
        difference[closure.name] = (min(gaps), max(gaps)) if len(gaps) == len(found) else None
    return sliding, difference


_MU = 0.1
_FAR = (2e3, 1e3)  # tau of two impacts that slide, over mu
_NEAR = (0.5, 0.05)  # and of two that stick


def _slopes(closure: Closure, c: float | None, inertia_factor: float) -> tuple[float, float | None]:
    """Slope of sliding, and of sticking where that is a straight line through the origin."""
    own: dict[str, Any] = {closure.constant: c} if closure.constant else {}
    tau = _MU * np.array([*_FAR, *_NEAR])
    impact = rebound(
        np.arctan(tau), e_n=1.0, mu=_MU, closure=closure.name, inertia_factor=inertia_factor, **own
    )
    psi = impact.contact_x / impact.incidence.cosine
    slide = float((psi[0] - psi[1]) / (tau[0] - tau[1]))
    stick = psi[2:] / tau[2:]
    straight = abs(stick[0] - stick[1]) <= 1e-6
    return slide, float(stick[1]) if straight else None
