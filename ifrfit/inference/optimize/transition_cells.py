"""Cells of least squares in two unknowns, c and kappa, from six sums over rows; many are solved at once.

Where e_n is known or found apart, a tangential row is v = u k + noise with the impulse factor
k = a0 + a1 c + min(b0 + b1 c, kappa x), x = 1/tau. The first rows by tau stick, the others slide, and chi2
of each such cell is a quadratic in (c, kappa) whose coefficients come from six sums, eq. (16). Two unknowns
and four edges leave a minimum in closed form: section 7 of docs/theory/certificate.md.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import NEAR, Array
from ifrfit.inference.optimize.piecewise_quadratic import DOUBTFUL, FLAT, CellMinima
from ifrfit.inference.optimize.solved_cells import SolvedCells
from ifrfit.physics.impulse_laws import Coefficients

Index = NDArray[np.intp]
Bool = NDArray[np.bool_]

UU, UV, VV, UUX, UUXX, UVX = range(6)  # sums of products of u, v and x
CC, CK, KK, C, K, ONE = range(6)  # chi2 = CC c^2 + 2 CK c kappa + KK kappa^2 - 2 C c - 2 K kappa + ONE
SIZE = 6  # no less than the terms that make up `ONE`
_WALLS = 64  # on which a value is looked for
_CHUNK = 4096  # cells solved at once
_FEW = 1024  # cells that are all solved
_FAR = 1e150  # a slip ratio in the place of infinity, of which 0 times is no number
_TINY = float(np.finfo(float).tiny)  # of a sum of squares that is 0, it makes 0 of what it divides
N_BELOW = 3  # sums over rows that stick: UU, UV, VV; of those that slide all six follow


def row_products(u: Array | float, v: Array, x: Array, out: Sequence[Array]) -> Iterator[Array]:
    """Write the products of each row that are summed to `out`, (n,) each, one after another; x is lost."""
    uu, uv, vv, uux, uuxx, uvx = out
    yield np.multiply(u, u, out=uu)
    yield np.multiply(u, v, out=uv)
    yield np.multiply(v, v, out=vv)
    ux = np.multiply(u, x, out=x)
    yield np.multiply(u, ux, out=uux)
    yield np.multiply(ux, ux, out=uuxx)
    yield np.multiply(ux, v, out=uvx)


def quadratic_matrix(law: Coefficients) -> Array:
    """What makes the coefficients of chi2 in (c, kappa), and their size, from the sums, (7, 9).

    They come in the order of `CC`, `CK`, `KK`, `C`, `K`, `ONE`, `SIZE`; of the sums the first three are over
    the rows that stick, the other six over those that slide.
    """
    p, q = law.a0 + law.b0, law.a1 + law.b1  # k = p + q c where a row sticks
    a, b = law.a0, law.a1
    # 2 a uv is no more than a^2 u^2 + v^2
    stick_size, slide_size = 2.0 if p else 1.0, 2.0 if a else 1.0
    return np.array(
        [
            [q * q, 0.0, 0.0, b * b, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, b, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [-q * p, q, 0.0, -b * a, b, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -a, 0.0, 1.0],
            [p * p, -2.0 * p, 1.0, a * a, -2.0 * a, 1.0, 0.0, 0.0, 0.0],
            [2.0 * p * p, 0.0, stick_size, 2.0 * a * a, 0.0, slide_size, 0.0, 0.0, 0.0],
        ]
    )


def lowest_anywhere(form: Array, size: Array, rounding: float) -> tuple[Array, Bool]:
    """Unconstrained minimum of each quadratic less its rounding error, and which the sums leave in doubt.

    By elimination of c, then of kappa: eq. (4) of certificate.md.

    Parameters
    ----------
    form : ndarray, (6, m)
    size : ndarray, (m,)
        Of the terms that make up `ONE`.
    rounding : float
        Relative error of a sum.
    """
    cc, ck, kk, of_c, of_k, one = form
    cc, kk = cc + _TINY, kk + _TINY  # where no row knows c, or kappa, nothing is left of either
    factor = ck / cc
    by_c = of_c * of_c / cc
    # the pivot is scaled to a unit diagonal: as it is in the general elimination
    share = 1.0 - factor * ck / kk
    doubtful = share < DOUBTFUL
    np.maximum(share, FLAT, out=share)
    left = of_k - factor * of_c
    by_kappa = left * left / (share * kk)
    error = rounding * (size + by_c + by_kappa / share)
    return one - by_c - by_kappa - error, doubtful


def value_at(form: Array | Sequence[float], c: Array | float, kappa: Array | float) -> Array:
    """Chi2 of quadratics (6, ...) at (c, kappa)."""
    cc, ck, kk, of_c, of_k, one = form
    along_c = cc * c + 2.0 * (ck * kappa - of_c)
    return np.asarray(along_c * c + (kk * kappa - 2.0 * of_k) * kappa + one)


def lowest_on_wall(
    form: Array, tau: Array, law: Coefficients, domain: tuple[float, float], kappa0: float
) -> tuple[Array, Array]:
    """The (c, kappa) of the least chi2 where the transition lies at tau.

    There kappa0 + kappa = tau (b0 + b1 c); tau is (m,) or (..., m) of quadratics (6, m).
    """
    cc, ck, kk, of_c, of_k, _ = form
    foot = law.b0 * tau
    foot -= kappa0
    slope = of_c - ck * foot
    if law.b1 == 0.0:  # a wall lies at one kappa
        slope /= cc + _TINY
    else:
        turn = law.b1 * tau
        slope += (of_k - kk * foot) * turn
        slope /= cc + (2.0 * ck + kk * turn) * turn + _TINY
    np.maximum(slope, domain[0], out=slope)
    c = np.minimum(slope, domain[1], out=slope)
    return c, foot if law.b1 == 0.0 else tau * (law.b0 + law.b1 * c) - kappa0


class TransitionCells(NamedTuple):
    """Neighbouring cells in c and kappa of one problem.

    Attributes
    ----------
    form : ndarray, (6, m)
    size : ndarray, (m,)
        See `quadratic_matrix`.
    n_stick : ndarray of int, (m,)
        How many rows stick; -1 for the void between cells that are no neighbours.
    low, high : ndarray, (m,)
        Slip ratios between which the transition lies.
    law : Coefficients
    domain : (float, float)
        Of c.
    rounding : float
        Relative error of a sum.
    kappa0 : float
        What is taken off kappa.
    """

    form: Array
    size: Array
    n_stick: Index
    low: Array
    high: Array
    law: Coefficients
    domain: tuple[float, float]
    rounding: float
    kappa0: float

    @classmethod
    def joined(cls, runs: Sequence[TransitionCells]) -> TransitionCells:
        """Runs of cells, with a void between one and the next."""
        first = runs[0]
        if len(runs) == 1:
            return first
        nowhere = np.zeros((6, 1))
        nowhere[ONE] = np.inf  # which is no minimum
        parts = [(first.form, first.size, first.n_stick, first.low, first.high)]
        for before, each in itertools.pairwise(runs):
            void = nowhere, np.zeros(1), np.array([-1]), before.high[-1:], each.low[:1]
            parts += [void, (each.form, each.size, each.n_stick, each.low, each.high)]
        form, size, n_stick, low, high = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
        rounding = max(each.rounding for each in runs)
        return cls(form, size, n_stick, low, high, first.law, first.domain, rounding, first.kappa0)

    def solved(self, center: tuple[float, float] = (0.0, 0.0)) -> SolvedCells:
        """Minimum of every cell that may hold one within `NEAR` of the least, and a lower bound of the rest.

        The free minimum of the cell of the lowest bound gives a value that is met, or else a transition on a
        wall does. A cell whose bound lies more than `NEAR` above it is left alone, unless there are few; one
        that the sums leave in doubt keeps the bound that needs no sums.

        Parameters
        ----------
        center : (float, float)
            What c and kappa lack here: it is added to the points.
        """
        if self.n_stick.size <= _FEW:  # sooner solved than looked through
            found, doubtful = self._minima(self.form, self.size, self.low, self.high)
            which, bounds = np.arange(self.n_stick.size), found.values - found.errors
            bounds[doubtful] = 0.0
        else:
            bounds, doubtful = lowest_anywhere(self.form, self.size, self.rounding)
            np.maximum(bounds, 0.0, out=bounds)
            bounds[doubtful] = 0.0
            lowest = int(bounds.argmin())
            met = math.inf if doubtful[lowest] else self._met_near(lowest)
            if not math.isfinite(met):
                met = self._met_on_walls()
            which = (~(bounds > max(met, float(bounds[lowest])) + NEAR)).nonzero()[0]
            parts = [self.minima(which[i : i + _CHUNK]) for i in range(0, which.size, _CHUNK)]
            found = parts[0] if len(parts) == 1 else CellMinima.joined(parts)
            least = found.values - found.errors
            sure = ~doubtful[which]
            bounds[which[sure]] = least[sure]
        points = found.points
        points += center
        return SolvedCells(found.values, found.errors, points, which, bounds, all_near_solved=True)

    def _met_near(self, cell: int) -> float:
        """Chi2 at the free minimum of a cell, with c in its domain; infinite where it lies in no cell."""
        cc, ck, kk, of_c, of_k, _ = self.form[:, cell].tolist()
        det = cc * kk - ck * ck
        if det <= 0.0:
            return math.inf
        c = min(max((of_c * kk - ck * of_k) / det, self.domain[0]), self.domain[1])
        kappa, bound = (cc * of_k - ck * of_c) / det, self.law.b0 + self.law.b1 * c
        if bound <= 0.0:
            return math.inf
        tau = (self.kappa0 + kappa) / bound
        at = int(self.low.searchsorted(tau, side="right")) - 1
        if at < 0 or tau > self.high[at]:
            return math.inf
        return float(value_at(self.form[:, at].tolist(), c, kappa))

    def _met_on_walls(self) -> float:
        """The least chi2 with the transition on some of the walls."""
        some = slice(None, None, self.n_stick.size // _WALLS + 1)
        form = self.form[:, some]
        met = value_at(form, *lowest_on_wall(form, self.low[some], self.law, self.domain, self.kappa0))
        return float(met[met.argmin()])

    def minima(self, which: Index) -> CellMinima:
        """Minimum of chosen cells: inside, on a wall, or at an end of the domain of c."""
        form = self.form.take(which, axis=1)
        return self._minima(form, self.size[which], self.low[which], self.high[which])[0]

    def _minima(self, form: Array, size: Array, low: Array, high: Array) -> tuple[CellMinima, Bool]:
        """Minimum of cells, and which of them the sums leave in doubt.

        Where c alone is kept in its domain, a minimum that lies across a wall leaves that of the cell on this
        wall: the line from one to the other leaves the cell there, and a convex function falls along it.
        """
        cc, ck, kk, of_c, of_k, _ = form
        both, (first, last) = cc * kk, self.domain
        det = both - ck * ck
        doubtful = det < DOUBTFUL * both
        det[det <= FLAT * both] = np.inf  # a valley: one place in it is as good as another
        c = (of_c * kk - ck * of_k) / det
        np.maximum(c, first, out=c)
        np.minimum(c, last, out=c)
        kappa = (of_k - ck * c) / (kk + _TINY)
        kappa[kk == 0.0] = -np.inf  # where no row knows it: on the lower wall
        bound = self.law.b0 + self.law.b1 * c
        above = kappa > np.minimum(high, _FAR) * bound - self.kappa0
        if high[-1] == np.inf:  # the last cell alone has no upper wall
            above[-1] = False
        outside = above | (kappa < low * bound - self.kappa0)
        wall = lowest_on_wall(form, np.where(above, high, low), self.law, self.domain, self.kappa0)
        for own, on_wall in zip((c, kappa), wall, strict=True):
            np.copyto(own, on_wall, where=outside)
        error = self.rounding * (size + 4.0 * (np.abs(of_c * c) + np.abs(of_k * kappa)))
        return CellMinima(value_at(form, c, kappa), error, np.array((c, kappa)).T), doubtful

    def determine(self, which: Index) -> bool:
        """Whether chosen cells determine c, and kappa where any row slides."""
        cells = self.form[:C].take(which, axis=1).T.tolist()
        return all(cc > 0.0 and cc * kk - ck * ck >= DOUBTFUL * (cc * kk) for cc, ck, kk in cells)
