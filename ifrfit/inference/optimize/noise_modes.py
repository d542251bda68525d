"""Least squares where noises are unknown: the modes of the likelihood, and a proof that no better one exists.

With each group's noise at its best for the constants, minus twice the log likelihood is, up to a constant,
Phi(theta) = sum_g n_g log(S_g(theta)/n_g) + the chi2 of the priors and of rows with a known sigma: eq. (12)
of docs/theory/certificate.md. The posterior with the noises integrated out has the same Phi. It may have
several modes, one for each group that is taken at its word while others are called noisy.

The logarithm is concave. Its tangent majorises it, so weights n_g/S_g lead downhill from any theta (13); its
chord over an interval of S_g minorises it, so one certified weighted fit bounds Phi over a box of (S_g) from
below (14), and cutting boxes raises the bound until it meets the best mode.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ifrfit.inference.diagnostics.thresholds import NOISE_GAP
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.aitken import end_of_steps
from ifrfit.inference.optimize.batched_search import BatchedSearch
from ifrfit.inference.optimize.concentrated_likelihood import Minimum
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.multistart import best_start, starts
from ifrfit.inference.optimize.noise_components import (
    Component,
    SolvedComponent,
    least_variance,
    noise_components,
    without_restitution,
)
from ifrfit.inference.optimize.optimum import Array, Optimum
from ifrfit.inference.optimize.piecewise import NEAR
from ifrfit.inference.optimize.solve import solve

_DESCENTS = 30  # weighted fits of one descent, at the most
_AT_REST = 1e-6  # relative change of every S_g; it enters Phi in the second order
_WIDELY = 12  # places all over the domain that are followed to a mode, the lowest after a few steps
_ROUGH_STEPS = 4
_DEGREES_OF_FREEDOM = 200  # iterations of leverage and noise, at the most
_LAST_CHANGE = 1e-10
_CUTS = 60  # boxes that are cut, at the most
_CUTS_OF_GROUPS = 120  # the same, times the number of groups: of many the bound does not close
_ROWS_OF_CUTS = 400_000  # rows of all boxes that are cut: of large tables fewer are
_FEWEST_CUTS = 8
_SAME = 1e-4  # modes nearer than this, in units of each constant's prior sd, are one
_SAME_NOISE = 1e-6  # relative; modes whose noises are nearer than this are one
_SAME_PHI = 1e-3  # and whose Phi are nearer than this
_SLACK = 0.1  # share of `NOISE_GAP` that the fit of a box may be off
_LARGEST = 700.0  # logarithm of a number
_EDGE = 0.1  # a cut keeps this share of the box on either side
_CLOSED = 0.002  # share of `NOISE_GAP` to which cells are bounded: it costs no more than the whole
_MOST_COMBINED = 3  # minima of one component that are combined with those of others
_MOST_PRODUCTS = 1000
_MOST_RIVALS = 16  # modes beside the best


@dataclass(frozen=True)
class Mode:
    """A local minimum of Phi.

    Attributes
    ----------
    value : float
        Phi.
    variance : ndarray, (groups,)
        S_g/n_g of each group.
    optimum : Optimum
        Of the weighted fit whose weights are those of the mode itself.
    """

    value: float
    variance: Array
    optimum: Optimum

    @property
    def theta(self) -> Array:
        """The constants."""
        return self.optimum.theta


@dataclass(frozen=True)
class NoiseModes:
    """Modes of Phi, best first, and how far the best may lie above the global minimum.

    Attributes
    ----------
    modes : tuple of Mode
    gap : float or None
        Phi of the best mode minus a proven lower bound; None where the weighted fits have no proof.
    follows_squares : bool
        Whether Phi rises with the sum of squares, so that plain least squares has the same optimum.
    """

    modes: tuple[Mode, ...]
    gap: float | None
    follows_squares: bool = False

    @property
    def best(self) -> Mode:
        """The mode of the least Phi."""
        return self.modes[0]

    @property
    def rivals(self) -> tuple[tuple[float, Array], ...]:
        """How far each other mode lies above the best, and its theta."""
        return tuple((mode.value - self.best.value, mode.theta) for mode in self.modes[1:])


@dataclass(order=True)
class _Box:
    """Intervals of log(S_g/n_g), a bound of Phi over them, and the fit that gave it."""

    bound: float
    number: int
    low: Array = field(compare=False)
    high: Array = field(compare=False)
    optimum: Optimum = field(compare=False)


def noise_modes(problem: Problem, start: Array | None = None, *, proven: bool = True) -> NoiseModes:
    """Find the modes of Phi and bound it from below.

    Parameters
    ----------
    problem : Problem
        Where no noise is unknown, Phi is chi2.
    start : ndarray, optional
        theta of a neighbouring problem: where only a search can find an optimum, it begins there alone.
    proven : bool
        Whether a bound is needed where it is dear: where series share some constants only.
    """
    search = _Search(problem)
    if search.is_monotone:
        optimum = solve(problem, search.base, start)
        return NoiseModes((search.mode(optimum),), optimum.gap, follows_squares=True)
    components = noise_components(problem)
    if components is not None:
        return search.over_components(components)
    if _share_nothing(problem):
        return search.over_components(
            [search.component(each, noise_modes(each, proven=proven)) for each in problem.by_series]
        )
    split = without_restitution(problem)
    if split is not None:
        rest = noise_modes(split.rest, start, proven=proven)
        return search.over_components([*split.restitution, search.component(split.rest, rest)])
    first = search.solve(search.spread(), start)
    if first.gap is None:
        if start is None:
            search.descend_together([first.theta, *search.optima_of_groups(first.theta)], widely=True)
        else:
            search.descend_together([first.theta])
        return NoiseModes(tuple(search.modes), None)
    search.descend(first)
    if not proven:
        variance = search.modes[0].variance
        search.descend_from_each_group(variance, variance)
        return NoiseModes(tuple(search.modes), None)
    gap = search.prove()
    return NoiseModes(tuple(search.modes), gap if search.all_proven else None)


def _share_nothing(problem: Problem) -> bool:
    """Whether the series share no constant and no noise."""
    separate = all(each.separate or each.fixed is not None for each in problem.parameters)
    return len(problem.series) > 1 and separate and problem.noise.has_unknown and problem.noise.separate


def best_mode_from(problem: Problem, thetas: Sequence[Array]) -> Mode:
    """The best of the modes that lie downhill from some places; nothing is proven of others.

    Parameters
    ----------
    problem : Problem
        With an unknown noise.
    thetas : sequence of ndarray
        Modes of a neighbouring problem.
    """
    search = _Search(problem)
    searched = not problem.closure.bilinear
    if search.is_monotone:
        optimum = solve(problem, search.base, thetas[0] if searched else None)
        return search.mode(optimum)
    if searched:
        search.descend_together(thetas)
        return search.modes[0]
    for theta in thetas:
        search.descend(search.solve(search.variance(theta)))
    return search.modes[0]


def phi(problem: Problem, theta: Array) -> float:
    """Phi at theta, eq. (12)."""
    return _Search(problem).at(theta)[0]


def likely_sigma(problem: Problem, theta: Array) -> Array:
    """Standard uncertainty of each row at the most likely noises, uncorrected for constants, (n,)."""
    search = _Search(problem)
    return search.sigma(search.variance(theta))


@dataclass(frozen=True)
class NoiseAtMode:
    """The noise that goes with a mode, and how far the mode lies above the best.

    Attributes
    ----------
    rise : float
        Of minus twice the log likelihood over the best mode.
    theta : ndarray
    sigma : ndarray, (n,)
        Standard uncertainty of each row.
    dof, squares : ndarray, (groups,)
        Degrees of freedom that each group keeps, and its sum of squares in units of its base.
    """

    rise: float
    theta: Array
    sigma: Array
    dof: Array
    squares: Array


def noise_at_mode(problem: Problem, theta: Array, rise: float) -> NoiseAtMode:
    """Noise of each group at theta: its sum of squares over its number of rows less their leverage.

    The leverage depends on the weights, so both are iterated.
    """
    search = _Search(problem)
    squares = search.variance(theta) * search.sizes
    dof = search.sizes
    for _ in range(_DEGREES_OF_FREEDOM):
        sigma = search.sigma(squares / dof)
        leverage = gaussian_approximation(problem, sigma, theta).leverage
        new = np.maximum(search.sizes - [float(leverage[rows].sum()) for rows in search.groups], 0.5)
        change = float(np.abs(new / dof - 1.0).max())
        dof = new
        if change <= _LAST_CHANGE:
            break
    return NoiseAtMode(rise, theta, search.sigma(squares / dof), dof, squares)


def _combinations(minima: Sequence[Sequence[Minimum]]) -> list[tuple[Minimum, ...]]:
    """The best minimum of every component, every other one beside the best, and what is nearly as good."""

    def rise(chosen: tuple[Minimum, ...]) -> float:
        return sum(one.value - own[0].value for one, own in zip(chosen, minima, strict=True))

    best = tuple(own[0] for own in minima)
    single = [(*best[:i], one, *best[i + 1 :]) for i, own in enumerate(minima) for one in own[1:]]
    few = [own[:_MOST_COMBINED] for own in minima]
    several = [
        chosen
        for chosen in itertools.islice(itertools.product(*few), _MOST_PRODUCTS)
        if sum(one is not first for one, first in zip(chosen, best, strict=True)) > 1
        and rise(chosen) <= 2.0 * NEAR
    ]
    return [best, *sorted(single + several, key=rise)[:_MOST_RIVALS]]


class _Search:
    """Descents from many places, and branch and bound over boxes of the groups' sums of squares."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.groups: Sequence[Index] = list(problem.noise_groups().values())
        self.sizes = np.array([problem.noise.count(rows) for rows in self.groups])
        self.base = problem.noise.base
        self.known = np.flatnonzero(problem.noise.is_given)
        self.modes: list[Mode] = []
        self.all_proven = True  # every weighted fit so far; one that was only searched bounds nothing
        scale = problem.parameters.prior_sd
        self.scale = np.where(np.isfinite(scale) & (scale > 0.0), scale, 1.0)

    @property
    def is_monotone(self) -> bool:
        """Whether Phi rises with the sum of squares: one noise for all rows and no priors, or none at all."""
        if not self.groups:
            return True
        no_prior = all(each.prior is None for each in self.problem.parameters)
        return len(self.groups) == 1 and not self.known.size and no_prior

    def solve(self, variance: Array, near: Array | None = None) -> Optimum:
        """The weighted fit where each group's factor has this variance."""
        return solve(self.problem, self.sigma(variance), near)

    def component(self, part: Problem, found: NoiseModes) -> SolvedComponent:
        """The modes of a part of the rows, whose noises are theirs alone."""
        names = list(self.problem.noise_groups())
        groups = np.array([names.index(name) for name in part.noise_groups()], dtype=np.intp)
        minima = [Minimum(mode.value, mode.variance) for mode in found.modes]
        return SolvedComponent(
            groups, minima, found.best.value - (np.inf if found.gap is None else found.gap)
        )

    def over_components(self, components: Sequence[Component]) -> NoiseModes:
        """Modes and the bound of each component alone, put together."""
        open_ones = sum(not each.is_monotone for each in components)
        solved = [each.solve(_CLOSED * NOISE_GAP / max(open_ones, 1)) for each in components]
        bound = sum(low for _, low in solved)
        near: Array | None = None
        for chosen in _combinations([minima for minima, _ in solved]):
            variance = np.empty(self.sizes.size)
            for each, minimum in zip(components, chosen, strict=True):
                variance[each.groups] = minimum.variance
            optimum = solve(self.problem, self.sigma(variance), near, proven=False)
            near = optimum.theta if near is None else near
            self._add(self.mode(optimum))
        self._add_minima_of_known_rows()
        gap = max(0.0, self.modes[0].value - bound)
        return NoiseModes(tuple(self.modes), gap if np.isfinite(gap) else None)

    def _add_minima_of_known_rows(self) -> None:
        """Add minima of the best weighted fit that change no unknown noise: Phi is higher by their chi2."""
        best = self.modes[0]
        for _, theta in best.optimum.minima[1:] if self.known.size else ():
            mode = self.mode(replace(best.optimum, theta=theta))
            if (np.abs(mode.variance / best.variance - 1.0) <= _SAME_NOISE).all():
                self._add(mode)

    def spread(self) -> Array:
        """Variance of the values of each group, in units of base: weights to begin with."""
        scaled = self.problem.rows.value / self.base
        return np.array([max(float(np.var(scaled[rows])), 1e-12) for rows in self.groups])

    def sigma(self, variance: Array) -> Array:
        """Standard uncertainty of each row where each group's factor has this variance."""
        sigma = self.base.copy()
        for rows, own in zip(self.groups, variance, strict=True):
            sigma[rows] *= np.sqrt(own)
        return sigma

    def variance(self, theta: Array) -> Array:
        """S_g/n_g of each group at theta, kept off zero."""
        return self.at(theta)[1]

    @cached_property
    def _least(self) -> float:
        return least_variance(self.problem)

    def at(self, theta: Array) -> tuple[float, Array]:
        """Phi at theta, and S_g/n_g of each group, kept off zero."""
        residual = self.problem.residual(theta) / self.base
        squares = [float(residual[rows] @ residual[rows]) for rows in self.groups]
        variance = np.array([max(s / n, self._least) for s, n in zip(squares, self.sizes, strict=True)])
        known, prior = residual[self.known], self.problem.parameters.prior_residuals(theta)
        return float(self.sizes @ np.log(variance) + known @ known + prior @ prior), variance

    def mode(self, optimum: Optimum) -> Mode:
        """What a weighted fit is as a mode."""
        return Mode(*self.at(optimum.theta), optimum)

    def descend(self, optimum: Optimum) -> None:
        """Follow the tangents down from an optimum to a mode, and keep it if it is a new one."""
        mode = self.mode(optimum)
        variance, before = mode.variance, np.empty(0)
        for _ in range(_DESCENTS):
            mode = self.mode(solve(self.problem, self.sigma(variance), mode.theta, proven=False))
            step = np.log(mode.variance / variance)
            if np.abs(step).max() <= _AT_REST:
                break
            if self._is_known(mode.theta, mode.value, mode.variance):
                break
            ahead = end_of_steps(before, step) if before.size else None
            variance = mode.variance if ahead is None else mode.variance * np.exp(ahead)
            before = step if ahead is None else np.empty(0)
        self._add(mode)

    def descend_together(self, thetas: Sequence[Array], *, widely: bool = False) -> None:
        """Search for the modes downhill from several places, where only a search can find an optimum.

        `widely` begins from places all over the domain as well; of these ends only one that is better than
        all others counts.
        """
        batch = BatchedSearch.of(self.problem, self.base, self.groups)
        found = batch.run(np.array(thetas), self.sizes)
        ends = list(found.theta[np.argsort(found.value, kind="stable")])
        if widely:
            places = np.array(starts(self.problem))
            rough = batch.run(batch.lowest(places, self.sizes, len(places)), self.sizes, steps=_ROUGH_STEPS)
            lowest = np.argsort(rough.value, kind="stable")[:_WIDELY]
            others = batch.run(rough.theta[lowest], self.sizes)
            if others.value.min() < found.value.min() - _SAME_PHI:
                ends.insert(0, others.theta[int(others.value.argmin())])
        for number, theta in enumerate(ends):
            value, variance = self.at(theta)
            if not self._is_known(theta, value, variance):
                weighted = solve(self.problem, self.sigma(variance), theta, proven=number == 0)
                self._add(self.mode(weighted))

    def optima_of_groups(self, theta: Array) -> list[Array]:
        """The best constants for each group alone, the others counting next to nothing."""
        found, own = [], self.variance(theta)
        for variance in self._each_alone(own, own):
            sigma = self.sigma(variance)
            near = best_start(self.problem, sigma)
            found.append(BatchedSearch.of(self.problem, sigma).run(near[None], np.empty(0)).theta[0])
        return found

    def _each_alone(self, variance: Array, own: Array) -> list[Array]:
        """Variances at which one group counts with its own, and all others, far above theirs, hardly.

        Where sigma of some rows is known, or constants have priors, these count alone in the last.
        """
        has_known = bool(self.known.size) or any(c.prior is not None for c in self.problem.parameters)
        if len(self.groups) + has_known < 2:
            return []
        made = np.tile(1e8 * variance, (len(self.groups) + has_known, 1))
        np.fill_diagonal(made, own)
        return list(made)

    def _add(self, mode: Mode) -> None:
        """Keep a mode if it is a new one, in its order."""
        if not self._is_known(mode.theta, mode.value, mode.variance):
            self.modes.append(mode)
            self.modes.sort(key=lambda mode: mode.value)

    def _is_known(self, theta: Array, value: float, variance: Array) -> bool:
        def same_theta(other: Mode) -> bool:
            both = np.isfinite(theta) & np.isfinite(other.theta)
            return bool((np.abs(theta - other.theta)[both] <= _SAME * self.scale[both]).all())

        def same_noise(other: Mode) -> bool:
            noises = np.abs(variance / other.variance - 1.0)
            # where sigma of some rows is known, modes may differ by these alone
            return bool((noises <= _SAME_NOISE).all()) and abs(value - other.value) <= _SAME_PHI

        return any(same_theta(other) or same_noise(other) for other in self.modes)

    def prove(self) -> float:
        """Cut boxes until their bounds meet the best mode; gives what is left between them."""
        least = self.least_of_each_group()
        self.descend_from_each_group(self.modes[0].variance, np.maximum(least, 1e-12))
        low = np.log(least)
        counter = itertools.count()
        left_out = np.inf  # least bound of the boxes that need no cut
        queue = [self._box(low, self._top(low), next(counter))]
        for _ in range(self._most_cuts):
            if not queue or queue[0].bound >= self.modes[0].value - NOISE_GAP:
                break
            if (queue[0].optimum.gap or 0.0) > NOISE_GAP:
                break  # no box is bounded better than its own fit
            box = heapq.heappop(queue)
            if self.at(box.optimum.theta)[0] <= self.modes[0].value + 2.0 * NEAR:
                self.descend(box.optimum)
            for low, high in self._cut(box):
                high = np.minimum(high, self._top(low))
                if (high < low).any():
                    continue  # nothing in it is as good as the best mode
                part = self._box(low, high, next(counter), at_least=box.bound)
                if part.bound < self.modes[0].value - NOISE_GAP:
                    heapq.heappush(queue, part)
                else:
                    left_out = min(left_out, part.bound)
        lowest = min(left_out, queue[0].bound if queue else np.inf)
        return max(0.0, self.modes[0].value - lowest)

    @property
    def _most_cuts(self) -> int:
        """Boxes that are cut at most; what is left open then shows in the gap."""
        by_size = max(_FEWEST_CUTS, _ROWS_OF_CUTS // len(self.problem.rows))
        return min(_CUTS, _CUTS_OF_GROUPS // len(self.groups), by_size)

    def descend_from_each_group(self, variance: Array, own: Array) -> None:
        """Look for a mode from each group alone, with its own variance; see `_each_alone`."""
        for each in self._each_alone(variance, own):
            self.descend(solve(self.problem, self.sigma(each), proven=False))

    def least_of_each_group(self) -> Array:
        """The least S_g/n_g that any constants give a group, proven."""
        plain = self.problem.with_parameters([replace(each, prior=None) for each in self.problem.parameters])
        found = np.empty(len(self.groups))
        for number, rows in enumerate(self.groups):
            alone = solve(plain.with_rows(rows), self.base[rows])
            self.all_proven &= alone.gap is not None
            found[number] = max((alone.objective - (alone.gap or 0.0)) / self.sizes[number], self._least)
        return found

    def _top(self, low: Array) -> Array:
        """Where each group alone lifts Phi to the best mode, the others at their least."""
        return low + max(self.modes[0].value - float(self.sizes @ low), 0.0) / self.sizes

    def _slope(self, low: Array, high: Array) -> Array:
        """Slope of the chord of log s between e^low and e^high, for each group."""
        return np.asarray(self._drop(low, high) * np.exp(-low))

    def _drop(self, low: Array, high: Array) -> Array:
        """How far that chord falls from e^low to 0: its slope times e^low, which has no number at times."""
        width = high - low
        narrow = width < 1e-9
        with np.errstate(over="ignore"):  # beyond all numbers the chord is level
            rise = np.expm1(np.where(narrow, 1.0, width))
        return np.where(narrow, 1.0, width / rise)

    def _box(self, low: Array, high: Array, number: int, at_least: float = -np.inf) -> _Box:
        """Bound Phi over a box by the certified fit with the chords' slopes for weights."""
        slope = self._slope(low, high)
        with np.errstate(divide="ignore"):  # under a level chord the group has no weight
            variance = 1.0 / slope
        optimum = solve(self.problem, self.sigma(variance), slack=_SLACK * NOISE_GAP)
        self.all_proven &= optimum.gap is not None
        linear = optimum.objective - (optimum.gap or 0.0)
        bound = linear + float(self.sizes @ (low - self._drop(low, high)))
        return _Box(max(bound, at_least), number, low, high, optimum)

    def _cut(self, box: _Box) -> list[tuple[Array, Array]]:
        """Cut a box in the group whose chord lies furthest below the logarithm at the fit."""
        log = np.clip(np.log(self.variance(box.optimum.theta)), box.low, box.high)
        above = log - box.low
        on_chord = self._drop(box.low, box.high) * np.expm1(np.minimum(above, _LARGEST))
        error = self.sizes * (above - on_chord)
        if error.max() <= 0.1 * NOISE_GAP:
            error = self.sizes * (box.high - box.low) ** 2
        at = int(error.argmax())
        edge = _EDGE * (box.high[at] - box.low[at])
        place = min(max(log[at], box.low[at] + edge), box.high[at] - edge)
        lower, upper = box.high.copy(), box.low.copy()
        lower[at] = upper[at] = place
        return [(box.low, lower), (upper, box.high)]
