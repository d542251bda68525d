"""The posterior by importance sampling from its certified modes, where a grid would be too large.

Eq. (14) to (18) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.diagnostics.thresholds import (
    FAR_BELOW,
    SAMPLING_ERROR,
)
from ifrfit.inference.distributions.draws import Draws, WeightedDraws
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, at_fitted_offset, least_squares
from ifrfit.inference.posterior.constants_density import ConstantsDensity
from ifrfit.inference.posterior.discrete_law import DiscreteLaw
from ifrfit.inference.posterior.grid_settings import fits_at_modes
from ifrfit.inference.posterior.importance_posterior import ROUGHLY, TARGET, ImportancePosterior
from ifrfit.inference.posterior.importance_weights import (
    REPLICATES,
    believed_evidence,
    effective_share,
    replicated_evidence,
)
from ifrfit.inference.posterior.marginals import Marginal, noise_over_squares
from ifrfit.inference.posterior.mixture_proposal import MixtureProposal, lattice
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.proposal_adaptation import (
    Gaussian,
    adapted_proposal,
    proposal_about,
    refitted,
)

Array = NDArray[np.float64]

_FIRST, _FEW = 512, 128  # points of each to begin with; where true angles are integrated out
# Points times what one costs, in rows, after which no finer lattice is begun: where errors are small enough
# to count as converged, and in any case
WORK, MOST_WORK = 6_000_000, 18_000_000
_OF_A_POINT = 20  # rows that a point costs beside its own and those of the law that it is drawn from
_REFITS = 4  # of the law to draw from
_FEWER = 4  # times fewer points to begin with where the evidence alone is asked for
_FITS_FIRST = 3  # of the law about the modes, before one is adapted
_EVEN = 0.15  # effective share of the points at which the law is not fitted again
_RISE = 25.0  # of minus twice the log likelihood to other modes: beyond, they have no weight
_FALL, _HEAVIEST = (
    50.0,
    64,
)  # of the log density from the optimum to draws that missed it; draws that are asked
_NEGLIGIBLE = 1e-12  # probability of sums of squares that noises leave out
_NORMAL = np.exp(-0.5 * special.ndtri(np.array(LEVELS)) ** 2) / math.sqrt(2.0 * math.pi)  # its density there


def sample_by_importance(
    problem: Problem, start: LeastSquaresFit | None = None, seed: int = 0, *, target: float = TARGET
) -> ImportancePosterior:
    """Sample the posterior of a problem, until standard errors are small or there are very many draws.

    Parameters
    ----------
    problem : Problem
        With a free constant at least.
    start : LeastSquaresFit, optional
        The certified optimum, where it is known already.
    seed : int
        Of the shifts of the lattices.
    target : float
        Standard error, in sd, at which sampling ends.
    """
    start = least_squares(problem) if start is None else start
    density = ConstantsDensity(problem)
    rng = np.random.default_rng(seed)
    modes = known_modes(density, start)
    proposal = adapted_proposal(density, modes, rng)
    replicates = best = _Replicates(density, proposal, rng)
    for _ in range(_REFITS):
        if best.effective_share >= _EVEN:
            break
        replicates = _Replicates(
            density, refitted(replicates.proposal, density, replicates.at, replicates.log_weights, rng), rng
        )
        best = max(best, replicates, key=lambda each: each.effective_share)
    if best.error_of_one_draw > target:
        # a law near to the posterior leaves few draws in a tail that is rare, and makes most of a variance
        best = min(best, best.with_law_fitted(far=True), key=lambda each: each.error_of_one_draw)
    found = best.enough(target)
    if not (found.converged or best.effective_share < _EVEN):
        far = best.with_law_fitted(far=True).enough(target)
        found = min(found, far, key=lambda each: max(each.error, each.error_evidence))
    # draws that agree with each other far below the optimum are all about another place
    return replace(found, error_evidence=math.inf) if best.fall_from(modes) > FAR_BELOW else found


class EvidenceByDraws(ABC):
    """Points enough for the evidence of a problem, and what they say of the same with fewer rows.

    A law that is near to the posterior of all impacts, with wide components beside, is near enough to that of
    all but one: its points get other weights. Section 9 of ``docs/theory/posterior.md``. Five impacts of each
    of 15 drawn tables were left out in a quarter of the seconds that integrals of their own take (median).

    Parameters
    ----------
    problem : Problem
        With a free constant at least.
    start : LeastSquaresFit
        The optimum.
    seed : int
        Of the shifts of the lattices.
    """

    @abstractmethod
    def evidence(self) -> tuple[float, float]:
        """Log of the integral of likelihood times normalised prior, and its standard error.

        The error is infinite where few points carry the weight.
        """

    @abstractmethod
    def evidence_of(self, kept: Index) -> tuple[float, float]:
        """The same of some of the rows; each noise keeps the prior that it has with all of them.

        The points get other weights; where few carry them, laws are fitted to them and others drawn.
        """

    def log_density_of_others(self, kept: Index) -> tuple[float, float]:
        """Log density of the rows of an impact, as all others predict it, and its standard error.

        The error is the larger one of both evidences: infinite where few points carry the weight of all rows
        or of the kept ones, or coordinates differ.

        Parameters
        ----------
        kept : ndarray of int
            Rows of the other impacts.
        """
        whole, found = self.evidence(), self.evidence_of(kept)
        return whole[0] - found[0], max(whole[1], found[1])


def with_kept_rows(problem: Problem, kept: Index) -> Problem:
    """Some of a problem's rows; each noise keeps the prior that it has with all of them."""
    rest = problem.with_rows(kept)
    groups = rest.noise_groups()
    bounds = {name: ends for name, ends in problem.noise_bounds().items() if name in groups}
    return rest.with_noise(rest.noise.with_bounds(bounds))


