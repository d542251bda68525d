"""The posterior of the plainest question: a quadrature over the transition alone, all else in closed form.

With rows that are linear in the impulse factor or measure e_n, and a closure whose transition does not depend
on its constant c, kappa alone decides which rows slide. Given kappa the sum of squares is a quadratic in c: c
has a normal law cut off at its bounds where the noise is known, and Student's where each of the two
observables has an unknown one. e_n is independent of both, but for the Jacobian 1/(1 + e_n) of
mu = kappa/(1 + e_n). What remains is an integral over kappa, smooth between the transitions at the measured
tau, and one over e_n. Section 11 of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.entry_names import split_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior.adaptive_quadrature import integrate
from ifrfit.inference.posterior.discrete_law import DiscreteLaw
from ifrfit.inference.posterior.friction_bound import FrictionBound
from ifrfit.inference.posterior.kappa_integral import KappaIntegral, Region, SlidingCells
from ifrfit.inference.posterior.marginals import Cdf, Marginal, noise_over_squares, whole_error
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.plain_question import NO_SHARE, PlainQuestion
from ifrfit.inference.posterior.quadrature_posterior import PosteriorByMarginals, QuadraturePosterior
from ifrfit.inference.posterior.restitution_integral import RestitutionIntegral, RestitutionLaw

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# of panels, in sd of the sharpest cell of kappa that counts, and of e_n, to begin with, at a tolerance: the
# error of the coarse rules rises with the tenth power
_WIDTH, _AT, _POWER = 1.5, 1e-6, 0.1
_HALVINGS = 3  # until the general integral is left to it
_SURE = 0.2  # of the tolerance: error up to which few points of e_n are believed, where kinks might hide more
_LOST = 1e-4  # of the tolerance: mass beyond the panels, were kappa's domain no wider than its sd
_BEYOND = 50.0  # error of a result, in sd, over the probability beyond a bound that was left out
_LITTLE = 0.3  # relative sd of 1 + e_n over that of kappa, below which few points of e_n are enough
_LEAST = 1e-300


@dataclass(frozen=True)
class Integrals:
    """The integrals over kappa and e_n, and what ties them where mass reaches the bound of mu.

    Attributes
    ----------
    kappa, e_n : KappaIntegral, RestitutionIntegral
    bound : FrictionBound or None
    log_mass : ndarray, (2,)
        Log of the integral over both by both levels.
    of_kappa, of_e_n : list of (float, float)
        Mean and standard deviation by both levels.
    """

    kappa: KappaIntegral
    e_n: RestitutionIntegral
    bound: FrictionBound | None
    log_mass: Array
    of_kappa: list[tuple[float, float]]
    of_e_n: list[tuple[float, float]]

    @classmethod
    def of(
        cls, kappa: KappaIntegral, e_n: RestitutionIntegral, bound: FrictionBound | None = None
    ) -> Integrals:
        """With the moments of each."""
        log_mass = kappa.log_mass + e_n.log_mass if bound is None else bound.log_mass
        moments = _moments(kappa.share, kappa.kappa), _moments(e_n.share, e_n.nodes)
        return cls(kappa, e_n, bound, log_mass, *moments)

    @property
    def error_of_mass(self) -> float:
        """Change of the log from the coarse rules; and from one order of the integrals to the other."""
        coarse = float(abs(self.log_mass[1] - self.log_mass[0]))
        return coarse if self.bound is None else max(coarse, self.bound.change_by_order)

    def mean_product(self, of_e_n: Array, one: str, other: str) -> float:
        """Mean of what is given at the nodes of e_n times two of "one", "kappa" and "c", by the rules.

        The latter about their centres.
        """
        if self.bound is None:
            return self.kappa.mean_product(one, other) * self.e_n.mean(of_e_n)
        return self.kappa.mean_product(one, other, self.bound.given_kappa(of_e_n))

    def mu_moments(self) -> list[tuple[float, float]]:
        """Mean and standard deviation of mu by both levels, eq. (10) or (26)."""
        if self.bound is not None:
            return self.bound.mu_moments
        inverse = _moments(self.e_n.share, 1.0 / (1.0 + self.e_n.nodes))
        return [_product(one, other) for one, other in zip(self.of_kappa, inverse, strict=True)]

    def mu_below(self, *, few: bool) -> Cdf:
        """Distribution function of mu: its bound takes from kappa and e_n what is above it, and no more."""
        if self.bound is None:
            return _quotient(self, few=few)
        free = Integrals.of(self.bound.free_kappa, self.bound.free_e_n)
        whole = _quotient(free, few=few, has_steps=not free.e_n.likelihood.is_whole)
        within = whole(np.array([self.bound.highest]), 2)
        return lambda t, levels: whole(t, levels) / within[:levels]


@dataclass(frozen=True)
class TransitionPosterior(PosteriorByMarginals):
    """The posterior by quadrature over the transition, with the error that the nested rules show.

    Attributes
    ----------
    problem : Problem
    log_evidence : float
        Log of the integral of the normalised likelihood times the normalised prior.
    error_evidence : float
        Change of the log evidence from the coarse rules to the fine ones.
    tolerance : float
    marginals : mapping
        Name to `Marginal`: free entries of theta, kappa, and free noises.
    error : float
        Largest change of a mean, a standard deviation or a quantile, in posterior standard deviations.
    transition_scale : float
        b: kappa over the tau at which sticking ends.
    start : LeastSquaresFit
    has_few_points : bool
        Whether few points of e_n served the marginals.
    """

    problem: Problem
    log_evidence: float
    error_evidence: float
    tolerance: float
    marginals: Mapping[str, Marginal] = field(repr=False)
    error: float
    transition_scale: float
    start: LeastSquaresFit = field(repr=False)
    has_few_points: bool = field(repr=False)
    _integrals: Integrals = field(repr=False)

    @property
    def error_of_moments(self) -> float:
        """That of all results: means and standard deviations are among them."""
        return self.error

    def _made_marginals(self) -> Mapping[str, Marginal]:
        question = PlainQuestion.of(self.problem)
        assert question is not None
        few = self.has_few_points
        return _marginals(self.problem, question, self._integrals, self.tolerance, few=few)

    def covariance(self, names: Sequence[str]) -> Array:
        """Posterior covariance of free entries of theta and kappa, (n, n)."""
        own = [self._parts(name) for name in names]
        found = np.diag([self.sd(name) ** 2 for name in names])
        for i, j in itertools.combinations(range(len(own)), 2):
            found[i, j] = found[j, i] = self._covariance(own[i], own[j])
        return found

    def _parts(self, name: str) -> tuple[Array, str]:
        """A quantity as a factor at the nodes of e_n times one of kappa's integral."""
        e_n = self._integrals.e_n.nodes
        if name == "e_n":
            return e_n, "one"
        if name == "mu":
            return 1.0 / (1.0 + e_n), "kappa"
        return np.ones_like(e_n), "kappa" if split_name(name)[0] == "kappa" else "c"

    def _covariance(self, *pair: tuple[Array, str]) -> float:
        """Of two quantities p x, with p at the nodes of e_n: each is p (x - x0) + x0 (p - p0), and small."""
        terms = [self._about_centre(*each) for each in pair]
        mean = self._integrals.mean_product
        means = [sum(mean(p, x, "one") for p, x in each) for each in terms]
        product = sum(mean(p * q, x, y) for (p, x), (q, y) in itertools.product(*terms))
        return product - means[0] * means[1]

    def _about_centre(self, p: Array, x: str) -> list[tuple[Array, str]]:
        centre = self._integrals.kappa.centres.get(x, 1.0)
        around = [(centre * (p - self._integrals.e_n.mean(p)), "one")]
        return around if x == "one" else [(p, x), *around]

    def _transition(self, series: str, p: Array) -> Array:
        """Quantiles of the tau at which sticking ends, the same in each series."""
        return np.asarray(self.quantile(self.problem.parameters.kappas[0].name, p)) / self.transition_scale

    @cached_property
    def grid(self) -> QuadraturePosterior:
        """The same posterior on the grids of the general integral, made when draws are first asked for."""
        return integrate(self.problem, self.tolerance, self.start)

    def draws(self, n: int, rng: np.random.Generator, names: Sequence[str] | None = None) -> dict[str, Array]:
        """Independent draws of constants and kappa together, from the general integral.

        All of them, or those of some names.
        """
        return self.grid.draws(n, rng, names)


