"""Products of tangential rows summed up by the number that stick, and the quadratic that they give.

The four columns of a row are its residual at a reference, its value there, and the derivatives of the value
by the closure constant and by kappa: eq. (4) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.observable import scale_factor

Array = NDArray[np.float64]

PAIRS = [(i, j) for i in range(4) for j in range(i, 4)]  # of columns, in the order of the products


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
    if sums.scale == "one":
        square = rr - d_kappa * (2.0 * rq - d_kappa * qq)
        slope, curvature = rp - d_kappa * pq, pp
        if h is not None:
            slope = slope + h * (rq - d_kappa * qq)
            curvature = curvature + h * (2.0 * pq + h * qq)
        return Quadratic(square, slope, curvature)
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
