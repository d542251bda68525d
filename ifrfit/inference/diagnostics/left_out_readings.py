"""Readings that are left out, as their impact counts already, held against those that are used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from scipy import special

from ifrfit.data.double_counting import impact_numbers
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.scalar_search import bounded_minimum
from ifrfit.inference.result.types import Fact
from ifrfit.physics.angles import Incidence
from ifrfit.physics.inertia import BODIES, is_plausible
from ifrfit.physics.observable import Observable
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import Reading
from ifrfit.text import joined, p_text, plus_minus

_FEWEST = 6  # impacts
_COUNTS = 0.02  # rms of a systematic difference over that of the readings, below which curvature may make it
_STEP = 1e-4  # of a reading, or of what may be wrong, in differences
_EXPLAINS = 0.5  # share of the rms difference that a remedy leaves at most
_AS_GOOD = 1.1  # rms that a remedy may leave over that of the best
_SAME_BODY = 0.05  # J this near to that of a body, or within 2 sd, is meant to be that
_FACTORS = (-1.0, 3.0)  # impulse factors that angles are searched for
_HALVINGS = 50
_NEAR = 1e-5  # to which remedies are searched
_ANGLES = ("delta_deg", "psi_after_deg", "psi_out_deg")  # that rise or fall with the impulse factor
_SPINS = ("spin_x_after", "spin_y_after")
# what is known of an impact, by the measurements that an observable takes
_ALONG, _SPIN, _CONTACT = frozenset({"Tx"}), frozenset({"Sy"}), frozenset({"Tx", "Sy"})


@dataclass(frozen=True)
class _Beside:
    """Readings of one observable that are left out, beside those used of the same impacts; n impacts.

    Attributes
    ----------
    observable : Observable
    given : ndarray, (n,)
    used : mapping of str to ndarray, (n,)
        Readings that are used, by observable; nan where there is none.
    fitted : mapping of str to ndarray, (n,)
        What the fit makes of these.
    incidence : Incidence
    inertia_factor : float
    """

    observable: Observable
    given: Array
    used: Mapping[str, Array]
    fitted: Mapping[str, Array]
    incidence: Incidence
    inertia_factor: float

    def made(self, used: Mapping[str, Array]) -> Array:
        """What readings of the impacts make of the one that is left out, (n,); nan where they do not."""
        i, j, name = self.incidence, self.inertia_factor, self.observable.name
        none = np.full(self.given.size, np.nan)
        if name in used:
            return used[name]
        e_n = used.get("e_n", none)
        e_n = np.where(np.isnan(e_n), used.get("v_n", none) / i.cosine, e_n)
        by = {_ALONG: none, _SPIN: none, _CONTACT: none}
        for each, value in used.items():
            takes = OBSERVABLES[each].takes
            kind = min(_CONTACT, takes)
            if kind in by:
                k = impulse_factor(OBSERVABLES[each], i, value, e_n, j)
                by[kind] = np.where(np.isnan(by[kind]), k, by[kind])
        contact = by[_CONTACT]
        along = _first(by[_ALONG], contact, by[_SPIN])
        spin = _first(by[_SPIN], contact, by[_ALONG])
        read = Reading(
            i.sine - along * i.slip_x,
            0.0 - along * i.slip_y,
            e_n * i.cosine,
            i.spin_x - spin * i.slip_y / j,
            i.spin_y - spin * i.slip_x / j,
            np.zeros(none.size, dtype=bool),
            along,
            i,
            e_n,
            j,
        )
        return np.asarray(self.observable.value(read, none))

    def spins_times(self, factor: float) -> _Beside:
        """The same where spins after impact are a number of times as large."""
        used = {name: value * factor if name in _SPINS else value for name, value in self.used.items()}
        fitted = {name: value * factor if name in _SPINS else value for name, value in self.fitted.items()}
        given = self.given * factor if self.observable.name in _SPINS else self.given
        return replace(self, used=used, fitted=fitted, given=given)

    def with_inertia(self, inertia_factor: float) -> _Beside:
        """The same of a body of another inertia factor."""
        return replace(self, inertia_factor=inertia_factor)

    def off(self) -> Array:
        """Readings less what the others make of them, (n,)."""
        return self.given - self.made(self.used)

    def weight(self) -> Array:
        """One over the variance of `off` to a factor, (n,), were all errors alike."""
        variance = np.full(self.given.size, _unit(self.observable) ** 2)
        for name, value in self.fitted.items():
            ends = [self.made({**self.fitted, name: value + s * _STEP}) for s in (1.0, -1.0)]
            slope = (ends[0] - ends[1]) / (2.0 * _STEP)
            variance = variance + np.nan_to_num(slope * _unit(OBSERVABLES[name])) ** 2
        return 1.0 / variance


def left_out_readings(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Hold readings that are left out, as others count the impact, against what these make of them.

    An impact's readings are tied by the kinematics alone: velocities and spins after, and what is computed
    from them, by one impulse at the contact point, at the inertia factor of the fit and whatever the closure.
    The products of the differences and of what each remedy would change are held against 0 by Student's t.
    For independent Gaussian errors of whatever size each, its p is no smaller than stated (Bakirov and
    Székely, Zap. Nauchn. Sem. POMI 328 (2005) 5, below 0.08); it counts times the number of tests.

    Returns
    -------
    Fact or None
        None where nothing is left out, or nothing contradicts.
    """
    pairs = _pairs(problem, found)
    tests = [_p_values(one) for one in pairs]
    many = sum(len(p) for p in tests)
    said, figures = [], {}
    for one, p_values in zip(pairs, tests, strict=True):
        p = min(1.0, many * min(p_values, default=1.0))
        if p < REFUTED:
            name, by = one.observable.name, joined(list(one.used))
            remedies = _remedies(one)
            verb = "which are" if len(one.used) > 1 else "which is"
            what = (
                f"what would reconcile them: {joined(remedies, 'or')}"
                if remedies
                else "no inertia factor, scale or sign alone reconciles them: check the definitions of both"
            )
            typical = float(np.median(np.abs(one.off())))
            said.append(
                f"{name}, left out, contradicts {by} of the same impacts, {verb} used: it differs by "
                f"{typical:.2g} (median, {one.given.size} impacts, p = {p_text(p)}) from what these make of "
                f"it with inertia factor {one.inertia_factor:.4g}, and not by scatter; {what}"
            )
            figures[name] = {"p": p, "n": one.given.size, "median": typical}
    if not said:
        return None
    return Fact(False, ". ".join(said), {"observables": figures}, FACTS["left_out_readings"])