def transition_posterior(
    problem: Problem, tolerance: float, start: LeastSquaresFit
) -> TransitionPosterior | None:
    """The posterior of a plain problem; None where it is not plain, or its error exceeds the tolerance.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        As `ifrfit.inference.posterior.adaptive_quadrature.integrate`.
    start : LeastSquaresFit
        The certified optimum.
    """
    question = PlainQuestion.of(problem)
    if question is None:
        return None
    lost = -math.log(_LOST * tolerance)
    likelihood = RestitutionLaw.of(question, lost)
    if likelihood is None:
        return None
    cells = SlidingCells.of(question, problem, start)
    furthest = question.mu.upper * (1.0 + likelihood.high)
    region = cells.region(question.c, question.highest_kappa, furthest, lost)
    if region is None:
        return None
    widest = _WIDTH * min(tolerance / _AT, 1e3) ** _POWER
    for attempt in range(_HALVINGS):
        few = attempt == 0
        integrals = _integrals(question, cells, region, likelihood, widest / 2.0**attempt, tolerance)
        if integrals is None or not integrals.kappa.is_within(question.noises):
            return None
        beyond = _BEYOND * integrals.kappa.beyond
        if beyond > tolerance:
            return None
        marginals = _marginals(problem, question, integrals, tolerance, few=few)
        error_evidence = integrals.error_of_mass
        if not error_evidence <= tolerance:
            continue
        error = max(whole_error(marginals, tolerance), beyond)
        if error <= (_SURE if few else 1.0) * tolerance:
            return TransitionPosterior(
                problem,
                float(integrals.log_mass[0]) + question.log_scale,
                error_evidence,
                tolerance,
                marginals,
                error,
                question.law.b0,
                start,
                few,
                integrals,
            )
    return None


