"""Many values of many inverted distribution functions at once: tables."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ifrfit.inference.posterior.clenshaw_curtis import rule
from ifrfit.inference.posterior.panel_cdf import PanelCdf

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STEPS = 32  # points to a panel at which distribution functions are tabled, beside its nodes


@cache
def _grid(order: int) -> tuple[Array, Array, Index]:
    """Points of a panel, the integrals' polynomials there, and the node at or before the end of each step."""
    nodes = rule(order).nodes
    points = np.union1d(np.linspace(0.0, 1.0, _STEPS + 1), nodes)
    # the same node twice, but for rounding, makes no step
    points = points[np.concatenate(([True], np.diff(points) > 1e-12))]
    before = np.clip(np.searchsorted(nodes, points - 1e-9) - 1, 0, order - 1)
    return points, np.asarray(chebyshev.chebvander(2.0 * points - 1.0, order + 1).T, dtype=float), before


def table_points(order: int) -> Array:
    """Points of a panel at which distribution functions are tabled, on [0, 1]; its nodes are among them."""
    return _grid(order)[0]


@dataclass(frozen=True)
class InverseCdfTable:
    """Distribution functions, one a row, at the points of all panels.

    Attributes
    ----------
    below : ndarray, (rows, points)
        Ascending from 0 to 1.
    order : int
        Of the panels.
    """

    below: Array
    order: int

    @classmethod
    def of(cls, panels: PanelCdf) -> InverseCdfTable:
        """Of all rows of panels."""
        order = panels.axis.order
        below = panels.cumulative[:, :-1, None] + panels.coefficients @ _grid(order)[1]
        below = np.maximum.accumulate(below.reshape(below.shape[0], -1), axis=1)
        below = np.maximum(below, 0.0) / np.maximum(below[:, -1:], 1e-300)
        below[:, -1] = 1.0
        return cls(below, order)

    def inverse(self, row: Index, p: Array, places: Array) -> tuple[Array, Index]:
        """Where the distribution function of a row takes the value p.

        Parameters
        ----------
        row : ndarray of int, (n,)
        p : ndarray, (n,)
        places : ndarray, (rows or 1, points)
            The quantity at the points.

        Returns
        -------
        values : ndarray, (n,)
        before : ndarray of int, (n,)
            The last node before each value, counted along all panels.
        """
        rows, points = self.below.shape
        own: Index = row if rows > 1 else np.zeros(1, dtype=np.intp)
        flat = self.below.reshape(-1)
        # a guide table: for each of `points` equal cells of [0, 1], the first entry of the row in it; four
        # times as fast as a binary search for each of 100,000 values
        cell = (self.below * points).astype(np.intp) + np.arange(rows)[:, None] * (points + 1)
        count = np.bincount(cell.reshape(-1), minlength=rows * (points + 1))
        first = np.cumsum(count) - count
        right = first[own * (points + 1) + (p * points).astype(np.intp)]
        right = np.maximum(right, own * points + 1)  # a step has a point before it
        late = np.flatnonzero(flat[right] < p)
        while late.size:  # entries of the same cell before p
            right[late] += 1
            late = late[flat[right[late]] < p[late]]
        a, b = flat[right - 1], flat[right]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(b > a, np.clip((p - a) / (b - a), 0.0, 1.0), 0.5)
        point = right - own * points
        if places.shape[0] > 1:
            places, at = places.reshape(-1), right
        else:
            places, at = places[0], point
        left = places[at - 1]
        return left + share * (places[at] - left), self._nodes()[point]

    def _nodes(self) -> Index:
        """The last node before the end of each step, along all panels."""
        before = _grid(self.order)[2]
        panels = self.below.shape[1] // before.size
        return np.asarray((np.arange(panels)[:, None] * (self.order + 1) + before).reshape(-1))
