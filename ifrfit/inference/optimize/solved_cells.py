"""What branch and bound has found out about the cells of one problem: a value type."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import Array


@dataclass(frozen=True)
class SolvedCells:
    """Minima of k cells that were solved, and a lower bound of each of the m cells.

    Attributes
    ----------
    values, errors : ndarray, (k,)
        Minima, and their rounding errors.
    points : ndarray, (k, q)
        Minimisers.
    cells : ndarray of int, (k,)
        Which cells they are.
    bounds : ndarray, (m,)
    all_near_solved : bool
        Whether every cell within `NEAR` of the least value is among them.
    """

    values: Array
    errors: Array
    points: Array
    cells: NDArray[np.intp]
    bounds: Array
    all_near_solved: bool

    @property
    def best(self) -> int:
        """Place of the best among the solved."""
        return int(np.argmin(self.values))

    @property
    def value(self) -> float:
        """Least value."""
        return float(self.values[self.best])

    @property
    def point(self) -> Array:
        """Where it is, (q,)."""
        return np.asarray(self.points[self.best])

    @property
    def cell(self) -> int:
        """In which cell."""
        return int(self.cells[self.best])

    def lowest_bound_elsewhere(self) -> float:
        """Least bound over all cells but those that hold the least value."""
        rest = np.ones(self.bounds.size, dtype=bool)
        same = self.values <= self.value + self.errors + self.errors[self.best]
        rest[self.cells[same]] = False
        return float(self.bounds[rest].min(initial=np.inf))
