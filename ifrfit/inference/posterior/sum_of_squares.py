"""Sums of squared residuals of one set of constants, at many constants at once.

Sorted by tau, the rows that stick at a given transition are the first ones. Prefix and suffix sums of the
products of four columns (residual at a reference, value there, and the derivatives of the value by the
closure constant and by kappa) give the sum of squares at any constants from sixteen numbers, however many
rows there are: a quadratic in the closure constant, given e_n and the transition. Rows that are not linear
in the impulse are evaluated as they stand; under a law that is not bilinear that is every oblique row. There,
and where no row is oblique, kappa itself is the transition's coordinate. Eq. (4) of
``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.rows import OBLIQUE, Index, Rows
from ifrfit.inference.posterior.chebyshev import on_grid
from ifrfit.inference.posterior.slabs import Slab, slabs_of
from ifrfit.physics.closure import Closure
from ifrfit.physics.impulse_laws import Coefficients, Law
from ifrfit.physics.observable import scale_factor
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]

PAIRS = [(i, j) for i in range(4) for j in range(i, 4)]  # of columns, in the order of the products
_BY_KAPPA = Coefficients(0.0, 0.0, 1.0, 0.0)  # x = kappa
_MANY = 10_000_000  # values of curved rows from which it pays to look for a polynomial
_CURVED_SLABS = 8  # at most, of a grid with curved rows
AT_ONCE = 40_000  # values of curved rows computed at once: their arrays stay in the cache


@dataclass(frozen=True)
class Quadratic:
    """Sum of squares C - 2 B d + A d^2 in d = c - reference."""

    square: Array
    slope: Array
    curvature: Array

    def at(self, d: Array | float) -> Array:
        """The sum of squares."""
        return np.asarray(self.square + d * (self.curvature * d - 2.0 * self.slope))


@dataclass(frozen=True)
class PrefixSums:
    """Tangential rows of one noise group and one scale: the ten products by number of sticking rows."""

    scale: str
    tau: Array
    products: Array  # (10, n + 1)


def with_c_axis(value: Array) -> Array:
    """The value with an axis for the closure constant; a number as it is."""
    return value[..., None] if np.ndim(value) else value


def expand(
    sums: PrefixSums, e_n: Array, x: Array, d_kappa: Array, h: Array | None, reference_e_n: float
) -> Quadratic:
    """The quadratic in d: with v = v0 + d v1 in the four columns, v0'Gv0, -v0'Gv1 and v1'Gv1."""
    which = np.searchsorted(sums.tau, x, side="right")
    rr, rm, rp, rq, mm, mp, mq, pp, pq, qq = sums.products[:, which]
    factor = scale_factor(sums.scale, e_n)
    shift = factor - scale_factor(sums.scale, np.asarray(reference_e_n))
    y = factor * d_kappa
    square = rr - 2.0 * shift * rm + shift * shift * mm - y * (2.0 * (rq - shift * mq) - y * qq)
    slope = factor * (rp - shift * mp - y * pq)
    curvature = factor * factor * pp
    if h is not None:
        slope = slope + factor * h * (rq - shift * mq - y * qq)
        curvature = curvature + factor * factor * h * (2.0 * pq + h * qq)
    return Quadratic(square, slope, curvature)


@dataclass(frozen=True)
class Reference:
    """Constants about which the sums are taken: near the optimum they keep their digits."""

    e_n: float
    c: float
    mu: float


