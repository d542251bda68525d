"""The likelihood with every noise at its best, over the cells of a piecewise problem: minima and a bound.

Phi(t) = sum_g n_g log(S_g(t)/n_g) + P(t), eq. (12) of docs/theory/certificate.md; P is chi2 of the priors and
of rows with a known sigma. In a cell every S_g, and P, is a quadratic. Over a region of it the chords of the
logarithms make one convex quadratic that lies below Phi (14); what that leaves of the region is an ellipsoid,
over which the chords are drawn anew. Regions of all cells are worked at together, and cut where this does not
shrink them.
"""

from __future__ import annotations

import contextlib
import itertools
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.branch_and_bound import branch, minimise
from ifrfit.inference.optimize.piecewise import NEAR, Array, PiecewiseBatch, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_quadratic import PiecewiseQuadratic, cell_constraints, quadratic_of

Index = NDArray[np.intp]
Bool = NDArray[np.bool_]

_DESCENTS = 200  # weighted fits of one descent, at the most
_AT_REST = 1e-9  # relative change of every S_g
_SAME = 1e-5  # relative; minima whose S_g are nearer than this are one
_FIRST = 3  # cells of a weighted fit that are solved first
_MOST_CANDIDATES = 24  # places from which minima are looked for, in one round
_ROUNDS = 60
_MOST_REGIONS = 3000  # worked at in one round
_REGIONS = 12_000  # worked at in all
_SWEEPS = 12  # over the multipliers of the constraints
_SHRUNK = 0.5  # a region whose chords came nearer by this factor is not cut
_FLAT = 1e-10  # relative curvature below which the frame keeps an unknown's own scale
_NARROW = 1e-6  # least half width of a region, in the frame
_STEEPEST = 1e50  # a multiplier, at the most: of a region without a point they grow without end
_FAR = 1e9  # an unknown beyond has no end


@dataclass(frozen=True)
class Minimum:
    """A fixed point of the descent: Phi, and S_g/n_g of each group."""

    value: float
    variance: Array


