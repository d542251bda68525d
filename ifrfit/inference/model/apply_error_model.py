"""Put the chosen error model into a problem, or say in words why it does not fit the data or the method."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.data import Observations
from ifrfit.data.observations import word_of
from ifrfit.errors import DataError
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.noise import NoiseModel, Policy
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import OBSERVABLES


def with_propagated_sigma(observations: Observations, error_model: ErrorModel) -> Observations:
    """Observations whose sigma follows from the errors of the measured velocities and spins.

    Raises
    ------
    DataError
        For an observable whose error cannot be propagated.
    """
    if not error_model.propagates:
        return observations
    table = observations.table.copy()
    gamma = table["gamma_deg"].fillna(0.0).to_numpy(dtype=float)
    incidence = Incidence.of(
        gamma, table["spin_x"].to_numpy(float), table["spin_y"].to_numpy(float), degrees=True
    )
    sigma = np.empty(len(table))
    for name, rows in table.groupby("observable", sort=False).indices.items():
        own = incidence.take(np.asarray(rows))
        value = table["value"].to_numpy(dtype=float)[rows]
        where = str(table["source"].iloc[int(rows[0])])
        sigma[rows] = propagated_sigma(str(name), own, value, error_model, where)
    table["sigma"] = sigma
    return replace(observations, table=table)


def with_error_model(problem: Problem, error_model: ErrorModel) -> Problem:
    """The problem under this error model.

    One unknown noise becomes a common factor on a sigma of 1: the factor has the prior of the noise.

    Raises
    ------
    UsageError
        If the closure does not know this error model.
    DataError
        If the data lack the errors of angle and spin, have several unknown noises, or know no angle whose
        offset could be fitted.
    """
    error_model.check_closure(problem.closure)
    if error_model.offset is not None and not problem.rows.has_angle.any():
        raise DataError("--angle-offset, but the angle of incidence enters no row: leave it out.")
    if error_model.angles != "none":
        _check_errors_of_angles(problem, error_model)
    if error_model.is_plain:
        return replace(problem, error_model=error_model)
    if problem.noise.is_mixed:
        without = problem.with_noise(replace(problem.noise, policy="unknown"))
        alone = "" if len(without.noise_groups()) > 1 else ", or take --noise unknown"
        raise DataError(
            f"{', '.join(problem.noise_groups())}: no sigma, beside others that have one, and "
            f"{error_model.option} does not know both. Give a sigma in every row{alone}, or fit one "
            "observable at a time."
        )
    if problem.noise.is_unknown:
        groups = problem.noise_groups()
        if len(groups) > 1:
            raise DataError(
                f"{len(groups)} unknown noises ({', '.join(groups)}) beside {error_model.option}: give a "
                "sigma in every row and --noise scaled, or fit one observable at a time."
            )
        (ends,) = problem.noise_bounds().values()
        problem = problem.with_noise(NoiseModel("scaled", np.ones(len(problem.rows)), {"": ends}))
    return replace(problem, error_model=error_model)


def reported_policy(problem: Problem) -> Policy:
    """Noise policy as the user knows it: an unknown noise that became a factor is unknown all the same."""
    if problem.noise.is_scaled and not np.isfinite(problem.observations.table["sigma"]).all():
        return "unknown"
    return problem.noise.policy


def tied_to_e_n(problem: Problem, error_model: ErrorModel) -> list[str]:
    """Observables whose true angle, integrated out, ties a free e_n to the tangential constants."""
    if not error_model.integrates or problem.parameters["e_n"].fixed is not None:
        return []
    seen = problem.rows.observables
    return [o.name for o in seen if o.ties_e_n or (o.kind == "normal" and o.has_angle)]


def _check_errors_of_angles(problem: Problem, error_model: ErrorModel) -> None:
    """Refuse data that do not say how uncertain any angle or spin is, and angles outside their population."""
    table = problem.observations.table
    has_angle = problem.rows.has_angle
    spins = table[["sigma_spin_x", "sigma_spin_y"]].fillna(0.0).to_numpy(dtype=float)
    of_angle = table["sigma_gamma_deg"].fillna(error_model.gamma or 0.0).to_numpy(dtype=float)
    if not (has_angle & ((spins > 0.0).any(axis=1) | (of_angle > 0.0))).any():
        raise DataError(
            f"--angle-errors {error_model.angles}, but no row states an uncertainty of its angle or spin: "
            "add a column sigma_gamma_deg (or sigma_spin_y), or give --sigma-gamma DEG."
        )
    if error_model.population is None:
        return
    low, high = error_model.population
    gamma = table["gamma_deg"].fillna(low).to_numpy(dtype=float)
    away = has_angle & ((gamma < low - 5.0 * of_angle) | (gamma > high + 5.0 * of_angle))
    if away.any():
        raise DataError(_outside(problem.observations, np.flatnonzero(away), low, high))


def _outside(observations: Observations, rows: Index, low: float, high: float) -> str:
    row = observations.table.iloc[int(rows[0])]
    word = word_of(observations.sources, row["source"])
    return (
        f"{row['source']}, {word} {row['row']}: the angle {row['gamma_deg']:g} lies more than five of its "
        f"standard uncertainties outside --angle-population {low:g},{high:g}. Widen the population."
    )


Array = NDArray[np.float64]


def propagated_sigma(
    observable: str, i: Incidence, value: Array, error_model: ErrorModel, where: str
) -> Array:
    """Standard uncertainty of rows of one observable.

    The velocity of the contact point is that of the centre plus the spin, so its error is
    sqrt(sigma_v^2 + sigma_s^2). A ratio has the error of its numerator over its denominator: without bound
    near normal incidence for beta and beta_cm, where such rows say nothing.

    Parameters
    ----------
    observable : str
    i : Incidence
        Of the rows.
    value : ndarray
        Of the rows.
    error_model : ErrorModel
        With `velocity` given.
    where : str
        The source, for messages.

    Raises
    ------
    DataError
        For an observable whose error depends on the constants, or that needs the error of the spin.
    """
    assert error_model.velocity is not None
    kind = OBSERVABLES[observable]
    if kind.numerator is None:
        raise DataError(
            f"{where}: the error of {observable} cannot be propagated from --sigma-velocity, because it "
            "depends on the constants. Give the velocities themselves, or a sigma in every row without "
            "--sigma-velocity."
        )
    velocity, spin = error_model.velocity, error_model.spin
    if kind.numerator != "velocity" and spin is None:
        raise DataError(
            f"{where}: {observable} contains the spin after impact, so its error needs --sigma-spin, too "
            "(R sigma_Omega per incoming speed)."
        )
    parts = {"velocity": (velocity,), "spin": (spin,), "contact": (velocity, spin)}[kind.numerator]
    sigma = np.full(value.shape, math.hypot(*(part for part in parts if part is not None)))
    if kind.divided_by is not None:
        # without an angle e_n is that of a normal drop: cosine 1
        sigma = sigma / np.maximum(np.abs(kind.divided_by(i)), 1e-300)
    if kind.unit == "deg":
        sigma = np.degrees(sigma * np.cos(np.radians(value)) ** 2)
    return np.asarray(sigma)