class EvidenceByImportance(EvidenceByDraws):
    """By points of a law over all constants together.

    The law about the known modes serves where it leaves a small error; else one is adapted.
    """

    def __init__(self, problem: Problem, start: LeastSquaresFit, seed: int = 0) -> None:
        self._density = density = ConstantsDensity(problem)
        self._rng = rng = np.random.default_rng(seed)
        modes = known_modes(density, start)
        replicates = _Replicates(density, proposal_about(density.coordinates, modes), rng, fewer=_FEWER)
        for _ in range(_FITS_FIRST):
            before = replicates
            if before.evidence()[1] <= TARGET:
                break
            replicates = before.with_law_fitted()
            if replicates.effective_share < 2.0 * before.effective_share:
                break
        if replicates.evidence()[1] > TARGET:
            replicates = _Replicates(density, adapted_proposal(density, modes, rng), rng)
        self._points = replicates.enough_for_evidence()

    def evidence(self) -> tuple[float, float]:
        """Log evidence and its standard error."""
        return self._points.evidence()

    def evidence_of(self, kept: Index) -> tuple[float, float]:
        """The same of some of the rows."""
        density, points = ConstantsDensity(with_kept_rows(self._density.problem, kept)), self._points
        if density.coordinates != self._density.coordinates:
            return math.nan, math.inf
        log_weights = points.log_weights + density(points.at)[0] - self._log_density
        found, error = believed_evidence(log_weights)
        if error <= SAMPLING_ERROR:
            return found, error
        law = refitted(points.proposal, density, points.at, log_weights, self._rng)
        points = _Replicates(density, law, self._rng, fewer=_FEWER)
        if points.evidence()[1] > SAMPLING_ERROR:
            points = points.with_law_fitted()
        found, error = points.evidence()
        return (found, error) if math.isinf(error) else points.enough_for_evidence().evidence()

    @cached_property
    def _log_density(self) -> Array:
        return self._density(self._points.at)[0]


