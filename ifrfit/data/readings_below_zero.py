"""Readings below zero of what has no negative value: noise makes them where the value is near its noise.

A rebound seen through noise is read as often above itself as below, and at grazing incidence, or of a surface
that gives hardly any back, some readings of v_n and e_n come out negative. They belong to the sample: to
leave them out, and keep those as far above, moves the constants. So a reading is one of noise where it lies
no further below zero than errors reach, by its stated uncertainty, or where none is stated by the scatter of
its series about the law, constant times slope by least absolute deviations, which fewer readings of a wrong
sign than half do not move. A table that has them negative on the whole has its sign, or its axis, the other
way round; one that is far from the law is an outlier, which the fit tells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.column_layout import Layout
from ifrfit.data.schema import BY_NOISE
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.observable import Observable

Mask = NDArray[np.bool_]

FURTHEST = 5.0  # standard uncertainties: one normal error of 3,000,000 reaches as far to one side
ON_THE_WHOLE = -4.0  # standard errors of the constant that the readings make, from which their sign is wrong
FEWEST = 5  # readings whose scatter tells something
_MAD = 1.4826  # standard deviation of a normal law over its median absolute deviation
_KINDS = ("normal", "friction")  # a constant times a slope; |v| is a size, and no noise makes it negative


def has_sign(observable: Observable) -> bool:
    """Whether readings of an observable that is never negative have a sign, which noise can turn."""
    return observable.low == 0.0 and observable.kind in _KINDS


def within_errors(observable: Observable, value: Array, sigma: Array) -> Mask:
    """Which values noise of the stated uncertainty carries below zero; none where it is nan."""
    if not has_sign(observable):
        return np.zeros(value.shape, dtype=bool)
    return np.asarray((value < 0.0) & (value > -BY_NOISE) & (value >= -FURTHEST * sigma))


def made_by_noise(
    observable: Observable,
    value: Array,
    gamma_deg: Array,
    sigma: Array,
    series: NDArray[np.str_] | None = None,
) -> Mask:
    """Which readings below zero noise explains.

    Parameters
    ----------
    observable : Observable
    value, gamma_deg, sigma : ndarray, (n,)
        Uncertainties, and values, that are not known are nan; so may angles be that the law does not need.
    series : ndarray of str, (n,), optional
        Of each reading; without it all are of one.

    Returns
    -------
    ndarray of bool, (n,)
    """
    found = np.zeros(value.shape, dtype=bool)
    below = np.asarray((value < 0.0) & (value > -BY_NOISE))
    if not below.any() or not has_sign(observable):
        return found
    slope = _slope(observable, gamma_deg)
    labels = np.zeros(value.size, dtype=np.intp)
    if series is not None:
        labels = np.unique(series, return_inverse=True)[1]
    for label in np.unique(labels[below]):
        own = np.flatnonzero((labels == label) & np.isfinite(value))
        error = np.where(sigma[own] > 0.0, sigma[own], _scatter(value[own], slope[own]))
        if not _is_negative(value[own], slope[own], error):
            found[own] = within_errors(observable, value[own], error)
    return found


def no_noise(observable: Observable) -> str:
    """What is said of a reading below zero, which is to be put in, that noise does not explain."""
    return (
        f"{{}} is impossible for {observable.name} ({observable.low:g} to {observable.high:g}), and no "
        f"noise: that reaches {FURTHEST:g} sigma below 0 (where none is stated, {FURTHEST:g} times the "
        f"scatter of {FEWEST} readings or more), and not on the whole. Correct it or its sign, or "
        "state the sigma of its noise; left out alone, what remains is too large."
    )


def series_of(layout: Layout) -> NDArray[np.str_] | None:
    """Name of the series of each row of a table; None where all are of one."""
    return np.array(layout.texts("series")) if layout.has("series") else None


def _slope(observable: Observable, gamma_deg: Array) -> Array:
    """The law over its constant."""
    if observable.by_e_n is None:
        return np.ones(gamma_deg.shape)
    return np.asarray(observable.by_e_n(Incidence.of(np.nan_to_num(gamma_deg), degrees=True)))


def _is_negative(value: Array, slope: Array, error: Array) -> bool:
    """Whether the constant that readings make by weighted least squares is far below zero."""
    there = error > 0.0
    z, weight = value[there] / error[there], slope[there] / error[there]
    return float(z @ weight) < ON_THE_WHOLE * float(np.linalg.norm(weight))


def _scatter(value: Array, slope: Array) -> float:
    """Standard deviation of one reading about constant times slope; 0 where too few tell it."""
    there = slope > 0.0
    if np.count_nonzero(there) < FEWEST:
        return 0.0
    value, slope = value[there], slope[there]
    quotient = value / slope
    order = np.argsort(quotient, kind="stable")
    weight = np.cumsum(slope[order])
    constant = quotient[order][np.searchsorted(weight, 0.5 * weight[-1])]
    return float(_MAD * np.median(np.abs(value - constant * slope)))
