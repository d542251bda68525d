"""Values of the rows at many sets of constants at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.physics.observables import get_observable
from ifrfit.physics.rebound import rebound_with

Array = NDArray[np.float64]


def fitted_at(problem: Problem, theta: Array) -> Array:
    """Value of each row at many theta at once: `Problem.fitted`, row by row of theta.

    Parameters
    ----------
    problem : Problem
    theta : ndarray, (m, p)
        Entries as in `problem.parameters.names`, fixed ones included.

    Returns
    -------
    ndarray, (m, n)
    """
    e_n, c, mu = _columns(problem, theta)
    law = problem.closure.law(problem.inertia_factor)
    k, _ = law.impulse(problem.rows.incidence, c, mu * (1.0 + e_n))
    out = np.empty((theta.shape[0], problem.rows.value.size))
    for name in problem.rows.names:
        rows = problem.rows.rows_of(name)
        part = problem.rows.take(rows)
        own_e_n, own_mu = (x if x.shape[1] == 1 else x[:, rows] for x in (e_n, mu))
        free = np.zeros(1, dtype=bool)  # whether a row sticks does not matter once k is known
        state = rebound_with(part.incidence, k[:, rows], free, own_e_n, problem.inertia_factor)
        out[:, rows] = get_observable(name).value(state, own_mu)
    return out


def _columns(problem: Problem, theta: Array) -> tuple[Array, Array, Array]:
    """(e_n, closure constant, mu), each (m, n), or (m, 1) where all rows share it."""
    places = problem.parameters.positions
    separate = {constant.name for constant in problem.parameters if constant.separate}

    def column(name: str | None) -> Array:
        if name is None:
            return np.zeros((theta.shape[0], 1))
        return theta[:, places[name][problem.rows.series if name in separate else [0]]]

    return column("e_n"), column(problem.closure.constant), column("mu")