def known_modes(density: ConstantsDensity, start: LeastSquaresFit) -> list[Gaussian]:
    """Centre and covariance, in coordinates, of the posterior about each mode that least squares knows.

    Where one lies beyond the end of a prior, least squares search again up to there: an open mu whose optimum
    is 47 says nothing of where the posterior lies below 2.
    """
    free = density.problem.parameters.free
    ends = np.array([unknown.upper for unknown in density.problem.free_parameters])
    modes = fits_at_modes(at_fitted_offset(density.problem, start), start, _RISE)
    if any(np.any(mode.optimum.theta[free] > ends) for mode in modes):
        confined = density.problem.within_prior()
        start = least_squares(confined, proven=False)
        modes = fits_at_modes(at_fitted_offset(confined, start), start, _RISE)
    found = []
    for mode in modes:
        theta, covariance = mode.optimum.theta, mode.gaussian.covariance(capped=True)
        found.append(_in_coordinates(density, start, theta[free], covariance[np.ix_(free, free)], mode.sigma))
    return found


def _in_coordinates(
    density: ConstantsDensity, start: LeastSquaresFit, constants: Array, covariance: Array, sigma: Array
) -> Gaussian:
    """A mode of the constants with what else has coordinates: a factor of the noise, the offset."""
    n, d = constants.size, density.coordinates.dimensions
    values, whole = np.zeros(d), np.zeros((d, d))
    values[:n], whole[:n, :n] = constants, covariance
    groups = density.problem.noise_groups()
    for place, name in enumerate(density.sampled_noises, start=n):
        rows = groups[name]
        factor = float(np.median(sigma[rows] / density.problem.noise.base[rows]))
        values[place], whole[place, place] = math.log(factor), 0.5 / max(rows.size - 1, 1)
    offset = start.angle_offset
    if offset is not None:  # the constants go along with it
        carried = np.append(offset.carried[density.problem.parameters.free], 1.0) * offset.sd
        places = np.append(np.arange(n), d - 1)
        values[-1] = offset.value
        whole[np.ix_(places, places)] += np.outer(carried, carried)
    return density.coordinates.at(values[None])[0], whole


