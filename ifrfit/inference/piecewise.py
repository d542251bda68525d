"""Global minimum of a sum of squares that changes its form where impacts begin to slide.

Sort the rows by tau. Between two neighbouring values of tau the transition leaves every row in its regime,
so the sum of squares is one convex quadratic there (a cell). Prefix sums of the sticking rows and suffix
sums of the sliding rows give the quadratics of all cells in O(N). A cell's unconstrained minimum bounds it
from below; only cells whose bound lies under the best value found are solved exactly. What remains is
proven: no cell holds a lower value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """Weighted rows: residual_i = target_i - design_i @ t, in q unknowns t."""

    design: Array  # (n, q)
    target: Array  # (n,)

    def residuals(self, t: Array) -> Array:
        """Residuals at t."""
        return np.asarray(self.target - self.design @ t)

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Rows:
        """Some of the rows."""
        return Rows(self.design[which], self.target[which])


@dataclass(frozen=True)
class PiecewiseProblem:
    """Rows with two forms, the switch between them, and a convex domain.

    Row i sticks where tau_i * (bound @ t + bound0) <= kappa @ t + kappa0; `stick` and `slide` hold its two
    forms, `always` the rows without regimes. The domain is ``walls @ t <= limits``; it must hold no line.
    `pull` adds pull @ t to the sum of squares (a Lagrange multiplier, when several problems share unknowns).
    """

    tau: Array
    stick: Rows
    slide: Rows
    always: Rows
    kappa: Array
    kappa0: float
    bound: Array
    bound0: float
    walls: Array
    limits: Array
    pull: Array | None = None

    @property
    def slope0(self) -> Array:
        """What `pull` takes off the slopes of the quadratics."""
        return np.zeros(self.kappa.size) if self.pull is None else 0.5 * self.pull

    def sticks(self, t: Array) -> NDArray[np.bool_]:
        """Which rows stick at t."""
        return np.asarray(self.tau * (self.bound @ t + self.bound0) <= self.kappa @ t + self.kappa0)

    def value(self, t: Array) -> float:
        """The sum of squares plus pull @ t, from the rows themselves."""
        rows = np.where(self.sticks(t), self.stick.residuals(t), self.slide.residuals(t))
        rest = self.always.residuals(t)
        pulled = 0.0 if self.pull is None else self.pull @ t
        return float(rows @ rows + rest @ rest + pulled)


@dataclass(frozen=True)
class View:
    """Coordinates u with t = center + frame @ u, in which sums of squares keep their digits."""

    center: Array
    frame: Array

    def of(self, rows: Rows) -> Rows:
        """Restate rows in u."""
        return Rows(rows.design @ self.frame, rows.residuals(self.center))


@dataclass(frozen=True)
class PiecewiseOptimum:
    """The minimum, and what is proven about it.

    Attributes
    ----------
    t : ndarray
        Minimiser.
    chi2 : float
        The sum of squares plus pull @ t.
    gap : float
        chi2 minus a proven lower bound over everything else, at least 0.
    optima : tuple of (float, ndarray)
        Distinct local minima within chi2 + 4, best first.
    n_cells, n_solved : int
        Cells there are, and how many had to be solved beyond their bound.
    """

    t: Array
    chi2: float
    gap: float
    optima: tuple[tuple[float, Array], ...]
    n_cells: int
    n_solved: int


def minimise(problem: PiecewiseProblem) -> PiecewiseOptimum:
    """Find the global minimum and prove it.

    Parameters
    ----------
    problem : PiecewiseProblem
        In at most three unknowns.

    Returns
    -------
    PiecewiseOptimum
    """
    from ifrfit.inference.cells import branch, build
    from ifrfit.inference.minima import local_minima
    from ifrfit.inference.polish import polish

    problem = _sorted(problem)
    q = problem.kappa.size
    t, view = np.zeros(q), View(np.zeros(q), np.eye(q))
    for _ in range(4):
        cells = build(problem, view)
        found = branch(problem, view, cells)
        before, (t, frame) = t, polish(problem, cells, found)
        # sums about a far centre lose digits to cancellation: look again from the optimum
        if cells.rounding <= 1e-10 * abs(found.value) or np.array_equal(t, before):
            break
        view = View(t, frame)
    chi2 = problem.value(t)
    # values of cells are seen from the centre: what pull @ centre adds is common to all of them
    shift = 0.0 if problem.pull is None else float(problem.pull @ view.center)
    gap = chi2 - shift - found.lowest_bound_elsewhere(cells.rounding)
    optima = [(chi2, t)]
    optima += [(value + shift, point) for value, point in local_minima(problem, cells, found)[1:]]
    return PiecewiseOptimum(
        t, chi2, gap if gap > cells.rounding else 0.0, tuple(optima), found.bounds.size, found.solved.size
    )


def _sorted(problem: PiecewiseProblem) -> PiecewiseProblem:
    if problem.tau.size < 2 or bool((problem.tau[1:] >= problem.tau[:-1]).all()):
        return problem
    order = np.argsort(problem.tau)
    return replace(
        problem, tau=problem.tau[order], stick=problem.stick.take(order), slide=problem.slide.take(order)
    )