@dataclass(frozen=True)
class ConcentratedLikelihood:
    """Phi of rows in groups of unknown noise.

    Attributes
    ----------
    problem : PiecewiseProblem
        The rows in units of their base, sorted by tau, about a point near the best fit.
    group, always_group : ndarray of int
        Group of each row with two regimes, and of each without; -1 for those of priors and of known sigma.
    sizes : ndarray, (groups,)
        Rows of each group.
    least : float
        S_g/n_g below which there is nothing but rounding.
    scatter : ndarray, (groups,)
        Variance of the values of each group.
    """

    problem: PiecewiseProblem
    group: Index
    always_group: Index
    sizes: Array
    least: float
    scatter: Array

    @classmethod
    def of(
        cls,
        problem: PiecewiseProblem,
        group: Index,
        always_group: Index,
        sizes: Array,
        least: float,
        scatter: Array,
    ) -> ConcentratedLikelihood:
        """Put rows in order, and take them about the best fit with the scatter for noise."""
        order = np.argsort(problem.tau, kind="stable")
        made = cls(problem.take(order), group[order], always_group, sizes, least, scatter)
        found = branch(made.problem, made._weighted(1.0 / scatter[None]), _FIRST)
        center = found.points[0, int(found.values[0].argmin())]
        return replace(made, problem=made.problem.about(center))

    @cached_property
    def _quadratic(self) -> PiecewiseQuadratic:
        """The quadratics of each group, and of what is known as the last one: a batch of 0/1 weights."""
        labels = [*range(self.sizes.size), -1]
        return quadratic_of(
            PiecewiseBatch(
                self.problem,
                np.array([self.group == label for label in labels], dtype=float),
                np.array([self.always_group == label for label in labels], dtype=float),
            )
        )

    def _weighted(self, weight: Array, known: float = 1.0) -> PiecewiseQuadratic:
        """The quadratics of weighted fits, by the weight of each group's S_g, (b, groups), and of P."""
        weight = np.column_stack((weight, np.full(weight.shape[0], known)))
        each = self._quadratic
        return replace(
            each,
            gram=np.moveaxis(np.tensordot(weight, each.gram, axes=(1, 2)), 0, 2),
            slope=np.moveaxis(np.tensordot(weight, each.slope, axes=(1, 1)), 0, 1),
            square=weight @ each.square,
        )

    @cached_property
    def least_squares(self) -> Array:
        """The least S_g that any constants give each group in each cell, from below, (cells, groups).

        Infinite for all groups of a cell where no constants lie in it.
        """
        each = branch(self.problem, self._weighted(np.eye(self.sizes.size), known=0.0), _FIRST).bounds
        # a group that sees few unknowns may find no corner of a thin cell in which another group does
        thin = np.isinf(each) & np.isfinite(each).any(axis=0)
        each = np.where(thin, each.min(axis=1, keepdims=True), each)
        for g in np.flatnonzero(each.min(axis=1) <= 0.0):
            found = minimise(self._rows_of(int(g)))
            each[g] = np.maximum(each[g], found.chi2 - found.gap)
        each = np.maximum(each, each.min(axis=1, keepdims=True))
        return np.asarray(np.maximum(each.T, self.least * self.sizes))

    @property
    def has_known(self) -> bool:
        """Whether any row counts that has no unknown noise: one of known sigma, or a prior."""
        return bool((self.group < 0).any() or (self.always_group < 0).any())

    @cached_property
    def least_known(self) -> Array:
        """The least P that any constants give in each cell, from below, (cells,)."""
        none = self._weighted(np.zeros((1, self.sizes.size)))
        return np.asarray(np.maximum(branch(self.problem, none, _FIRST).bounds[0], 0.0))

    def _rows_of(self, g: int) -> PiecewiseProblem:
        """The rows of one group alone."""
        rest = self.problem.always.take(self.always_group == g)
        return replace(self.problem.take(np.flatnonzero(self.group == g)), always=rest)

    def phi(self, squares: Array, prior: Array) -> Array:
        """Phi from S_g, (..., groups), and P, (...)."""
        variance = np.maximum(squares / self.sizes, self.least)
        return np.asarray(np.log(variance) @ self.sizes + prior)

    def descend(self, variance: Array, known: list[Minimum]) -> list[Minimum]:
        """Minima of Phi: those known, and the new ones below each of these places, (b, groups); best first.

        Each weighted fit goes to the least value of all cells, so a minimum that is not the best fit at its
        own noises is passed over.
        """
        minima = list(known)
        for _ in range(_DESCENTS):
            if not variance.size:
                break
            new, value = self._step(variance)
            rest = np.abs(new / variance - 1.0).max(axis=1) <= _AT_REST
            for one, own in zip(value[rest].tolist(), new[rest], strict=True):
                if not self._is_among(one, own, minima):
                    minima.append(Minimum(one, own))
            moving = zip(value[~rest].tolist(), new[~rest], strict=True)
            variance = np.array([own for one, own in moving if not self._is_among(one, own, minima)])
        minima += [Minimum(float(self._step(own[None])[1][0]), own) for own in variance]
        return sorted(minima, key=lambda minimum: minimum.value)

    def _is_among(self, value: float, variance: Array, minima: list[Minimum]) -> bool:
        """Whether a place is one of the minima; those that differ in known rows alone differ in Phi."""
        near = _SAME * float(self.sizes.sum())
        return any(
            np.abs(variance / each.variance - 1.0).max() <= _SAME and abs(value - each.value) <= near
            for each in minima
        )

    def _step(self, variance: Array) -> tuple[Array, Array]:
        """S_g/n_g and Phi at the weighted fits with these variances for noises, (b, groups) and (b,)."""
        found = branch(self.problem, self._weighted(1.0 / variance), _FIRST)
        cell = found.values.argmin(axis=1)
        point = found.points[np.arange(cell.size), cell]
        squares = _at(*_of_cells(self._quadratic, cell), point)
        new = np.maximum(squares[:, :-1] / self.sizes, self.least)
        return new, self.phi(squares[:, :-1], squares[:, -1])

    def minima(self) -> list[Minimum]:
        """Minima below the scatter of the values, and below what each group, and P, alone would choose."""
        found = self.descend(self.scatter[None], [])
        if self.sizes.size == 1 and not self.has_known:
            return found
        # the other groups count next to nothing: they only choose among equals
        each = self.least_squares.min(axis=0) / self.sizes
        alone = np.tile(1e8 * found[0].variance, (self.sizes.size + self.has_known, 1))
        np.fill_diagonal(alone, np.maximum(each, 1e-12))
        return self.descend(alone, found)

    def prove(self, minima: list[Minimum], gap: float) -> tuple[list[Minimum], float]:
        """Bound Phi from below; gives all minima, those met on the way too, and the bound.

        Parameters
        ----------
        minima : list of Minimum
        gap : float
            Regions that come within this of the best minimum are left.
        """
        return _Proof(self, minima, gap).run()


