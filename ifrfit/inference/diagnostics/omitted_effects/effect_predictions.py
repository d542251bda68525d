"""The impacts of a fit as the physics of effects takes them, and what they measure back as rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.physics.effects import Contact, Impacts, compose, plane_effects

Array = NDArray[np.float64]


def impacts_of(problem: Problem, theta: Array, speed: Array, radius: Array) -> Impacts:
    """The rows' impacts with the fitted constants.

    Parameters
    ----------
    problem : Problem
    theta : ndarray
    speed, radius : ndarray, (n,)
        m/s and m; nan where not known.
    """
    e_n, c, mu = problem.per_row(theta)
    return Impacts(problem.rows.incidence, speed, radius, problem.closure, e_n, c, mu)


def computed(problem: Problem, contact: Contact, impacts: Impacts, on: tuple[str, ...]) -> Array:
    """Value of each row with these effects, (n,); nan where an effect leaves none.

    Every fit is in three dimensions.
    """
    outcome, mu = compose(contact, impacts, (*on, *plane_effects())), impacts.mu
    out = np.empty(mu.size)
    for observable, at, _ in problem.rows.by_observable:
        out[at] = np.broadcast_to(observable.value(outcome, mu), mu.shape)[at]
    return out


def speeds(problem: Problem, otherwise: float = np.nan) -> Array:
    """Incoming speed of each row, m/s; `otherwise` where a row states none."""
    stated = problem.observations.table["speed_m_s"].to_numpy(dtype=float)
    return np.where(np.isfinite(stated), stated, otherwise)
