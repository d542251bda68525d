"""Errors of rows that were computed from measured velocities and spins, by first order in these errors."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.physics.angles import Incidence

Array = NDArray[np.float64]

_OWN_VELOCITY = ("v_x", "v_y", "v_n", "beta_tot")
_OWN_SPIN = ("spin_x_after", "spin_y_after")
# over which incoming velocity a row was taken: what the true angle changes about it
DIVIDED_BY: dict[str, Callable[[Incidence], Array]] = {
    "beta": lambda i: i.slip,
    "beta_cm": lambda i: i.sine,
    "tan_psi_after": lambda i: i.cosine,
    "e_n": lambda i: i.cosine,
}


def propagated_sigma(
    observable: str, i: Incidence, value: Array, error_model: ErrorModel, where: str
) -> Array:
    """Standard uncertainty of rows of one observable.

    The velocity of the contact point is that of the centre plus the spin, so its error is
    sqrt(sigma_v^2 + sigma_s^2). A ratio has the error of its numerator over its denominator: without bound
    near normal incidence for beta and beta_cm, where such rows say nothing.

    Parameters
    ----------
    observable : str
    i : Incidence
        Of the rows.
    value : ndarray
        Of the rows.
    error_model : ErrorModel
        With `velocity` given.
    where : str
        The source, for messages.

    Raises
    ------
    DataError
        For an observable whose error depends on the constants, or that needs the error of the spin.
    """
    assert error_model.velocity is not None
    v, s = error_model.velocity, error_model.spin
    if observable in _OWN_VELOCITY:
        return np.full(value.shape, v)
    if observable in ("beta_cm", "e_n"):
        # without an angle e_n is that of a normal drop: cosine 1
        return np.asarray(v / np.maximum(np.abs(DIVIDED_BY[observable](i)), 1e-300))
    if observable not in (*_OWN_SPIN, "beta", "tan_psi_after", "psi_after_deg"):
        raise DataError(
            f"{where}: the error of {observable} cannot be propagated from --sigma-velocity, because it "
            "depends on the constants. Give the velocities themselves, or a sigma in every row without "
            "--sigma-velocity."
        )
    if s is None:
        raise DataError(
            f"{where}: {observable} contains the spin after impact, so its error needs --sigma-spin, too "
            "(R sigma_Omega per incoming speed)."
        )
    if observable in _OWN_SPIN:
        return np.full(value.shape, s)
    contact = math.hypot(v, s)
    if observable == "psi_after_deg":
        slope = np.cos(np.radians(value)) ** 2
        return np.asarray(np.degrees(contact * slope / np.maximum(i.cosine, 1e-300)))
    return np.asarray(contact / np.maximum(np.abs(DIVIDED_BY[observable](i)), 1e-300))
