"""Put the chosen scatter into a problem, or say in words why it does not fit the data or the method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from ifrfit.data import Observations
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.model.error_model import Scatter
from ifrfit.inference.model.error_propagation import propagated_sigma
from ifrfit.inference.model.problem import Index, Problem
from ifrfit.inference.posterior.noise_scale import noise_bounds
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import OBSERVABLES


def with_propagated_sigma(observations: Observations, scatter: Scatter) -> Observations:
    """Observations whose sigma follows from the errors of the measured velocities and spins.

    Raises
    ------
    DataError
        For an observable whose error cannot be propagated.
    """
    if not scatter.propagates:
        return observations
    table = observations.table.copy()
    gamma = table["gamma_deg"].fillna(0.0).to_numpy(dtype=float)
    incidence = Incidence.of(
        gamma, table["spin_x"].to_numpy(float), table["spin_y"].to_numpy(float), degrees=True
    )
    sigma = np.empty(len(table))
    for name, rows in table.groupby("observable", sort=False).indices.items():
        own = Incidence(
            *(getattr(incidence, f)[rows] for f in ("sine", "cosine", "spin_x", "spin_y", "slip_x", "slip_y"))
        )
        value = table["value"].to_numpy(dtype=float)[rows]
        where = str(table["source"].iloc[int(rows[0])])
        sigma[rows] = propagated_sigma(str(name), own, value, scatter, where)
    table["sigma"] = sigma
    return replace(observations, table=table)


def with_scatter(problem: Problem, scatter: Scatter, method: str) -> Problem:
    """The problem under this scatter.

    One unknown noise becomes a common factor on a sigma of 1: the factor has the prior of the noise.

    Raises
    ------
    UsageError
        If the method does not know this scatter.
    DataError
        If the data lack the errors of angle and spin, or have several unknown noises.
    """
    _check_method(problem, scatter, method)
    if scatter.angles != "none":
        _check_errors_of_angles(problem, scatter)
    if scatter.is_plain:
        return replace(problem, scatter=scatter)
    if problem.noise == "unknown":
        groups = problem.groups()
        if len(groups) > 1:
            raise DataError(
                f"{len(groups)} unknown noises ({', '.join(groups)}) beside {_said(scatter)}: give a sigma "
                "in every row and --noise scaled, or fit one observable of one series at a time."
            )
        (ends,) = noise_bounds(problem).values()
        ones = np.ones(problem.sigma.size)
        problem = replace(problem, noise="scaled", sigma=ones, noise_bounds={"": ends})
    return replace(problem, scatter=scatter)


def reported_policy(problem: Problem) -> str:
    """Noise policy as the user knows it: an unknown noise that became a factor is unknown all the same."""
    if problem.noise == "scaled" and not np.isfinite(problem.observations.table["sigma"]).all():
        return "unknown"
    return problem.noise


def _said(scatter: Scatter) -> str:
    return f"--angle-errors {scatter.angles}" if scatter.angles != "none" else "--tails student-t"


def _check_method(problem: Problem, scatter: Scatter, method: str) -> None:
    if scatter.is_plain:
        return
    if not problem.closure.bilinear:
        raise UsageError(
            f"Closure {problem.closure.title} knows independent Gaussian errors of the values only: leave "
            f"{_said(scatter)} out, or choose another closure."
        )
    if method in ("profile", "bootstrap"):
        raise UsageError(
            f"--method {method} knows independent Gaussian errors of the values only: use --method exact or "
            f"mcmc with {_said(scatter)}."
        )
    if not scatter.integrates:
        return
    if method == "lsq":
        raise UsageError(
            "--method lsq cannot integrate true angles out: use --method exact or mcmc with "
            f"{_said(scatter)}, or --angle-errors effective."
        )
    tied = tied_to_e_n(problem, scatter) if method == "exact" else []
    if tied:
        raise UsageError(
            f"--angle-errors {scatter.angles} with {', '.join(tied)}: the true angle ties e_n to the "
            "tangential constants, which the quadrature does not take on. Use --method mcmc, or fix e_n."
        )


def tied_to_e_n(problem: Problem, scatter: Scatter) -> list[str]:
    """Observables whose true angle, integrated out, ties a free e_n to the tangential constants."""
    free = any(c.name == "e_n" and c.fixed is None for c in problem.constants)
    return [name for name in problem.rows.names if _couples(name)] if scatter.integrates and free else []


def _couples(name: str) -> bool:
    """Whether a row sees e_n together with the true angle."""
    o = OBSERVABLES[name]
    if o.kind == "normal":
        return o.name != "e_n"
    return (o.kind == "tangential" and o.scale != "one") or (o.kind == "curved" and not o.without_e_n)


def _check_errors_of_angles(problem: Problem, scatter: Scatter) -> None:
    """Refuse data that do not say how uncertain any angle or spin is, and angles outside their population."""
    table = problem.observations.table
    has_angle = np.array([OBSERVABLES[n].has_angle for n in problem.rows.names])[problem.rows.which]
    spins = table[["sigma_spin_x", "sigma_spin_y"]].fillna(0.0).to_numpy(dtype=float)
    of_angle = table["sigma_gamma_deg"].fillna(scatter.gamma or 0.0).to_numpy(dtype=float)
    if not (has_angle & ((spins > 0.0).any(axis=1) | (of_angle > 0.0))).any():
        raise DataError(
            f"--angle-errors {scatter.angles}, but no row states an uncertainty of its angle or spin: add a "
            "column sigma_gamma_deg (or sigma_spin_y), or give --sigma-gamma DEG."
        )
    if scatter.population is None:
        return
    low, high = scatter.population
    gamma = table["gamma_deg"].fillna(low).to_numpy(dtype=float)
    away = has_angle & ((gamma < low - 5.0 * of_angle) | (gamma > high + 5.0 * of_angle))
    if away.any():
        raise DataError(_outside(table, np.flatnonzero(away), low, high))


def _outside(table: pd.DataFrame, rows: Index, low: float, high: float) -> str:
    row = table.iloc[int(rows[0])]
    return (
        f"{row['source']}, line {row['row']}: the angle {row['gamma_deg']:g} lies more than five of its "
        f"standard uncertainties outside --angle-population {low:g},{high:g}. Widen the population."
    )
