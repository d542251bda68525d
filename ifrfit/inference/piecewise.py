"""Global minimum of a sum of squares that changes its form where impacts begin to slide.

Sort the rows by tau. Between two neighbouring values of tau the transition leaves every row in its regime,
so the sum of squares is one convex quadratic there (a cell). Prefix sums of the sticking rows and suffix
sums of the sliding rows give the quadratics of all cells in O(N). A cell's unconstrained minimum bounds it
from below; only cells whose bound lies under the best value found are solved exactly. What remains is
proven: no cell holds a lower value.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_RELATIVE_PIVOT = 1e-14  # below this share of its diagonal a pivot counts as zero
_FEASIBLE = 1e-11  # slack of a constraint, relative to its terms
_ROUNDING = 64.0 * np.finfo(float).eps  # of a sum of squares, relative to its largest partial sum
_MOST_CELLS = 4096  # solved exactly at the most while optima are counted


@dataclass(frozen=True)
class Rows:
    """Weighted rows: residual_i = target_i - design_i @ t, in q unknowns t."""

    design: Array  # (n, q)
    target: Array  # (n,)

    def residuals(self, t: Array) -> Array:
        """Residuals at t."""
        return np.asarray(self.target - self.design @ t)


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


@dataclass(frozen=True)
class _Cells:
    """Quadratics t'Gt - 2 g't + s of all cells."""

    gram: Array  # (cells, q, q)
    slope: Array  # (cells, q)
    square: Array  # (cells,)
    count: NDArray[np.intp]  # rows that stick
    low: Array  # tau of the last sticking row (0 for none)
    high: Array  # tau of the first sliding row (inf for none)
    rounding: float  # of any sum of squares here


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
    problem = _sorted(problem)
    q = problem.kappa.size
    t, frame = np.zeros(q), np.eye(q)
    for _ in range(4):
        center = t
        local = _seen_from(problem, center, frame)
        cells = _build(local)
        values, points, solved, bounds = _branch(local, cells)
        best = int(np.argmin(values))
        seen_with = frame
        t, frame = _polish(problem, cells, solved[best], center + frame @ points[best])
        # sums about a far centre lose digits to cancellation: look again from the optimum
        if cells.rounding <= 1e-10 * abs(values[best]) or np.array_equal(t, center):
            break
    chi2 = chi2_at(problem, t)
    # `values` are seen from the centre: what pull @ centre adds is common to all
    shift = 0.0 if problem.pull is None else float(problem.pull @ center)
    rest = np.delete(bounds, solved[values <= values[best] + cells.rounding])
    gap = max(0.0, chi2 - shift - float(rest.min())) if rest.size else 0.0
    if gap <= cells.rounding:
        gap = 0.0
    optima = [(chi2, t)]
    for value, u in _local_minima(local, cells, solved, values, points)[1:]:
        optima.append((value + shift, center + seen_with @ u))
    return PiecewiseOptimum(t, chi2, gap, tuple(optima), bounds.size, solved.size)


def _sorted(problem: PiecewiseProblem) -> PiecewiseProblem:
    order = np.argsort(problem.tau, kind="stable")
    return replace(
        problem,
        tau=problem.tau[order],
        stick=Rows(problem.stick.design[order], problem.stick.target[order]),
        slide=Rows(problem.slide.design[order], problem.slide.target[order]),
    )


def _seen_from(problem: PiecewiseProblem, center: Array, frame: Array) -> PiecewiseProblem:
    """Restate the problem in u, with t = center + frame @ u."""

    def rows(r: Rows) -> Rows:
        return Rows(r.design @ frame, r.residuals(center))

    return PiecewiseProblem(
        problem.tau,
        rows(problem.stick),
        rows(problem.slide),
        rows(problem.always),
        problem.kappa @ frame,
        problem.kappa0 + float(problem.kappa @ center),
        problem.bound @ frame,
        problem.bound0 + float(problem.bound @ center),
        problem.walls @ frame,
        problem.limits - problem.walls @ center,
        None if problem.pull is None else problem.pull @ frame,
    )


def chi2_at(problem: PiecewiseProblem, t: Array) -> float:
    """Sum of squares at t, from the rows themselves."""
    sticks = problem.tau * (problem.bound @ t + problem.bound0) <= problem.kappa @ t + problem.kappa0
    rows = np.where(sticks, problem.stick.residuals(t), problem.slide.residuals(t))
    rest = problem.always.residuals(t)
    pulled = 0.0 if problem.pull is None else problem.pull @ t
    return float(rows @ rows + rest @ rest + pulled)


def _products(rows: Rows) -> Array:
    """Columns a_i a_j (lower triangle), a_i y and y^2 of each row."""
    a, y = rows.design, rows.target
    columns = [a[:, i] * a[:, j] for i in range(a.shape[1]) for j in range(i + 1)]
    columns += [a[:, i] * y for i in range(a.shape[1])]
    columns.append(y * y)
    return np.stack(columns)


def _build(problem: PiecewiseProblem) -> _Cells:
    """Quadratics of all cells; rows of equal tau change together."""
    tau = problem.tau
    q = problem.kappa.size
    count = np.unique(np.concatenate(([0], np.flatnonzero(np.diff(tau) > 0.0) + 1, [tau.size])))
    stick = np.cumsum(_products(problem.stick), axis=1)
    slide = np.cumsum(_products(problem.slide)[:, ::-1], axis=1)[:, ::-1]
    zero = np.zeros((stick.shape[0], 1))
    sums = np.hstack((zero, stick))[:, count] + np.hstack((slide, zero))[:, count]
    sums += _products(problem.always).sum(axis=1, keepdims=True)
    gram = np.empty((count.size, q, q))
    pairs = [(i, j) for i in range(q) for j in range(i + 1)]
    for (i, j), column in zip(pairs, sums, strict=False):
        gram[:, i, j] = gram[:, j, i] = column
    first = q * (q + 1) // 2
    return _Cells(
        gram,
        sums[first : first + q].T - problem.slope0,
        sums[-1],
        count,
        np.concatenate(([0.0], tau))[count],
        np.concatenate((tau, [np.inf]))[count],
        _ROUNDING * float(sums[-1].max(initial=0.0)),
    )


def _unconstrained(cells: _Cells) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Minimiser and minimum of every cell's quadratic, and where a pivot vanished.

    Elimination on the Jacobi-scaled matrices, all cells at once. A cell with a vanished pivot has no
    unique minimiser; its minimum is not trusted as a bound.
    """
    q = cells.slope.shape[1]
    size = np.sqrt(np.maximum(cells.gram[:, range(q), range(q)], 1e-300))
    a = cells.gram / (size[:, :, None] * size[:, None, :])
    z = cells.slope / size
    singular = np.zeros(a.shape[0], dtype=bool)
    pivots = np.empty_like(z)
    for k in range(q):
        pivot = a[:, k, k]
        flat = ~(pivot > _RELATIVE_PIVOT)
        singular |= flat
        pivots[:, k] = np.where(flat, np.inf, pivot)
        for i in range(k + 1, q):
            factor = a[:, i, k] / pivots[:, k]
            a[:, i, k + 1 :] -= factor[:, None] * a[:, k, k + 1 :]
            z[:, i] -= factor * z[:, k]
    minimum = cells.square - (z * z / pivots).sum(axis=1)
    t = np.zeros_like(z)
    for k in reversed(range(q)):
        rest = (a[:, k, k + 1 :] * t[:, k + 1 :]).sum(axis=1)
        t[:, k] = np.where(np.isinf(pivots[:, k]), 0.0, (z[:, k] - rest) / pivots[:, k])
    return t / size, minimum, singular


