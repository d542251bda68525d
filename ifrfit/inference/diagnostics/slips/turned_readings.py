"""Wrong signs in some rows of what is never negative: readings below zero that are turned, not of noise.

Noise makes readings y below zero where the law f = k s is near it, y = f + e, and in a table some of whose
signs are wrong a share q of the rows is y = -(f + e). Both are likelihoods of the same readings, the first
the second at q = 0, constant k, noise and share each at their best: so they compare by their ratio. (A sum of
squares about the nearer of f and -f compares nothing: to fold noise lowers it.) Errors with long tails reach
below zero, too: where wider ones beside the others describe the readings better both have them, and the same
ratio of the readings mirrored at the law is taken off, for what lies as far above it is of no wrong sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.data.readings_below_zero import has_sign
from ifrfit.inference.diagnostics.slips.compared_fit import Slip
from ifrfit.inference.diagnostics.slips.refit import spread
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Bool, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_FEWEST = 3  # rows that are turned more likely than not
_FEWEST_READINGS = 8
_SHARES = (0.05, 0.3)  # of turned rows, from which theirs is looked for
_ROUNDS = 300
_AT_REST = 1e-5  # of log likelihood
_MOST_READINGS = 20_000  # by which constants are looked for
_TINY = 1e-300
_WORTH_IT = 9.0  # fall of -2 log likelihood from which long tails are asked for, p = 0.003
_LONG_TAILS = 4.0  # fall of -2 log likelihood by wider errors, from which some are
_OUTLYING = 0.05  # share of the wider errors, to begin with
# kinds of row: right and wrong sign, each with errors and with wider ones
_SIGNS = np.array([1.0, 1.0, -1.0, -1.0])
_WIDTHS = np.array([1.0, 3.0, 1.0, 3.0])
_OTHER = slice(2, 4)


def turned_readings(problem: Problem, fit: LeastSquaresFit) -> list[Slip]:
    """Observables some of whose readings below zero are better described by a wrong sign than by noise.

    Returns
    -------
    list of Slip
        One for each observable that has readings below zero and could show it; p from chi2 of share and
        constant, the row that speaks most for it left out.
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
            # without a constant a table says nothing of the share: near 0 both are free
            p = float(special.chdtrc(2, max(careful, 0.0)))
            at = tuple(own[turned].tolist())
            yield Slip("mixed-sign-below-zero", drop, p, observable=observable.name, rows=at)


@dataclass(frozen=True)
class _Model:
    """Constants by series, noise, shares of each kind of row, (4,), and log likelihood of each row, (n,)."""

    k: Array
    noise: float
    shares: Array
    log: Array


@dataclass(frozen=True)
class _Readings:
    """Readings z and slopes of the law w in units of their noise's usual size, (n,); series of constants."""

    z: Array
    w: Array
    series: Index

    def compared(self) -> tuple[float, float, Bool]:
        """Fall of -2 log likelihood, the same less its largest term and the mirror's, and turned rows."""
        part = self
        if self.z.size > _MOST_READINGS:
            some = spread(self.z.size, _MOST_READINGS)
            part = _Readings(self.z[some], self.w[some], self.series[some])
        normal = part._turned(0.0)
        if 2.0 * float((normal.log - part._plain(0.0).log).sum()) < _WORTH_IT:
            return 0.0, 0.0, np.zeros(self.z.size, dtype=bool)
        wide = part._turned(_OUTLYING)
        gain = 2.0 * float((wide.log - normal.log).sum())
        outlying, turned = (_OUTLYING, wide) if gain > _LONG_TAILS else (0.0, normal)
        plain = part._plain(outlying)
        terms = 2.0 * (turned.log - plain.log)
        law = plain.k[part.series] * part.w
        mirrored = _Readings(2.0 * law - part.z, part.w, part.series)
        tails = 2.0 * float((mirrored._turned(outlying).log - mirrored._plain(outlying).log).sum())
        drop = float(terms.sum())
        careful = drop - float(terms.max()) - max(tails, 0.0)
        return drop, careful, self._chances(turned)[0][_OTHER].sum(axis=0) > 0.5

    def _plain(self, outlying: float) -> _Model:
        """Without a wrong sign, at its best."""
        return self._searched(np.ones(self.z.size), 0.0, outlying)

    def _turned(self, outlying: float) -> _Model:
        """With a share of wrong signs, at its best; `outlying` errors are wider, at first such a share."""
        every = (self._searched(np.sign(self.z), share, outlying) for share in _SHARES)
        return max(every, key=lambda one: float(one.log.sum()))

    def _constants(self, weight: Array, sign: Array) -> Array:
        """Of each series by least squares of weights, readings times their (expected) sign; none below 0."""
        count = int(self.series.max()) + 1
        square = np.bincount(self.series, weight * self.w**2, count)
        along = np.bincount(self.series, sign * self.w * self.z, count)
        return np.asarray(np.maximum(along, 0.0) / (square + _TINY))

    def _chances(self, model: _Model) -> tuple[Array, Array, Array]:
        """Of each row that it is of each kind, (4, n), residuals so, and the log likelihood of each row."""
        f = model.k[self.series] * self.w
        off = self.z - _SIGNS[:, None] * f
        width = model.noise * _WIDTHS[:, None]
        with np.errstate(divide="ignore"):
            log = np.log(model.shares)[:, None] - 0.5 * (off / width) ** 2 - np.log(width)
        most = log.max(axis=0)
        of_all = most + np.log(np.exp(log - most).sum(axis=0))
        return np.exp(log - of_all), off, of_all

    def _searched(self, sign: Array, share: float, outlying: float) -> _Model:
        """By expectation and maximization from constants at some signs, and a share of wrong ones."""
        k = self._constants(np.ones(self.z.size), sign)
        noise = float(np.sqrt(((sign * self.z - k[self.series] * self.w) ** 2).mean()))
        shares = np.outer((1.0 - share, share), (1.0 - outlying, outlying)).ravel()
        model = _Model(k, noise, shares, np.full(self.z.size, -np.inf))
        for _ in range(_ROUNDS):
            chance, off, log = self._chances(model)
            rest = float(log.sum()) - float(model.log.sum())
            model = replace(model, log=log)
            if rest < _AT_REST:
                break
            weight = chance / _WIDTHS[:, None] ** 2
            k = self._constants(weight.sum(axis=0), _SIGNS @ weight)
            off = self.z - _SIGNS[:, None] * (k[self.series] * self.w)
            noise = float(np.sqrt((weight * off**2).sum() / self.z.size))
            model = _Model(k, noise, chance.mean(axis=1), log)
        return model
