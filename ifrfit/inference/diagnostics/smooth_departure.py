"""A smooth departure of residuals along tau, which no constants explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.diagnostics.quadratic_forms import Array, orthonormal

_KNOTS = 4  # of the spline: three degrees of freedom beside the constant
_SMALLEST = 8  # residuals of an observable below which none is looked for


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
        basis = _natural_spline(tau[rows]) if rows.size >= _SMALLEST else None
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


def _natural_spline(tau: Array) -> Array | None:
    """Basis of the natural cubic splines in tau, knots at quantiles, that vanish at the first knot, (n, 3).

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
