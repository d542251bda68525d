"""Cells of a plain least squares in two unknowns, c and kappa, from six sums over rows; all are solved at once.

Where e_n is known or found apart, a tangential row is v = u k + noise with the impulse factor
k = a0 + a1 c + min(b0 + b1 c, kappa x), x = 1/tau. The first rows by tau stick, the others slide, and chi2 of
each such cell is a quadratic in (c, kappa) whose coefficients come from six sums over either side. Two unknowns
and four edges leave a minimum in closed form: section 6 of docs/theory/certificate.md.
"""

from __future__ import annotations

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


def row_products(u: Array, v: Array, x: Array) -> Array:
    """The products of each row that are summed, (6, ...)."""
    terms = np.empty((6, *u.shape))
    ux = u * x
    np.multiply(u, u, out=terms[UU])
    np.multiply(u, v, out=terms[UV])
    np.multiply(v, v, out=terms[VV])
    np.multiply(u, ux, out=terms[UUX])
    np.multiply(ux, ux, out=terms[UUXX])
    np.multiply(ux, v, out=terms[UVX])
    return terms


def cell_quadratics(below: Array, above: Array, law: Coefficients) -> Array:
    """Coefficients of chi2 in (c, kappa), (6, ...), in the order of `CC`, `CK`, `KK`, `C`, `K`, `ONE`.

    Parameters
    ----------
    below, above : ndarray, (6, ...)
        Sums over the rows that stick, and over those that slide.
    law : Coefficients
    """
    a, b = law.a0 + law.b0, law.a1 + law.b1
    stick, slide = np.zeros((6, 3)), np.zeros((6, 6))
    stick[CC, UU] = b * b
    stick[C, [UV, UU]] = b, -b * a
    stick[ONE, [VV, UV, UU]] = 1.0, -2.0 * a, a * a
    slide[CC, UU] = law.a1**2
    slide[CK, UUX] = law.a1
    slide[KK, UUXX] = 1.0
    slide[C, [UV, UU]] = law.a1, -law.a1 * law.a0
    slide[K, [UVX, UUX]] = 1.0, -law.a0
    slide[ONE, [VV, UV, UU]] = 1.0, -2.0 * law.a0, law.a0**2
    return np.asarray(np.tensordot(stick, below[:3], 1) + np.tensordot(slide, above, 1))


def size_of_terms(below: Array, above: Array, law: Coefficients) -> Array:
    """Sum of the absolute terms of `ONE`, by which its rounding error is told."""
    a, a0 = abs(law.a0 + law.b0), abs(law.a0)
    stick = below[VV] + 2.0 * a * np.abs(below[UV]) + a * a * below[UU]
    return np.asarray(stick + above[VV] + 2.0 * a0 * np.abs(above[UV]) + a0 * a0 * above[UU])


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


def value_at(form: Array, c: Array, kappa: Array) -> Array:
    """Chi2 of quadratics (6, ...) at (c, kappa)."""
    along_c = form[CC] * c + 2.0 * (form[CK] * kappa - form[C])
    return np.asarray(along_c * c + (form[KK] * kappa - 2.0 * form[K]) * kappa + form[ONE])


def lowest_on_wall(form: Array, tau: Array, law: Coefficients, domain: tuple[float, float]) -> Array:
    """The c of the least chi2 where the transition lies at tau: kappa = tau (b0 + b1 c)."""
    turn, foot = law.b1 * tau, law.b0 * tau
    curved = form[CC] + (2.0 * form[CK] + form[KK] * turn) * turn
    slope = form[C] - form[CK] * foot + (form[K] - form[KK] * foot) * turn
    c = np.divide(slope, curved, out=np.zeros_like(slope), where=curved > 0.0)
    return np.asarray(np.clip(c, *domain))


@dataclass(frozen=True)
class TransitionCells:
    """Neighbouring cells in c and kappa of one problem.

    Attributes
    ----------
    form : ndarray, (6, m)
        See `cell_quadratics`.
    n_stick : ndarray of int, (m,)
        How many rows stick; -1 for the void between cells that are no neighbours.
    low, high : ndarray, (m,)
        Slip ratios between which the transition lies.
    law : Coefficients
    domain : (float, float)
        Of c.
    size : ndarray, (m,)
        Of the terms that make up chi2 at c = kappa = 0.
    rounding : float
        Relative error of a sum.
    """

    form: Array
    n_stick: Index
    low: Array
    high: Array
    law: Coefficients
    domain: tuple[float, float]
    size: Array
    rounding: float

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
        void = self.n_stick < 0
        if void.any():
            bounds[void], doubtful[void] = np.inf, False
        return bounds[None], doubtful[None]

    def minima(self, which: Index) -> CellMinima:
        """Minimum of chosen cells: inside, on a wall, or at an end of the domain of c."""
        form, low, high = self.form[:, which], self.low[which], self.high[which]
        law, (first, last) = self.law, self.domain
        c, kappa = np.empty((5, which.size)), np.empty((5, which.size))
        with np.errstate(all="ignore"):
            det = form[CC] * form[KK] - form[CK] ** 2
            c[0] = (form[C] * form[KK] - form[CK] * form[K]) / det
            kappa[0] = (form[CC] * form[K] - form[CK] * form[C]) / det
            bound = law.b0 + law.b1 * c[0]
            inside = (c[0] >= first) & (c[0] <= last) & (kappa[0] >= low * bound)
            inside &= (kappa[0] <= high * bound) & (det > FLAT * form[CC] * form[KK])
            # beyond the last row nothing depends on kappa: its wall is as good as any place
            walls = np.stack((low, np.where(np.isinf(high), low, high)))
            c[1:3] = lowest_on_wall(form, walls, law, self.domain)
            kappa[1:3] = walls * (law.b0 + law.b1 * c[1:3])
            c[3], c[4] = first, last
            bound = law.b0 + law.b1 * c[3:]
            along = (form[K] - form[CK] * c[3:]) / form[KK]
            along = np.where(form[KK] > 0.0, along, 0.0)
            kappa[3:] = np.minimum(np.maximum(along, walls[0] * bound), walls[1] * bound)
            value = value_at(form, c, kappa)
        value[0] = np.where(inside, value[0], np.inf)
        best, cell = value.argmin(axis=0), np.arange(which.size)
        points = np.stack((c[best, cell], kappa[best, cell]), axis=1)
        linear = np.abs(form[C] * points[:, 0]) + np.abs(form[K] * points[:, 1])
        return CellMinima(value[best, cell], self.rounding * (self.size[which] + 4.0 * linear), points)

    @property
    def knows_c(self) -> Bool:
        """In which cells chi2 depends on c at all, (m,)."""
        return np.asarray(self.form[CC] > 0.0)
