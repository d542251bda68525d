"""One measurement seen as another observable: a tangential one gives the impulse factor, that the rest."""

from __future__ import annotations

import numpy as np

from ifrfit.physics import OBSERVABLES
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.rebound import rebound_with

_STEP = 1e-6


def convert_observable(
    target: str,
    measured: str,
    value: Array,
    sigma: Array,
    incidence: Incidence,
    *,
    e_n: float,
    inertia_factor: float = 0.4,
) -> tuple[Array, Array]:
    """Convert tangential measurements into another observable by the balance of angular momentum.

    Parameters
    ----------
    target, measured : str
        Observables; `measured` is of the tangential kind and does not depend on e_n.
    value, sigma : ndarray, (n,)
        What was measured, with its standard uncertainty.
    incidence : Incidence
        Of the n impacts.
    e_n : float
        Normal restitution, which some observables need (mu_app, delta).
    inertia_factor : float

    Returns
    -------
    value, sigma : ndarray, (n,)
        In the unit of `target`; sigma to first order. nan where it is undefined.

    Notes
    -----
    No closure enters: centre and spin change by the same impulse, -k U_t per mass.
    """
    offset, slope = OBSERVABLES[measured].linear(incidence, inertia_factor)  # type: ignore[misc]
    with np.errstate(divide="ignore", invalid="ignore"):
        k, sigma_k = (value - offset) / slope, sigma / np.abs(slope)

    def read(factor: Array) -> Array:
        sticking = np.zeros(factor.shape, dtype=bool)
        state = rebound_with(incidence, factor, sticking, np.asarray(e_n), inertia_factor)
        return np.asarray(OBSERVABLES[target].value(state, np.zeros_like(factor)))

    gradient = (read(k + _STEP) - read(k - _STEP)) / (2.0 * _STEP)
    return read(k), np.asarray(np.abs(gradient) * sigma_k)
