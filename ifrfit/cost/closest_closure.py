"""Constants with which a closure comes closest to a given beta."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.parameters import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.optimize.solve import solve
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.closure import Closure


@dataclass(frozen=True)
class Constants:
    """e_n, the closure's own constant (0 where it has none), mu."""

    e_n: float
    own: float
    mu: float


def closest(closure: Closure, incidence: Incidence, beta: Array, e_n: float) -> Constants:
    """Least squares of beta over these impacts, in the passive domain, every impact with equal weight.

    Parameters
    ----------
    closure : Closure
        Of a bilinear one the optimum is the global one, see `ifrfit.inference.optimize.solve.solve`; of
        another, the best of many local ones.
    incidence : Incidence
        Of solid spheres, without lateral spin.
    beta : ndarray, (n,)
    e_n : float
        Held, because beta knows mu (1 + e_n) only.

    Returns
    -------
    Constants
    """
    gamma = np.degrees(np.arctan2(incidence.sine, incidence.cosine))
    columns = {"series": "", "observable": "beta", "gamma_deg": gamma, "spin_y": incidence.spin_y}
    table = make_table(columns | {"value": beta, "sigma": 1.0, "provenance": "simulated"})
    constants = make_parameters(closure, 0.4, fix={"e_n": e_n})
    problem = make_problem(Observations(table), closure, 0.4, constants, "known")
    theta = dict(
        zip(problem.parameters.names, solve(problem, problem.noise.sigma).theta.tolist(), strict=True)
    )
    return Constants(theta["e_n"], theta.get(closure.constant or "", 0.0), theta["mu"])
