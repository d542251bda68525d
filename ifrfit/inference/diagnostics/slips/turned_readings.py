"""Wrong signs in some rows of what is never negative: readings below zero that are turned, not of noise.

Noise makes readings y below zero where the law f = k s is near it, y ~ N(f, s'), and in a table some of whose
signs are wrong a share q of the rows is of N(-f, s'). Both are likelihoods of the same readings, the first
the second at q = 0, constant k, noise and share each at their best: so they compare by their ratio. (A sum of
squares about the nearer of f and -f compares nothing: to fold noise lowers it.) Errors with long tails, or a
scatter that grows where the law is small, have readings as far above the law as below. So the same ratio of
the readings mirrored at the law is taken off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.data.readings_below_zero import has_sign
from ifrfit.inference.diagnostics.slips.compared_fit import Slip
from ifrfit.inference.diagnostics.slips.refit import spread
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_FEWEST = 3  # rows that are turned more likely than not
_FEWEST_READINGS = 8
_SHARES = (0.05, 0.3)  # of turned rows, from which theirs is looked for
_ROUNDS = 300
_AT_REST = 1e-5  # of log likelihood
_MOST_READINGS = 20_000  # by which constants are looked for
_TAILS = 3.0  # falls of the mirrored readings taken off: what long tails make is seldom as much more on a side
_TINY = 1e-300


def turned_readings(problem: Problem, fit: LeastSquaresFit) -> list[Slip]:
    """Observables some of whose readings below zero are better described by a wrong sign than by noise.

    Returns
    -------
    list of Slip
        One for each observable that has readings below zero and could show it; p from chi2 of the share, the
        row that speaks most for it left out.
    """
    return list(_looks(problem, fit))


def _looks(problem: Problem, fit: LeastSquaresFit) -> Iterator[Slip]:
    rows, positions = problem.rows, problem.parameters.positions
    for observable in rows.observables:
        own = rows.rows_of(observable.name)
        if not has_sign(observable) or np.count_nonzero(rows.value[own] < 0.0) < _FEWEST:
            continue
        by_e_n = observable.by_e_n
        slope = np.ones(own.size) if by_e_n is None else np.asarray(by_e_n(rows.incidence.take(own)))
        constant = "mu" if observable.kind == "friction" else "e_n"
        series = rows.series[own] if len(positions[constant]) > 1 else np.zeros(own.size, dtype=np.intp)
        readings = _Readings(rows.value[own] / fit.sigma[own], slope / fit.sigma[own], series)
        if own.size < _FEWEST_READINGS or not (slope > 0.0).any():
            continue
        drop, careful, turned = readings.compared()
        if np.count_nonzero(turned) >= _FEWEST:
            p = float(special.chdtrc(1, max(careful, 0.0)))
            at = tuple(own[turned].tolist())
            yield Slip("mixed-sign-below-zero", drop, p, observable=observable.name, rows=at)


@dataclass(frozen=True)
class _Readings:
    """Readings z and slopes of the law w in units of their noise's usual size, (n,); series of constants."""

    z: Array
    w: Array
    series: Index

    def compared(self) -> tuple[float, float, np.ndarray]:
        """Fall of -2 log likelihood, the same less its largest term and the mirror's, and turned rows."""
        part = self
        if self.z.size > _MOST_READINGS:
            some = spread(self.z.size, _MOST_READINGS)
            part = _Readings(self.z[some], self.w[some], self.series[some])
        law = part._constants(np.ones(part.z.size))[part.series] * part.w
        mirrored = _Readings(2.0 * law - part.z, part.w, part.series)
        terms, k, noise, share = part._turned()
        if terms.sum() <= 0.0:
            return 0.0, 0.0, np.zeros(self.z.size, dtype=bool)
        drop = float(terms.sum())
        tails = max(float(mirrored._turned()[0].sum()), 0.0)
        return drop, drop - float(terms.max()) - _TAILS * tails, self._chance(k, noise, share) > 0.5

    def _constants(self, sign: Array) -> Array:
        """Of each series by least squares, readings times their (expected) sign; none below 0."""
        count = int(self.series.max()) + 1
        square = np.bincount(self.series, self.w**2, count)
        return np.maximum(np.bincount(self.series, sign * self.w * self.z, count), 0.0) / (square + _TINY)

    def _chance(self, k: Array, noise: float, share: float) -> Array:
        """Of each row that it is turned, (n,)."""
        odds = np.log(share / (1.0 - share)) - 2.0 * k[self.series] * self.w * self.z / noise**2
        return np.asarray(special.expit(odds))

    def _turned(self) -> tuple[Array, Array, float, float]:
        """Terms of the fall of -2 log likelihood, (n,), and constants, noise and share at their best."""
        k = self._constants(np.ones(self.z.size))
        plain = self.z - k[self.series] * self.w
        noise = float(np.sqrt((plain**2).mean()))
        before = -0.5 * (plain / noise) ** 2 - np.log(noise)
        tried = [self._searched(share) for share in _SHARES]
        after, *best = max(tried, key=lambda one: float(one[0].sum()))
        return 2.0 * (after - before), *best

    def _searched(self, share: float) -> tuple[Array, Array, float, float]:
        """Log likelihood of each row, constants, noise and share, by expectation and maximization."""
        k = self._constants(np.sign(self.z))
        noise = float(np.sqrt(((np.abs(self.z) - k[self.series] * self.w) ** 2).mean()))
        last = -np.inf
        for _ in range(_ROUNDS):
            f = k[self.series] * self.w
            plain, read = ((self.z - sign * f) / noise for sign in (1.0, -1.0))
            log = np.logaddexp(np.log1p(-share) - 0.5 * plain**2, np.log(share) - 0.5 * read**2)
            log -= np.log(noise)
            if float(log.sum()) - last < _AT_REST:
                break
            last = float(log.sum())
            chance = self._chance(k, noise, share)
            share = float(np.clip(chance.mean(), 1e-9, 1.0 - 1e-9))
            k = self._constants(1.0 - 2.0 * chance)
            f = k[self.series] * self.w
            square = (1.0 - chance) * (self.z - f) ** 2 + chance * (self.z + f) ** 2
            noise = float(np.sqrt(square.mean()))
        return log, k, noise, share