def _constraints(problem: PiecewiseProblem, cells: _Cells, which: NDArray[np.intp]) -> tuple[Array, Array]:
    """Walls and limits of the chosen cells, (m, walls, q) and (m, walls): the domain, then the two kinks."""
    m = which.size
    walls = np.broadcast_to(problem.walls, (m, *problem.walls.shape))
    limits = np.broadcast_to(problem.limits, (m, problem.limits.size))
    low = cells.low[which, None]
    low_wall = low * problem.bound - problem.kappa
    high = cells.high[which, None]
    open_end = np.isinf(high)
    high = np.where(open_end, 0.0, high)
    high_wall = np.where(open_end, 0.0, problem.kappa - high * problem.bound)
    low_limit = problem.kappa0 - low * problem.bound0
    high_limit = np.where(open_end, 1.0, high * problem.bound0 - problem.kappa0)
    walls = np.concatenate((walls, low_wall[:, None], high_wall[:, None]), axis=1)
    return walls, np.concatenate((limits, low_limit, high_limit), axis=1)


def _inside(t: Array, walls: Array, limits: Array) -> NDArray[np.bool_]:
    """Whether t obeys all constraints, up to rounding."""
    terms = walls * t[:, None, :]
    size = np.abs(terms).sum(axis=2) + np.abs(limits)
    return np.asarray((terms.sum(axis=2) - limits <= _FEASIBLE * size + 1e-300).all(axis=1))


