"""Columns of the campaign's table as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def column(rows: Sequence[Mapping[str, Any]], key: str) -> Array:
    """The numbers of all rows under a name, (n,); nan where there is none."""
    return np.array([row.get(key) for row in rows], dtype=float)
