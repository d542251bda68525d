"""Numbers of impacts that begin anew in each file, or within one: rows of a stream need none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import Conventions
from ifrfit.data.validate import SAME_ANGLE


def without_repeated_ids(cells: Cells, conventions: Conventions) -> tuple[Cells, str]:
    """A table without its impact_id, where one of these stands at two angles, and what is said of ids.

    Such an id names no single impact. Any other table is returned as it is, and of ids that repeat at one
    angle it is said that each row counts.
    """
    layout = identify(cells, conventions)
    if not layout.has("impact_id") or not layout.has_gamma:
        return cells, ""
    ids, gamma = np.array(layout.texts("impact_id"), dtype=object), layout.gamma()
    given = np.flatnonzero((ids != "") & np.isfinite(gamma))
    _, first, impact = np.unique(ids[given].astype(str), return_index=True, return_inverse=True)
    start = given[first[impact]]
    differs = np.flatnonzero(np.abs(gamma[given] - gamma[start]) > SAME_ANGLE)
    if not differs.size:
        again = np.flatnonzero(start != given)
        if not again.size:
            return cells, ""
        return cells, (
            f"column {layout.header('impact_id')}: '{ids[given[again[0]]]}' stands in several rows at one "
            "angle. If these are readings of one impact, they are one: each row is counted here, "
            "so that standard deviations are too small. Leave one reading an impact, or fit a part that is "
            "held in memory"
        )
    row, other = given[differs[0]], start[differs[0]]
    at = layout.columns["impact_id"].index
    kept = replace(
        cells,
        headers=[header for place, header in enumerate(cells.headers) if place != at],
        columns=[column for place, column in enumerate(cells.columns) if place != at],
    )
    return kept, (
        f"column {layout.header('impact_id')}: '{ids[row]}' stands at {gamma[other]:.4g} and at "
        f"{gamma[row]:.4g} degrees, and so names no single impact: each row is taken for an impact of its own"
    )