def _solve_cells(problem: PiecewiseProblem, cells: _Cells, which: NDArray[np.intp]) -> tuple[Array, Array]:
    """Constrained minimum of each chosen cell, exactly: the best stationary point over all its faces.

    Faces on which the quadratic is flat are passed over: then a face of lower dimension has the same value.
    """
    walls, limits = _constraints(problem, cells, which)
    gram, slope, square = cells.gram[which], cells.slope[which], cells.square[which]
    m, n_walls, q = walls.shape
    best = np.full(m, np.inf)
    points = np.zeros((m, q))
    for n_active in range(q + 1):
        for active in itertools.combinations(range(n_walls), n_active):
            t, good = _stationary(gram, slope, walls[:, active], limits[:, active])
            good &= _inside(t, walls, limits)
            value = np.einsum("mi,mij,mj->m", t, gram, t) - 2.0 * (slope * t).sum(axis=1) + square
            better = good & (value < best)
            best[better] = value[better]
            points[better] = t[better]
    return best, points


def _stationary(gram: Array, slope: Array, walls: Array, limits: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Stationary points of the quadratics on the faces where the given walls are touched."""
    m, n_active, q = walls.shape
    size = np.sqrt(np.maximum(gram[:, range(q), range(q)], 1e-300))
    norm = np.sqrt(((walls / size[:, None, :]) ** 2).sum(axis=2))
    norm = np.where(norm > 0.0, norm, 1.0)
    system = np.zeros((m, q + n_active, q + n_active))
    system[:, :q, :q] = gram / (size[:, :, None] * size[:, None, :])
    scaled = walls / size[:, None, :] / norm[:, :, None]
    system[:, q:, :q] = scaled
    system[:, :q, q:] = np.swapaxes(scaled, 1, 2)
    right = np.concatenate((slope / size, limits / norm), axis=1)
    determinant = np.linalg.det(system)
    good = np.abs(determinant) > _RELATIVE_PIVOT
    system[~good] = np.eye(q + n_active)
    t = np.linalg.solve(system, right[:, :, None])[:, :q, 0] / size
    return t, good


def _branch(problem: PiecewiseProblem, cells: _Cells) -> tuple[Array, Array, NDArray[np.intp], Array]:
    """Solve cells exactly, lowest bound first, until every other bound lies above the best value + 4.

    Returns the values, points and numbers of the solved cells, and a lower bound of every cell.
    """
    t, minimum, singular = _unconstrained(cells)
    bounds = np.where(singular, 0.0 if problem.pull is None else -np.inf, minimum)
    order = np.argsort(bounds, kind="stable")
    values, points, solved = np.empty(0), np.empty((0, t.shape[1])), np.empty(0, dtype=np.intp)
    start, size, best = 0, 8, np.inf
    while start < order.size:
        reach = best + cells.rounding + (4.0 if start < _MOST_CELLS else 0.0)
        which = order[start : start + size]
        which = which[bounds[which] <= reach]
        if which.size == 0:
            break
        found, where = _solve_cells(problem, cells, which)
        values = np.concatenate((values, found))
        points = np.concatenate((points, where))
        solved = np.concatenate((solved, which))
        bounds[which] = found
        best = float(values.min())
        start, size = start + size, min(4 * size, 65536)
    return values, points, solved, bounds


def _polish(problem: PiecewiseProblem, cells: _Cells, cell: np.intp, t: Array) -> tuple[Array, Array]:
    """Take the rounding of the sums out of a minimiser, and give the frame in which its cell is round.

    Newton steps with residuals from the rows; the constraints that hold t are kept. In the frame the
    cell's Gram matrix is near the identity, so that wide weights cost no digits there.
    """
    count = int(cells.count[cell])
    design = np.concatenate(
        (problem.stick.design[:count], problem.slide.design[count:], problem.always.design)
    )
    target = np.concatenate(
        (problem.stick.target[:count], problem.slide.target[count:], problem.always.target)
    )
    held = _null_space(_held(problem, cells, cell, t), t.size)
    step = _round_frame(design @ held)
    for _ in range(3):
        reduced = design @ held @ step
        downhill = reduced.T @ (target - design @ t) - (held @ step).T @ problem.slope0
        t = t + held @ (step @ downhill)
    return t, _round_frame(design)


def _held(problem: PiecewiseProblem, cells: _Cells, cell: np.intp, t: Array) -> Array:
    """Walls of a cell that t touches."""
    walls, limits = _constraints(problem, cells, np.array([cell]))
    terms = walls[0] * t
    size = np.abs(terms).sum(axis=1) + np.abs(limits[0])
    return np.asarray(walls[0][np.abs(terms.sum(axis=1) - limits[0]) <= 1e-9 * size + 1e-300])


def _round_frame(design: Array) -> Array:
    """Matrix F for which (design F)'(design F) is the identity; flat directions keep their unit."""
    q = design.shape[1]
    if q == 0 or design.shape[0] == 0:
        return np.eye(q)
    # heavy rows first: without it orthogonalisation would drown the light ones
    order = np.argsort(-np.abs(design).max(axis=1), kind="stable")
    triangle: Array = np.asarray(np.linalg.qr(design[order], mode="r"))
    size = np.sqrt((triangle * triangle).sum(axis=0))
    size = np.where(size > 0.0, size, 1.0)
    _, singular, rows = np.linalg.svd(triangle / size)
    singular = np.concatenate((singular, np.zeros(q - singular.size)))
    singular = np.where(singular > 1e-14 * max(singular[0], 1e-300), singular, 1.0)
    return np.asarray((rows.T / singular) / size[:, None])


def _null_space(held: Array, q: int) -> Array:
    """Orthonormal directions along all held walls, (q, free)."""
    if held.shape[0] == 0:
        return np.eye(q)
    _, singular, rows = np.linalg.svd(held)
    rank = int((singular > 1e-12 * singular[0]).sum()) if singular[0] > 0.0 else 0
    return np.asarray(rows[rank:].T)


def _local_minima(
    problem: PiecewiseProblem, cells: _Cells, solved: NDArray[np.intp], values: Array, points: Array
) -> list[tuple[float, Array]]:
    """Distinct local minima within 4 of the least, best first.

    A cell's minimum on a kink is one of the whole only if the cell beyond the kink goes no lower; equal
    neighbours are one minimum.
    """
    near = values <= values.min() + 4.0
    order = np.argsort(solved[near])
    number, value, point = solved[near][order], values[near][order], points[near][order]
    tolerance = max(1e-9 * abs(float(value.min())), cells.rounding, 1e-12)
    kappa, bound = point @ problem.kappa + problem.kappa0, point @ problem.bound + problem.bound0
    neighbours = np.diff(number) == 1
    kink = cells.high[number[:-1]]
    linked = neighbours & (_touches(kappa[:-1], bound[:-1], kink) | _touches(kappa[1:], bound[1:], kink))
    minima: list[tuple[float, Array]] = []
    for chain in np.split(np.arange(number.size), np.flatnonzero(~linked) + 1):
        minima += _descend(value[chain], point[chain], tolerance)
    return sorted(minima, key=lambda item: item[0])


def _touches(kappa: Array, bound: Array, tau: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(kappa - tau * bound) <= 1e-9 * (np.abs(kappa) + np.abs(tau * bound)))


def _descend(values: Array, points: Array, tolerance: float) -> list[tuple[float, Array]]:
    """Local minima of a chain of cells that touch: those with no lower neighbour, plateaus counted once."""
    found = []
    i = 0
    while i < values.size:
        end = i
        while end + 1 < values.size and abs(values[end + 1] - values[i]) <= tolerance:
            end += 1
        left = i > 0 and values[i - 1] < values[i] - tolerance
        right = end + 1 < values.size and values[end + 1] < values[i] - tolerance
        if not left and not right:
            found.append((float(values[i]), points[i]))
        i = end + 1
    return found
