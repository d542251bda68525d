"""Sums over measurements of k that decide the cells of c and kappa, about a point where they keep digits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.optimize.impulse_rows import ImpulseRows
from ifrfit.inference.optimize.piecewise import Array
from ifrfit.inference.optimize.transition_cells import (
    CC,
    CK,
    KK,
    N_BELOW,
    ONE,
    SIZE,
    UU,
    C,
    Index,
    K,
    TransitionCells,
    quadratic_matrix,
    row_products,
    value_at,
)
from ifrfit.physics.impulse_laws import Coefficients

_SAMPLE = 64  # rows that tell what is typical
_EPS = float(np.finfo(float).eps)
_ALL = 6  # products of a row that may slide
_BOTH, _ABOVE = slice(0, _ALL), slice(N_BELOW, N_BELOW + _ALL)  # those where they serve both, and where not


@dataclass(frozen=True)
class ImpulseSums:
    """How sums are taken of rows: in c and kappa less those of a point, and k less what it is there.

    Rows that stick and rows that slide have a k of their own taken off, unless both are the same number: then
    the products of a row serve both.

    Attributes
    ----------
    rows : ImpulseRows
    c, kappa : float
        The point.
    stick, slide : float
        Taken off k where a row sticks; where it slides, with kappa/tau.
    in_common : bool
        Whether both are the same number, and kappa is 0.
    law : Coefficients
        Of what is left of k, and of the transition.
    matrix : ndarray, (7, 9)
        See `quadratic_matrix`.
    """

    rows: ImpulseRows
    c: float
    kappa: float
    stick: float
    slide: float
    in_common: bool
    law: Coefficients
    matrix: Array

    @classmethod
    def of(cls, rows: ImpulseRows) -> ImpulseSums:
        """About the middle of the domain of c, and a typical k: all that is known before any fit."""
        n = rows.tau.size
        u, v = rows.of_places(slice(None, None, max(1, n // _SAMPLE)))
        u = u * np.ones(v.size)  # many rows may share it
        square = float(u @ u)
        k = float(u @ v) / square if square > 0.0 else 0.0
        c, law = 0.5 * (rows.domain[0] + rows.domain[1]), rows.law
        left = Coefficients(law.a0 + law.a1 * c - k, law.a1, law.b0 + law.b1 * c, law.b1)
        return cls(rows, c, 0.0, k, k, in_common=True, law=left, matrix=quadratic_matrix(left))

    def about(self, c: float, kappa: float) -> ImpulseSums:
        """About a point near the optimum."""
        law = self.rows.law
        slide, bound = law.a0 + law.a1 * c, law.b0 + law.b1 * c
        matrix = quadratic_matrix(Coefficients(0.0, law.a1, 0.0, law.b1))  # less k at the point itself
        left = Coefficients(0.0, law.a1, bound, law.b1)
        return ImpulseSums(
            self.rows, c, kappa, slide + bound, slide, in_common=False, law=left, matrix=matrix
        )

    @property
    def width(self) -> int:
        """Products of a row: those of one that sticks, then those of one that slides, where these differ."""
        return _ALL if self.in_common else N_BELOW + _ALL

    @property
    def above(self) -> slice:
        """Which products are those of a row that slides; the first `N_BELOW` are of one that sticks."""
        return _BOTH if self.in_common else _ABOVE

    @property
    def squares(self) -> tuple[int, ...]:
        """Which products are u^2."""
        return (UU,) if self.in_common else (UU, N_BELOW + UU)

    @property
    def domain(self) -> tuple[float, float]:
        """Of what is left of c."""
        return self.rows.domain[0] - self.c, self.rows.domain[1] - self.c

    @property
    def direct(self) -> Array | None:
        """`ImpulseRows.direct` in what is left of c and kappa; None for nothing."""
        if not any(self.rows.direct.tolist()):
            return None
        made = self.rows.direct.copy()
        made[ONE] = value_at(made, self.c, self.kappa)
        made[C] -= made[CC] * self.c + made[CK] * self.kappa
        made[K] -= made[CK] * self.c + made[KK] * self.kappa
        return made

    def products(self, at: slice | Index, tau: Array, out: Sequence[Array]) -> Iterator[Array]:
        """Write products of some of the rows, whose slip ratios are tau, to `out`, `width` times (n,).

        They come one after another, so that all may be written to the same memory.
        """
        u, v = self.rows.of_places(at)
        x = 1.0 / tau
        if not self.in_common:
            stick = v - self.stick * u
            yield np.multiply(u, u, out=out[0])
            yield np.multiply(u, stick, out=out[1])
            yield np.multiply(stick, stick, out=out[2])
        left = v - (self.slide if self.in_common else self.slide + self.kappa * x) * u
        yield from row_products(u, left, x, out[self.above])

    def products_alike(self, at: slice | Index, tau: Array) -> Iterator[Array]:
        """As `products`, of rows that are alike: over their weight, and but for `squares`."""
        assert self.rows.alike is not None
        k, x = self.rows.alike.k(self.rows.values(at)), 1.0 / tau
        if not self.in_common:
            left = k - self.stick
            yield left
            yield np.multiply(left, left, out=left)
        left = k - (self.slide if self.in_common else self.slide + self.kappa * x)
        yield left
        yield np.multiply(left, left, out=k)
        yield x
        yield np.multiply(x, x, out=k)
        yield np.multiply(x, left, out=k)

    def quadratics(self, sums: Array) -> tuple[Array, Array]:
        """Coefficients of chi2, prior included, and the size of its terms, from sums (9, m)."""
        made = self.matrix @ sums
        form, size = made[:SIZE], made[SIZE]
        direct = self.direct
        if direct is not None:
            form += direct[:, None]
            size += np.abs(direct[ONE])
        return form, size

    def cells(
        self, order: Index, outside: Array | None, ends: tuple[float, float], n_below: int, depth: float
    ) -> TransitionCells:
        """Cells of some rows, in ascending order of tau.

        Parameters
        ----------
        order : ndarray of int, (n,)
        outside : ndarray, (9,), or None
            Sums over the rows below, which stick, and over those above; None where there are none.
        ends : (float, float)
            Slip ratios between which the transition lies.
        n_below : int
            Rows below.
        depth : float
            Terms in a sum.
        """
        tau, n = self.rows.tau[order], order.size
        terms = np.empty((self.width, n))
        list(self.products(order, tau, list(terms)))
        sums = np.zeros((9, n + 1))
        np.add.accumulate(terms[:N_BELOW], axis=1, out=sums[:N_BELOW, 1:])
        # not as what is left of all: where x is large the difference would lose its digits
        np.add.accumulate(terms[self.above, ::-1], axis=1, out=sums[N_BELOW:, -2::-1])
        if outside is not None:
            sums += outside[:, None]
        walls = np.empty(n + 2)
        walls[0], walls[-1] = ends
        walls[1:-1] = tau
        low, high = walls[:-1], walls[1:]
        n_stick = np.arange(n_below, n_below + n + 1)
        change = high > low
        if np.count_nonzero(change) <= n:  # rows of equal tau change together
            sums, low, high, n_stick = sums[:, change], low[change], high[change], n_stick[change]
        form, size = self.quadratics(sums)
        return TransitionCells(
            form, size, n_stick, low, high, self.law, self.domain, rounding_of(depth), self.kappa
        )

    def all_cells(self) -> TransitionCells:
        """The cells of all rows."""
        order = self.rows.order
        return self.cells(order, None, (0.0, np.inf), 0, float(order.size))


def rounding_of(depth: float) -> float:
    """Relative error of sums so many terms deep."""
    return 4.0 * _EPS * max(16.0, math.sqrt(depth))
