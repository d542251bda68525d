"""Projections, and tail probabilities of quadratic forms of normal errors."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


def orthonormal(a: Array) -> Array:
    """Orthonormal basis of the columns' span."""
    size = np.sqrt((a * a).sum(axis=0))
    seen = size > 1e-12 * size.max(initial=0.0)
    if not seen.any():
        return a[:, seen]
    basis, weight, _ = np.linalg.svd(a[:, seen] / size[seen], full_matrices=False)
    return np.asarray(basis[:, weight > 1e-9 * weight[0]])


def ratio_exceeds(form: Array, found: float, basis: Array) -> float:
    """Probability that z'Bz/z'z exceeds a number.

    Parameters
    ----------
    form : ndarray, (n, n)
        B, symmetric.
    found : float
    basis : ndarray, (n, k)
        Orthonormal: z is what independent normal errors of one size leave beside these columns. Rows of such
        a basis will do, where further rows have no part in B.
    """
    return sum_exceeds(projected_weights(form - found * np.eye(len(form)), basis))


def projected_weights(form: Array, basis: Array) -> Array:
    """Weights of the sum of chi2 of one degree of freedom each that z'Bz is; see `ratio_exceeds`."""
    directions, size, _ = np.linalg.svd(basis, full_matrices=False)
    # the root of the covariance 1 - basis basis', which differs from 1 along few directions
    root = np.eye(len(form)) + (directions * (np.sqrt(np.maximum(1.0 - size**2, 0.0)) - 1.0)) @ directions.T
    return np.asarray(np.linalg.eigvalsh(root @ form @ root))


def sum_exceeds(weights: Array, found: float = 0.0) -> float:
    """Probability that a weighted sum of chi2 of one degree of freedom exceeds a number, by its saddle point.

    References
    ----------
    Lugannani & Rice (1980), Adv. Appl. Probab. 12, 475.
    """
    from scipy.optimize import brentq  # 0.2 s, and few residuals are suspicious

    def slope(s: float) -> float:
        return float((weights / (1.0 - 2.0 * s * weights)).sum()) - found

    if weights.max() <= 0.0:
        return 0.0
    if slope(0.0) >= 0.0:
        return 1.0
    s = float(brentq(slope, 0.0, 0.5 / float(weights.max()) * (1.0 - 1e-12)))
    left = 1.0 - 2.0 * s * weights
    w = math.sqrt(max(float(np.log(left).sum()) + 2.0 * s * found, 1e-300))
    u = s * math.sqrt(2.0 * float(((weights / left) ** 2).sum()))
    density = math.exp(-0.5 * w * w) / math.sqrt(2.0 * math.pi)
    return float(np.clip(special.ndtr(-w) + density * (1.0 / u - 1.0 / w), 0.0, 1.0))
