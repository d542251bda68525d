"""Global minimum of a sum of squares that changes its form where impacts begin to slide.

Sort the rows by tau. Between two neighbouring values of tau the transition leaves every row in its regime,
so the sum of squares is one convex quadratic there (a cell). Prefix sums of the sticking rows and suffix
sums of the sliding rows give the quadratics of all cells in O(N). A cell's unconstrained minimum bounds it
from below; only cells whose bound lies under the best value found are solved exactly. What remains is
proven: no cell holds a lower value. Bounds and values are taken less their rounding error, and a cell that
rounding leaves in doubt is solved again from its own rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MANY = 20_000  # rows beyond which the sums are taken about a point near the optimum
_SAMPLE = 1000  # rows that find that point
_NEAR = 3.84146  # rise of chi2 at the ends of a 95 % interval


@dataclass(frozen=True)
class Rows:
    """Weighted rows: residual_i = target_i - sum_j columns_j,i t_j; None stands for a column of zeros."""

    columns: tuple[Array | None, ...]
    target: Array

    @classmethod
    def of(cls, design: Array, target: Array) -> Rows:
        """Rows from a dense design of shape (n, q)."""
        return cls(tuple(np.ascontiguousarray(column) for column in design.T), target)

    @property
    def design(self) -> Array:
        """The dense design, (n, q)."""
        dense = np.zeros((self.target.size, len(self.columns)))
        for j, column in enumerate(self.columns):
            if column is not None:
                dense[:, j] = column
        return dense

    def residuals(self, t: Array) -> Array:
        """Residuals at t."""
        left = self.target
        for column, x in zip(self.columns, t, strict=True):
            if column is not None and x != 0.0:
                left = left - x * column
        return left

    def gram(self) -> Array:
        """Design' design, (q, q)."""
        q = len(self.columns)
        found = np.zeros((q, q))
        for i, first in enumerate(self.columns):
            for j, second in enumerate(self.columns[: i + 1]):
                if first is not None and second is not None:
                    found[i, j] = found[j, i] = float(first @ second)
        return found

    def onto(self, r: Array) -> Array:
        """Design' r, (q,)."""
        return np.array([0.0 if column is None else float(column @ r) for column in self.columns])

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Rows:
        """Some of the rows."""
        return Rows(tuple(None if c is None else c[which] for c in self.columns), self.target[which])


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
    extremes : ndarray
        The outermost minimisers, along every unknown, of all cells within chi2 + 3.84, (2 q, q).
    all_slide, all_stick : bool
        Whether the cells at the ends are among them: then no impact limits the transition on that side.
    n_cells, n_solved : int
        Cells there are, and how many had to be solved beyond their bound.
    """

    t: Array
    chi2: float
    gap: float
    optima: tuple[tuple[float, Array], ...]
    extremes: Array
    all_slide: bool
    all_stick: bool
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
    problem = in_order(problem)
    if problem.tau.size <= _MANY:
        return _minimise(problem)
    # sums over many rows keep their digits when they are taken about a point near the optimum
    every = slice(None, None, problem.tau.size // _SAMPLE)
    sample = replace(
        problem, tau=problem.tau[every], stick=problem.stick.take(every), slide=problem.slide.take(every)
    )
    center = _minimise(sample).t
    return _moved(_minimise(about(problem, center)), problem, center)


def about(problem: PiecewiseProblem, center: Array) -> PiecewiseProblem:
    """Restate the problem in u = t - center."""

    def rows(r: Rows) -> Rows:
        return Rows(r.columns, r.residuals(center))

    return replace(
        problem,
        stick=rows(problem.stick),
        slide=rows(problem.slide),
        always=rows(problem.always),
        kappa0=problem.kappa0 + float(problem.kappa @ center),
        bound0=problem.bound0 + float(problem.bound @ center),
        limits=problem.limits - problem.walls @ center,
    )


def _moved(found: PiecewiseOptimum, problem: PiecewiseProblem, center: Array) -> PiecewiseOptimum:
    """Put an optimum that was found in u = t - center back into t."""
    shift = 0.0 if problem.pull is None else float(problem.pull @ center)
    return replace(
        found,
        t=center + found.t,
        chi2=found.chi2 + shift,
        optima=tuple((value + shift, center + u) for value, u in found.optima),
        extremes=center + found.extremes,
    )


def _minimise(problem: PiecewiseProblem) -> PiecewiseOptimum:
    """Minimise a problem whose rows are sorted."""
    from ifrfit.inference.optimize.local_minima import local_minima
    from ifrfit.inference.optimize.refinement import settle
    from ifrfit.inference.optimize.regime_sums import branch, build

    cells = build(problem)
    found = settle(problem, cells, branch(problem, cells))
    chi2 = problem.value(found.point)
    gap = max(0.0, chi2 - found.lowest_bound_elsewhere())
    optima = [(chi2, found.point), *local_minima(problem, cells, found)[1:]]
    near = found.values <= found.value + _NEAR
    points, which = found.points[near], found.solved[near]
    return PiecewiseOptimum(
        found.point,
        chi2,
        gap,
        tuple(optima),
        np.concatenate((points[points.argmin(axis=0)], points[points.argmax(axis=0)])),
        bool((which == 0).any()),
        bool((which == found.bounds.size - 1).any()),
        found.bounds.size,
        found.solved.size,
    )


def in_order(problem: PiecewiseProblem) -> PiecewiseProblem:
    """The same with its rows sorted by tau."""
    if problem.tau.size < 2 or bool((problem.tau[1:] >= problem.tau[:-1]).all()):
        return problem
    order = np.argsort(problem.tau)
    return replace(
        problem, tau=problem.tau[order], stick=problem.stick.take(order), slide=problem.slide.take(order)
    )
