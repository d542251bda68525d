"""Projections, tail probabilities of quadratic forms of normal errors, and departures that they leave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]
_KNOTS = 4  # of the spline: three degrees of freedom beside the constant
_SMALLEST = 8  # residuals of an observable below which none is looked for
_DIVISIONS = 14  # of a bracket, and how often: 13**14 is the inverse of rounding


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
    if weights.max() <= 0.0:
        return 0.0
    if float(weights.sum()) >= found:
        return 1.0
    # the saddle point; scipy.optimize would find it, and takes 0.2 s to import
    ends = 0.0, 0.5 / float(weights.max()) * (1.0 - 1e-12)
    for _ in range(_DIVISIONS):
        places = np.linspace(*ends, _DIVISIONS)
        slope = (weights / (1.0 - 2.0 * places[:, None] * weights)).sum(axis=1)
        last = int(np.searchsorted(slope[:-1], found, side="left")) - 1
        ends = float(places[last]), float(places[last + 1])
    s = 0.5 * sum(ends)
    left = 1.0 - 2.0 * s * weights
    w = math.sqrt(max(float(np.log(left).sum()) + 2.0 * s * found, 1e-300))
    u = s * math.sqrt(2.0 * float(((weights / left) ** 2).sum()))
    density = math.exp(-0.5 * w * w) / math.sqrt(2.0 * math.pi)
    return float(np.clip(special.ndtr(-w) + density * (1.0 / u - 1.0 / w), 0.0, 1.0))


@dataclass(frozen=True)
class SmoothDeparture:
    """F test of a natural cubic spline in tau, one an observable, beyond the constants' own directions.

    Attributes
    ----------
    p : float
    rest : float
        Sum of squares that is left.
    dof : int
        Degrees of freedom of that.
    """

    p: float
    rest: float
    dof: int


def smooth_departure(
    groups: Sequence[NDArray[np.intp]], tau: Array, jacobian: Array, r: Array, scale: Array | None = None
) -> SmoothDeparture | None:
    """Test residuals for it; None where too few are left.

    Parameters
    ----------
    groups : sequence of ndarray of int
        Places of the residuals of each observable.
    tau : ndarray, (n,)
    jacobian : ndarray, (n, p)
        Of the values over sigma, by the free constants.
    r : ndarray, (n,)
        Residuals over sigma.
    scale : ndarray, (n,), optional
        What a departure of 1 is in units of `r`; 1 where not given.
    """
    columns = []
    for rows in groups:
        rows = rows[np.isfinite(tau[rows])]
        basis = natural_spline(tau[rows]) if rows.size >= _SMALLEST else None
        if basis is not None:
            wide = np.zeros((r.size, basis.shape[1]))
            wide[rows] = basis if scale is None else basis * scale[rows, None]
            columns.append(wide)
    if not columns:
        return None
    own = orthonormal(jacobian)
    extra = np.concatenate(columns, axis=1)
    extra = orthonormal(extra - own @ (own.T @ extra))
    left = r - own @ (own.T @ r)
    gained = float(((extra.T @ left) ** 2).sum())
    rest = float(left @ left) - gained
    dof = r.size - own.shape[1] - extra.shape[1]
    if dof < 3 or extra.shape[1] == 0 or rest <= 0.0:
        return None
    f = gained / extra.shape[1] / (rest / dof)
    return SmoothDeparture(float(special.fdtrc(extra.shape[1], dof, f)), rest, dof)


def natural_spline(tau: Array) -> Array | None:
    """Basis of the natural cubic splines in tau, knots at quantiles, that vanish at the first knot, (n, 3).

    None where tau has too few different quantiles.

    By truncated powers (Hastie, Tibshirani & Friedman 2009, eqs 5.4 and 5.5): scipy.interpolate would take
    longer to import than the whole fit.
    """
    knots = np.unique(np.quantile(tau, np.linspace(0.0, 1.0, _KNOTS)))
    if knots.size < _KNOTS:
        return None
    x, t = (tau - knots[0]) / np.ptp(knots), (knots - knots[0]) / np.ptp(knots)
    cubes = np.maximum(x[:, None] - t, 0.0) ** 3
    d = (cubes[:, :-1] - cubes[:, -1:]) / (t[-1] - t[:-1])
    return np.column_stack((x, d[:, :-1] - d[:, -1:]))
