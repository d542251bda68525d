"""Least squares: certified optimum, and the noise where the data must say how large it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.thresholds import AT_REST
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.laplace import Local, local_picture
from ifrfit.inference.optimize.optimum import Array, Optimum
from ifrfit.inference.optimize.solve import solve
from ifrfit.physics.observables import OBSERVABLES

_ITERATIONS = 100
_CONVERGED = 1e-10


@dataclass(frozen=True)
class LeastSquares:
    """An optimum with the noise that goes with it.

    Attributes
    ----------
    optimum : Optimum
    sigma : ndarray
        Standard uncertainty of each row that the intervals rest on.
    noise : mapping
        "series/observable" to its sigma (the root mean square where rows differ).
    noise_dof : float
        Degrees of freedom behind the noise; infinite where sigma is known.
    change : float
        Last relative change of the noise; 0 where it is known.
    local : Local
    """

    optimum: Optimum
    sigma: Array
    noise: Mapping[str, float]
    noise_dof: float
    change: float
    local: Local

    @property
    def converged(self) -> bool:
        """Whether the iteration over the noise has come to rest."""
        return self.change <= AT_REST


def least_squares(problem: Problem, start: Array | None = None) -> LeastSquares:
    """Fit by least squares under the problem's noise policy.

    known: sigma is taken at its word. scaled: sigma times one common factor, from the misfit.
    unknown: one sigma a series and observable, from the misfit; weights are iterated and the optimum is
    certified at the final ones. The same where the scatter is not plain, see `scatter.reweighted`.

    Parameters
    ----------
    problem : Problem
    start : ndarray, optional
        theta of a neighbouring problem: where only a search can find the optimum, it begins there alone.

    Raises
    ------
    DataError
        If the noise is to come from the misfit and a group could be fitted exactly.
    """
    if not problem.error_model.is_plain:
        from ifrfit.inference.optimize.irls import reweighted  # which calls this for each set of weights

        return reweighted(problem)
    if problem.noise.is_known:
        optimum = solve(problem, problem.noise.sigma, start)
        local = local_picture(problem, problem.noise.sigma, optimum.theta)
        return LeastSquares(
            optimum, problem.noise.sigma, group_sigma(problem, problem.noise.sigma), math.inf, 0.0, local
        )
    groups = problem.noise_groups()
    for name, rows in groups.items():
        _refuse_exact(problem, name, rows)
    base = problem.noise.base
    factor = np.ones(base.size)
    change = math.inf
    if problem.noise.is_unknown:
        for rows in groups.values():
            factor[rows] = max(float(np.std(problem.rows.value[rows])), 1e-6)
    near = start  # a search that found the optimum once follows it while the noise settles
    for _ in range(_ITERATIONS):
        optimum = solve(problem, base * factor, near)
        local = local_picture(problem, base * factor, optimum.theta)
        new = _factors(problem, optimum.theta, base, groups, local)
        change = float(np.abs(new / factor - 1.0).max())
        factor = new
        if change <= _CONVERGED:
            break
        near = None if problem.closure.bilinear else optimum.theta
    sigma = base * factor
    if near is not None:
        optimum = solve(problem, sigma, start)
    dof = sum(rows.size - float(local.leverage[rows].sum()) for rows in groups.values())
    local = local_picture(problem, sigma, optimum.theta)
    return LeastSquares(optimum, sigma, group_sigma(problem, sigma), dof, change, local)


def _factors(problem: Problem, theta: Array, base: Array, groups: Mapping[str, Index], local: Local) -> Array:
    """Noise factor of each row: misfit of its group over the degrees of freedom that the group keeps."""
    residual = (problem.rows.value - problem.predict(theta)) / base
    factor = np.empty(base.size)
    for name, rows in groups.items():
        square = float(residual[rows] @ residual[rows])
        dof = rows.size - float(local.leverage[rows].sum())
        # a misfit of nothing but rounding says nothing of the noise
        size = float(np.abs(problem.rows.value[rows] / base[rows]).max()) + 1.0
        if dof < 0.5 or square <= (1e-13 * size) ** 2 * rows.size:
            raise DataError(_needs_sigma(problem, name, rows))
        factor[rows] = math.sqrt(square / dof)
    return factor


def _refuse_exact(problem: Problem, name: str, rows: Index) -> None:
    """Refuse a group whose points the free constants could run through exactly."""
    inputs = inputs_of(problem, rows)
    values = np.column_stack((inputs, problem.rows.value[rows]))
    points = np.unique(inputs, axis=0).shape[0]
    scatter = np.unique(values, axis=0).shape[0] > points
    if points <= n_taken(problem, rows) and not scatter:
        raise DataError(_needs_sigma(problem, name, rows))


def n_taken(problem: Problem, rows: Index) -> int:
    """How many free constants, or combinations of them, the rows depend on."""
    free = {c.name for c in problem.parameters if c.fixed is None}
    own = {problem.closure.constant}
    takes: set[str] = set()
    for which in np.unique(problem.rows.which[rows]):
        observable = OBSERVABLES[problem.rows.names[which]]
        if observable.kind == "normal":
            takes |= free & {"e_n"}
        elif observable.kind == "friction":
            takes |= free & {"mu"}
        elif observable.kind == "tangential" and observable.scale == "one":
            takes |= (free & own) | ({"kappa"} if free & {"mu", "e_n"} else set())
        else:
            takes |= free
    return len(takes)


def inputs_of(problem: Problem, rows: Index) -> Array:
    """What was set in each row, as numbers: rows that differ in none of them repeat one point, (n, 5)."""
    i = problem.rows.incidence
    inputs = np.column_stack(
        (problem.rows.which[rows], problem.rows.tau[rows], i.spin_x[rows], i.spin_y[rows], i.sine[rows])
    )
    inputs[np.isin(problem.rows.which[rows], _without_angle(problem))] *= [1, 0, 0, 0, 0]
    return np.asarray(inputs, dtype=float)


def _without_angle(problem: Problem) -> list[int]:
    return [i for i, n in enumerate(problem.rows.names) if not OBSERVABLES[n].has_angle]


def _needs_sigma(problem: Problem, name: str, rows: Index) -> str:
    table = problem.observations.table.iloc[rows]
    what = ", ".join(dict.fromkeys(table["observable"]))
    where = table["source"].iloc[0] + (f", series {table['series'].iloc[0]}" if name else "")
    own, needs = ("its own", "it needs") if rows.size == 1 else ("their own", "they need")
    return (
        f"{where}: {rows.size} value{'' if rows.size == 1 else 's'} of {what} cannot tell {own} noise "
        f"from the constants, so {needs} a sigma. "
        "Add a column sigma (and --noise known), or more impacts at other angles."
    )


def group_sigma(problem: Problem, sigma: Array) -> dict[str, float]:
    """Root mean square of sigma in each "series/observable"."""
    return {name: float(np.sqrt((sigma[rows] ** 2).mean())) for name, rows in problem.groups().items()}
