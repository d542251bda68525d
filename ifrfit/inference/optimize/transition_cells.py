"""Cells of least squares in two unknowns, c and kappa, from six sums over rows; many are solved at once.

Where e_n is known or found apart, a tangential row is v = u k + noise with the impulse factor
k = a0 + a1 c + min(b0 + b1 c, kappa x), x = 1/tau. The first rows by tau stick, the others slide, and chi2
of each such cell is a quadratic in (c, kappa) whose coefficients come from six sums, eq. (16). Two unknowns
and four edges leave a minimum in closed form: section 7 of docs/theory/certificate.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import Array
from ifrfit.inference.optimize.piecewise_quadratic import DOUBTFUL, FLAT, CellMinima
from ifrfit.physics.impulse_laws import Coefficients

Index = NDArray[np.intp]
Bool = NDArray[np.bool_]

UU, UV, VV, UUX, UUXX, UVX = range(6)  # sums of products of u, v and x
CC, CK, KK, C, K, ONE = range(6)  # chi2 = CC c^2 + 2 CK c kappa + KK kappa^2 - 2 C c - 2 K kappa + ONE
N_BELOW = 3  # sums over rows that stick: UU, UV, VV; of those that slide all six follow


def row_products(u: Array, v: Array, x: Array, out: Array) -> None:
    """Write the products of each row that are summed to `out`, (6, ...)."""
    np.multiply(u, u, out=out[UU])
    np.multiply(u, v, out=out[UV])
    np.multiply(v, v, out=out[VV])
    np.multiply(u, x, out=out[UVX])
    np.multiply(u, out[UVX], out=out[UUX])
    np.multiply(out[UVX], out[UVX], out=out[UUXX])
    out[UVX] *= v


def quadratic_matrix(law: Coefficients) -> Array:
    """What makes the coefficients of chi2 in (c, kappa) from the sums, (6, 9).

    The coefficients come in the order of `CC`, `CK`, `KK`, `C`, `K`, `ONE`; of the sums the first three are
    over the rows that stick, the other six over those that slide.
    """
    a, b = law.a0 + law.b0, law.a1 + law.b1
    made = np.zeros((6, 9))
    stick, slide = made[:, :N_BELOW], made[:, N_BELOW:]
    stick[CC, UU] = b * b
    stick[C, UV], stick[C, UU] = b, -b * a
    stick[ONE, UU], stick[ONE, UV], stick[ONE, VV] = a * a, -2.0 * a, 1.0
    slide[CC, UU] = law.a1**2
    slide[CK, UUX] = law.a1
    slide[KK, UUXX] = 1.0
    slide[C, UV], slide[C, UU] = law.a1, -law.a1 * law.a0
    slide[K, UVX], slide[K, UUX] = 1.0, -law.a0
    slide[ONE, UU], slide[ONE, UV], slide[ONE, VV] = law.a0**2, -2.0 * law.a0, 1.0
    return made


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
    first = form[CC] > 0.0
    factor = np.divide(form[CK], form[CC], out=np.zeros_like(form[CC]), where=first)
    of_c = np.divide(form[C], form[CC], out=np.zeros_like(form[CC]), where=first) * form[C]
    pivot = form[KK] - factor * form[CK]
    share = np.divide(pivot, form[KK], out=np.ones_like(pivot), where=form[KK] > 0.0)
    second = (share > FLAT) & (form[KK] > 0.0)
    left = form[K] - factor * form[C]
    of_kappa = np.divide(left * left, pivot, out=np.zeros_like(pivot), where=second)
    # the pivot is scaled to a unit diagonal: as it is in the general elimination
    error = rounding * (size + of_c + of_kappa / np.where(second, share, 1.0))
    return form[ONE] - of_c - of_kappa - error, share < DOUBTFUL


def value_at(form: Array, c: Array | float, kappa: Array | float) -> Array:
    """Chi2 of quadratics (6, ...) at (c, kappa)."""
    along_c = form[CC] * c + 2.0 * (form[CK] * kappa - form[C])
    return np.asarray(along_c * c + (form[KK] * kappa - 2.0 * form[K]) * kappa + form[ONE])


def lowest_on_wall(
    form: Array, tau: Array, law: Coefficients, domain: tuple[float, float], kappa0: float
) -> Array:
    """The c of the least chi2 where the transition lies at tau: kappa0 + kappa = tau (b0 + b1 c)."""
    turn, foot = law.b1 * tau, law.b0 * tau - kappa0
    curved = form[CC] + (2.0 * form[CK] + form[KK] * turn) * turn
    slope = form[C] - form[CK] * foot + (form[K] - form[KK] * foot) * turn
    c = np.divide(slope, curved, out=np.zeros_like(slope), where=curved > 0.0)
    return np.asarray(np.minimum(np.maximum(c, domain[0]), domain[1]))


@dataclass(frozen=True)
class TransitionCells:
    """Neighbouring cells in c and kappa of one problem.

    Attributes
    ----------
    form : ndarray, (6, m)
        See `quadratic_matrix`.
    size : ndarray, (m,)
        Of the terms that make up chi2 at c = kappa = 0.
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
        first, *rest = runs
        if not rest:
            return first
        nowhere = np.zeros((6, 1))
        nowhere[ONE] = np.inf  # which is no minimum
        void = nowhere, np.zeros(1), np.array([-1]), np.zeros(1), np.array([np.inf])
        parts = [(first.form, first.size, first.n_stick, first.low, first.high)]
        for each in rest:
            parts += [void, (each.form, each.size, each.n_stick, each.low, each.high)]
        form, size, n_stick, low, high = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
        rounding = max(each.rounding for each in runs)
        return cls(form, size, n_stick, low, high, first.law, first.domain, rounding, first.kappa0)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(self.n_stick.size)

    @property
    def n_unknowns(self) -> int:
        """c and kappa."""
        return 2

    @property
    def least(self) -> float:
        """Of a sum of squares."""
        return 0.0

    def lower_bounds(self) -> tuple[Array, Bool]:
        """Lower bound of every cell from its unconstrained minimum, and which are in doubt, (1, m) each."""
        bounds, doubtful = lowest_anywhere(self.form, self.size, self.rounding)
        return bounds[None], doubtful[None]

    def minima(self, which: Index) -> CellMinima:
        """Minimum of chosen cells: inside, on a wall, or at an end of the domain of c."""
        form, low, high = self.form[:, which], self.low[which], self.high[which]
        law, (first, last) = self.law, self.domain
        cc, ck, kk, of_c, of_k, _ = form
        c, kappa = np.empty((2, 5, which.size))
        walls = np.empty((2, which.size))
        walls[0] = low
        walls[1] = high
        last_cell = high == np.inf  # it has one wall, which is as good as any place where no row knows kappa
        np.copyto(walls[1], low, where=last_cell)
        with np.errstate(all="ignore"):
            det, both = ck * ck, cc * kk
            np.subtract(both, det, out=det)
            c[0] = (of_c * kk - ck * of_k) / det
            kappa[0] = (cc * of_k - ck * of_c) / det
            bound = law.b0 + law.b1 * c[0]
            inside = (c[0] >= first) & (c[0] <= last) & (kappa[0] >= low * bound - self.kappa0)
            inside &= (kappa[0] <= high * bound - self.kappa0) & (det > FLAT * both)
            c[1:3] = lowest_on_wall(form, walls, law, self.domain, self.kappa0)
            c[3], c[4] = first, last
            along = (of_k - ck * c[3:]) / kk
            along[:, kk <= 0.0] = 0.0
            kappa[3:] = along
            ends = walls[:, None] * (law.b0 + law.b1 * c[1:]) - self.kappa0
            kappa[1], kappa[2] = ends[0, 0], ends[1, 1]
            np.maximum(kappa[3:], ends[0, 2:], out=kappa[3:])
            np.minimum(kappa[3:], ends[1, 2:], out=kappa[3:], where=~last_cell | (kk <= 0.0))
            value = value_at(form, c, kappa)
            value[0, ~inside] = np.inf
        best, cell = value.argmin(axis=0), np.arange(which.size)
        points = np.empty((which.size, 2))
        points[:, 0], points[:, 1] = c[best, cell], kappa[best, cell]
        linear = np.abs(form[C : K + 1] * points.T).sum(axis=0)
        return CellMinima(value[best, cell], self.rounding * (self.size[which] + 4.0 * linear), points)

    def determine(self, which: Index) -> bool:
        """Whether chosen cells determine c, and kappa where any row slides."""
        form = self.form[:, which]
        pivot = form[CC] * form[KK] - form[CK] ** 2
        return bool(((form[CC] > 0.0) & (pivot >= DOUBTFUL * form[CC] * form[KK])).all())
