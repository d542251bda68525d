"""Readings of e_n: one value at all angles and speeds, as fixed or known before, and at most 1.

Yield and viscosity make e_n fall with the normal speed, which at one total speed is a rise with the angle. A
rise that neither of their laws gives is not blamed on them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import LAWS, LawOfSpeed
from ifrfit.inference.diagnostics.thresholds import FACTS, RANGE_OF_SPEEDS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text, plus_minus

_FEWEST = 6  # readings of a series from which a trend is looked for
OF_SPEEDS = "e_n falls with the normal speed"
_GRAZING = 0.05  # share of the incoming speed that goes into the wall, below which v_n says nothing of e_n
_NEGLIGIBLE = 2e-3  # change over the whole range that matters to no use of e_n, and may be rounding
_RANGE_OF_ANGLES = 5.0  # degrees
_ABOVE = 4.0  # sd by which a single reading may exceed 1


# what one look at the readings gave: its p value, and a sentence for the case that it is small
_Look = tuple[float, str]


@dataclass(frozen=True)
class _Readings:
    """Readings of e_n of one series.

    Attributes
    ----------
    series : str
        Empty where there is only one.
    value, weight : ndarray, (n,)
        Weights are 1/sigma^2; 1 where the noise is unknown.
    dof : float
        Behind the scale of the weights: infinite where sigma is known.
    gamma, speed : ndarray, (n,)
        Degrees and m/s; nan where not stated.
    """

    series: str
    value: Array
    weight: Array
    dof: float
    gamma: Array
    speed: Array

    @property
    def mean(self) -> float:
        """Weighted mean."""
        return float(np.average(self.value, weights=self.weight))

    @property
    def variance(self) -> float:
        """Variance of a reading of weight 1."""
        if math.isinf(self.dof):
            return 1.0
        square = float(self.weight @ (self.value - self.mean) ** 2)
        return square / self.dof if self.dof > 0.0 else math.inf

    @property
    def standard_error(self) -> float:
        """Of the mean."""
        return math.sqrt(self.variance / float(self.weight.sum()))

    @property
    def of(self) -> str:
        """Words that name the series where there are several, else nothing."""
        return f" of {self.series}" if self.series else ""


def normal_restitution(problem: Problem, found: LeastSquaresFit, *, advise: bool = True) -> Fact | None:
    """Hold the readings of e_n against angle, speed, what was fixed or known before, and 1.

    Each look is a test of its own; p values are multiplied by their number (Bonferroni). A trend is a
    parabola in the angle, or in the logarithm of speeds that differ by a fifth, tested against a constant: by
    F, or by chi2 where sigma is known. `advise` says whether a narrower range is advised, which is none where
    a slip is found.

    Returns
    -------
    Fact or None
        None without readings of e_n.
    """
    every = list(_by_series(problem, found))
    looks = [finding for readings in every for finding in _findings(problem, readings, advise)]
    if not looks:
        return None
    p = min(1.0, len(looks) * min(looks)[0])
    figures = {"p": p, "n_tests": len(looks)}
    rule = FACTS["normal_restitution"]
    wrong = [
        says for p_look, says in sorted(looks, key=lambda look: look[0]) if len(looks) * p_look < REFUTED
    ]
    if wrong and (of_law := _laws_of_speed(every)) < REFUTED:
        figures["p_laws_of_speed"] = of_law
        wrong.append(
            f"neither yield nor viscosity makes e_n rise so with the angle (p = {p_text(of_law)}); a shape "
            "that is not round does, as of faceted rocks"
        )
    if wrong:
        return Fact(False, "; ".join(wrong), figures, rule)
    return Fact(True, f"readings of e_n agree with one value (p = {p_text(p)})", figures, rule)


def hides_speeds(problem: Problem) -> bool:
    """Whether e_n is read at speeds that no column holds."""
    speed = problem.speeds
    return bool(problem.rows.of_kind("normal").any()) and not bool((speed > 0.0).any())


def _by_series(problem: Problem, found: LeastSquaresFit) -> Iterator[_Readings]:
    table = problem.observations.table
    # v_n is e_n times the cosine of the angle: every reading is brought to e_n by its slope
    place = problem.parameters.positions["e_n"][problem.rows.series]
    slope = problem.jacobian(found.optimum.theta)[np.arange(len(problem.rows)), place]
    normal = problem.rows.of_kind("normal") & (slope > _GRAZING)
    for number, series in enumerate(problem.series):
        rows = np.flatnonzero(normal & (problem.rows.series == number))
        if rows.size == 0:
            continue
        given = problem.noise.is_given[rows]
        known = bool(given.all())
        base = (found.sigma[rows] if given.any() else problem.noise.base[rows]) / slope[rows]
        yield _Readings(
            series if len(problem.series) > 1 else "",
            problem.rows.value[rows] / slope[rows],
            1.0 / base**2,
            math.inf if known else rows.size - 1.0,
            table["gamma_deg"].to_numpy(dtype=float)[rows],
            table["speed_m_s"].to_numpy(dtype=float)[rows],
        )


def _findings(problem: Problem, readings: _Readings, advise: bool) -> Iterator[_Look]:
    if np.ptp(readings.gamma) >= _RANGE_OF_ANGLES:
        yield from _trend(readings, readings.gamma, "the angle", "degrees", advise)
    x = np.log(np.where(readings.speed > 0.0, readings.speed, np.nan))
    # of speeds that are all but one, the errors are in e_n, too, which is made of them; so of angles
    if np.isfinite(x).any() and np.nanmax(x) - np.nanmin(x) >= math.log(RANGE_OF_SPEEDS):
        yield from _trend(readings, x, "the speed", "m/s", advise)
    yield from _against_known(problem, readings)
    yield from _above_one(readings)


def _trend(readings: _Readings, x: Array, what: str, unit: str, advise: bool) -> Iterator[_Look]:
    """A parabola in x against a constant."""
    at = np.flatnonzero(np.isfinite(x))
    if at.size < _FEWEST or np.unique(x[at]).size < 4:
        return
    x, root, value = x[at], np.sqrt(readings.weight[at]), readings.value[at]
    parabola, rest = _parabola(x, value, root)
    mean = float(np.average(value, weights=root**2))
    gained = max(float(root**2 @ (value - mean) ** 2) - rest, 0.0)
    if math.isinf(readings.dof):
        p = float(special.chdtrc(2, gained))
    elif rest > 0.0:
        p = float(special.fdtrc(2, x.size - 3, gained / 2.0 / (rest / (x.size - 3))))
    else:
        p = 0.0 if gained > 0.0 else 1.0
    order = np.argsort(x)
    ends = parabola[order[[0, -1]]]
    if np.ptp(parabola) <= _NEGLIGIBLE:
        return
    # of a parabola that turns, its ends may be alike
    least_most = sorted(
        (int(np.argmin(parabola)), int(np.argmax(parabola))), key=lambda place: float(x[place])
    )
    shown = np.exp(x[least_most]) if unit == "m/s" else x[least_most]
    of_e_n = parabola[least_most]
    remedy = "Fit a narrower range of it" if advise else "Mend the slip in the table first"
    directions, _ = np.linalg.qr(np.vander(x - x.mean(), 3) * root[:, None])
    variance = 1.0 if math.isinf(readings.dof) else rest / (x.size - 3)
    sd = np.sqrt(variance * (directions**2).sum(axis=1)) / root
    if advise and (parabola > 1.0 + _NEGLIGIBLE + _ABOVE * sd).any():
        remedy = (
            "e_n above 1 cannot be: no impact gains energy; look at the scale of the velocities, at what v_n "
            "is divided by, and at the angles"
        )
    if unit == "degrees" and advise and ends[1] > ends[0] and not (readings.speed > 0.0).any():
        remedy += f", or give the speeds in a column speed_m_s: {OF_SPEEDS}, and it rises with the angle then"
    yield (
        p,
        f"e_n{readings.of} is not one value: its readings go from {of_e_n[0]:.3g} at {shown[0]:.3g} {unit} "
        f"to {of_e_n[1]:.3g} at {shown[1]:.3g} {unit} (p = {p_text(p)}); one e_n over {what} does not stand. "
        f"{remedy}",
    )


def _parabola(x: Array, value: Array, root: Array) -> tuple[Array, float]:
    """A parabola in x by least squares with weights `root` squared: its values, and the sum left."""
    scaled = (x - x.mean()) / np.ptp(x)
    design = np.stack((np.ones(x.size), scaled, scaled**2), axis=1)
    coefficients, *_ = np.linalg.lstsq(design * root[:, None], value * root, rcond=None)
    parabola = design @ coefficients
    return parabola, float(np.sum(((value - parabola) * root) ** 2))


def _laws_of_speed(every: Sequence[_Readings]) -> float:
    """The p value of e_n by yield or viscosity, one number a series, against a rise with the angle.

    1 where e_n does not rise with the angle, or where the normal speed explains it better: a parabola in its
    logarithm beside one in the angle. F of the better law against the latter, or chi2 where sigma is known.
    """
    p, looks, gained = 1.0, 0, 0.0
    for readings in every:
        speed = readings.speed * np.cos(np.radians(readings.gamma))
        at = np.flatnonzero(speed > 0.0)
        gamma, speed, value, root = (
            readings.gamma[at],
            speed[at],
            readings.value[at],
            np.sqrt(readings.weight[at]),
        )
        if at.size < _FEWEST or np.unique(gamma).size < 4 or np.unique(speed).size < 4:
            continue
        parabola, rest = _parabola(gamma, value, root)
        misfits = [_misfit_of_law(law, speed, value, root) for law in LAWS.values()]
        scale = 1.0 if math.isinf(readings.dof) else rest / (at.size - 3)
        if scale == 0.0 or parabola[np.argmax(gamma)] <= parabola[np.argmin(gamma)]:
            return 1.0
        gained += (_parabola(np.log(speed), value, root)[1] - rest) / scale
        square = max(min(misfits) - rest, 0.0) / scale
        known = math.isinf(readings.dof)
        of_series = special.chdtrc(2, square) if known else special.fdtrc(2, at.size - 3, square / 2.0)
        p, looks = min(p, float(of_series)), looks + 1
    return min(1.0, looks * p) if gained >= 0.0 and looks else 1.0


def _misfit_of_law(law: Callable[[float], LawOfSpeed], speed: Array, value: Array, root: Array) -> float:
    """The least weighted sum of squares that a law e_n(v) leaves, by its e_n at the median speed."""
    ratio = speed / np.median(speed)

    def misfit(e_n: float) -> float:
        return float(np.sum(((value - law(e_n)(ratio)) * root) ** 2))

    from scipy.optimize import minimize_scalar  # a quarter of a second, and rarely asked

    return float(minimize_scalar(misfit, bounds=(0.01, 0.999), method="bounded").fun)


def _against_known(problem: Problem, readings: _Readings) -> Iterator[_Look]:
    """The mean against what e_n was fixed at, or known to be before."""
    place = problem.parameters.positions["e_n"]
    number = problem.series.index(readings.series) if readings.series else 0
    entry = problem.parameters.entries[int(place[number])]
    if entry.fixed is not None:
        mean, sd, words = entry.fixed, 0.0, f"e_n is fixed at {entry.fixed:.4g}"
    elif entry.prior is not None:
        (mean, sd), words = entry.prior, f"e_n was said to be {plus_minus(*entry.prior)}"
    else:
        return
    spread = math.hypot(readings.standard_error, sd)
    if not (0.0 < spread < math.inf):
        return
    p = _two_sided((readings.mean - mean) / spread, readings.dof)
    measured = plus_minus(readings.mean, readings.standard_error)
    yield (p, f"readings of e_n{readings.of} give {measured}, but {words} (p = {p_text(p)})")


def _above_one(readings: _Readings) -> Iterator[_Look]:
    """The mean above 1, or single readings far above it."""
    error = readings.standard_error
    if not (0.0 < error < math.inf):
        return
    one_sided = 0.5 * _two_sided((readings.mean - 1.0) / error, readings.dof)
    p = one_sided if readings.mean > 1.0 else 1.0
    says = f"the mean of the readings of e_n{readings.of}, {plus_minus(readings.mean, error)}, lies above 1"
    sd = np.sqrt(readings.variance / readings.weight)
    far = readings.value > 1.0 + _ABOVE * sd
    if far.any():
        p = min(
            p,
            readings.value.size * 0.5 * _two_sided(float(((readings.value - 1.0) / sd).max()), readings.dof),
        )
        says = (
            f"{int(far.sum())} of {far.size} readings of e_n{readings.of} lie more than {_ABOVE:g} sd "
            f"above 1, up to {float(readings.value.max()):.4g}: no impact gains energy; look at the scale of "
            "the velocities"
        )
    yield (p, says)


def _two_sided(t: float, dof: float) -> float:
    return float(2.0 * special.stdtr(dof, -abs(t)))
