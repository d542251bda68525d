"""Wide tables: one impact a row, a column for each observable."""

from __future__ import annotations

import numpy as np

from ifrfit.data.column_layout import Layout
from ifrfit.data.partial_table import Piece, common_columns, repeats, uncertainty
from ifrfit.errors import DataError
from ifrfit.physics.observables import OBSERVABLES


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
    _check_uncertainties(layout, names)
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


def _check_uncertainties(layout: Layout, names: list[str]) -> None:
    for kind in ("sigma", "sd"):
        if layout.has(kind) and len(names) > 1:
            headers = ", ".join(layout.header(name) for name in names)
            raise DataError(
                f"{layout.cells.at(header=layout.header(kind))}: could belong to any of {headers}. Call it "
                f"{kind}_{names[0]}, and so on."
            )
        for key, column in layout.columns.items():
            of = key.removeprefix(f"{kind}:")
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