class _Replicates:
    """Lattices with independent shifts over one law: their scatter is the standard error of their mean."""

    def __init__(
        self, density: ConstantsDensity, proposal: MixtureProposal, rng: np.random.Generator, fewer: int = 1
    ) -> None:
        self._density, self.proposal, self._rng = density, proposal, rng
        self._shifts = rng.random((REPLICATES, 1 + density.coordinates.dimensions))
        self._fewer = fewer
        self._points = (_FIRST if density.cost_of_row == 1 else _FEW) // fewer  # of each
        self._parts = [self._drawn(finer=False)]
        self._join()

    def _drawn(self, *, finer: bool) -> tuple[Array, Array, Array]:
        """Points, log weights and sums of squares, (replicates, points, ...)."""
        at = self.proposal.draw(
            np.stack([lattice(self._points, shift, finer=finer) for shift in self._shifts])
        )
        log_p, squares = self._density(at.reshape(-1, at.shape[2]))
        log_weights = log_p.reshape(at.shape[:2]) - self.proposal.log_density(at)
        return at, log_weights, squares.reshape(*at.shape[:2], squares.shape[1])

    def with_law_fitted(self, *, far: bool = False) -> _Replicates:
        """As many points of the law that is fitted to these; `far` by what each adds to the variances."""
        density, rng = self._density, self._rng
        log_weights = (
            self.log_weights + np.log(1.0 + self._squares_away.sum(axis=1)) if far else self.log_weights
        )
        law = refitted(self.proposal, density, self.at, log_weights, rng)
        return _Replicates(density, law, rng, fewer=self._fewer)

    def fall_from(self, modes: Sequence[Gaussian]) -> float:
        """From the largest log density at known modes to that at the points of most weight."""
        heaviest = self.at[np.argsort(self.log_weights)[-_HEAVIEST:]]
        of_modes = self._density(np.array([centre for centre, _ in modes]))[0]
        return float(np.nanmax(of_modes) - self._density(heaviest)[0].max())

    def enough(self, target: float) -> ImportancePosterior:
        """The posterior by these, as fine as it needs: standard errors in sd of `target`."""
        while True:
            work = 2 * self.at.shape[0] * self.cost
            # beyond it the lattice is refined, whatever the error is
            limit = target if work <= WORK else SAMPLING_ERROR if work <= MOST_WORK else math.inf
            found = self.posterior(limit)
            if work > (WORK if found.converged else MOST_WORK):
                return found
            if found.converged and found.error <= target and found.error_evidence <= TARGET:
                return found
            self.refine()

    def enough_for_evidence(self) -> _Replicates:
        """These, as fine as the evidence needs."""
        while True:
            _, error = self.evidence()
            work = 2 * self.at.shape[0] * self.cost
            if error <= TARGET or work > (WORK if error <= SAMPLING_ERROR else MOST_WORK):
                return self
            self.refine()

    def refine(self) -> None:
        """Double the points of every lattice."""
        self._parts.append(self._drawn(finer=True))
        self._points *= 2
        self._join()

    def _join(self) -> None:
        whole = [np.concatenate(parts, axis=1) for parts in zip(*self._parts, strict=True)]
        at, log_weights, squares = whole
        self.at, self.log_weights = at.reshape(log_weights.size, -1), log_weights.reshape(-1)
        self._squares = squares.reshape(log_weights.size, squares.shape[-1])

    @property
    def _squares_away(self) -> Array:
        """Squared distances from the means, in sd, of the free constants, (m, constants); 0 where sd is 0."""
        density, weights = self._density, special.softmax(self.log_weights)
        theta = density.theta(density.coordinates.values(self.at))[:, density.problem.parameters.free]
        square = (theta - weights @ theta) ** 2
        variance = weights @ square
        return np.divide(square, variance, out=np.zeros_like(square), where=variance > 0.0)

    @property
    def error_of_one_draw(self) -> float:
        """Standard error, in sd, of the sd of a constant by the draw that makes most of its variance."""
        weights = special.softmax(self.log_weights)
        of_each = weights[:, None] * self._squares_away
        # a variance of 0 is that of one draw with all of the weight
        return (
            0.5 if of_each.size and not of_each.any(axis=0).all() else 0.5 * float(of_each.max(initial=0.0))
        )

    @property
    def cost(self) -> float:
        """Of a point, in rows."""
        of_the_law = self.proposal.own * self.proposal.n_laws
        rows = len(self._density.problem.rows) * self._density.cost_of_row
        return rows + of_the_law + _OF_A_POINT

    @property
    def effective_share(self) -> float:
        """Effective draws over points."""
        return effective_share(self.log_weights)

    def evidence(self) -> tuple[float, float]:
        """Log evidence and its standard error; infinite where few draws carry the weight."""
        return believed_evidence(self.log_weights)

    def posterior(self, limit: float = math.inf) -> ImportancePosterior:
        """All replicates together, with the standard error of their mean, in full up to a limit."""
        density = self._density
        drawn = Draws.of(density.problem, self._draws())
        weights = special.softmax(self.log_weights)
        noises = noise_marginals(density.noises, weights, self._squares)
        log_evidence, error_evidence = replicated_evidence(self.log_weights)
        return ImportancePosterior(
            drawn.values,
            drawn.transitions,
            weights,
            density.problem,
            log_evidence,
            standard_error(drawn.values, weights, noises, density.noises, self._squares, limit),
            error_evidence,
            SAMPLING_ERROR,
            float(weights.max()),
            noises,
        )

    def _draws(self) -> Mapping[str, Array]:
        """Constants, noises and the offset of all points, by name."""
        density, coordinates = self._density, self._density.coordinates
        theta = density.theta(coordinates.values(self.at))
        found = dict(zip(density.problem.parameters.names, theta.T, strict=True))
        found |= coordinates.named(self.at, density.free)
        for (name, scale), square in zip(density.noises.items(), self._squares.T, strict=True):
            found[noise_name(name)] = scale.draw(square, self._rng)
        return found


def noise_marginals(scales: Mapping[str, NoiseScale], weights: Array, squares: Array) -> dict[str, Marginal]:
    """Marginal of each noise that is integrated out, by its name, eq. (11).

    Parameters
    ----------
    scales : mapping of str to NoiseScale
        By the name of the group.
    weights : ndarray, (m,)
    squares : ndarray, (m, groups)
    """
    both = np.stack((weights, weights))
    return {
        noise_name(name): noise_over_squares(
            scale, DiscreteLaw.of(square, both), _NEGLIGIBLE, noise_name(name)
        )
        for (name, scale), square in zip(scales.items(), squares.T, strict=True)
    }


