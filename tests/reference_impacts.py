"""The impacts of tests/reference/impacts.csv, and where the package misses them."""

from __future__ import annotations

import csv
import functools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics import Rebound, rebound

Columns = dict[str, NDArray[Any]]
TEXT = ("regime", "tag", "note")
VELOCITIES = {
    "v_x": "v_x",
    "v_y": "v_y",
    "spin_x": "ROmega_x",
    "spin_y": "ROmega_y",
    "contact_x": "V_x",
    "contact_y": "V_y",
}
OBSERVABLES = {
    "beta": "beta",
    "beta_cm": "beta_cm",
    "beta_tot": "beta_tot",
    "energy_change": "dE",
    "mu_app": "mu_app",
    "mu_app_magnitude": "mu_app_mag",
}


@functools.cache
def columns() -> Columns:
    """All rows by column; numbers as float, the rest as text."""
    path = Path(__file__).parent / "reference" / "impacts.csv"
    with path.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(handle))
    return {
        name: np.array([row[name] for row in rows], dtype=object if name in TEXT else float)
        for name in rows[0]
    }


def tagged(tag: str) -> Columns:
    """The rows that serve one purpose."""
    every = columns()
    return {name: column[every["tag"] == tag] for name, column in every.items()}


def cancelling(rows: Columns) -> NDArray[Any]:
    """The one row where the slip cancels to the last bits."""
    return np.asarray((rows["gamma_deg"] == 89.999999) & (rows["spin_y"] == -1.0))


def rebounds(rows: Columns, closure: str = "ifr") -> Rebound:
    """What the package makes of them."""
    constants = {name: rows[name] for name in ("e_n", "e_t", "mu")}
    return rebound(
        rows["gamma_deg"], rows["spin_x"], rows["spin_y"], closure=closure, degrees=True, **constants
    )


def misses(rows: Columns, closure: str = "ifr") -> list[str]:
    """Every number beyond the tolerance of tests/reference/README.md; nan is required where nan stands."""
    found, got = [], rebounds(rows, closure)

    def compare(name: str, ours: Any, expected: Any, tolerance: Any) -> None:
        off = np.isnan(ours) != np.isnan(expected)
        off |= np.nan_to_num(np.abs(ours - expected)) > tolerance
        where = np.nonzero(off)[0]
        found.extend(f"{name}, {rows['tag'][i]}: {ours[i]!r} for {expected[i]!r}" for i in where)

    for name, column in VELOCITIES.items():
        scale = 1.0 + np.abs(rows["spin_x"]) + np.abs(rows["spin_y"])
        compare(name, getattr(got, name), rows[column], 1e-13 * scale)
    # v_n is a magnitude, v_z points into the wall
    compare("v_n", got.v_n, -rows["v_z"], 1e-13)
    for name, column in OBSERVABLES.items():
        # relative where spins of 1e15 make the quantity itself huge
        tolerance = 1e-12 * np.maximum(1.0, np.nan_to_num(np.abs(rows[column])))
        loose = cancelling(rows) & name.startswith("mu_app")
        compare(name, getattr(got, name), rows[column], np.where(loose, 1e3, 1.0) * tolerance)
    cosine = np.sin(np.radians(90.0 - rows["gamma_deg"]))
    for name, y, x in (
        ("delta", rows["v_x"], -rows["v_z"]),
        ("lambda_", rows["v_y"], rows["v_x"]),
        ("psi_after", rows["V_x"], cosine),
        ("psi_out", rows["V_x"], -rows["v_z"]),
    ):
        expected = np.where((y == 0.0) & (x == 0.0), np.nan, np.arctan2(y, x))
        turn = getattr(got, name) - expected
        turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        # psi divides the cancelling slip by cos(gamma) = 2e-8: the last bit of the slip is 5e-9 there
        loose = cancelling(rows) & name.startswith("psi")
        compare(name, expected + turn, expected, np.where(loose, 5e-9, 1e-12))
    for name, ours, column in (
        ("tan delta", (got.v_x, got.v_n), "tan_delta"),
        ("tan lambda", (got.v_y, got.v_x), "tan_lambda"),
    ):
        defined = ~np.isnan(rows[column])
        quotient = np.divide(*ours, out=np.full(defined.size, np.nan), where=defined)
        compare(name, quotient, rows[column], 1e-12 + 1e-11 * np.abs(np.nan_to_num(rows[column])))
    return found
