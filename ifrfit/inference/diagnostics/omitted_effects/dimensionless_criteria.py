"""The effects' criteria on the scene of the data, and what each effect would do to the fitted values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import (
    computed,
    impacts_of,
)
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting
from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine
from ifrfit.inference.diagnostics.quadratic_forms import orthonormal
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import by_entry
from ifrfit.physics.effects import EFFECTS, Effect, Impacts, compose, plane_effects
from ifrfit.physics.observables import OBSERVABLES

# effects that depend on speed and size, not on the tangential law
_BY_SPEED = ("normal", "adhesion", "fluid")


def effect_lines(
    problem: Problem, fit: LeastSquaresFit, setting: Setting | None, derived: Mapping[str, Any]
) -> tuple[EffectLine, ...]:
    """Every effect but motion across the plane of incidence, which each fit computes; none without a scene.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    setting : Setting or None
        The scene of the data.
    derived : mapping
        Name to `Estimate`, or to one a series.
    """
    if setting is None:
        return ()
    kappa_known = all(one.value is not None for one in by_entry({"kappa": derived["kappa"]}).values())
    scene = _Scene(problem, fit, setting)
    lines = []
    for name, effect in EFFECTS.items():
        if name in plane_effects():
            continue
        if name == problem.closure.effect:
            lines.append(EffectLine(name, says="in the closure"))
        elif effect.stage in ("tangential", "rolling") and not kappa_known:
            lines.append(EffectLine(name, says="not known: kappa is not determined"))
        else:
            lines.append(scene.line(name, effect))
    return tuple(lines)


class _Scene:
    """Rows, constants and conditions together."""

    def __init__(self, problem: Problem, fit: LeastSquaresFit, setting: Setting) -> None:
        self.problem, self.fit, self.setting = problem, fit, setting
        self.stated = problem.speeds
        self.own = orthonormal(problem.jacobian(fit.optimum.theta) / fit.sigma[:, None])

    def line(self, name: str, effect: Effect) -> EffectLine:
        """One effect, at the ends of the range of speed and size where it shows most."""
        setting, by_speed = self.setting, effect.stage in _BY_SPEED
        if by_speed and not setting.diameter:
            return EffectLine(name, says="not known: the diameter")
        if by_speed and not setting.speed and not np.isfinite(self.stated).any():
            return EffectLine(name, says="not known: the speed")
        rows = self._rows(by_speed)
        if not rows.size:
            return EffectLine(name, says="shows in none of these rows")
        ends = itertools.product(setting.speed or (math.nan,), setting.diameter or (math.nan,))
        lines = [self._at(name, effect, rows, speed, 0.5 * diameter) for speed, diameter in ends]
        return max(lines, key=lambda line: math.inf if line.signal is None else line.signal)

    def _rows(self, by_speed: bool) -> NDArray[np.intp]:
        """Rows that the effect can show in."""
        if not by_speed:
            return np.flatnonzero(self.problem.rows.is_oblique)
        known = np.isfinite(self.stated) | bool(self.setting.speed)
        return np.flatnonzero(known & ~self.problem.rows.of_kind("friction"))

    def _at(
        self, name: str, effect: Effect, rows: NDArray[np.intp], speed: float, radius: float
    ) -> EffectLine:
        problem, contact, sigma = self.problem, self.setting.contact, self.fit.sigma
        filled = np.where(np.isfinite(self.stated), self.stated, speed)
        every = impacts_of(problem, self.fit.optimum.theta, filled, np.full(filled.size, radius))
        few = every.take(rows)
        lacking = effect.lacks(contact, few)
        if lacking:
            # chi is no constant of measured impacts
            return EffectLine(name, says=lacking.replace(", or constants.chi", ""))
        number = effect.criterion(contact, few, compose(contact, few, plane_effects()), self._accuracy(rows))
        line = EffectLine(name, number.symbol, number.value, number.threshold, number.met)
        change = self._change(name, effect, every)
        inside = np.zeros(change.size)
        inside[rows] = change[rows] / sigma[rows]
        start = f"{number.symbol} = {number.value:.2g}, acts {'above' if number.above else 'below'} "
        start += f"{number.threshold:.2g}"
        if not np.isfinite(inside).all():
            what = problem.rows.names[problem.rows.which[int(np.argmin(np.isfinite(inside)))]]
            return replace(line, says=f"{start}; would decide whether {what} exists")
        left = inside - self.own @ (self.own.T @ inside)
        most = int(np.argmax(np.abs(left)))
        observable = problem.rows.names[problem.rows.which[most]]
        size, signal = float(abs(left[most]) * sigma[most]), float(np.linalg.norm(left))
        unit = "deg" if OBSERVABLES[observable].unit == "deg" else ""
        amount = f"{size:.2g}{' degrees' if unit else ''}"
        says = f"{start}; would change {observable} by {amount}, {size / sigma[most]:.2g} times its noise"
        if size <= 1e-9 * sigma[most]:
            says = f"{start}; would change nothing"
        line = replace(line, change=size, observable=observable, unit=unit, signal=signal, says=says)
        if not effect.validity(contact, few).holds:  # what its law gives is a bound, and calls for nothing
            return replace(line, signal=None, says=f"{says} at most: its law does not hold here")
        return line

    def _change(self, name: str, effect: Effect, impacts: Impacts) -> Array:
        """What the effect does to each row's value; of a law of e_n, beyond its own mean e_n."""
        contact = self.setting.contact
        if effect.replaces == "e_n":
            law = compose(contact, impacts, (name, *plane_effects())).e_n
            mean = np.full(law.size, np.nanmean(law))
            # kappa stays, which the data determine even where they leave e_n open
            mu = impacts.mu * (1.0 + impacts.e_n) / (1.0 + mean)
            impacts = replace(impacts, e_n=mean, mu=mu)
        return computed(self.problem, contact, impacts, (name,)) - computed(
            self.problem, contact, impacts, ()
        )

    def _accuracy(self, rows: NDArray[np.intp]) -> float:
        """Noise of a middling row, angles in radians."""
        in_degrees = np.array([each.unit == "deg" for each in self.problem.rows.observables])
        sigma = self.fit.sigma[rows]
        return float(np.median(np.where(in_degrees[self.problem.rows.which[rows]], np.radians(sigma), sigma)))
