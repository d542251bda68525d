"""A sum of squares that changes its form where impacts begin to slide, and the rows it is made of.

Value types only; `ifrfit.inference.optimize.branch_and_bound` finds and proves the minimum. The mathematics
is derived in docs/theory/certificate.md, whose equations the code names.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEAR = 4.0  # local minima up to this far above the least value are counted
CHI2_95 = 3.84146  # rise of chi2 at the ends of a 95 % interval


@dataclass(frozen=True)
class LinearRows:
    """Weighted rows that are linear in the unknowns t: residual_i = target_i - sum_j columns_j,i t_j.

    Attributes
    ----------
    columns : tuple of (ndarray (n,) or None)
        One for each unknown; None stands for zeros.
    target : ndarray, (n,)
    """

    columns: tuple[Array | None, ...]
    target: Array

    @classmethod
    def of(cls, design: Array, target: Array) -> LinearRows:
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

    def transpose_times(self, r: Array) -> Array:
        """Design' r, (q,)."""
        return np.array([0.0 if column is None else float(column @ r) for column in self.columns])

    def about(self, center: Array) -> LinearRows:
        """The same rows in u = t - center."""
        return LinearRows(self.columns, self.residuals(center))

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_] | slice) -> LinearRows:
        """Some of the rows."""
        return LinearRows(tuple(None if c is None else c[which] for c in self.columns), self.target[which])


@dataclass(frozen=True)
class Transition:
    """Where regimes change: rows whose tau lies below (kappa @ t + kappa0)/(bound @ t + bound0) stick.

    Attributes
    ----------
    kappa, bound : ndarray, (q,)
    kappa0, bound0 : float
    """

    kappa: Array
    kappa0: float
    bound: Array
    bound0: float

    def at(self, points: Array) -> tuple[Array, Array]:
        """kappa and the bound of the impulse at points (k, q)."""
        return points @ self.kappa + self.kappa0, points @ self.bound + self.bound0


@dataclass(frozen=True)
class PiecewiseProblem:
    """Rows with two regimes, the switch between them, and a convex domain: eq. (1) of certificate.md.

    Row i sticks where tau_i * (bound @ t + bound0) <= kappa @ t + kappa0.

    Attributes
    ----------
    tau : ndarray, (n,)
        Slip ratio at which each row's regime changes.
    stick, slide : LinearRows
        The two forms of the n rows.
    always : LinearRows
        Rows without regimes.
    kappa, bound : ndarray, (q,)
        Both sides of the switch, less their constants `kappa0` and `bound0`.
    constraints, limits : ndarray, (p, q) and (p,)
        The domain is ``constraints @ t <= limits``; it must hold no line.
    linear : ndarray, (q,), or None
        Adds linear @ t to the sum of squares: the term of a Lagrange multiplier.
    """

    tau: Array
    stick: LinearRows
    slide: LinearRows
    always: LinearRows
    kappa: Array
    kappa0: float
    bound: Array
    bound0: float
    constraints: Array
    limits: Array
    linear: Array | None = None

    @property
    def half_linear(self) -> Array:
        """What `linear` takes off g in t'Gt - 2 g't, (q,)."""
        return np.zeros(self.kappa.size) if self.linear is None else 0.5 * self.linear

    @property
    def transition(self) -> Transition:
        """Where its rows change their regime."""
        return Transition(self.kappa, self.kappa0, self.bound, self.bound0)

    def sticks(self, t: Array) -> NDArray[np.bool_]:
        """Which rows stick at t."""
        return np.asarray(self.tau * (self.bound @ t + self.bound0) <= self.kappa @ t + self.kappa0)

    def value(self, t: Array) -> float:
        """The sum of squares plus linear @ t, from the rows themselves."""
        rows = np.where(self.sticks(t), self.stick.residuals(t), self.slide.residuals(t))
        rest = self.always.residuals(t)
        extra = 0.0 if self.linear is None else self.linear @ t
        return float(rows @ rows + rest @ rest + extra)

    def sorted_by_tau(self) -> PiecewiseProblem:
        """The same with its rows in ascending order of tau."""
        if self.tau.size < 2 or bool((self.tau[1:] >= self.tau[:-1]).all()):
            return self
        return self.take(np.argsort(self.tau))

    def take(self, which: NDArray[np.intp] | slice) -> PiecewiseProblem:
        """The same with some of the rows that switch."""
        return replace(self, tau=self.tau[which], stick=self.stick.take(which), slide=self.slide.take(which))

    def about(self, center: Array) -> PiecewiseProblem:
        """The same in u = t - center."""
        return replace(
            self,
            stick=self.stick.about(center),
            slide=self.slide.about(center),
            always=self.always.about(center),
            kappa0=self.kappa0 + float(self.kappa @ center),
            bound0=self.bound0 + float(self.bound @ center),
            limits=self.limits - self.constraints @ center,
        )

    def with_fixed(self, unknown: int, value: float) -> PiecewiseProblem:
        """The same with one unknown fixed at a value, in the q - 1 others."""
        rest = [i for i in range(self.kappa.size) if i != unknown]

        def rows(r: LinearRows) -> LinearRows:
            own = r.columns[unknown]
            target = r.target if own is None else r.target - value * own
            return LinearRows(tuple(r.columns[i] for i in rest), target)

        kept = np.abs(self.constraints[:, rest]).max(axis=1, initial=0.0) > 0.0
        return replace(
            self,
            stick=rows(self.stick),
            slide=rows(self.slide),
            always=rows(self.always),
            kappa=self.kappa[rest],
            kappa0=self.kappa0 + value * float(self.kappa[unknown]),
            bound=self.bound[rest],
            bound0=self.bound0 + value * float(self.bound[unknown]),
            constraints=self.constraints[kept][:, rest],
            limits=self.limits[kept] - value * self.constraints[kept, unknown],
        )

    def interval(self, unknown: int) -> tuple[float, float]:
        """What the constraints on one unknown alone leave it."""
        low, high = -np.inf, np.inf
        for i in np.flatnonzero(self._bounds_alone(unknown)):
            end = float(self.limits[i] / self.constraints[i, unknown])
            low, high = (low, min(high, end)) if self.constraints[i, unknown] > 0.0 else (max(low, end), high)
        return low, high

    def within(self, unknown: int, low: float, high: float) -> PiecewiseProblem:
        """The same with one unknown between two ends, which may be infinite."""
        others = ~self._bounds_alone(unknown)
        ends = [(factor, factor * end) for factor, end in ((-1.0, low), (1.0, high)) if np.isfinite(end)]
        own = np.zeros((len(ends), self.kappa.size))
        own[:, unknown] = [factor for factor, _ in ends]
        return replace(
            self,
            constraints=np.concatenate((self.constraints[others], own)),
            limits=np.concatenate((self.limits[others], [limit for _, limit in ends])),
        )

    def _bounds_alone(self, unknown: int) -> NDArray[np.bool_]:
        """Which constraints hold this unknown and no other."""
        holds = self.constraints != 0.0
        return np.asarray(holds[:, unknown] & (holds.sum(axis=1) == 1))

    def with_linear(self, unknown: int, factor: float) -> PiecewiseProblem:
        """The same with factor * t[unknown] for its linear term."""
        linear = np.zeros(self.kappa.size)
        linear[unknown] = factor
        return replace(self, linear=linear if factor else None)


