"""Likelihood of rows whose scatter is not plain, at many constants at once."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.latent_incidence import HALF_WIDTH, Latent
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]

_STEP = 1e-5  # of differences by angle (degrees) and spin
_INSIDE = 1e-9  # of the split coordinate's range: a cut nearer to its end cuts nothing
_AT_ONCE = 400_000  # values held at once
_STEEPEST = 60.0  # slope in the angle, in sigma a sd, up to which the nodes follow


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


def pieces(law: RowLaw, at: At) -> Iterator[Piece]:
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


def _observed(law: RowLaw, at: At) -> Piece:
    """Everything at the angles and spins as they were observed."""
    rows, units = np.arange(law.value.size), np.arange(law.latent.gamma.size)
    value = _values(law, rows, _lifted(law.observed), at)
    sigma = law.sigma[rows, None] * at.factor[..., None, None]
    if law.error_model.angles == "effective":
        sigma = np.sqrt(sum(((slope * sd[:, None]) ** 2 for sd, slope in slopes(law, at)), sigma**2))
    return Piece(rows, units, law.unit, np.zeros((1, 1, units.size, 1)), value, sigma, first=True)


def slopes(law: RowLaw, at: At) -> Iterator[tuple[Array, Array]]:
    """Uncertainty of each coordinate that has one, (n,), and the slope of the values by it, (P, C, n, 1)."""
    rows = np.arange(law.value.size)
    for sd, (left, right) in _moved(law):
        yield sd, (_values(law, rows, right, at) - _values(law, rows, left, at)) / (2.0 * _STEP)


def _moved(law: RowLaw) -> Iterator[tuple[Array, tuple[Incidence, Incidence]]]:
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


def _values(law: RowLaw, rows: Index, i: Incidence, at: At) -> Array:
    """Values of rows, (P, C, rows, N), at incidences (P, rows, N)."""
    across = (..., None, None)
    tau = i.tau
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(tau > 0.0, at.x[:, None, None] / tau, np.inf)
    k = at.a[across] + at.b[across] * np.minimum(1.0, ratio)[:, None]
    e_n, mu = at.e_n[across], at.mu[across]
    out = np.empty(np.broadcast_shapes(k.shape, e_n.shape, mu.shape))
    for number, name in enumerate(law.names):
        here = np.flatnonzero(law.which[rows] == number)
        if here.size:
            part = _picked(i, here)
            of_sets = part.map(lambda x: x[:, None])
            value = OBSERVABLES[name].by_form(of_sets, k[..., here, :], e_n, mu, law.inertia_factor)
            out[..., here, :] = _restated(law, name, rows[here], part, value)
    return out


def _restated(law: RowLaw, name: str, rows: Index, i: Incidence, value: Array) -> Array:
    """The value over the observed incoming velocity, where the row was computed with that one."""
    over = OBSERVABLES[name].divided_by
    restated = law.error_model.propagates and law.error_model.angles != "none"
    if not restated or over is None or OBSERVABLES[name].unit == "deg":
        return value
    return np.asarray(value * (over(i) / over(_picked(law.observed, rows))[:, None])[:, None])


@dataclass(frozen=True)
class RowLaw:
    """Likelihood of rows whose true angles or heavy tails are integrated; an impact is a unit of one angle.

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

    @classmethod
    def of(cls, problem: Problem, rows: Index, reference: Array | None = None) -> RowLaw:
        """Law of some rows of a problem.

        Parameters
        ----------
        problem : Problem
        rows : ndarray of int
        reference : ndarray, optional
            Entries of theta near which it is asked for. The steeper the values are there in the angle, the
            more nodes are taken.
        """
        own = problem.rows.take(rows)
        has_angle = own.has_angle
        sd = [np.where(has_angle, x, 0.0) for x in (own.sigma_spin_x, own.sigma_spin_y)]
        of_angle = np.where(
            np.isnan(own.sigma_gamma_deg), problem.error_model.gamma or 0.0, own.sigma_gamma_deg
        )
        gamma = np.where(has_angle, own.gamma_deg, 0.0)
        columns = np.column_stack((gamma, own.incidence.spin_x, own.incidence.spin_y))
        columns = np.column_stack((columns, np.where(has_angle, of_angle, 0.0), *sd))
        key = np.column_stack((own.impacts, columns))
        _, first, unit = np.unique(key, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(unit, kind="stable")
        gamma, spin_x, spin_y, sd_gamma, sd_x, sd_y = columns[first].T
        ends = problem.error_model.population or (0.0, 90.0)
        latent = Latent(gamma, spin_x, spin_y, sd_gamma, sd_x, sd_y, ends, np.ones(gamma.size, dtype=np.intp))
        own = own.take(order) if rows.size > 1 else own
        law = cls(
            problem.error_model, own.names, own.which, unit[order], own.value,
            problem.noise.sigma[rows][order], own.incidence, latent, problem.inertia_factor, order,
        )  # fmt: skip
        return law if reference is None else law._fine_enough(problem, reference)

    def _fine_enough(self, problem: Problem, theta: Array) -> RowLaw:
        """Nodes for the narrower of the two laws whose product is integrated: of the angle, of the value."""
        steep = np.zeros(self.latent.gamma.size)  # squared
        for sd, slope in slopes(self, at_theta(problem, theta[None])):
            np.add.at(steep, self.unit, (slope[0, 0, :, 0] * sd / self.sigma) ** 2)
        widths = 2.0 * HALF_WIDTH * np.sqrt(1.0 + np.minimum(steep, _STEEPEST**2))
        # few different numbers, so that impacts are done together
        order = 16.0 * 1.5 ** np.ceil(np.log((6.0 + 0.9 * widths) / 16.0) / math.log(1.5))
        return replace(self, latent=replace(self.latent, order=np.ceil(order).astype(np.intp)))

    def log_likelihood(self, at: At) -> Array:
        """Log likelihood of all rows together, (P, C)."""
        total = np.zeros((at.x.size, at.width))
        for points in self._chunks(at):
            total[points] = self._log_units(at.take(points)).sum(axis=-1)
        return total

    def log_units(self, at: At) -> Array:
        """Log likelihood of each unit, (P, C, U)."""
        found = np.empty((at.x.size, at.width, self.latent.gamma.size))
        for points in self._chunks(at):
            found[points] = self._log_units(at.take(points))
        return found

    def below(self, at: At) -> Array:
        """Probability of a value below the measured one, row by row, (P, C, n)."""
        found = np.empty((at.x.size, at.width, self.value.size))
        for points in self._chunks(at):
            part = at.take(points)
            for piece in pieces(self, part):
                z = (self.value[piece.rows, None] - piece.value) / piece.sigma
                share = self.error_model.law.cdf(z, self.error_model.dof)
                share = (share * np.exp(piece.log_weight[..., piece.of_rows, :])).sum(axis=-1)
                if piece.first:
                    found[points][..., piece.rows] = 0.0
                found[points][..., piece.rows] += share
        return found

    def _chunks(self, at: At) -> Iterator[slice]:
        nodes = int(self.latent.order[self.unit].sum()) if self.error_model.integrates else self.value.size
        step = max(1, _AT_ONCE // (at.width * nodes))
        yield from (slice(start, start + step) for start in range(0, at.x.size, step))

    def _log_units(self, at: At) -> Array:
        out = np.full((at.x.size, at.width, self.latent.gamma.size), -np.inf)
        for piece in pieces(self, at):
            z = (self.value[piece.rows, None] - piece.value) / piece.sigma
            log_p = self.error_model.law.log_density(z, self.error_model.dof) - np.log(piece.sigma)
            if piece.rows.size > piece.units.size:
                log_p = np.add.reduceat(log_p, np.flatnonzero(np.diff(piece.of_rows, prepend=-1)), axis=-2)
            log_p = log_p + piece.log_weight
            if log_p.shape[-1] > 1:
                top = log_p.max(axis=-1)
                top = np.where(np.isfinite(top), top, 0.0)
                with np.errstate(divide="ignore"):
                    log_p = top + np.log(np.exp(log_p - top[..., None]).sum(axis=-1))
            else:
                log_p = log_p[..., 0]
            out[..., piece.units] = log_p if piece.first else np.logaddexp(out[..., piece.units], log_p)
        return out


def at_theta(problem: Problem, theta: Array, factor: Array | float = 1.0, series: int = 0) -> At:
    """Constants of one series at many theta, (m, p); m points of one constant set each."""
    at = [places[series] for places in problem.parameters.positions.values()]
    by_name = dict(zip(problem.parameters.positions, theta[:, at].T, strict=True))
    own = problem.closure.constant
    c = by_name[own] if own else np.zeros(theta.shape[0])
    k = problem.closure.coefficients(problem.inertia_factor)
    e_n, mu, b = by_name["e_n"], by_name["mu"], k.b0 + k.b1 * c
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.where(b > 0.0, mu * (1.0 + e_n) / b, np.inf)
    scale = np.broadcast_to(np.asarray(factor, dtype=float), theta.shape[0])
    return At(x, *(part[:, None] for part in (k.a0 + k.a1 * c, b, e_n, mu, scale)))
