"""Slabs of a grid: some nodes along one of its axes, worked on at once so that temporaries stay small."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_AT_ONCE = 50_000  # values of a density worked on at once


@dataclass(frozen=True)
class Slab:
    """Neighbouring nodes along one axis of (outer nodes, e_n, transition).

    Attributes
    ----------
    axis : int
    nodes : slice
        At least two of them, or all.
    """

    axis: int
    nodes: slice

    def of(self, values: Array, first: int = 0) -> Array:
        """Part of an array whose axes of the grid begin at `first`; all of it where it has size 1 there."""
        at = first + self.axis
        return values if values.shape[at] == 1 else values[(slice(None),) * at + (self.nodes,)]


def slabs_of(shape: Sequence[int], size: int, at_least: int = 0) -> list[Slab]:
    """Slabs along the longest axis of a grid.

    Parameters
    ----------
    shape : sequence of int
        Nodes along (outer nodes, e_n, transition).
    size : int
        Values on the whole grid.
    at_least : int
        Values of a slab where these are more than usual.
    """
    axis = int(np.argmax(shape))
    count = max(1, min(shape[axis] // 2, size // max(_AT_ONCE, at_least)))
    if count == 1:
        return [Slab(axis, slice(None))]
    ends = np.linspace(0, shape[axis], count + 1).astype(int)
    return [Slab(axis, slice(int(low), int(high))) for low, high in pairwise(ends)]
