"""The rows of a problem as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Incidence

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class Rows:
    """What each row measures, as numbers.

    Attributes
    ----------
    incidence : Incidence
    tau : ndarray
        |U_t|/U_n.
    names : tuple of str
        The observables that occur.
    which : ndarray of int
        Observable of each row, an index into `names`.
    series : ndarray of int
        Series of each row.
    value : ndarray
    """

    incidence: Incidence
    tau: Array
    names: tuple[str, ...]
    which: Index
    series: Index
    value: Array

    def rows_of(self, name: str) -> Index:
        """Rows of one observable."""
        if len(self.names) == 1:
            return np.arange(self.which.size)
        return np.flatnonzero(self.which == self.names.index(name))

    def take(self, rows: Index) -> Rows:
        """The same for some rows."""
        if rows.size == self.tau.size and bool((np.diff(rows) == 1).all()):
            return self
        i = self.incidence
        incidence = Incidence(
            i.sine[rows], i.cosine[rows], i.spin_x[rows], i.spin_y[rows], i.slip_x[rows], i.slip_y[rows]
        )
        return Rows(
            incidence, self.tau[rows], self.names, self.which[rows], self.series[rows], self.value[rows]
        )
