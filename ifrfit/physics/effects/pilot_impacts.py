"""The impacts of a scene on which its plan is made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.effects.contact import Impacts

PILOT = 400  # beside the extreme ones


def pilot_rows(impacts: Impacts) -> NDArray[np.intp]:
    """Rows evenly through the scene, and the extreme ones in everything the effects depend on.

    Parameters
    ----------
    impacts : Impacts
        With one dimension.

    Returns
    -------
    ndarray of int
        All rows where there are no more than 400.
    """
    n = impacts.speed.size
    if n <= PILOT:
        return np.arange(n)
    columns: list[NDArray[np.float64]] = [
        impacts.normal_speed,
        impacts.radius,
        impacts.normal_speed * impacts.radius,
        impacts.incidence.tau,
        impacts.incidence.slip,
        np.abs(impacts.incidence.spin_x),
        impacts.e_n,
        impacts.mu,
    ]
    moving = np.flatnonzero(impacts.normal_speed > 0.0)
    rows = [np.linspace(0, n - 1, PILOT).astype(np.intp)]
    for column in columns:
        rows.append(np.array([np.argmin(column), np.argmax(column)]))
        if moving.size:
            rows.append(moving[[np.argmin(column[moving]), np.argmax(column[moving])]])
    return np.unique(np.concatenate(rows))
