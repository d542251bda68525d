"""Clenshaw-Curtis rules on [0, 1]: nested, closed, and integrable up to any point.

The nodes include both ends (bounds and kinks are hit exactly), every second node makes the rule of half the
order (its change is the error estimate, at no further cost), and the values at the nodes are a polynomial
whose integral up to any point is known (which makes distribution functions).

Section 5 of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FEW = 128  # points below which cosines are cheaper than the steps of Clenshaw's recurrence


@dataclass(frozen=True)
class Rule:
    """A rule of order n with the rule of order n/2 inside it.

    Attributes
    ----------
    nodes : ndarray, (n + 1,)
        Ascending, from 0 to 1.
    weights : ndarray, (2, n + 1)
        Of the rule, and of the coarse one (zero at odd nodes).
    antiderivative : ndarray, (2, n + 2, n + 1)
        From values at the nodes to Chebyshev coefficients of the integral from 0; fine and coarse.
    differences : ndarray, (4, n + 1)
        Fine less coarse integral, from 0 to a quarter, a half, three quarters and the whole.
    """

    nodes: Array
    weights: Array
    antiderivative: Array
    differences: Array


@cache
def rule(order: int) -> Rule:
    """Rule of an even order."""
    fine, coarse = _antiderivative(order), _antiderivative(order // 2)
    padded = np.zeros_like(fine)
    padded[: coarse.shape[0], ::2] = coarse
    both = np.stack((fine, padded))
    nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(order + 1) / order)
    quarters = chebyshev.chebvander(np.array([-0.5, 0.0, 0.5, 1.0]), order + 1)
    return Rule(nodes, both.sum(axis=1), both, quarters @ (both[0] - both[1]))


def _antiderivative(order: int) -> Array:
    nodes = -np.cos(np.pi * np.arange(order + 1) / order)
    coefficients = np.linalg.inv(chebyshev.chebvander(nodes, order))
    return np.asarray(0.5 * chebyshev.chebint(coefficients, lbnd=-1.0, axis=0))


def integral_up_to(coefficients: Array, v: Array) -> Array:
    """Integral from 0 to v in [0, 1], from the coefficients of the antiderivative along the last axis."""
    y = 2.0 * v - 1.0
    if y.size <= _FEW:  # all polynomials at once
        k = np.arange(coefficients.shape[-1])
        return np.asarray((coefficients * np.cos(k * np.arccos(y)[..., None])).sum(axis=-1))
    # Clenshaw's recurrence; numpy's chebval takes half as long again here
    twice = 2.0 * y
    ahead = np.zeros(np.broadcast_shapes(coefficients.shape[:-1], v.shape))
    second = ahead
    for j in range(coefficients.shape[-1] - 1, 0, -1):
        ahead, second = coefficients[..., j] + twice * ahead - second, ahead
    return np.asarray(coefficients[..., 0] + y * ahead - second)
