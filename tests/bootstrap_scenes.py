"""Experiments that the tests of the bootstrap share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from factories import problem_of

from ifrfit.data.observations import make_table
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.physics import OBSERVABLES, rebound

TRUTH = {"e_n": 0.9, "e_t": -0.8, "mu": 0.15}
SIGMA = {"beta": 0.05, "e_n": 0.02}


def scene(
    n: int = 40,
    observables: Sequence[str] = ("beta", "e_n"),
    *,
    seed: int = 1,
    noise: str | None = None,
    closure: str = "ifr",
    gamma: Sequence[float] | None = None,
    series: int = 1,
    joint: bool = False,
    copies: int = 1,
    **choices: object,
) -> Problem:
    """Impacts at angles from 5 to 85 degrees, each observable with noise of its own.

    `joint` gives the observables of an impact one impact_id; `copies` writes every row several times under
    one impact_id, with the same value: readings that are perfectly correlated.
    """
    rng = np.random.default_rng(seed)
    angles = np.linspace(5.0, 85.0, n) if gamma is None else np.asarray(gamma, dtype=float)
    own = {"beta0": 0.4} if closure == "fr" else {} if closure == "f" else {"e_t": TRUTH["e_t"]}
    state = rebound(angles, e_n=TRUTH["e_n"], mu=TRUTH["mu"], closure=closure, degrees=True, **own)
    columns: dict[str, list[object]] = {
        key: [] for key in ("series", "observable", "gamma_deg", "value", "sigma", "impact_id")
    }
    for number in range(series):
        for name in observables:
            sigma = SIGMA.get(name, 0.03)
            values = OBSERVABLES[name].value(state, np.array(TRUTH["mu"]))
            values = np.broadcast_to(values, angles.shape) + sigma * rng.standard_normal(angles.size)
            for i, (angle, value) in enumerate(zip(angles.tolist(), values.tolist(), strict=True)):
                impact = f"{number}-{i}" if joint else f"{number}-{name}-{i}" if copies > 1 else ""
                for _ in range(copies):
                    row = (f"s{number}", name, angle, value, sigma, impact)
                    for key, cell in zip(columns, row, strict=True):
                        columns[key].append(cell)
    return problem_of(make_table(columns), closure, noise=noise, **choices)


def fitted(problem: Problem) -> tuple[Problem, LeastSquaresFit]:
    """A problem with its fit."""
    return problem, least_squares(problem)


def with_values(problem: Problem, value: np.ndarray) -> Problem:
    """The same question of other values."""
    table = problem.observations.table.assign(value=value)
    observations = replace(problem.observations, table=table)
    return replace(problem, observations=observations, rows=replace(problem.rows, value=value))
