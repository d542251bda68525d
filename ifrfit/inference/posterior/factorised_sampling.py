"""Importance sampling where series have constants of their own: given what they share, series by series.

Eq. (19) to (21) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.thresholds import SAMPLING_ERROR
from ifrfit.inference.distributions.draws import Draws, WeightedDraws, kappa_draws
from ifrfit.inference.distributions.protocol import transition_name
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior.constants_density import FactorisedDensity, SeriesFactor
from ifrfit.inference.posterior.importance_posterior import TARGET, ImportancePosterior
from ifrfit.inference.posterior.importance_sampling import (
    EvidenceByDraws,
    known_modes,
    noise_marginals,
    standard_error,
    with_kept_rows,
)
from ifrfit.inference.posterior.importance_weights import (
    REPLICATES,
    believed_evidence,
    effective_share,
    replicated_evidence,
    tempered,
)
from ifrfit.inference.posterior.marginals import Marginal
from ifrfit.inference.posterior.mixture_proposal import (
    Array,
    Beside,
    Component,
    MixtureProposal,
    lattice,
)
from ifrfit.inference.posterior.proposal_adaptation import (
    FITTED,
    Gaussian,
    component_about,
    fitted_components,
    fitted_proposal,
    further_seeds,
)

_TRIED = 512, 512, 1024, 2048  # points of each round of adaptation
_EVEN = 0.4  # effective share of the points of a later round after which no other one follows
_TRIED_OF_SERIES = 16  # points of a series at each of them
_FLATTENED = 0.2  # power of the weights of half of what the laws of series are fitted to
_TEMPERED = 0.15  # least effective share of the points that laws are fitted to
_FIRST = 256  # points of each replicate to begin with
_OF_SERIES = 4  # points of a series at each of them, for each of its constants
_FITTED, _STEPS, _KEPT = 1024, 8, 6  # points and steps of a fit, components of a series
_RARER = 4  # so many times fewer points to begin with where true angles are integrated out
_BESIDE = replace(FITTED, long=0.25)  # what laws of shared coordinates have beside their components
_AT_FIRST = Beside(wide=0.3, factor=4.0, uniform=0.2)  # the same about known modes
_OF_A_SERIES = Beside(wide=0.15, factor=5.0, long=0.1, uniform=0.25)  # and the laws of series
_WORK, _MOST_WORK = 8e6, 25e6  # as of importance sampling without factors
_DRAWS = 65_536  # joint draws at most


@dataclass(frozen=True)
class _Laws:
    """What is drawn from: shared coordinates, and those of each series given them."""

    shared: MixtureProposal | None
    series: tuple[MixtureProposal, ...]

    @property
    def cost(self) -> float:
        """Of one point of each series, in rows."""
        return float(sum(law.n_laws * law.domain.dimensions for law in self.series))


@dataclass(frozen=True)
class _Points:
    """Shared coordinates with points of each series at each of them.

    Attributes
    ----------
    shared : ndarray, (n, k)
    log_outer : ndarray, (n,)
        Log of the prior of shared coordinates over the density that they were drawn from.
    series : tuple of ndarray, (n, m, k + own)
    log_inner : tuple of ndarray, (n, m)
        Log of each factor over the density that its points were drawn from.
    squares : tuple of ndarray, (n, m, groups)
    """

    shared: Array
    log_outer: Array
    series: tuple[Array, ...]
    log_inner: tuple[Array, ...]
    squares: tuple[Array, ...]

    @property
    def log_weights(self) -> Array:
        """Log of the unbiased estimate of the marginal density over the one drawn from, (n,)."""
        each = [special.logsumexp(log_w, axis=1) - math.log(log_w.shape[1]) for log_w in self.log_inner]
        return np.asarray(self.log_outer + np.sum(each, axis=0))

    def of_series(self, number: int, log_weights: Array) -> Array:
        """Log weight of each point of a series, (n, m), from those of the shared coordinates."""
        log_w = self.log_inner[number]
        with np.errstate(invalid="ignore"):
            inner = log_w - special.logsumexp(log_w, axis=1, keepdims=True)
        return np.asarray(log_weights[:, None] + np.where(np.isnan(inner), -np.inf, inner))

    def joined(self, other: _Points) -> _Points:
        """Those of another set behind these, replicate by replicate."""

        def interleaved(a: Array, b: Array) -> Array:
            parts = [x.reshape(REPLICATES, x.shape[0] // REPLICATES, *x.shape[1:]) for x in (a, b)]
            return np.concatenate(parts, axis=1).reshape(a.shape[0] + b.shape[0], *a.shape[1:])

        return _Points(
            interleaved(self.shared, other.shared),
            interleaved(self.log_outer, other.log_outer),
            tuple(map(interleaved, self.series, other.series)),
            tuple(map(interleaved, self.log_inner, other.log_inner)),
            tuple(map(interleaved, self.squares, other.squares)),
        )


def sample_by_series(
    problem: Problem, start: LeastSquaresFit | None = None, seed: int = 0, *, target: float = TARGET
) -> ImportancePosterior:
    """Sample the posterior of a problem with constants of each series, until standard errors are small.

    Of 38 drawn tables 33 converge, and 16 by points of all constants together, which take 1.4 times the
    seconds in all (decision 18).

    Parameters
    ----------
    problem : Problem
        With a free constant of each of several series.
    start : LeastSquaresFit, optional
        The certified optimum, where it is known already.
    seed : int
    target : float
        Standard error, in sd, at which sampling ends.
    """
    start = least_squares(problem) if start is None else start
    rng = np.random.default_rng(seed)
    sampler = _Sampler(FactorisedDensity(problem), rng)
    laws = sampler.adapted(known_modes(sampler.density.whole, start))
    return sampler.sample(laws, target)


class EvidenceBySeries(EvidenceByDraws):
    """By points of each series, given what series share."""

    def __init__(self, problem: Problem, start: LeastSquaresFit, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        self._density = FactorisedDensity(problem)
        sampler = _Sampler(self._density, self._rng)
        self._laws = sampler.adapted(known_modes(self._density.whole, start))
        self._points = sampler.enough_for_evidence(self._laws)
        self._factors: dict[int, Array] = {}

    def evidence(self) -> tuple[float, float]:
        """Log evidence and its standard error."""
        return believed_evidence(self._points.log_weights)

    def evidence_of(self, kept: Index) -> tuple[float, float]:
        """The same where one series has lost rows; the error is infinite where several have."""
        problem = self._density.problem
        lost = np.unique(np.delete(problem.rows.series, kept))
        if lost.size > 1:
            return math.nan, math.inf
        number, density = int(lost[0]), FactorisedDensity(with_kept_rows(problem, kept))
        if density.whole.coordinates != self._density.whole.coordinates:
            return math.nan, math.inf
        flat = _flat(self._points.series[number])
        if number not in self._factors:
            self._factors[number] = self._density.factors[number](flat)[0]
        log_inner = self._points.log_inner[number]
        gain = density.factors[number](flat)[0] - self._factors[number]
        moved = list(self._points.log_inner)
        moved[number] = log_inner + gain.reshape(log_inner.shape)
        points = replace(self._points, log_inner=tuple(moved))
        found, error = believed_evidence(points.log_weights)
        if error <= SAMPLING_ERROR:
            return found, error
        sampler = _Sampler(density, self._rng)
        points = sampler.enough_for_evidence(sampler.fitted(self._laws, points), at_first=True)
        return believed_evidence(points.log_weights)


class _Sampler:
    """Draws from laws, and what follows from the draws."""

    def __init__(self, density: FactorisedDensity, rng: np.random.Generator) -> None:
        self.density, self._rng = density, rng
        # fewer points where each takes long
        self._rarer = 1 if density.whole.cost_of_row == 1 else _RARER

    def _points(self, laws: _Laws, shared: Array, m: Sequence[int]) -> _Points:
        """Points of each series at shared coordinates."""
        density, rng = self.density, self._rng
        log_outer = density.coordinates.log_prior(shared)
        if laws.shared is not None:
            log_outer = log_outer - laws.shared.log_density(shared[None])[0]
        series, log_inner, squares = [], [], []
        for factor, law, count in zip(density.factors, laws.series, m, strict=True):
            turned = lattice(count, np.zeros(1 + law.own)) + rng.random((shared.shape[0], 1, 1 + law.own))
            at = law.draw(np.clip(turned % 1.0, 1e-12, 1.0 - 1e-12), shared)
            flat = _flat(at)
            log_p, square = factor(flat)
            series.append(at)
            log_inner.append(log_p.reshape(at.shape[:2]) - law.log_density(at))
            squares.append(square.reshape(*at.shape[:2], square.shape[1]))
        return _Points(shared, log_outer, tuple(series), tuple(log_inner), tuple(squares))

    def adapted(self, modes: Sequence[Gaussian]) -> _Laws:
        """Laws near to the posterior, fitted to points of those before them."""
        laws = self._about(modes)
        for number, n in enumerate(each // self._rarer for each in _TRIED):
            shared = self._shared(laws, n, self._rng.random(1 + len(self.density.shared)))
            points = self._points(laws, shared, [_TRIED_OF_SERIES] * len(laws.series))
            laws = self.fitted(laws, points)
            if number > 0 and effective_share(points.log_weights) >= _EVEN:
                break
        return laws

    def _about(self, modes: Sequence[Gaussian]) -> _Laws:
        """Laws about known modes, with wide tails."""
        density = self.density
        shared = list(density.shared)
        outer = None
        if shared:
            near = [
                component_about(density.coordinates, c[shared], v[np.ix_(shared, shared)]) for c, v in modes
            ]
            shares = np.full(len(near), 1.0 / len(near))
            outer = MixtureProposal(density.coordinates, tuple(near), shares, _AT_FIRST)
        series = []
        for factor in density.factors:
            places = np.ix_(factor.places, factor.places)
            each = [component_about(factor.coordinates, c[factor.places], v[places]) for c, v in modes]
            series.append(_law_of_series(factor, np.full(len(each), 1.0 / len(each)), each))
        return _Laws(outer, tuple(series))

    def fitted(self, laws: _Laws, points: _Points) -> _Laws:
        """Laws fitted to weighted points."""
        density, rng = self.density, self._rng
        log_weights = tempered(points.log_weights, _TEMPERED)
        outer = laws.shared
        if outer is not None:
            start = further_seeds(outer.all_components, points.shared, log_weights, rng)
            outer = fitted_proposal(
                density.coordinates,
                points.shared,
                log_weights,
                rng,
                start,
                beside=_BESIDE,
                resampled=2048,
                steps=10,
            )
        # laws of series have to hold wherever shared coordinates are drawn, not where the posterior is alone
        flatter = np.logaddexp(
            special.log_softmax(log_weights), special.log_softmax(_FLATTENED * points.log_weights)
        )
        series = []
        for number, (factor, law) in enumerate(zip(density.factors, laws.series, strict=True)):
            at = points.series[number]
            flat, weights = _flat(at), points.of_series(number, flatter).reshape(-1)
            start = further_seeds(law.components, flat, weights, rng)
            shares, fitted = fitted_components(
                factor.coordinates, flat, weights, rng, start, resampled=_FITTED, steps=_STEPS, most=_KEPT
            )
            series.append(_law_of_series(factor, shares, fitted))
        return _Laws(outer, tuple(series))

    def _shared(self, laws: _Laws, n: int, shift: Array, *, finer: bool = False) -> Array:
        """Shared coordinates from a lattice, (n, k)."""
        if laws.shared is None:
            return np.zeros((n, 0))
        return np.asarray(laws.shared.draw(lattice(n, shift, finer=finer)[None])[0])

    def sample(self, laws: _Laws, target: float) -> ImportancePosterior:
        """Draw finer and finer lattices until standard errors, in sd, are no more than `target`."""
        lattices = self._lattices(laws)
        while True:
            points, work = next(lattices)
            found = self._posterior(points)
            if work > (_WORK if found.converged else _MOST_WORK):
                return found
            if found.converged and found.error <= target and found.error_evidence <= TARGET:
                return found

    def enough_for_evidence(self, laws: _Laws, *, at_first: bool = False) -> _Points:
        """Lattices as fine as the evidence needs; `at_first`: one alone where few points count."""
        lattices = self._lattices(laws)
        while True:
            points, work = next(lattices)
            _, error = believed_evidence(points.log_weights)
            if error <= TARGET or work > (_WORK if error <= SAMPLING_ERROR else _MOST_WORK):
                return points
            if at_first and math.isinf(error):
                return points

    def _lattices(self, laws: _Laws) -> Iterator[tuple[_Points, float]]:
        """Finer and finer lattices, each with the work of the next one."""
        shifts = self._rng.random((REPLICATES, 1 + len(self.density.shared)))
        m = [_OF_SERIES * max(law.own, 1) for law in laws.series]
        rows = len(self.density.problem.rows) * self.density.whole.cost_of_row
        cost = float(np.mean(m)) * (rows + laws.cost + 20.0 * len(laws.series))

        def drawn(n: int, *, finer: bool) -> _Points:
            shared = [self._shared(laws, n, shift, finer=finer) for shift in shifts]
            return self._points(laws, np.concatenate(shared), m)

        n = _FIRST // self._rarer
        points = drawn(n, finer=False)
        while True:
            yield points, 2 * n * REPLICATES * cost
            points = points.joined(drawn(n, finer=True))
            n *= 2

    def _posterior(self, points: _Points) -> ImportancePosterior:
        """All replicates together, with the standard error of their mean."""
        problem = self.density.problem
        log_weights = points.log_weights
        outer = special.softmax(log_weights)
        parts: list[WeightedDraws] = []
        noises: dict[str, Marginal] = {}
        errors: list[float] = []
        values, joint = self._joint(points, outer)
        drawn = Draws.of(problem, values)
        if points.shared.shape[1]:
            shared = self.density.coordinates.named(points.shared)
            if not _kappas_differ(problem):
                shared |= kappa_draws(problem, shared)
            parts.append(WeightedDraws(shared, {}, outer))
        for number, factor in enumerate(self.density.factors):
            weights = special.softmax(points.of_series(number, log_weights)).reshape(-1)
            part = self._part(factor, _flat(points.series[number]), weights)
            squares = _flat(points.squares[number])
            own = noise_marginals(factor.noises, weights, squares)
            noises |= own
            errors.append(standard_error(part.values, weights, own, factor.noises, squares))
            parts.append(part)
        if points.shared.shape[1]:
            errors.append(standard_error(parts[0].values, outer, {}, {}, np.empty((outer.size, 0))))
        log_evidence, error_evidence = replicated_evidence(log_weights)
        return ImportancePosterior(
            drawn.values,
            drawn.transitions,
            joint,
            problem,
            log_evidence,
            max(errors),
            error_evidence,
            SAMPLING_ERROR,
            max(float(part.weights.max()) for part in parts),
            noises,
            tuple(parts),
        )

    def _part(self, factor: SeriesFactor, at: Array, weights: Array) -> WeightedDraws:
        """Constants of a series, its kappa and transition, with weights of their own."""
        problem = self.density.problem
        named = factor.coordinates.named(at)
        entries = {name: named.get(name, np.zeros(weights.size)) for name in problem.parameters.free_names}
        found = Draws.of(problem, entries)
        own = {c.domain.name for c in factor.coordinates.each[len(factor.shared) :]}
        transition = transition_name(problem.series[factor.number])
        if _kappas_differ(problem):
            own.add(problem.parameters.kappas[factor.number].name)
        values = {name: v for name, v in found.values.items() if name in own}
        return WeightedDraws(values, {transition: found.transitions[transition]}, weights)

    def _joint(self, points: _Points, outer: Array) -> tuple[dict[str, Array], Array]:
        """Joint draws by name with their weights: at each shared point one of every series, several times."""
        rng, density = self._rng, self.density
        n = outer.size
        times = max(1, min(_DRAWS // n, max(log_w.shape[1] for log_w in points.log_inner)))
        found = {name: np.repeat(v, times) for name, v in density.coordinates.named(points.shared).items()}
        for number, factor in enumerate(density.factors):
            log_w = points.log_inner[number]
            with np.errstate(invalid="ignore"):
                inner = np.nan_to_num(special.softmax(log_w, axis=1), nan=1.0 / log_w.shape[1])
            up_to = np.cumsum(inner, axis=1)
            up_to /= up_to[:, -1:]
            places = (np.arange(times) + rng.random((n, 1))) / times
            rows = np.arange(n)[:, None]
            chosen = np.searchsorted((up_to + rows).reshape(-1), (places + rows).reshape(-1)).reshape(
                n, times
            )
            chosen = np.clip(chosen - rows * log_w.shape[1], 0, log_w.shape[1] - 1)
            chosen = rng.permuted(chosen, axis=1)
            at, square = (
                _flat(np.take_along_axis(x[number], chosen[:, :, None], axis=1))
                for x in (points.series, points.squares)
            )
            found |= factor.coordinates.named(at, len(factor.shared))
            for (name, scale), own in zip(factor.noises.items(), square.T, strict=True):
                found[noise_name(name)] = scale.draw(own, rng)
        return found, np.repeat(outer / times, times)


def _law_of_series(factor: SeriesFactor, shares: Array, components: Sequence[Component]) -> MixtureProposal:
    """Components over the coordinates of a factor as a law of those of the series."""
    beside = _OF_A_SERIES if len(factor.own) > 1 else replace(_OF_A_SERIES, long=0.0)
    return MixtureProposal(factor.coordinates, tuple(components), shares, beside, len(factor.shared))


def _kappas_differ(problem: Problem) -> bool:
    """Whether series have a kappa each."""
    return len({kappa.name for kappa in problem.parameters.kappas}) > 1


def _flat(x: Array) -> Array:
    """Points of all shared coordinates one after the other, (n m, d)."""
    return x.reshape(x.shape[0] * x.shape[1], x.shape[2])
