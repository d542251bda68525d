"""A result's best values and covariance in the coordinates of its state, for all series or for one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.entry_names import quantity_of, split_name
from ifrfit.inference.result.fit_result import FitResult

Array = NDArray[np.float64]


def coordinates(
    result: FitResult, series: str | None
) -> tuple[tuple[str, ...], Array, Array, NDArray[np.bool_]]:
    """Coordinates of one series' constants.

    Parameters
    ----------
    result : FitResult
    series : str or None
        Whose, where constants are separate.

    Returns
    -------
    names : tuple of str
        As in the state.
    best : ndarray, (p,)
        The values the result states (posterior medians, or the optimum).
    covariance : ndarray, (p, p)
        Of the posterior draws, or of the local Gaussian where there are none.
    free : ndarray of bool, (p,)
        Which of them have any spread.
    """
    state = result.state
    own = [i for i, name in enumerate(state.names) if split_name(name)[1] in ("", series)]
    if state.sample is None:
        covariance = np.array(state.covariance[np.ix_(own, own)])
    else:
        covariance = np.atleast_2d(np.cov(state.sample[:, own], rowvar=False))
    free = np.sqrt(np.diag(covariance)) > 1e-12 * (1.0 + np.abs(state.point[own]))
    return tuple(state.names[i] for i in own), np.array(state.point[own]), covariance, free


def values_of(names: tuple[str, ...], point: Array) -> dict[str, float]:
    """(e_n, closure constant, mu) at a point of the coordinates, by name without the series."""
    values = {quantity_of(name): float(value) for name, value in zip(names, point, strict=True)}
    kappa = values.pop("kappa", None)
    if kappa is not None:
        values["mu"] = kappa / (1.0 + values["e_n"])
    return values
