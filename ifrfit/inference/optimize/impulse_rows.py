"""Weighted measurements of the impulse factor k, where e_n is known or found apart."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ifrfit.inference.model.rows import Rows
from ifrfit.inference.model.slip_intervals import SlipIntervals
from ifrfit.inference.optimize.parameter_group import ParameterGroup, direct_sums, is_separable
from ifrfit.inference.optimize.piecewise import Array
from ifrfit.inference.optimize.transition_cells import CC, KK, ONE, C, Index, K, value_at
from ifrfit.physics.angles import Incidence
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observable import Observable

# rows at once, which stay in the cache; u and v of more are made anew: that takes less time than their memory
_BLOCK = 32768
_WHOLE = slice(None)


class Alike(NamedTuple):
    """What rows share that measure k alike: value = offset + slope k, with one sigma."""

    offset: float
    slope: float
    sigma: float

    @property
    def weight(self) -> float:
        """Of each row, as a measurement of k."""
        u = self.slope / self.sigma
        return u * u

    def k(self, value: Array) -> Array:
        """What values say of k."""
        return (value - self.offset) / self.slope


@dataclass(frozen=True)
class ImpulseRows:
    """Weighted measurements of the impulse factor k, made from the rows of a group as they are asked for.

    The residual of a row is v - u k, with u its slope and v its value less its offset, over sigma.

    Attributes
    ----------
    rows : Rows
    sigma : ndarray, (n,)
    inertia_factor : float
    parts : tuple of (Observable, float)
        Observables that measure k, and what their slope and offset are multiplied by.
    law : Coefficients
    domain : (float, float)
        Of c.
    direct : ndarray, (6,)
        What measures c or kappa on its own adds to the coefficients of chi2: priors, and values of mu.
    places : ndarray of int, (n,), or None
        Rows that measure k; None for all.
    tau : ndarray, (n,)
        Their slip ratios.
    alike : Alike or None
        What many rows share, if they do.
    """

    rows: Rows
    sigma: Array
    inertia_factor: float
    parts: tuple[tuple[Observable, float], ...]
    law: Coefficients
    domain: tuple[float, float]
    direct: Array
    places: Index | None
    tau: Array
    alike: Alike | None = None

    @classmethod
    def of(cls, group: ParameterGroup) -> ImpulseRows | None:
        """The rows of a group whose chi2 is one in c and kappa, but for what e_n alone decides; else None."""
        e_n, own, mu = group.e_n, group.c, group.mu
        plain = mu.fixed is None and mu.lower == 0.0 and math.isinf(mu.upper)
        if not (plain and own.fixed is None and math.isfinite(own.lower) and math.isfinite(own.upper)):
            return None
        if e_n.fixed is None and not is_separable(group):
            return None
        if e_n.fixed is not None and e_n.prior is not None:
            return None
        scale = {"one": 1.0}
        if e_n.fixed is not None and e_n.fixed > 0.0:
            scale |= {"impulse": 1.0 / (1.0 + e_n.fixed), "rebound": 1.0 / e_n.fixed}
        parts, rows = [], group.rows
        for observable in rows.measured:
            if observable.kind in ("normal", "friction"):
                continue  # e_n is known or found apart, and with it values of mu are values of kappa
            if observable.kind != "tangential" or observable.scale not in scale:
                return None
            parts.append((observable, scale[observable.scale]))
        if not parts:
            return None
        domain = own.lower, own.upper
        places = None
        if len(parts) < len(rows.measured):
            places = np.flatnonzero(rows.is_any_of([observable.name for observable, _ in parts]))
        made = cls(
            rows,
            group.sigma,
            group.inertia_factor,
            tuple(parts),
            group.coefficients,
            domain,
            _direct_coefficients(group),
            places,
            rows.tau if places is None else rows.tau[places],
        )
        return made if made._is_kept else replace(made, alike=made._find_alike())

    @property
    def order(self) -> Index:
        """Rows in ascending order of tau; made once, as `slip_intervals` are."""
        return self.rows.by_tau if self.places is None else self.tau.argsort()

    @property
    def slip_intervals(self) -> SlipIntervals | None:
        """The rows by intervals of tau; those of all rows are made once, whatever is known of their noise."""
        return self.rows.slip_intervals if self.places is None else SlipIntervals.of(self.tau)

    def blocks(self) -> Iterator[slice]:
        """Parts of the rows."""
        for start in range(0, self.tau.size, _BLOCK):
            yield slice(start, start + _BLOCK)

    @cached_property
    def _of_all(self) -> tuple[Array | float, Array]:
        return self._made(_WHOLE)

    def of_places(self, at: slice | Index) -> tuple[Array | float, Array]:
        """u and v of some of the rows; one u of those that are alike."""
        if not self._is_kept:
            return self._made(at)
        u, v = self._of_all
        return u[at] if isinstance(u, np.ndarray) else u, v[at]

    @property
    def _is_kept(self) -> bool:
        return self.tau.size <= _BLOCK

    def _made(self, at: slice | Index) -> tuple[Array | float, Array]:
        u, v, sigma = self._measured(at)
        weight = 1.0 / sigma
        v *= weight
        return u * weight, v

    def _measured(self, at: slice | Index) -> tuple[Array | float, Array, Array | float]:
        """Slope, value less offset, and sigma."""
        value = self.values(at)
        if self.alike is not None:
            return self.alike.slope, value - self.alike.offset, self.alike.sigma
        at = at if self.places is None else self.places[at]
        sigma = self.sigma[at]
        is_whole = isinstance(at, slice) and at == _WHOLE
        incidence = self.rows.incidence if is_whole else self.rows.incidence.lazily(at)
        if len(self.parts) == 1:
            offsets, slopes = self._line(incidence, *self.parts[0])
            return slopes, value - offsets, sigma
        which, (u, v) = self.rows.which[at], np.empty((2, value.size))
        for observable, factor in self.parts:
            here = which == self.rows.names.index(observable.name)
            offsets, slopes = self._line(incidence, observable, factor)
            u[here], v[here] = slopes[here], (value - offsets)[here]
        return u, v, sigma

    def _line(self, incidence: Incidence, observable: Observable, factor: float) -> tuple[Array, Array]:
        """Offset and slope of an observable in k."""
        assert observable.linear is not None
        offset, slope = observable.linear(incidence, self.inertia_factor)
        return (offset, slope) if factor == 1.0 else (factor * offset, factor * slope)

    def _find_alike(self) -> Alike | None:
        sigma = float(self.sigma[0])
        if len(self.parts) > 1 or np.count_nonzero(self.sigma != sigma):
            return None
        # of several rows: of a single one nothing that was broadcast has strides
        some = self.rows.incidence.take(slice(None, None, len(self.rows) // 2))
        line = [np.asarray(each) for each in self._line(some, *self.parts[0])]
        if any(each.ndim > 0 and each.strides != (0,) for each in line):
            return None
        offset, slope = (float(each.flat[0]) for each in line)
        return Alike(offset, slope, sigma) if slope != 0.0 else None

    def values(self, at: slice | Index) -> Array:
        """What was measured, of some of the rows."""
        return self.rows.value[at if self.places is None else self.places[at]]

    def chi2(self, c: float, kappa: float) -> float:
        """The sum of squares, from the rows themselves."""
        a, b = self.law.a0 + self.law.a1 * c, self.law.b0 + self.law.b1 * c
        total, weight = 0.0, 1.0 if self.alike is None else self.alike.weight
        for at in self.blocks():
            k = kappa / self.tau[at]
            np.minimum(k, b, out=k)
            k += a
            if self._is_kept:
                u, v = self._of_all
                k *= u
                k -= v
            elif self.alike is not None:
                k -= self.alike.k(self.values(at))
            else:
                slope, left, sigma = self._measured(at)
                k *= slope
                k -= left
                k /= sigma
            total += weight * float(k @ k)
        return total + max(0.0, float(value_at(self.direct.tolist(), c, kappa)))


def _direct_coefficients(group: ParameterGroup) -> Array:
    """Coefficients of chi2 of what measures c or kappa on its own, (6,)."""
    made = np.zeros(6)
    if group.c.prior is not None:
        made[CC], made[C], made[ONE] = direct_sums(group.c, np.zeros(0), np.zeros(0))
    if group.e_n.fixed is not None and (group.mu.prior is not None or group.rows.measures("friction")):
        at, unit = group.rows.of_kind("friction"), 1.0 + group.e_n.fixed
        weight = group.weight[at]
        square, product, rest = direct_sums(group.mu, weight, weight * group.rows.value[at])
        made[KK], made[K] = square / unit**2, product / unit
        made[ONE] += rest
    return made