def standard_error(
    values: Mapping[str, Array],
    weights: Array,
    noises: Mapping[str, Marginal],
    scales: Mapping[str, NoiseScale],
    squares: Array,
    limit: float = math.inf,
) -> float:
    """Largest standard error of a mean, sd or quantile, in sd, from the scatter of the replicates, eq. (18).

    Parameters
    ----------
    values : mapping of str to ndarray, (m,)
        Draws by name, replicate by replicate.
    weights : ndarray, (m,)
    noises : mapping of str to Marginal
        Of noises that are integrated out, by their names.
    scales : mapping of str to NoiseScale
        Of the same, by the names of their groups.
    squares : ndarray, (m, groups)
    limit : float
        The first error above it is handed back, and others are not looked at.
    """
    shares = weights.reshape(REPLICATES, -1)
    shares = shares / np.maximum(shares.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    drawn = (_error_of_draws(value, weights, shares) for name, value in values.items() if name not in noises)
    worst = 0.0
    for error in chain(drawn, _errors_of_noises(noises, scales, shares, squares)):
        worst = max(worst, error)
        if worst > limit:
            break
    return worst


def _error_of_draws(value: Array, weights: Array, shares: Array) -> float:
    """Largest standard error of a quantity by its draws (m,); shares (replicates, draws of each)."""
    pairs = zip(value.reshape(shares.shape), shares, strict=True)
    each = [WeightedDraws({"": own}, {}, share) for own, share in pairs]
    whole = WeightedDraws({"": value}, {}, weights)
    sd = whole.sd("")
    # one draw that carries a share of the variance is a share that another one may as well lack
    square = weights * (value - whole.mean("")) ** 2
    single = 0.5 * float(square.max()) / max(sd * sd, np.finfo(float).tiny)
    if sd <= 0.0:
        return single
    below = np.array([part.cdf("", whole.quantile("", LEVELS)) for part in each])
    return max(single, _scatter(np.array([_of_draws(part) for part in each]), below, sd))


def _errors_of_noises(
    noises: Mapping[str, Marginal], scales: Mapping[str, NoiseScale], shares: Array, squares: Array
) -> Iterator[float]:
    """The same of each noise that is integrated out, which takes longer: arguments as `standard_error`."""
    if not scales:
        return
    parts = squares.reshape(*shares.shape, squares.shape[1])
    replicates = [noise_marginals(scales, *each) for each in zip(shares, parts, strict=True)]
    for name, marginal in noises.items():
        at = marginal.at_levels(ROUGHLY)
        found = np.array([_of_marginal(each[name]) for each in replicates])
        below = np.array([each[name].cdf(at, 1)[0] for each in replicates])
        yield _scatter(found, below, marginal.moments(0)[1])


def _scatter(found: Array, below: Array, sd: float) -> float:
    """Largest standard error, in sd, of mean, sd and quantiles, from the scatter of the replicates.

    A quantile that moves by more than counts as converged errs by the probability below it, in the units of a
    normal law: between two modes nothing but that probability is certain.

    Parameters
    ----------
    found : ndarray, (replicates, 2 + levels)
    below : ndarray, (replicates, levels)
        Probability below the quantiles of all replicates together.
    sd : float
    """
    moved = found.std(axis=0, ddof=1) / sd / math.sqrt(REPLICATES)
    missed = below.std(axis=0, ddof=1) / _NORMAL / math.sqrt(REPLICATES)
    of_quantiles = np.where(moved[2:] > SAMPLING_ERROR, np.minimum(moved[2:], missed), moved[2:])
    return float(max(moved[:2].max(), of_quantiles.max()))


def _of_draws(part: WeightedDraws) -> list[float]:
    """Mean, sd and quantiles of a quantity."""
    return [part.mean(""), part.sd(""), *np.asarray(part.quantile("", LEVELS)).tolist()]


def _of_marginal(own: Marginal) -> list[float]:
    """The same of a noise."""
    return [*own.moments(0), *own.at_levels(ROUGHLY).tolist()]