def _of_cells(quadratic: PiecewiseQuadratic, cell: Index) -> tuple[Array, Array, Array]:
    """Gram matrices (k, groups + 1, q, q), slopes and squares of chosen cells."""
    gram = np.moveaxis(quadratic.gram[..., cell], (3, 2), (0, 1))
    return gram, np.moveaxis(quadratic.slope[..., cell], (2, 1), (0, 1)), quadratic.square[:, cell].T


def _inverses(matrices: Array) -> Array:
    """Inverse of each matrix, (m, q, q); of one that is singular to all its digits, what is not a number."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        found = np.full_like(matrices, np.nan)
        for own, inverse in zip(matrices, found, strict=True):
            with contextlib.suppress(np.linalg.LinAlgError):
                inverse[...] = np.linalg.inv(own)
        return found


def _at(gram: Array, slope: Array, square: Array, point: Array) -> Array:
    """Values of quadratics (k, g) at a point each, (k, q)."""
    curved = (gram @ point[:, None, :, None])[..., 0]
    return np.asarray(((curved - 2.0 * slope) * point[:, None]).sum(axis=2) + square)


def _corners(constraints: Array, limits: Array) -> Array:
    """Corners of the polytope constraints @ t <= limits, (k, q)."""
    q = constraints.shape[1]
    scale = np.abs(constraints).max(axis=1, keepdims=True)
    constraints, limits = constraints / scale, limits / scale[:, 0]
    sets = np.array(list(itertools.combinations(range(limits.size), q)))
    system = constraints[sets]
    good = np.abs(np.linalg.det(system)) > 1e-12
    found = np.linalg.solve(system[good], limits[sets[good]][..., None])[..., 0]
    terms = constraints * found[:, None]
    slack = 1e-9 * (np.abs(terms).sum(axis=2) + np.abs(limits))
    return np.asarray(found[(terms.sum(axis=2) <= limits + slack).all(axis=1)])


@dataclass(frozen=True)
class _Regions:
    """k parts of cells: boxes in the frame, with what is known of each group's S_g there.

    Attributes
    ----------
    cell : ndarray of int, (k,)
    low, high : ndarray, (k, q)
    least, most : ndarray, (k, groups)
        Between which S_g lies wherever Phi is low.
    bound : ndarray, (k,)
        Of Phi.
    """

    cell: Index
    low: Array
    high: Array
    least: Array
    most: Array
    bound: Array

    def take(self, which: Index | Bool) -> _Regions:
        """Some of them."""
        return _Regions(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    @classmethod
    def join(cls, parts: list[_Regions]) -> _Regions:
        """Several together."""
        return cls(*(np.concatenate([getattr(p, n) for p in parts]) for n in cls.__dataclass_fields__))


class _Proof:
    """Branch and bound over regions of all cells."""

    def __init__(self, likelihood: ConcentratedLikelihood, minima: list[Minimum], gap: float) -> None:
        self.likelihood = likelihood
        self.minima = minima
        self.gap = gap
        self.rounding = 4.0 * likelihood._quadratic.rounding

    @property
    def target(self) -> float:
        """Regions above this are left."""
        return self.minima[0].value - self.gap

    def run(self) -> tuple[list[Minimum], float]:
        """Work at all regions until none is left, or too many are."""
        q = self.likelihood.problem.kappa.size
        if q == 0:
            return self.minima, self.minima[0].value
        regions = self._first()
        if regions is None:
            return self.minima, -np.inf
        count = 0
        for number in range(_ROUNDS):
            regions = regions.take(regions.bound < self.target)
            count += regions.cell.size
            if not regions.cell.size or regions.cell.size > _MOST_REGIONS or count > _REGIONS:
                break
            regions = self._round(regions, look=number < 2)
        return self.minima, float(min(self.target, regions.bound.min(initial=np.inf)))

    def _first(self) -> _Regions | None:
        """All cells that may hold a Phi as low as a mode worth knowing; None where one has no end."""
        made = self.likelihood
        least = made.least_squares
        floor = made.phi(least, made.least_known)
        high = self.minima[0].value + 2.0 * NEAR
        near = np.flatnonzero(floor < high)
        with np.errstate(over="ignore"):
            most = least * np.exp(np.maximum(high - floor, 0.0)[:, None] / made.sizes)
        last = -1 if np.isfinite(least[-1]).all() else int(floor.argmin())  # where there is no last cell
        ends = self._ends(least[last], most[last], high)
        if ends is None:
            return None
        self._into_frame(ends)
        k, q = near.size, self.box[0].size
        return _Regions(
            near,
            np.broadcast_to(self.box[0], (k, q)).copy(),
            np.broadcast_to(self.box[1], (k, q)).copy(),
            least[near],
            most[near],
            np.full(k, -np.inf),
        )

    def _ends(self, least: Array, most: Array, high: float) -> tuple[Array, Array] | None:
        """The domain as a bounded polytope: constraints and limits; None where it has no end.

        Beyond the largest tau every row sticks. There an unknown without an upper limit is limited by the
        groups that see it still, where there are such; else it changes nothing any more.
        """
        p = self.likelihood.problem
        q = p.kappa.size
        unit = np.eye(q)
        corners = _corners(np.concatenate((p.constraints, unit)), np.append(p.limits, np.full(q, _FAR)))
        if not len(corners):
            return None
        size = np.abs(corners).max(axis=0)
        is_open = size >= 0.1 * _FAR
        linked = p.kappa != 0.0
        inside = corners[(np.abs(corners[:, ~linked]) < 0.1 * _FAR).all(axis=1)]
        edge = np.abs(inside @ np.where(linked, 0.0, p.bound) + p.bound0).max(initial=0.0)
        tau = float(p.tau.max(initial=0.0))
        cap = 1.01 * (tau * float(edge) + abs(p.kappa0)) / float(np.abs(p.kappa).max(initial=1e-300)) + 1.0
        gram, slope, square = (x[0] for x in _of_cells(self.likelihood._quadratic, np.array([-1])))
        weight, constant = self._chords(least, most)
        whole, down = np.tensordot(weight, gram, 1), weight @ slope
        seen = np.diag(whole) > 0.0
        if (is_open & ~seen & ~linked).any():
            return None
        # where an unknown has an end, a parabola that is nowhere above zero makes the matrix regular
        whole = whole + np.diag(np.where(is_open, 0.0, 1.0 / np.maximum(size, 1e-300) ** 2))
        constant = constant + float(weight @ square) - float((~is_open).sum())
        kept = np.flatnonzero(seen | ~is_open)
        if (is_open & seen).any():
            (inverse,) = _inverses(whole[np.ix_(kept, kept)][None])
            if not np.isfinite(inverse).all():
                return None
            center = inverse @ down[kept]
            left = max(high - (constant - float(down[kept] @ center)), 0.0)
            far = center + np.sqrt(left * np.maximum(np.diag(inverse), 0.0))
            cap = max(cap, float(far[(is_open & seen)[kept]].max()))
        caps = np.full(int(is_open.sum()), 4.0 * cap)
        constraints = np.concatenate((p.constraints, unit[is_open]))
        return constraints, np.append(p.limits, caps)

    def _into_frame(self, ends: tuple[Array, Array]) -> None:
        """Take all quadratics and constraints into a frame where the best minimum is round."""
        made = self.likelihood
        p, quadratic = made.problem, made._quadratic
        weight = np.append(1.0 / self.minima[0].variance, 1.0)
        best = branch(p, made._weighted(weight[None, :-1]), _FIRST)
        cell = int(best.values[0].argmin())
        corners = _corners(*ends)
        width = np.maximum(corners.max(axis=0) - corners.min(axis=0), 1e-300)
        scaled = np.tensordot(weight, _of_cells(quadratic, np.array([cell]))[0][0], 1) * np.outer(
            width, width
        )
        value, vector = np.linalg.eigh(scaled)
        value = np.maximum(value, max(_FLAT * float(value.max(initial=0.0)), 1.0))
        frame = width[:, None] * vector / np.sqrt(value)
        every = np.arange(quadratic.n_cells)
        gram, slope, self.square = _of_cells(quadratic, every)
        self.gram, self.slope = frame.T @ gram @ frame, slope @ frame
        bounded = replace(p, constraints=ends[0], limits=ends[1])
        constraints, self.limits = cell_constraints(bounded, quadratic.low, quadratic.high)
        self.constraints = constraints @ frame
        placed = np.linalg.solve(frame, corners.T).T
        slack = 1e-9 * (1.0 + np.abs(placed).max(axis=0))
        self.box = placed.min(axis=0) - slack, placed.max(axis=0) + slack

    def _chords(self, least: Array, most: Array) -> tuple[Array, Array]:
        """Weights of the chords with the priors' 1, (..., groups + 1), and their constants, (...)."""
        sizes = self.likelihood.sizes
        width = np.log(most / least)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(width > 1e-9, width / (most - least), 1.0 / least)
        constant = (np.log(least / sizes) - slope * least) @ sizes
        ones = np.ones((*slope.shape[:-1], 1))
        return np.concatenate((sizes * slope, ones), axis=-1), constant

    def _round(self, regions: _Regions, *, look: bool) -> _Regions:
        """Bound all regions, shrink them, and cut those that did not shrink."""
        sizes = self.likelihood.sizes
        regions = self._with_ranges(regions)
        gram, slope, square = (x[regions.cell] for x in (self.gram, self.slope, self.square))
        center, half = 0.5 * (regions.low + regions.high), 0.5 * (regions.high - regions.low)
        q = center.shape[1]
        weight, constant = self._chords(regions.least, regions.most)
        matrix = np.einsum("kg,kgij->kij", weight, gram)
        down = np.einsum("kg,kgi->ki", weight, slope)
        constant = constant + (weight * square).sum(axis=1)
        # a parabola that is nowhere above zero in the box: it makes the matrix regular
        half = np.maximum(half, _NARROW)
        extra = 1e-3 * self.gap / (q * half * half)
        matrix[:, range(q), range(q)] += extra
        down = down + extra * center
        constant = constant + (extra * (center * center - half * half)).sum(axis=1)
        inverse = _inverses(matrix)
        point, value = self._dual(regions, matrix, down, inverse)
        squares = _at(gram, slope, square, point)
        size = squares + 2.0 * np.abs((slope @ point[..., None])[..., 0]) + square
        error = self.rounding * ((weight * np.abs(size)).sum(axis=1) + np.abs(constant) + np.abs(value))
        # what is not a number tells nothing: fmax and fmin pass it over
        bound = np.fmax(regions.bound, constant + value - error)
        if look and regions.cell.size:
            self._look(regions.cell, squares)
        left = self.target - (constant + value - error)
        kept = ~(bound >= self.target)
        rise = np.maximum(left, 0.0)
        half_width = np.sqrt(rise[:, None] * np.maximum(inverse[:, range(q), range(q)], 0.0))
        gradient = 2.0 * ((gram @ point[:, None, :, None])[..., 0] - slope)[:, :-1]
        steep = np.einsum("kgi,kij,kgj->kg", gradient, inverse, gradient)
        swing = np.sqrt(np.maximum(steep, 0.0) * rise[:, None])
        own, slack = squares[:, :-1], self.rounding * size[:, :-1]
        before = (sizes * np.log(regions.most / regions.least) ** 2).sum(axis=1)
        new = _Regions(
            regions.cell,
            np.fmax(regions.low, point - half_width),
            np.fmin(regions.high, point + half_width),
            np.fmax(regions.least, own - swing - slack),
            np.fmin(regions.most, own + swing + rise[:, None] / weight[:, :-1] + slack),
            bound,
        )
        kept &= (new.low <= new.high).all(axis=1) & (new.least <= new.most).all(axis=1)
        new, before, gradient = new.take(kept), before[kept], gradient[kept]
        after = (sizes * np.log(new.most / new.least) ** 2).sum(axis=1)
        shrunk = after <= _SHRUNK * before
        halves = self._cut(new.take(~shrunk), gram[kept][~shrunk], gradient[~shrunk])
        return _Regions.join([new.take(shrunk), *halves])

    def _with_ranges(self, regions: _Regions) -> _Regions:
        """Regions with S_g bounded by its tangent plane and its curvature over the box."""
        gram, slope, square = (x[regions.cell][:, :-1] for x in (self.gram, self.slope, self.square))
        center, half = 0.5 * (regions.low + regions.high), 0.5 * (regions.high - regions.low)
        turned = (gram @ center[:, None, :, None])[..., 0]
        value = ((turned - 2.0 * slope) * center[:, None]).sum(axis=2) + square
        far = np.abs(center) + half
        curved = (np.abs(gram) @ far[:, None, :, None])[..., 0]
        slack = self.rounding * (((curved + 2.0 * np.abs(slope)) * far[:, None]).sum(axis=2) + square)
        swing = (2.0 * np.abs(turned - slope) * half[:, None]).sum(axis=2)
        bend = ((np.abs(gram) @ half[:, None, :, None])[..., 0] * half[:, None]).sum(axis=2)
        made = replace(
            regions,
            least=np.fmax(regions.least, value - swing - slack),
            most=np.fmin(regions.most, value + swing + bend + slack),
        )
        return made.take(np.flatnonzero((made.least <= made.most).all(axis=1)))

    def _dual(self, regions: _Regions, matrix: Array, down: Array, inverse: Array) -> tuple[Array, Array]:
        """Lower bounds of quadratics over their regions by Lagrange's dual, and where they lie.

        Any multipliers give a bound, so their ascent may end early.
        """
        k, q = down.shape
        ends = np.broadcast_to(np.eye(q), (k, q, q))
        constraints = np.concatenate((self.constraints[regions.cell], ends, -ends), axis=1)
        limits = np.concatenate((self.limits[regions.cell], regions.high, -regions.low), axis=1)
        start = (inverse @ down[..., None])[..., 0]
        excess = (constraints @ start[..., None])[..., 0] - limits
        mixed = 0.5 * constraints @ inverse @ np.swapaxes(constraints, 1, 2)
        diagonal = np.einsum("kii->ki", mixed)
        diagonal = np.where(diagonal > 0.0, diagonal, 1.0)
        active = np.flatnonzero((excess > 0.0).any(axis=0))
        multiplier = np.zeros_like(limits)
        if active.size:
            for _ in range(_SWEEPS):
                for i in range(limits.shape[1]):
                    ahead = (excess[:, i] - (mixed[:, i] * multiplier).sum(axis=1)) / diagonal[:, i]
                    multiplier[:, i] = np.clip(multiplier[:, i] + ahead, 0.0, _STEEPEST)
        pulled = down - 0.5 * (np.swapaxes(constraints, 1, 2) @ multiplier[..., None])[..., 0]
        point = (inverse @ pulled[..., None])[..., 0]
        # what the inverse has lost in digits counts against the bound
        rest = pulled - (matrix @ point[..., None])[..., 0]
        lost = np.abs((point * rest).sum(axis=1)) + np.abs(np.einsum("ki,kij,kj->k", rest, inverse, rest))
        return point, -(pulled * point).sum(axis=1) - (multiplier * limits).sum(axis=1) - 2.0 * lost

    def _look(self, cell: Index, squares: Array) -> None:
        """Descend from the lowest places that were met, one of each valley of the cells."""
        made = self.likelihood
        value = made.phi(squares[:, :-1], squares[:, -1])
        order = np.lexsort((value, cell))
        order = order[np.concatenate(([True], np.diff(cell[order]) > 0))]  # the best of each cell
        values, cells = value[order], cell[order]
        beside = np.concatenate(([np.inf], np.where(np.diff(cells) == 1, values[:-1], np.inf)))
        behind = np.concatenate((np.where(np.diff(cells) == 1, values[1:], np.inf), [np.inf]))
        lowest = (values <= beside) & (values <= behind) & (values <= self.minima[0].value + 2.0 * NEAR)
        chosen = order[lowest][np.argsort(values[lowest])][:_MOST_CANDIDATES]
        variance = np.maximum(squares[chosen, :-1] / made.sizes, made.least)
        self.minima = made.descend(variance, self.minima)

    def _cut(self, regions: _Regions, gram: Array, gradient: Array) -> list[_Regions]:
        """Halve each box along the axis on which the logarithms of S_g vary most."""
        if not regions.cell.size:
            return []
        half = 0.5 * (regions.high - regions.low)
        q = half.shape[1]
        curved = gram[:, :-1][..., range(q), range(q)] * half[:, None] ** 2
        change = (np.abs(gradient) * half[:, None] + curved) / regions.least[..., None]
        change = np.minimum(change, np.log(regions.most / regions.least)[..., None] + 1e-300)
        axis = np.einsum("g,kgi->ki", self.likelihood.sizes, change * change).argmax(axis=1)
        at = np.arange(axis.size), axis
        middle = 0.5 * (regions.low[at] + regions.high[at])
        lower, upper = regions.high.copy(), regions.low.copy()
        lower[at] = upper[at] = middle
        return [replace(regions, high=lower), replace(regions, low=upper)]
