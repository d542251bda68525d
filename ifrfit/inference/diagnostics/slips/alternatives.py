"""Slips without a size: the table as it should have been, where a sign, an angle or a name is another one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Rows
from ifrfit.physics.angles import Incidence

_TALL = 1.5  # median size of a fraction from which it may be in percent
_EXCHANGED = (
    ("beta", "beta_cm"),
    ("tan_psi_after", "tan_psi_out"),
    ("psi_after_deg", "psi_out_deg"),
)
_FRACTIONS = ("v_x", "v_y", "v_n", "beta_cm", "e_n", "beta", "mu_app", "beta_tot", "mu")


@dataclass(frozen=True)
class Alternative:
    """A table without the slip.

    Attributes
    ----------
    name : str
    observable : str
        Whose values are corrected; empty where angles or spins are.
    problem : Problem
        The question of the corrected table.
    unit : ndarray, (n,)
        Of the given values, in that of the corrected ones: errors are compared as they were given.
    """

    name: str
    observable: str
    problem: Problem
    unit: Array


def alternatives(problem: Problem) -> Iterator[Alternative]:
    """Every table that these rows could have been meant as."""
    yield from _of_spins(problem)
    yield from _of_angles(problem)
    yield from _of_values(problem)
    yield from _of_names(problem)


def _changed(problem: Problem, name: str, observable: str = "", **changes: object) -> Alternative:
    """The rows with other numbers; tau follows from the incidence."""
    rows = replace(problem.rows, **changes)  # type: ignore[arg-type]
    rows = replace(rows, tau=rows.incidence.tau)
    return Alternative(name, observable, replace(problem, rows=rows), np.ones(len(rows)))


def _of_spins(problem: Problem) -> Iterator[Alternative]:
    i, value = problem.rows.incidence, problem.rows.value
    for axis, before in (("y", i.spin_y), ("x", i.spin_x)):
        sign = {"y": (1.0, -1.0), "x": (-1.0, 1.0)}[axis]
        turned = _incidence(problem.rows, sign[0] * i.spin_x, sign[1] * i.spin_y)
        after = f"spin_{axis}_after"
        at = problem.rows.rows_of(after) if after in problem.rows.names else np.array([], dtype=np.intp)
        opposite = value.copy()
        opposite[at] = -opposite[at]
        if before.any():
            yield _changed(problem, f"sign-of-spin-{axis}-before", incidence=turned)
        if at.size:
            yield _changed(problem, f"sign-of-spin-{axis}-after", after, value=opposite)
        if before.any() and at.size:
            yield _changed(problem, f"sign-of-spins-{axis}", after, incidence=turned, value=opposite)


def _of_angles(problem: Problem) -> Iterator[Alternative]:
    rows = problem.rows
    gamma = rows.gamma_deg
    if not rows.has_angle.any() or not np.ptp(gamma[rows.has_angle]) > 0.0:
        return
    i = rows.incidence
    for name, other in (("angle-from-wall", 90.0 - gamma), ("angle-in-radians", np.degrees(gamma))):
        if float(other.max()) <= 90.0 * (1.0 + 1e-3):
            incidence = _incidence(rows, i.spin_x, i.spin_y, np.minimum(other, 90.0))
            yield _changed(problem, name, gamma_deg=other, incidence=incidence)


def _of_values(problem: Problem) -> Iterator[Alternative]:
    """Signs, percent, and radians of angles after impact."""
    rows = problem.rows
    for observable in rows.observables:
        at = rows.rows_of(observable.name)
        own = rows.value[at]
        factors = {}
        if observable.low < 0.0 and not observable.name.startswith("spin_"):
            factors["sign"] = -1.0
        if observable.name in _FRACTIONS and float(np.median(np.abs(own))) > _TALL:
            factors["percent"] = 0.01
        if observable.unit == "deg" and float(np.abs(own).max()) <= math.pi:
            factors["radians"] = 180.0 / math.pi
        for name, factor in factors.items():
            value, unit = rows.value.copy(), np.ones(len(rows))
            value[at] *= factor
            unit[at] = abs(factor)
            yield replace(_changed(problem, name, observable.name, value=value), unit=unit)


def _of_names(problem: Problem) -> Iterator[Alternative]:
    """Values that are of another observable of the same kind of number."""
    names = problem.rows.names
    for pair in _EXCHANGED:
        for here, there in (pair, pair[::-1]):
            if here in names and there not in names:
                other = tuple(there if name == here else name for name in names)
                yield _changed(problem, f"meant-{there}", here, names=other)


def _incidence(rows: Rows, spin_x: Array, spin_y: Array, gamma: Array | None = None) -> Incidence:
    return Incidence.of(rows.gamma_deg if gamma is None else gamma, spin_x, spin_y, degrees=True)
