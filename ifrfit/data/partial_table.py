"""What the readers of the three forms of tables hand to validation and assembly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.column_layout import Layout
from ifrfit.errors import DataError
from ifrfit.physics.angles import Array


@dataclass(frozen=True)
class Piece:
    """Rows of the common schema, each from one row of the file.

    Attributes
    ----------
    columns : dict of str to array
        Schema columns without series, provenance and bookkeeping; equal lengths.
    rows : (n,) int array
        Row of the file (0-based, among its data rows) of each.
    headers : mapping of str to str
        Header in the file of a schema column, for messages.
    """

    columns: dict[str, Any]
    rows: NDArray[np.int64]
    headers: Mapping[str, str] = field(default_factory=dict)

    def header(self, name: str) -> str:
        """Return the header of a column as it stands in the file."""
        return self.headers.get(name, name)

    def take(self, keep: NDArray[np.bool_]) -> Piece:
        """Return the rows that `keep` marks."""
        if keep.all():
            return self
        columns = {name: np.asarray(values)[keep] for name, values in self.columns.items()}
        return Piece(columns, self.rows[keep], self.headers)


def common_columns(layout: Layout) -> tuple[dict[str, Any], dict[str, str]]:
    """Return angle, spins, speed and labels of every row of the file, and their headers."""
    columns: dict[str, Any] = {
        "gamma_deg": layout.gamma(),
        "sigma_gamma_deg": layout.numbers("sigma_gamma"),
        "speed_m_s": layout.numbers("speed"),
        "impact_id": np.array(layout.texts("impact_id"), dtype=object),
    }
    for name in ("spin_x", "spin_y"):
        spin = layout.numbers(name)
        # A column that is there but empty throughout says no more than one that is not there: no spin.
        columns[name] = np.zeros(len(spin)) if np.isnan(spin).all() else spin
        columns[f"sigma_{name}"] = layout.numbers(f"sigma_{name}")
    headers = {name: layout.header(name) for name in (*columns, "value", "sigma")}
    headers["gamma_deg"] = layout.header("gamma", layout.header("tan_gamma", "gamma_deg"))
    headers["sigma_gamma_deg"] = layout.header("sigma_gamma", "sigma_gamma_deg")
    headers["speed_m_s"] = layout.header("speed", "speed_m_s")
    return columns, headers


def source_headers(layout: Layout) -> dict[str, tuple[str, ...]]:
    """Return the columns of the file that spins, and the uncertainties of angle and spins, come from."""
    keys = {"sigma_gamma_deg": ("sigma_gamma", *(f"sigma:raw:u_{axis}" for axis in "xyz"))}
    for axis, other in ("xy", "yx"):
        # the other axis counts too where the impact is turned until it runs along x
        size = ("sigma:raw:radius", "sigma:raw:diameter")
        keys[f"sigma_spin_{axis}"] = (
            f"sigma_spin_{axis}",
            f"sigma:raw:omega_{axis}",
            f"sigma:raw:omega_{other}",
            *size,
        )
    keys["spin"] = tuple(f"{form}_{axis}" for form in ("spin", "raw:omega") for axis in "xy")
    keys["lateral_spin"] = ("spin_x", "raw:omega_x")
    found = {name: tuple(layout.header(k) for k in of if layout.has(k)) for name, of in keys.items()}
    return {name: headers for name, headers in found.items() if headers}


def uncertainty(layout: Layout, sigma: str, sd: str) -> tuple[Array, str]:
    """Return standard uncertainties, as given or from sample deviations of n repeats; and the header.

    The standard error of a mean of n values with sample standard deviation s is s/sqrt(n).
    """
    if layout.has(sigma) and layout.has(sd):
        raise DataError(
            f"{layout.cells.file}: the columns {layout.header(sigma)} and {layout.header(sd)} both give an "
            "uncertainty. Remove one: sigma is that of the value itself, sd that of one of its n repeats."
        )
    if not layout.has(sd):
        return layout.numbers(sigma), layout.header(sigma, "sigma")
    if not layout.has("n_repeats"):
        raise DataError(
            f"{layout.cells.at(header=layout.header(sd))}: the deviation of repeats needs their number. Add "
            "a column n, or call the column sigma if it is the uncertainty of the value itself."
        )
    spread, n = layout.numbers(sd), repeats(layout)
    # One value has no sample deviation: whatever stands there is not an uncertainty of it.
    return np.where(n > 1, spread / np.sqrt(n), np.nan), layout.header(sd)


def repeats(layout: Layout) -> NDArray[np.int64]:
    """Return how many repeats each row is the mean of; 1 where nothing is said."""
    n = layout.numbers("n_repeats")
    n = np.where(np.isnan(n), 1.0, n)
    layout.cells.refuse_first(
        (n < 1) | (n != np.floor(n)) | (n > 1e9),
        layout.header("n_repeats"),
        lambda row: (
            f"{n[row]:g} is not a number of repeats. "
            "Give a whole number from 1, or leave the cell empty for one."
        ),
    )
    return n.astype(np.int64)