@dataclass(frozen=True)
class PiecewiseBatch:
    """Problems that have the same rows under other weights, and with other targets.

    Attributes
    ----------
    problem : PiecewiseProblem
        Sorted by tau.
    weight, always_weight : ndarray (b, n) and (b, k), or None
        Weight of each row in the sum of squares of each member: of the rows with two regimes, and of
        `always`. None for a batch of one, whose rows are weighted already.
    shift, always_shift : ndarray (b, n) and (b, k), or None
        Added to the targets; None for nothing.
    """

    problem: PiecewiseProblem
    weight: Array | None = None
    always_weight: Array | None = None
    shift: Array | None = None
    always_shift: Array | None = None

    @property
    def size(self) -> int:
        """Number of members."""
        return 1 if self.weight is None else int(self.weight.shape[0])

    def member(self, number: int) -> PiecewiseProblem:
        """One of them, with its weights worked into its rows."""
        if self.weight is None or self.always_weight is None:
            return self.problem

        def rows(rows: LinearRows, weight: Array, shift: Array | None) -> LinearRows:
            root = np.sqrt(weight[number])
            target = rows.target if shift is None else rows.target + shift[number]
            return LinearRows(tuple(None if c is None else root * c for c in rows.columns), root * target)

        p = self.problem
        return replace(
            p,
            stick=rows(p.stick, self.weight, self.shift),
            slide=rows(p.slide, self.weight, self.shift),
            always=rows(p.always, self.always_weight, self.always_shift),
        )


@dataclass(frozen=True)
class PiecewiseOptimum:
    """The minimum, and what is proven about it.

    Attributes
    ----------
    t : ndarray
        Minimiser.
    chi2 : float
        The sum of squares plus linear @ t.
    gap : float
        chi2 minus a proven lower bound over everything else, at least 0.
    optima : tuple of (float, ndarray)
        Distinct local minima within chi2 + `NEAR`, best first.
    extremes : ndarray
        The outermost minimisers, along every unknown, of all cells within chi2 + 3.84, (2 q, q).
    all_slide, all_stick : bool
        Whether the cells at the ends are among them: then no impact limits the transition on that side.
    """

    t: Array
    chi2: float
    gap: float
    optima: tuple[tuple[float, Array], ...]
    extremes: Array
    all_slide: bool
    all_stick: bool

    def moved(self, center: Array, shift: float) -> PiecewiseOptimum:
        """The optimum of a problem in u = t - center, in t; `shift` is added to its values."""
        return replace(
            self,
            t=center + self.t,
            chi2=self.chi2 + shift,
            optima=tuple((value + shift, center + u) for value, u in self.optima),
            extremes=center + self.extremes,
        )
