"""Minima of the sum of squares between kinks, about which the first panels are laid: section 5 of the theory.

The certified minima of the least squares are those within 4 of the least; a posterior needs all that can hold
more of the mass than its tolerance. See ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.quadratic_sums import PAIRS
from ifrfit.inference.posterior.sum_of_squares import SumOfSquares
from ifrfit.physics.observable import scale_factor

Array = NDArray[np.float64]

_MOST_MINIMA = 8


def local_minima(
    squares: SumOfSquares,
    sigma: Array,
    c_ends: tuple[float, float],
    c_prior: tuple[float, float] | None,
    threshold: float,
) -> list[tuple[float, float]]:
    """Transitions about which the sum of squares has a minimum between two kinks, with their spread.

    Taken at the reference's e_n. Minima whose sum of squares exceeds the least by `threshold` are left out.
    """
    kinks = squares.kinks
    edges = np.concatenate(([0.0], kinks, [np.inf]))
    if kinks.size == 0 or not any(squares.sums):
        return []
    middle = np.concatenate((0.5 * (edges[:-2] + edges[1:-1]), [2.0 * kinks[-1]]))
    total = np.zeros((len(PAIRS), middle.size))
    for s, group in zip(sigma, squares.sums, strict=True):
        for part in group:
            factor = float(scale_factor(part.scale, np.asarray(squares.reference.e_n)))
            powers = np.array([1.0, 0, factor, factor, 0, 0, 0, factor**2, factor**2, factor**2])
            at = np.searchsorted(part.tau, middle, side="right")
            total += powers[:, None] * part.products[:, at] / s**2
    rr, _, rp, rq, _, _, _, pp, pq, qq = total
    if c_prior is not None:
        off = c_prior[0] - squares.reference.c
        rr, rp, pp = (
            rr + (off / c_prior[1]) ** 2,
            rp + off / c_prior[1] ** 2,
            pp + 1.0 / c_prior[1] ** 2,
        )
    k, ref = squares.coefficients, squares.reference
    with np.errstate(divide="ignore", invalid="ignore"):
        free = (qq * rp - pq * rq) / (qq * pp - pq * pq)
        free = np.where(np.isfinite(free), free, np.where(pp > 0.0, rp / pp, 0.0))
        d = np.clip(free, c_ends[0] - ref.c, c_ends[1] - ref.c)
        shift = (rq - pq * d) / qq
        square = rr - 2.0 * (rp * d + rq * shift) + pp * d * d + 2.0 * pq * d * shift + qq * shift * shift
        b = k.b0 + k.b1 * (ref.c + d)
        x = (ref.mu * (1.0 + ref.e_n) + shift) / b
        spread = np.sqrt(pp / (qq * pp - pq * pq)) / b
    good = np.isfinite(x) & np.isfinite(spread) & (x >= edges[:-1]) & (x <= edges[1:])
    if not good.any():
        return []
    good &= square <= square[good].min() + threshold
    order = np.flatnonzero(good)[np.argsort(square[good])][:_MOST_MINIMA]
    return [(float(x[i]), float(spread[i])) for i in order]
