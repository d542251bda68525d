"""Long tables: one observation of one observable a row."""

from __future__ import annotations

import math

import numpy as np

from ifrfit.data.cell_table import show
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_names import closest, role_of
from ifrfit.data.conventions import OPEN_QUESTIONS
from ifrfit.data.partial_table import Piece, common_columns, repeats, uncertainty
from ifrfit.errors import DataError
from ifrfit.physics.observables import OBSERVABLES


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
    value = layout.numbers("value")
    sigma, headers["sigma"] = uncertainty(layout, "sigma", "sd")
    plain = bool(np.all(factors == 1.0))
    columns |= {
        "observable": names,
        "value": value if plain else value * factors,
        "sigma": sigma if plain else sigma * np.abs(factors),
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
