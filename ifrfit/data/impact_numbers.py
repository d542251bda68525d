"""An impact_id names one impact: a numbering that starts anew at each angle is refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import show
from ifrfit.data.column_layout import Layout

# by how much readings of one impact may differ, and what to call them; of a speed relative to itself
_SETTINGS = {
    "gamma_deg": (0.5, "angle", " degrees"),
    "spin_x": (0.05, "spin", ""),
    "spin_y": (0.05, "spin", ""),
    "speed_m_s": (0.1, "speed", " m/s"),
}


def refuse_restarted_impacts(layout: Layout, columns: Mapping[str, Any], rows: NDArray[np.int64]) -> None:
    """Refuse an impact_id that stands at two angles, spins or speeds of one table.

    Parameters
    ----------
    layout : Layout
    columns : mapping of str to array_like
        Rows of the common schema.
    rows : ndarray of int
        In which row of the table each of them stands.

    Raises
    ------
    DataError
        Names both lines and the remedy.
    """
    if not layout.has("impact_id"):
        return
    ids = np.asarray(columns["impact_id"], dtype=object)
    given = np.flatnonzero(ids != "")
    _, first, impact = np.unique(ids[given].astype(str), return_index=True, return_inverse=True)
    start = given[first[impact]]
    cells = layout.cells
    free = " or remove the column" if not layout.has("observable") else ""
    for name, (tolerance, noun, unit) in _SETTINGS.items():
        value = np.asarray(columns[name], dtype=float)
        most = tolerance * (np.abs(value[start]) if name == "speed_m_s" else 1.0)
        differs = np.abs(value[given] - value[start]) > most  # what is not given differs from nothing
        for place in given[differs][:1].tolist():
            other = start[np.flatnonzero(given == place)[0]]
            cells.refuse_first(
                np.arange(len(cells)) == rows[place],
                layout.header("impact_id"),
                f"impact {show(str(ids[place]))} has the {noun} {value[place]:g}{unit} here and "
                f"{value[other]:g}{unit} in {cells.word} {cells.lines[rows[other]]}. "
                f"Number the impacts through the whole table{free}.",
            )