class SumOfSquares:
    """Sums of squares by noise group.

    Parameters
    ----------
    rows : Rows
        Of one set of constants.
    weight : ndarray
        1/sigma, or ones where the noise is unknown.
    groups : sequence of ndarray of int
        Rows of each noise group.
    closure : Closure
    inertia_factor : float
    reference : Reference
    """

    def __init__(
        self,
        rows: Rows,
        weight: Array,
        groups: Sequence[Index],
        closure: Closure,
        inertia_factor: float,
        reference: Reference,
    ) -> None:
        self.rows, self.weight, self.groups = rows, weight, tuple(groups)
        # of any other law than a bilinear one, whose rows are not linear; and of one with a tilted bound that
        # no row sees: at given mu and e_n the transition would still run with the closure constant
        oblique = rows.has_kind(*OBLIQUE)
        straight = closure.bilinear and (oblique or closure.coefficients(inertia_factor).b1 == 0.0)
        self.law: Law | None = None if straight else closure.law(inertia_factor)
        self.coefficients = closure.coefficients(inertia_factor) if self.law is None else _BY_KAPPA
        self.inertia_factor = inertia_factor
        self.reference = reference
        curved, tangential, normal, friction = (
            rows.of_kind(kind) for kind in ("curved", "tangential", "normal", "friction")
        )
        if self.law is not None:
            curved, tangential = curved | tangential, np.zeros_like(tangential)
        self._oblique = curved | tangential
        self.curved_rows = [group[curved[group]] for group in self.groups]
        linear = rows.linear_parts(inertia_factor)
        self.sums = [self._tangential(group[tangential[group]], linear) for group in self.groups]
        self._normal = [self._normal_rows(group[normal[group]]) for group in self.groups]
        self._friction = [self._friction_rows(group[friction[group]]) for group in self.groups]
        self.kinks = self._kinks()
        if self.is_quadratic:
            del self.rows, self._oblique  # no row is asked for again, and there may be many

    @property
    def is_quadratic(self) -> bool:
        """Whether every row is linear in the closure constant, given e_n and the transition."""
        return not any(rows.size for rows in self.curved_rows)

    def _kinks(self) -> Array:
        """Transitions at which a row changes its regime, ascending."""
        if self.law is not None:  # where that is depends on the closure constant, and nothing jumps there
            return np.empty(0)
        tau = np.unique(self.rows.tau[self._oblique])
        return np.asarray(tau[(tau > 0.0) & np.isfinite(tau)])

    def b(self, c: Array | float) -> Array | float:
        """Bound of the frictional part of the impulse factor in sticking."""
        return self.coefficients.b0 + self.coefficients.b1 * c

    def _tangential(self, at: Index, linear: tuple[Array, Array]) -> list[PrefixSums]:
        if not at.size:
            return []
        by_scale = {scale: at[self.rows.of_scale(scale)[at]] for scale in ("one", "impulse", "rebound")}
        return [self._summed(rows, scale, linear) for scale, rows in by_scale.items() if rows.size]

    def _summed(self, at: Index, scale: str, linear: tuple[Array, Array]) -> PrefixSums:
        at = at[np.argsort(self.rows.tau[at], kind="stable")]
        tau, measured = self.rows.tau[at], self.rows.value[at]
        offset, slope = (part[at] for part in linear)
        k, ref, w = self.coefficients, self.reference, self.weight[at]
        kappa = ref.mu * (1.0 + ref.e_n)
        with np.errstate(divide="ignore", invalid="ignore"):
            over_tau = np.where(slope == 0.0, 0.0, slope / tau)
        a = k.a0 + k.a1 * ref.c
        factor = float(scale_factor(scale, np.asarray(ref.e_n)))
        products = np.zeros((len(PAIRS), at.size + 1))
        for sticking in (True, False):
            fall = (k.b0 + k.b1 * ref.c) * slope if sticking else kappa * over_tau
            fall = np.where(np.isfinite(fall), fall, 0.0)  # a row at tau = 0 always sticks
            value = offset + slope * a + fall
            by_c = slope * (k.a1 + k.b1) if sticking else slope * k.a1
            by_kappa = np.zeros(at.size) if sticking else np.where(np.isfinite(over_tau), over_tau, 0.0)
            columns = [w * x for x in (measured - factor * value, value, by_c, by_kappa)]
            for total, (i, j) in zip(products, PAIRS, strict=True):
                product = columns[i] * columns[j]
                if sticking:
                    np.cumsum(product, out=total[1:])
                else:
                    total[:-1] += np.cumsum(product[::-1])[::-1]
        return PrefixSums(scale, tau, products)

    def _normal_rows(self, at: Index) -> Quadratic:
        """Sum of squares of rows of e_n by its distance from the reference."""
        factor = self.rows.normal_factor(at) * self.weight[at]
        left = self.rows.value[at] * self.weight[at] - factor * self.reference.e_n
        return Quadratic(left @ left, factor @ left, factor @ factor)

    def _friction_rows(self, at: Index) -> Quadratic:
        """Sum of squares of rows of mu by its distance from the reference."""
        weight = self.weight[at]
        left = (self.rows.value[at] - self.reference.mu) * weight
        return Quadratic(left @ left, weight @ left, weight @ weight)

    def quadratics(self, e_n: Array, x: Array) -> list[Quadratic]:
        """Of each noise group, all rows but the curved ones; under a tilted bound not those of mu either.

        Parameters
        ----------
        e_n, x : ndarray
            Broadcastable; x is the value of tau at the transition.
        """
        d_e = e_n - self.reference.e_n
        k, ref = self.coefficients, self.reference
        b = k.b0 + k.b1 * ref.c
        d_kappa, h = x * b - ref.mu * (1.0 + ref.e_n), x * k.b1
        d_mu = x * b / (1.0 + e_n) - ref.mu
        found = []
        for sums, normal, friction in zip(self.sums, self._normal, self._friction, strict=True):
            square: Array = np.asarray(normal.square)
            if normal.curvature:
                square = normal.at(d_e)
            slope: Array = np.asarray(0.0)
            curvature: Array = np.asarray(0.0)
            if friction.curvature and not k.b1:
                square = square + friction.at(d_mu)
            for part in sums:
                more = expand(part, e_n, x, d_kappa, h if k.b1 else None, ref.e_n)
                square, slope = square + more.square, slope + more.slope
                curvature = curvature + more.curvature
            found.append(Quadratic(square, slope, curvature))
        return found

    def with_mu(self, squares: Sequence[Quadratic], e_n: Array, x: Array) -> list[Quadratic]:
        """The quadratics with the rows of mu under a tilted bound, to find the likely closure constant.

        Far out, where mu is a large x times a small bound, their digits cancel: `curved` has these rows as
        they are.
        """
        k, ref = self.coefficients, self.reference
        d_mu, h = x * (k.b0 + k.b1 * ref.c) / (1.0 + e_n) - ref.mu, x * k.b1 / (1.0 + e_n)
        return [
            Quadratic(
                q.square + friction.at(d_mu),
                q.slope + h * (friction.slope - friction.curvature * d_mu),
                q.curvature + friction.curvature * h * h,
            )
            if friction.curvature and k.b1
            else q
            for q, friction in zip(squares, self._friction, strict=True)
        ]

    def curved(self, e_n: Array, x: Array, c: Array, mu: Array, slabs: int = 1) -> list[Array | float]:
        """Sum of squares of each noise group's curved rows, and of those of mu that `quadratics` leaves out.

        0.0 where there are none. The constants are those of one of a number of slabs of a grid.
        """
        return [self.curved_of(group, e_n, x, c, mu, slabs) for group in range(len(self.groups))]

    def curved_of(
        self, group: int, e_n: Array, x: Array, c: Array, mu: Array, slabs: int = 1
    ) -> Array | float:
        """The same of one noise group."""
        rows, friction = self.curved_rows[group], self._friction[group]
        square = self._curved_group(rows, e_n, x, c, slabs) if rows.size else 0.0
        if friction.curvature and self.coefficients.b1:
            square = square + friction.at(mu - self.reference.mu)
        return square

    def slabs(self, shape: Sequence[int], size: int) -> list[Slab]:
        """Slabs of a grid of (outer nodes, e_n, transition), with `size` values in all, for these sums.

        Where polynomials stand for curved rows, eq. (13), these are found for each slab: few of them, and
        none along e_n.
        """
        m, _, n_x = shape
        if self.is_quadratic or max(m, n_x) == 1:
            return slabs_of(shape, size)
        return slabs_of((m, 1, n_x), size, size // _CURVED_SLABS)

    def curved_values(self, rows: Index, e_n: Array, x: Array, c: Array) -> Array:
        """Weighted residuals of curved rows, (..., rows)."""
        part = self.rows.take(rows)
        factor = self._factors(part, x, c)
        out = np.empty(factor.shape)
        for name in part.names:
            at = part.rows_of(name)
            if at.size:
                whole = at.size == part.tau.size
                i = part.incidence if whole else part.take(at).incidence
                k = factor if whole else factor[..., at]
                mu = np.asarray(np.nan)  # takes no part in oblique observables once k is known
                value = OBSERVABLES[name].by_form(i, k, e_n[..., None], mu, self.inertia_factor)
                if whole:
                    out = value
                else:
                    out[..., at] = value
        return np.asarray((part.value - out) * self.weight[rows])

    def _factors(self, part: Rows, x: Array, c: Array) -> Array:
        """Impulse factors of rows, (..., rows)."""
        if self.law is not None:
            return self.law.impulse(part.incidence, c[..., None], x[..., None])[0]
        k = self.coefficients
        a, b = k.a0 + k.a1 * c, k.b0 + k.b1 * c
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(part.tau > 0.0, x[..., None] / part.tau, np.inf)
        return np.asarray(a[..., None] + b[..., None] * np.minimum(1.0, ratio))

    def _curved_group(self, rows: Index, e_n: Array, x: Array, c: Array, slabs: int) -> Array:
        shape = np.broadcast_shapes(e_n.shape, x.shape, c.shape)
        if (
            slabs * rows.size * math.prod(shape) < _MANY or self.law is not None
        ):  # its tables are not that smooth
            return self._squares(rows, *(np.broadcast_to(y, shape) for y in (e_n, x, c)))
        return on_grid(lambda *at: self._squares(rows, *at), e_n, x, c, rows.size)

    def _squares(self, rows: Index, e_n: Array, x: Array, c: Array) -> Array:
        """Sums of squares as they are, at constants in arrays of one shape."""
        flat = [y.reshape(-1) for y in (e_n, x, c)]
        out = np.empty(c.size)
        step = max(1, AT_ONCE // rows.size)
        for start in range(0, out.size, step):
            at = slice(start, start + step)
            residual = self.curved_values(rows, *(y[at] for y in flat))
            out[at] = np.einsum("ij,ij->i", residual, residual)
        return out.reshape(c.shape)
