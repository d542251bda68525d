"""Which groups of rows can tell the size of their own noise by their misfit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.optimum import Array
from ifrfit.physics.observables import OBSERVABLES


def refuse_exact_group(problem: Problem, name: str, rows: Index) -> None:
    """Refuse a group whose points the free constants could run through exactly.

    Raises
    ------
    DataError
        If there are no more different points than parameters, and no point is repeated with another value.
    """
    if _fits_exactly(problem, rows):
        raise DataError(needs_sigma(problem, name, rows))


def _fits_exactly(problem: Problem, rows: Index) -> bool:
    """Whether the free constants could run through all points of some rows."""
    inputs = inputs_of_rows(problem, rows)
    values = np.column_stack((inputs, problem.rows.value[rows]))
    points = _n_different(inputs)
    return points <= n_parameters_seen(problem, rows) and _n_different(values) == points


def _n_different(rows: Array) -> int:
    """How many different rows a table has; some ten times as fast as `np.unique` along an axis."""
    ordered = rows[np.lexsort(rows.T)]
    return 1 + int((ordered[1:] != ordered[:-1]).any(axis=1).sum())


def n_parameters_seen(problem: Problem, rows: Index) -> int:
    """How many free constants, or combinations of them, the rows depend on."""
    free = {c.name for c in problem.parameters if c.fixed is None}
    own = {problem.closure.constant}
    seen: set[str] = set()
    for which in np.unique(problem.rows.which[rows]):
        observable = OBSERVABLES[problem.rows.names[which]]
        if observable.kind == "normal":
            seen |= free & {"e_n"}
        elif observable.kind == "friction":
            seen |= free & {"mu"}
        elif observable.kind == "tangential" and observable.scale == "one":
            seen |= (free & own) | ({"kappa"} if free & {"mu", "e_n"} else set())
        else:
            seen |= free
    return len(seen)


def inputs_of_rows(problem: Problem, rows: Index) -> Array:
    """Observable, tau, spins and sine of each row, (n, 5): equal rows are repeats of one point."""
    i = problem.rows.incidence
    inputs = np.column_stack(
        (problem.rows.which[rows], problem.rows.tau[rows], i.spin_x[rows], i.spin_y[rows], i.sine[rows])
    )
    inputs[np.isin(problem.rows.which[rows], _without_angle(problem))] *= [1, 0, 0, 0, 0]
    return np.asarray(inputs, dtype=float)


def _without_angle(problem: Problem) -> list[int]:
    return [i for i, n in enumerate(problem.rows.names) if not OBSERVABLES[n].has_angle]


def needs_sigma(problem: Problem, name: str, rows: Index) -> str:
    """Message of the error where a group (`name`; "" for all rows) cannot tell its own noise."""
    table = problem.observations.table.iloc[rows]
    what = ", ".join(dict.fromkeys(table["observable"]))
    where = table["source"].iloc[0] + (f", series {table['series'].iloc[0]}" if name else "")
    own, needs = ("its own", "it needs") if rows.size == 1 else ("their own", "they need")
    together = ""
    if problem.noise.is_mixed:  # rows whose sigma is given may share their noise
        groups = problem.with_noise(replace(problem.noise, policy="unknown")).noise_groups().values()
        whole = next(group for group in groups if rows[0] in group)
        together = "" if _fits_exactly(problem, whole) else ", or take --noise unknown"
    return (
        f"{where}: {rows.size} value{'' if rows.size == 1 else 's'} of {what} cannot tell {own} noise "
        f"from the constants, so {needs} a sigma. "
        f"Add a column sigma (and --noise known), or more impacts at other angles{together}."
    )
