"""Impossible values of observables that are not used: a table in memory refuses them, as a sample is read."""

from __future__ import annotations

import contextlib
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import Conventions
from ifrfit.data.validate import impossible
from ifrfit.errors import DataError
from ifrfit.physics.observables import OBSERVABLES


def without_impossible(cells: Cells, conventions: Conventions, used: Collection[str]) -> Cells:
    """A table without the values of other observables than these that none of them can have."""
    layout, columns = identify(cells, conventions), list(cells.columns)
    for name in OBSERVABLES:
        if name in used or not layout.has(name):
            continue
        at = layout.columns[name].index
        column = columns[at]
        if not isinstance(column, np.ndarray):
            continue
        with contextlib.suppress(DataError):  # of a unit that is not known: never looked at
            bad = impossible(OBSERVABLES[name], layout.numbers(name))
            columns[at] = np.where(bad, np.nan, column)
    return replace(cells, columns=columns)
