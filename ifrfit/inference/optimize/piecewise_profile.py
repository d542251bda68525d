"""A piecewise problem along one of its two unknowns, the other at its best: every cell in closed form.

Given the one unknown, the minimum in a cell is that of a parabola between two ends, for all cells and many
places at once. That is quick, and good for finding the way; what is found is taken again by the certified
solver.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import Array, PiecewiseBatch, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_quadratic import cell_constraints, quadratic_of

_AT_ONCE = 1_000_000  # constraints met at once
_SLACK = 1e-9  # of a constraint that the other unknown cannot move, relative to its terms


class PiecewiseProfile:
    """Least sum of squares at given values x of one unknown, and its slope there.

    Parameters
    ----------
    problem : PiecewiseProblem
        In one unknown or two.
    center : ndarray, (q,)
        Its minimum: sums about it keep their digits.
    unknown : int
        The one that is given.
    """

    def __init__(self, problem: PiecewiseProblem, center: Array, unknown: int) -> None:
        problem = problem.sorted_by_tau().about(center)
        quadratic = quadratic_of(PiecewiseBatch(problem))
        self._center = float(center[unknown])
        constraints, self._limits = cell_constraints(problem, quadratic.low, quadratic.high)
        gram, slope = quadratic.gram[:, :, 0], quadratic.slope[:, 0]
        self._constraint, self._gram = constraints[:, :, unknown], gram[unknown, unknown]
        self._slope, self._square = slope[unknown], quadratic.square[0]
        if slope.shape[0] == 1:
            nothing = np.zeros(quadratic.n_cells)
            self._other_constraint, self._mixed = np.zeros_like(self._constraint), nothing
            self._other_gram, self._other_slope = nothing, nothing
        else:
            other = 1 - unknown
            self._other_constraint, self._mixed = constraints[:, :, other], gram[unknown, other]
            self._other_gram, self._other_slope = gram[other, other], slope[other]

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Least sum of squares at each x, and its derivative in the cell that holds it, both (n,)."""
        step = max(1, _AT_ONCE // self._limits.size)
        parts = [self._evaluate(x[i : i + step]) for i in range(0, x.size, step)]
        return np.concatenate([value for value, _ in parts]), np.concatenate([slope for _, slope in parts])

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        d = (x - self._center)[:, None]
        low, high, infeasible = self._ends(self._limits - self._constraint * d[..., None])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(
                self._other_gram > 0.0, (self._other_slope - self._mixed * d) / self._other_gram, 0.0
            )
        t = np.minimum(np.maximum(t, low), high)
        value = self._square + d * (self._gram * d - 2.0 * self._slope)
        value = value + t * (2.0 * self._mixed * d + self._other_gram * t - 2.0 * self._other_slope)
        value = np.where(infeasible, np.inf, value)
        at = np.arange(x.size), value.argmin(axis=1)
        return value[at], (2.0 * (self._gram * d + self._mixed * t - self._slope))[at]

    def _ends(self, limits: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Between what the constraints leave the other unknown, (n, m), and where they leave it nothing."""
        normal = self._other_constraint
        with np.errstate(divide="ignore", invalid="ignore"):
            edge = limits / normal
        low = np.where(normal < 0.0, edge, -np.inf).max(axis=-1, initial=-np.inf)
        high = np.where(normal > 0.0, edge, np.inf).min(axis=-1, initial=np.inf)
        violated = limits < -_SLACK * (1.0 + np.abs(self._limits))
        empty = low > high + _SLACK * (1.0 + np.abs(high))
        return low, high, ((normal == 0.0) & violated).any(axis=-1) | empty
