"""Some groups of what is held of many: arrays whose first axis is the group."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]


class OfGroups:
    """A dataclass whose arrays have the group as their first axis; what is no array is common to all."""

    def of_groups(self, groups: Index | slice) -> Self:
        """The same of some groups."""
        return replace(self, **{each.name: _of(getattr(self, each.name), groups) for each in fields(self)})  # type: ignore[type-var, arg-type]


def _of(value: Any, groups: Index | slice) -> Any:
    if isinstance(value, OfGroups):
        return value.of_groups(groups)
    return value[groups] if isinstance(value, np.ndarray) else value
