"""Values of rows at the nodes of their true angles: smooth pieces, one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.latent_incidence import Latent
from ifrfit.inference.model.rows import Index
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]

_STEP = 1e-5  # of differences by angle (degrees) and spin
_INSIDE = 1e-9  # of the split coordinate's range: a cut nearer to its end cuts nothing


@dataclass(frozen=True)
class At:
    """Constants at which rows are asked for, (P, C) or broadcastable; x, the transition, is (P,).

    `a` and `b` are the closure's: the impulse factor is a + b min(1, x/tau). `factor` is on sigma.
    """

    x: Array
    a: Array
    b: Array
    e_n: Array
    mu: Array
    factor: Array

    def take(self, at: slice) -> At:
        """Some of the points."""
        parts = (self.a, self.b, self.e_n, self.mu, self.factor)
        return At(self.x[at], *(part[at] if part.shape[0] > 1 else part for part in parts))

    @property
    def width(self) -> int:
        """C."""
        return max(int(part.shape[1]) for part in (self.a, self.b, self.e_n, self.mu, self.factor))


@dataclass(frozen=True)
class LatentRows:
    """Rows, the impacts (units of one true angle) they belong to, and the law of their errors.

    Attributes
    ----------
    error_model : ErrorModel
    names : tuple of str
        The observables that occur.
    which : ndarray of int, (n,)
        Observable of each row.
    unit : ndarray of int, (n,)
        Impact of each row, ascending.
    value, sigma : ndarray, (n,)
    observed : Incidence
        Of the rows, as observed.
    latent : Latent
        Of the units.
    inertia_factor : float
    order : ndarray of int, (n,)
        Place of each row in the problem.
    """

    error_model: ErrorModel
    names: tuple[str, ...]
    which: Index
    unit: Index
    value: Array
    sigma: Array
    observed: Incidence
    latent: Latent
    inertia_factor: float
    order: Index


@dataclass(frozen=True)
class Piece:
    """Some rows at some nodes.

    Attributes
    ----------
    rows, units : ndarray of int
        Places among the rows and the units of the law.
    of_rows : ndarray of int
        Unit of each row, an index into `units`.
    log_weight : ndarray, (P, 1, units, N), broadcastable
        Of the nodes.
    value : ndarray, (P, C, rows, N), broadcastable
    sigma : ndarray, broadcastable to `value`
    first : bool
        Whether these units were not there before; further pieces of them add up.
    """

    rows: Index
    units: Index
    of_rows: Index
    log_weight: Array
    value: Array
    sigma: Array
    first: bool


def pieces(law: LatentRows, at: At) -> Iterator[Piece]:
    """All rows of a law at some constants."""
    if not law.error_model.integrates:
        yield _observed(law, at)
        return
    first = np.ones(law.latent.gamma.size, dtype=bool)
    for spin_x, spin_y, weight in law.latent.spins():
        cuts = law.latent.roots(at.x, spin_x, spin_y)
        low, high = law.latent.limits()
        margin = _INSIDE * (high - low)
        cut = np.asarray(((cuts > low + margin) & (cuts < high - margin)).any(axis=(0, 1)))
        for units in _alike(cut, law.latent.order):
            some = cuts[:, :, units] if cut[units[0]] else np.empty((0, 1, units.size))
            incidence, share = law.latent.take(units).nodes(some, spin_x[units], spin_y[units])
            rows = np.flatnonzero(np.isin(law.unit, units))
            of_rows = np.searchsorted(units, law.unit[rows])
            i = _picked(incidence, of_rows)
            with np.errstate(divide="ignore"):
                log_weight = np.log(share * weight)[:, None]
            value, sigma = _values(law, rows, i, at), law.sigma[rows, None] * at.factor[..., None, None]
            yield Piece(rows, units, of_rows, log_weight, value, sigma, bool(first[units[0]]))
        first[:] = False


def _alike(cut: NDArray[np.bool_], order: Index) -> Iterator[Index]:
    """Units that are cut or not, and take as many nodes."""
    key = 2 * order + cut
    yield from (np.flatnonzero(key == value) for value in np.unique(key))


def _observed(law: LatentRows, at: At) -> Piece:
    """Everything at the angles and spins as they were observed."""
    rows, units = np.arange(law.value.size), np.arange(law.latent.gamma.size)
    value = _values(law, rows, _lifted(law.observed), at)
    sigma = law.sigma[rows, None] * at.factor[..., None, None]
    if law.error_model.angles == "effective":
        sigma = np.sqrt(sum(((slope * sd[:, None]) ** 2 for sd, slope in slopes(law, at)), sigma**2))
    return Piece(rows, units, law.unit, np.zeros((1, 1, units.size, 1)), value, sigma, first=True)


def slopes(law: LatentRows, at: At) -> Iterator[tuple[Array, Array]]:
    """Uncertainty of each coordinate that has one, (n,), and the slope of the values by it, (P, C, n, 1)."""
    rows = np.arange(law.value.size)
    for sd, (left, right) in _moved(law):
        yield sd, (_values(law, rows, right, at) - _values(law, rows, left, at)) / (2.0 * _STEP)


def _moved(law: LatentRows) -> Iterator[tuple[Array, tuple[Incidence, Incidence]]]:
    """Uncertainty of each coordinate that has one, by row, and the incidence a step to either side."""
    own = law.latent
    sds = (own.sd_gamma, own.sd_x, own.sd_y)
    for number, sd in enumerate(sds):
        if not (sd > 0.0).any():
            continue
        ends = []
        for step in (-_STEP, _STEP):
            shift = [step if number == k else 0.0 for k in range(3)]
            i = Incidence.of(own.gamma + shift[0], own.spin_x + shift[1], own.spin_y + shift[2], degrees=True)
            ends.append(_lifted(_picked(i, law.unit)))
        yield sd[law.unit], (ends[0], ends[1])


def _picked(i: Incidence, rows: Index) -> Incidence:
    """Incidence of rows from that of their units, the units along the last axis but one (or the only one)."""
    return i.map(lambda part: part[rows] if part.ndim == 1 else part[..., rows, :])


def _lifted(i: Incidence) -> Incidence:
    """With an axis for points and one for nodes."""
    return i.map(lambda part: part[None, :, None])


def _values(law: LatentRows, rows: Index, i: Incidence, at: At) -> Array:
    """Values of rows, (P, C, rows, N), at incidences (P, rows, N)."""
    across = (..., None, None)
    tau = i.tau
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(tau > 0.0, at.x[:, None, None] / tau, np.inf)
    k = at.a[across] + at.b[across] * np.minimum(1.0, ratio)[:, None]
    kinds = law.which[rows]
    if len(law.names) == 1:
        return _restated(law, law.names[0], rows, i, _value(law, law.names[0], i, k, at))
    out = np.empty(np.broadcast_shapes(k.shape, at.e_n[across].shape, at.mu[across].shape))
    for number, name in enumerate(law.names):
        here = np.flatnonzero(kinds == number)
        if here.size:
            part = _picked(i, here)
            value = _value(law, name, part, k[..., here, :], at)
            out[..., here, :] = _restated(law, name, rows[here], part, value)
    return out


def _value(law: LatentRows, name: str, i: Incidence, k: Array, at: At) -> Array:
    e_n, mu = at.e_n[..., None, None], at.mu[..., None, None]
    return OBSERVABLES[name].by_form(i.map(lambda part: part[:, None]), k, e_n, mu, law.inertia_factor)


def _restated(law: LatentRows, name: str, rows: Index, i: Incidence, value: Array) -> Array:
    """The value over the observed incoming velocity, where the row was computed with that one."""
    over = OBSERVABLES[name].divided_by
    restated = law.error_model.propagates and law.error_model.angles != "none"
    if not restated or over is None or OBSERVABLES[name].unit == "deg":
        return value
    return np.asarray(value * (over(i) / over(_picked(law.observed, rows))[:, None])[:, None])