def impulse_factor(observable: Observable, i: Incidence, value: Array, e_n: Array, j: float) -> Array:
    """Impulse factor k, (n,), at which an observable has a value; nan where it does not tell.

    Parameters
    ----------
    observable : Observable
    i : Incidence
    value, e_n : ndarray, (n,)
    j : float
    """
    none = np.full(value.size, np.nan)
    if observable.kind == "tangential":
        low, high = (observable.by_form(i, np.full(value.size, k), e_n, none, j) for k in (0.0, 1.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(high == low, np.nan, (value - low) / (high - low)))
    if observable.name not in _ANGLES:
        return none
    ends = [np.full(value.size, k) for k in _FACTORS]
    for _ in range(_HALVINGS):
        mid = 0.5 * (ends[0] + ends[1])
        # angles fall with k where the contact point moves along x, and rise where it moves back
        above = (observable.by_form(i, mid, e_n, none, j) > value) == (i.slip_x > 0.0)
        ends = [np.where(above, mid, ends[0]), np.where(above, ends[1], mid)]
    return np.asarray(np.where(np.isnan(value + e_n), np.nan, ends[0]))


def _first(*values: Array) -> Array:
    """The first of some values that is there, row by row."""
    found = values[0]
    for other in values[1:]:
        found = np.where(np.isnan(found), other, found)
    return found


def _unit(observable: Observable) -> float:
    return float(np.degrees(1.0)) if observable.unit == "deg" else 1.0


def _pairs(problem: Problem, found: LeastSquaresFit) -> list[_Beside]:
    """Observables that are left out beside what is used of the same impacts."""
    left = problem.observations.redundant
    if left is None or not len(left):
        return []
    table = problem.observations.stored
    ties = ["source", "impact_id"]
    impacts = impact_numbers(pd.concat([table[ties], left[ties]], ignore_index=True))
    here, there = impacts[: len(table)], impacts[len(table) :]
    names = left["observable"].to_numpy(dtype=object)
    predicted = problem.predict(found.optimum.theta)
    result = []
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero((names == name) & (there >= 0))
        used, fitted = {}, {}
        for each in problem.rows.names:
            at = problem.rows.rows_of(each)
            at = at[here[at] >= 0]
            used[each], fitted[each] = (
                _of_impacts(there[rows], here[at], values[at]) for values in (problem.rows.value, predicted)
            )
        one = _beside(name, left.iloc[rows], used, fitted, problem.inertia_factor)
        if one is not None:
            result.append(one)
    return result


def _of_impacts(sought: Index, impacts: Index, values: Array) -> Array:
    value = dict(zip(impacts.tolist(), values.tolist(), strict=True))
    return np.array([value.get(one, np.nan) for one in sought.tolist()])


def _beside(
    name: str, left: pd.DataFrame, used: dict[str, Array], fitted: dict[str, Array], inertia_factor: float
) -> _Beside | None:
    """Readings left out where others tell them; None where these are too few."""
    given, gamma, spin_x, spin_y = (
        left[c].to_numpy(dtype=float) for c in ("value", "gamma_deg", "spin_x", "spin_y")
    )
    i = Incidence.of(np.nan_to_num(gamma), spin_x, spin_y, degrees=True)
    one = _Beside(OBSERVABLES[name], given, used, fitted, i, inertia_factor)
    with np.errstate(all="ignore"):
        known = np.isfinite(one.off() + one.made(fitted)) & np.isfinite(gamma) & (i.slip_x != 0.0)
    if known.sum() < _FEWEST:
        return None
    takes = {
        each: {n: v[known] for n, v in values.items() if np.isfinite(v[known]).any()}
        for each, values in (("used", used), ("fitted", fitted))
    }
    i = Incidence.of(gamma[known], spin_x[known], spin_y[known], degrees=True)
    one = _Beside(one.observable, given[known], takes["used"], takes["fitted"], i, inertia_factor)
    telling = [n for n in one.used if _tells(one, n)]
    return replace(
        one,
        used={n: one.used[n] for n in telling},
        fitted={n: one.fitted[n] for n in telling},
    )


def _tells(one: _Beside, name: str) -> bool:
    """Whether a reading enters what is made of it."""
    changed = one.made({**one.used, name: one.used[name] + _STEP})
    return bool((changed != one.made(one.used)).any())


def _p_values(one: _Beside) -> list[float]:
    """Student's t of each direction in which readings may be off; 1 where that is too small to count."""
    made, off, weight = one.made(one.fitted), one.off(), one.weight()
    directions = [made, np.ones(made.size)]
    if one.observable.unit == "deg":
        directions.append(90.0 - 2.0 * made)  # read from the wall
    for other in (one.with_inertia(one.inertia_factor * (1.0 + _STEP)), one.spins_times(1.0 + _STEP)):
        # by what the fit makes of the readings, whose errors would enter both factors of a product
        directions.append((other.made(other.fitted) - made) / _STEP)
    found = []
    for by in directions:
        product = weight * by * off
        size = float(weight @ by**2)
        spread = float(product.std(ddof=1))
        if size == 0.0 or not np.abs(by).max() > _STEP:
            continue
        share = abs(float(product.sum())) / size * np.sqrt(np.mean(by**2) / np.mean(made**2))
        t = abs(float(product.mean())) * np.sqrt(off.size) / max(spread, 1e-300)
        found.append(1.0 if share < _COUNTS else 2.0 * float(special.stdtr(off.size - 1, -t)))
    return found


def _remedies(one: _Beside) -> list[str]:
    """What would reconcile readings, the best first, and those that do as well."""
    root = np.sqrt(one.weight())
    before = float(np.sqrt(np.mean((root * one.off()) ** 2)))

    def left(of: Callable[[float], _Beside], x: float) -> float:
        return float(np.sqrt(np.mean((root * of(x).off()) ** 2)))

    found: list[tuple[float, str]] = []
    spins = bool({*one.used, one.observable.name} & set(_SPINS))
    for of, ends in ((one.with_inertia, (0.05, 1.0)), (one.spins_times, (-3.0, 3.0))):
        rms, x = bounded_minimum(partial(left, of), *ends, _NEAR)
        slope = root * (of(x + _STEP).off() - of(x - _STEP).off()) / (2.0 * _STEP)
        steep = float(slope @ slope)
        if steep < _STEP**2 or (of == one.spins_times and not spins):
            continue
        sd = rms * np.sqrt(one.given.size / (one.given.size - 1) / steep)
        if of == one.with_inertia:
            if is_plausible(x - 2.0 * sd) or is_plausible(x) or is_plausible(x + 2.0 * sd):
                found.append((rms, _inertia_words(x, sd)))
        elif abs(x + 1.0) < max(_SAME_BODY, 2.0 * sd):
            found.append((left(of, -1.0), "spins after impact of the other sign"))
        else:
            found.append((rms, f"spins after impact {plus_minus(x, sd)} times as large"))
    given = one.given
    signs = [("of the other sign", -given)]
    signs.append(
        ("from the wall", 90.0 - given) if one.observable.unit == "deg" else ("in percent", given / 100.0)
    )
    for words, other in signs:
        off = replace(one, given=other).off()
        found.append((float(np.sqrt(np.mean((root * off) ** 2))), f"{one.observable.name} {words}"))
    least = min(rms for rms, _ in found)
    if least > _EXPLAINS * before:
        return []
    return [words for rms, words in sorted(found) if rms <= _AS_GOOD * least]


def _inertia_words(x: float, sd: float) -> str:
    near = [(abs(x - j), j) for j in BODIES if abs(x - j) < max(_SAME_BODY * j, 2.0 * sd)]
    option = f", {BODIES[min(near)[1]]}" if near else ""
    value = min(near)[1] if near else x
    return f"inertia factor {plus_minus(x, sd)} (--inertia-factor {value:.3g}{option})"
