"""Tables of observations, wide (one impact a row) and long (one observation a row), as rows of the schema."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import show
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_names import closest, role_of
from ifrfit.data.common_errors import dimension_of
from ifrfit.data.conventions import OPEN_QUESTIONS, suggest
from ifrfit.errors import DataError
from ifrfit.physics.angles import Array
from ifrfit.physics.observables import OBSERVABLES

_COUNTED = 4  # rows in order, 1, 2, 3, ..., from which a column of repeats numbers the lines


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
    for key in layout.columns:
        dimension = dimension_of(key)
        if dimension is not None:
            name = f"{key}_deg" if dimension == "angle" else key
            # an empty cell: the row has no part in it
            columns[name], headers[name] = np.nan_to_num(layout.numbers(key)), layout.header(key)
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
    if n.size >= _COUNTED and bool((np.diff(n) == 1.0).all()):
        raise DataError(
            f"{layout.cells.at(header=layout.header('n_repeats'))}: {n[0]:g}, {n[1]:g}, {n[2]:g}, ... number "
            "the lines, and are taken for how many repeats each is the mean of. Call the column impact_id, "
            "or leave it out."
        )
    return n.astype(np.int64)


def read_long(layout: Layout) -> list[Piece]:
    """Return the rows of a long table.

    Raises
    ------
    DataError
        A column is missing, or an observable is unknown, ambiguous or given in two conventions.
    """
    cells = layout.cells
    for name, other in (("observable", "value"), ("value", "observable")):
        if not layout.has(name):
            raise DataError(
                f"{cells.file}: there is a column {layout.header(other)} but no column {name}. A long table "
                "needs both; a wide one has a column for each observable, such as beta."
            )
    for key, column in layout.columns.items():
        if key.startswith(("raw:", "sigma:", "sd:")):
            raise DataError(
                f"{cells.at(header=column.header)}: does not belong in a long table. Put each observation "
                "into its own row, or remove the columns observable and value."
            )
    columns, headers = common_columns(layout)
    texts = np.array(layout.texts("observable"), dtype=object)
    factors, names = np.ones(len(cells)), np.empty(len(cells), dtype=object)
    used: dict[str, tuple[float, str]] = {}
    for text in dict.fromkeys(texts):
        here = texts == text
        name, factor = _observable(str(text), int(np.argmax(here)), layout)
        if used.setdefault(name, (factor, str(text)))[0] != factor:
            raise DataError(
                f"{cells.at(int(np.argmax(here)), layout.header('observable'))}: {show(str(text))} and "
                f"{show(used[name][1])} are {name} in two conventions. Keep one."
            )
        names[here], factors[here] = name, factor
    sigma, headers["sigma"] = uncertainty(layout, "sigma", "sd")
    columns |= {key: columns[key] * factors for key in columns if dimension_of(key) == "number"}
    columns |= {
        "observable": names,
        "value": layout.numbers("value") * factors,
        "sigma": sigma * np.abs(factors),
        "n_repeats": repeats(layout),
    }
    headers["value"] = layout.header("value")
    return [Piece(columns, np.arange(len(cells)), headers)]


def _observable(text: str, row: int, layout: Layout) -> tuple[str, float]:
    """Return the observable that a cell names, and the factor to its unit and sign."""
    at = layout.cells.at(row, layout.header("observable"))
    role = role_of(text)
    if role.kind == "magnitude":
        raise DataError(f"{at}: {show(text)}: {OPEN_QUESTIONS['magnitude']}.")
    # v_x with a unit reads as a raw velocity; in a long table it can only be the observable
    name = role.name if role.kind in ("observable", "open") else text.strip().lower()
    meaning = layout.conventions.observable(name)
    if meaning is None and name in OPEN_QUESTIONS:
        raise DataError(f"{at}: {show(text)}: {OPEN_QUESTIONS[name]}.")
    if meaning is None or role.kind == "raw":
        near = closest(text) if text else None
        hint = f", the closest is {near}" if near in OBSERVABLES else ""
        raise DataError(f"{at}: {show(text)} is no observable{hint}. Known are {', '.join(OBSERVABLES)}.")
    name, factor = meaning
    if OBSERVABLES[name].unit == "deg" and role.unit == "rad":
        factor *= 180.0 / math.pi
    return name, factor


def read_wide(layout: Layout) -> list[Piece]:
    """Return one piece for each column of an observable; the rows of an impact share their impact_id.

    Raises
    ------
    DataError
        There is no observable, no incidence angle where one is needed, or an uncertainty without its
        observable.
    """
    cells = layout.cells
    names = [key for key in layout.columns if key in OBSERVABLES]
    if not names:
        raise DataError(
            f"{cells.file}: no column of an observable. Add one, such as beta, or the velocities before and "
            "after (u_x_m_s, u_z_m_s, v_x_m_s, v_z_m_s); 'ifrfit template' prints tables to fill in."
        )
    # a column of empty cells is no observable: sigma is not of it
    filled = [name for name in names if not np.isnan(layout.numbers(name)).all()]
    check_uncertainties(layout, names, filled or names)
    columns, headers = common_columns(layout)
    if len(names) > 1:
        columns["impact_id"] = impact_ids(layout)
    columns["n_repeats"] = repeats(layout)
    pieces = []
    for name in names:
        sigma = f"sigma:{name}" if not layout.has("sigma") else "sigma"
        sd = f"sd:{name}" if not layout.has("sd") else "sd"
        spread, header = uncertainty(layout, sigma, sd)
        full = {
            **columns,
            "observable": np.full(len(cells), name, dtype=object),
            "value": layout.numbers(name),
            "sigma": spread,
        }
        pieces.append(
            Piece(full, np.arange(len(cells)), {**headers, "value": layout.header(name), "sigma": header})
        )
    return pieces


def impact_ids(layout: Layout) -> np.ndarray:
    """Return the impact of each row: as given, else named after its line."""
    word = layout.cells.word
    given = layout.texts("impact_id")
    return np.array(
        [text or f"{word} {line}" for text, line in zip(given, layout.cells.lines, strict=True)], dtype=object
    )


def check_uncertainties(layout: Layout, names: Sequence[str], filled: Sequence[str]) -> None:
    """Refuse uncertainties of a wide table that belong to none of its observables, or to any that is filled.

    Raises
    ------
    DataError
        With the column and the remedy.
    """
    for kind in ("sigma", "sd"):
        if layout.has(kind) and len(filled) > 1:
            headers = ", ".join(layout.header(name) for name in filled)
            raise DataError(
                f"{layout.cells.at(header=layout.header(kind))}: could belong to any of {headers}. Call it "
                f"{kind}_{filled[0]}, and so on."
            )
        for key, column in layout.columns.items():
            of = key.removeprefix(f"{kind}:")
            if of == "raw:speed":
                raise DataError(
                    f"{layout.cells.at(header=column.header)}: the uncertainty of a speed counts beside "
                    f"velocities "
                    f"alone; in a table of observables leave it out: {suggest(f'ignore={column.header}')}."
                )
            if of != key and of not in names:
                raise DataError(
                    f"{layout.cells.at(header=column.header)}: the uncertainty of {of}, which the table does "
                    "not have. Add the column or remove this one."
                )
            if of != key and layout.has(kind):
                raise DataError(
                    f"{layout.cells.file}: the columns {layout.header(kind)} and {column.header} both give "
                    f"an uncertainty of {of}. Remove one."
                )
