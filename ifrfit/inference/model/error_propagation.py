"""Errors of rows that were computed from measured velocities and spins, by first order in these errors."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]


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
    kind = OBSERVABLES[observable]
    if kind.numerator is None:
        raise DataError(
            f"{where}: the error of {observable} cannot be propagated from --sigma-velocity, because it "
            "depends on the constants. Give the velocities themselves, or a sigma in every row without "
            "--sigma-velocity."
        )
    velocity, spin = error_model.velocity, error_model.spin
    if kind.numerator != "velocity" and spin is None:
        raise DataError(
            f"{where}: {observable} contains the spin after impact, so its error needs --sigma-spin, too "
            "(R sigma_Omega per incoming speed)."
        )
    parts = {"velocity": (velocity,), "spin": (spin,), "contact": (velocity, spin)}[kind.numerator]
    sigma = np.full(value.shape, math.hypot(*(part for part in parts if part is not None)))
    if kind.divided_by is not None:
        # without an angle e_n is that of a normal drop: cosine 1
        sigma = sigma / np.maximum(np.abs(kind.divided_by(i)), 1e-300)
    if kind.unit == "deg":
        sigma = np.degrees(sigma * np.cos(np.radians(value)) ** 2)
    return np.asarray(sigma)