def _integrals(
    question: PlainQuestion,
    cells: SlidingCells,
    region: Region,
    likelihood: RestitutionLaw,
    width: float,
    tolerance: float,
) -> Integrals | None:
    """On panels of a width in sd; None where these are very many, or the bound of mu leaves little."""
    if region.high >= question.mu.upper * (1.0 + likelihood.low):
        bounds = question.mu.upper, question.c
        bound = FrictionBound.of(cells, region, likelihood, bounds, width, tolerance)
        return None if bound is None else Integrals.of(bound.kappa, bound.e_n, bound)
    edges = cells.edges(region, width)
    kappa = None if edges is None else KappaIntegral.of(cells, edges, question.c, tolerance)
    e_n = RestitutionIntegral.of(likelihood, width, tolerance)
    return None if kappa is None or e_n is None else Integrals.of(kappa, e_n)


def _marginals(
    problem: Problem,
    question: PlainQuestion,
    integrals: Integrals,
    tolerance: float,
    *,
    few: bool,
) -> dict[str, Marginal]:
    """Of the free entries of theta in their order, and of kappa."""
    kappa, e_n = integrals.kappa, integrals.e_n
    of_kappa, of_e_n = integrals.of_kappa, integrals.of_e_n
    of_mu, of_c = integrals.mu_moments(), kappa.c_moments()
    every = {
        "e_n": (question.e_n, of_e_n, e_n.law.below_in_all),
        question.c.name: (question.c, of_c, kappa.c_below),
        "mu": (question.mu, of_mu, integrals.mu_below(few=few)),
    }
    found = {}
    for name in problem.parameters.free_names:
        one, moments, below = every[name]
        found[name] = Marginal(name, one.lower, one.upper, moments.__getitem__, below)
    name, below = problem.parameters.kappas[0].name, kappa.law.below_in_all
    highest = max(question.highest_kappa, float(kappa.kappa[-1]))
    found[name] = Marginal(name, 0.0, highest, of_kappa.__getitem__, below)
    if question.noises:
        (first, own), (second, other) = question.noises
        # with c integrated out, sigma knows a sum of squares of one row less
        negligible = NO_SHARE * tolerance * kappa.kappa.size
        less = NoiseScale(own.n - 1.0, own.lower, own.upper)
        found[first] = noise_over_squares(less, DiscreteLaw.of(kappa.square, kappa.share), negligible, first)
        found[second] = noise_over_squares(other, DiscreteLaw.of(e_n.square, e_n.share), negligible, second)
    return found


def _quotient(free: Integrals, *, few: bool, has_steps: bool = False) -> Cdf:
    """Distribution function of mu, eq. (10): the mean over the narrower one of kappa and 1 + e_n.

    Over e_n where that of e_n has steps: kappa's is smooth between walls.
    """
    kappa, e_n, of_kappa, of_e_n = free.kappa, free.e_n, free.of_kappa[0], free.of_e_n[0]
    ratio = of_e_n[1] / (1.0 + of_e_n[0]) * of_kappa[0] / of_kappa[1]
    if ratio > 1.0 and not has_steps:
        values, shares_of_kappa = kappa.kappa[kappa.counts], kappa.share[:, kappa.counts]

        def by_kappa(t: Array, levels: int) -> Array:
            at = values / np.maximum(t, _LEAST)[:, None] - 1.0
            above = 1.0 - e_n.law.below_in_all(at.reshape(-1), levels).reshape(levels, t.size, -1)
            return np.asarray((above @ shares_of_kappa[:levels, :, None])[..., 0])

        return by_kappa
    factors, shares = e_n.points(few=few and ratio < _LITTLE)
    fine = int(np.flatnonzero(shares[0])[-1]) + 1

    def by_e_n(t: Array, levels: int) -> Array:
        some = slice(0, fine) if levels == 1 else slice(None)
        below = kappa.law.below_in_all((t[:, None] * factors[some]).reshape(-1), levels)
        return np.asarray((below.reshape(levels, t.size, -1) @ shares[:levels, some, None])[..., 0])

    return by_e_n


def _moments(share: Array, values: Array) -> list[tuple[float, float]]:
    """Mean and standard deviation by both levels; squares about the mean by the rules."""
    mean = share @ values
    offset = values - mean[0]
    variance = share @ (offset * offset) - (mean - mean[0]) ** 2
    return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(mean, variance, strict=True)]


def _product(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Mean and standard deviation of a product of independent quantities, eq. (10)."""
    (m, s), (n, r) = one, other
    return m * n, math.sqrt(s * s * (n * n + r * r) + m * m * r * r)
