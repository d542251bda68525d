"""The impacts of a fit as the physics of effects takes them, and what they measure back as rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.physics.effects import Contact, Impacts, Outcome, compose
from ifrfit.physics.observables import OBSERVABLES

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

    Lateral spin is no choice: every fit is in three dimensions.
    """
    return _values(problem, compose(contact, impacts, (*on, "lateral-spin")), impacts.mu)


def _values(problem: Problem, outcome: Outcome, mu: Array) -> Array:
    out = np.empty(mu.size)
    for name in problem.rows.names:
        at = problem.rows.rows_of(name)
        out[at] = np.broadcast_to(OBSERVABLES[name].value(outcome, mu), mu.shape)[at]
    return out


def speeds(problem: Problem, otherwise: float = np.nan) -> Array:
    """Incoming speed of each row, m/s; `otherwise` where a row states none."""
    stated = problem.observations.table["speed_m_s"].to_numpy(dtype=float)
    return np.where(np.isfinite(stated), stated, otherwise)


def oblique(problem: Problem) -> NDArray[np.bool_]:
    """Which rows depend on the tangential law."""
    kinds = [OBSERVABLES[name].kind in ("tangential", "curved") for name in problem.rows.names]
    return np.asarray(np.array(kinds)[problem.rows.which])
