"""Rows that sum up others, as the mean below a table: refused, because they would count impacts again."""

from __future__ import annotations

import numpy as np

from ifrfit.data.cell_table import show
from ifrfit.data.column_layout import Layout

_SUMMARIES = ("mean", "average", "std", "sd", "total")


def refuse_summary_rows(layout: Layout) -> None:
    """Refuse the first row whose impact or series is called a mean, a standard deviation or a total.

    A series of that name that every row belongs to is a label like any other: a table of means.

    Parameters
    ----------
    layout : Layout

    Raises
    ------
    DataError
        With file, line, column and remedy.
    """
    for key in ("impact_id", "series"):
        if not layout.has(key):
            continue
        texts = layout.texts(key)
        found = np.array([text.lower() in _SUMMARIES for text in texts], dtype=bool)
        if found.all():
            continue

        def why(row: int, texts: list[str] = texts) -> str:
            return f"{show(texts[row])} names a summary of other rows, not an impact. Remove the row."

        layout.cells.refuse_first(found, layout.header(key), why)
