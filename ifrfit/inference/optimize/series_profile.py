"""One series along a shared value, everything else at its best: every cell in closed form, no search.

Given the shared value one unknown at most is left, so the minimum in a cell is that of a parabola between two
ends, for all cells and many shared values at once. That is quick, and good for finding the way; what is
found is taken again by the certified solver.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.parameter_group import ParameterGroup
from ifrfit.inference.optimize.piecewise import Array, PiecewiseBatch
from ifrfit.inference.optimize.piecewise_quadratic import cell_constraints, quadratic_of

_AT_ONCE = 1_000_000  # constraints met at once
_SLACK = 1e-9  # of a constraint that the unknown cannot move, relative to its terms


class Along:
    """Sum of squares of a series at shared values, and its slope there.

    Parameters
    ----------
    block : ParameterGroup
        With e_n held, and the shared constant free.
    free : int
        Place of the shared value among the free unknowns of the block.
    """

    def __init__(self, block: ParameterGroup, free: int) -> None:
        form = kappa_form(block)
        own = minimise(form.problem)
        self.optima = [form.to_constants(t) for _, t in own.optima]
        # sums about the series' own optimum keep their digits
        problem = form.problem.sorted_by_tau().about(own.t)
        cells = quadratic_of(PiecewiseBatch(problem))
        self._center = float(own.t[free])
        constraints, self._limits = cell_constraints(problem, cells.low, cells.high)
        gram, slope = cells.gram[:, :, 0], cells.slope[:, 0]
        nothing = np.zeros(cells.n_cells)
        self._constraint, self._gram = constraints[:, :, free], gram[free, free]
        self._slope, self._square = slope[free], cells.square[0]
        if slope.shape[0] == 1:
            self._other_constraint, self._mixed = np.zeros_like(self._constraint), nothing
            self._other_gram, self._other_slope = nothing, nothing
        else:
            other = 1 - free
            self._other_constraint, self._mixed = constraints[:, :, other], gram[free, other]
            self._other_gram, self._other_slope = gram[other, other], slope[other]

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Least sum of squares at each shared value, and its derivative in the cell that holds it, (n,)."""
        step = max(1, _AT_ONCE // self._limits.size)
        parts = [self._at(x[i : i + step]) for i in range(0, x.size, step)]
        return np.concatenate([value for value, _ in parts]), np.concatenate([slope for _, slope in parts])

    def _at(self, x: Array) -> tuple[Array, Array]:
        d = (x - self._center)[:, None]
        room = self._limits - self._constraint * d[..., None]
        low, high, shut = self._ends(room)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(
                self._other_gram > 0.0, (self._other_slope - self._mixed * d) / self._other_gram, 0.0
            )
        t = np.minimum(np.maximum(t, low), high)
        value = self._square + d * (self._gram * d - 2.0 * self._slope)
        value = value + t * (2.0 * self._mixed * d + self._other_gram * t - 2.0 * self._other_slope)
        value = np.where(shut, np.inf, value)
        at = np.arange(x.size), value.argmin(axis=1)
        return value[at], (2.0 * (self._gram * d + self._mixed * t - self._slope))[at]

    def _ends(self, room: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Between what the constraints leave the other unknown, and whether they leave it nothing."""
        constraint = self._other_constraint
        with np.errstate(divide="ignore", invalid="ignore"):
            edge = room / constraint
        low = np.where(constraint < 0.0, edge, -np.inf).max(axis=-1, initial=-np.inf)
        high = np.where(constraint > 0.0, edge, np.inf).min(axis=-1, initial=np.inf)
        short = room < -_SLACK * (1.0 + np.abs(self._limits))
        apart = low > high + _SLACK * (1.0 + np.abs(high))
        return low, high, ((constraint == 0.0) & short).any(axis=-1) | apart
