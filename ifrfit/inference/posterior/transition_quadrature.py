"""The posterior of the plainest question: a quadrature over the transition alone, all else in closed form.

With rows that are linear in the impulse factor or measure e_n, and a closure whose transition does not depend
on its constant c, kappa alone decides which rows slide. Given kappa the sum of squares is a quadratic in c: c
has a normal law cut off at its bounds where the noise is known, and Student's where each of the two
observables has an unknown one. e_n is independent of both, but for the Jacobian 1/(1 + e_n) of
mu = kappa/(1 + e_n). What remains is an integral over kappa, smooth between the transitions at the measured
tau, and one over e_n. Section 11 of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainccinv, gammaincinv, gammaln, ndtr, stdtr

from ifrfit.inference.model.entry_names import split_name
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior.adaptive_quadrature import integrate
from ifrfit.inference.posterior.discrete_law import DiscreteLaw
from ifrfit.inference.posterior.marginals import Cdf, Marginal, noise_over_squares, whole_error
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis
from ifrfit.inference.posterior.quadrature_posterior import PosteriorByMarginals, QuadraturePosterior
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_ORDER = 16  # of the rules, with those of half the order inside them
_LOW_ORDER = 8  # where most panels end at transitions, and are narrow
# of panels, in sd of the sharpest cell of kappa that counts, and of e_n, to begin with, at a tolerance: the
# error of the coarse rules rises with the tenth power
_WIDTH, _AT, _POWER = 1.5, 1e-6, 0.1
_HALVINGS = 3  # until the general integral is left to it
_SURE = 0.2  # of the tolerance: error up to which few points of e_n are believed, where kinks might hide more
_MOST_PANELS = 400
_LOST = 1e-4  # of the tolerance: mass beyond the panels, were kappa's domain no wider than its sd
_NEAR = 32.0  # of chi2 above the best, within which a cell says how sharp kappa is
_OUTSIDE = 16.0  # of chi2 by which the optimum without bounds may lie below the one inside
_FREE_OF_BOUNDS = 9.0  # sd between c and its bounds from which nothing is cut off
_NO_SHARE = 1e-7  # of the tolerance: probability of a node that is left out of a mean
_FEWEST = 12  # rows of unknown noise below which tails are too long for even panels
_BEYOND = 50.0  # error of a result, in sd, over the probability beyond a bound that was left out
_LITTLE = 0.3  # relative sd of 1 + e_n over that of kappa, below which few points of e_n are enough
_LEAST = 1e-300
_NO_TAIL = 1e-17  # of the law of an unknown sigma, beyond its bounds
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)
_PER_ROOT_2PI = 1.0 / math.sqrt(2.0 * math.pi)


def _hermite(fine: int, coarse: int) -> tuple[Array, Array]:
    """Points of two rules of Gauss and Hermite for the standard normal law, and their weights, (2, n)."""
    (x, w), (y, v) = (np.polynomial.hermite_e.hermegauss(order) for order in (fine, coarse))
    weights = np.zeros((2, fine + coarse))
    weights[0, :fine], weights[1, fine:] = w, v
    return np.concatenate((x, y)), weights


_HERMITE, _HERMITE_WEIGHTS = _hermite(12, 6)


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
    """

    problem: Problem
    log_evidence: float
    error_evidence: float
    tolerance: float
    marginals: Mapping[str, Marginal] = field(repr=False)
    error: float
    transition_scale: float
    start: LeastSquaresFit = field(repr=False)
    _kappa: _Transition = field(repr=False)
    _e_n: _Restitution = field(repr=False)

    @property
    def error_of_moments(self) -> float:
        """That of all results: means and standard deviations are among them."""
        return self.error

    def covariance(self, names: Sequence[str]) -> Array:
        """Posterior covariance of free entries of theta and kappa, (n, n); e_n is independent of c."""
        own = [self._parts(name) for name in names]
        found = np.empty((len(own), len(own)))
        for i, (power, factor, first) in enumerate(own):
            for j, (other, second, last) in enumerate(own[: i + 1]):
                of_kappa = self._kappa.mean_product(factor, second)
                of_e_n = self._e_n.mean(power * other)
                found[i, j] = found[j, i] = of_kappa * of_e_n - first * last
            found[i, i] = self.sd(names[i]) ** 2
        return found

    def _parts(self, name: str) -> tuple[Array, str, float]:
        """A quantity as a factor at the nodes of e_n times one of kappa's integral; and its mean."""
        e_n = self._e_n.nodes
        if name == "e_n":
            return e_n, "one", self.mean(name)
        if name == "mu":
            return 1.0 / (1.0 + e_n), "kappa", self.mean(name)
        return np.ones_like(e_n), "kappa" if split_name(name)[0] == "kappa" else "c", self.mean(name)

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
    question = _PlainQuestion.of(problem)
    if question is None:
        return None
    lost = -math.log(_LOST * tolerance)
    cells = _Cells.of(question, problem, start)
    region = cells.region(question.highest_kappa, lost)
    if region is None:
        return None
    widest = _WIDTH * min(tolerance / _AT, 1e3) ** _POWER
    for attempt in range(_HALVINGS):
        width, few = widest / 2.0**attempt, attempt == 0
        kappa = _Transition.of(cells, region, question.c, width, tolerance)
        e_n = _Restitution.of(question, lost, width, tolerance)
        if kappa is None or e_n is None or not kappa.is_within(question.noises):
            return None
        marginals = _marginals(problem, question, kappa, e_n, tolerance, few=few)
        error_evidence = float(abs(kappa.log_mass[1] - kappa.log_mass[0] + e_n.log_mass[1] - e_n.log_mass[0]))
        if not error_evidence <= tolerance:
            continue
        error = max(whole_error(marginals, tolerance), _BEYOND * kappa.beyond)
        if error <= (_SURE if few else 1.0) * tolerance:
            log_evidence = float(kappa.log_mass[0] + e_n.log_mass[0]) + question.log_scale
            return TransitionPosterior(
                problem,
                log_evidence,
                error_evidence,
                tolerance,
                marginals,
                error,
                question.law.b0,
                start,
                kappa,
                e_n,
            )
    return None


@dataclass(frozen=True)
class _PlainQuestion:
    """What the integral needs of a plain problem.

    Attributes
    ----------
    law : Coefficients
        With b1 = 0.
    e_n, c, mu : FreeParameter
    tau, factor, weight : ndarray, (n,)
        Of the tangential rows, in the order of tau: the slip ratio, the impulse factor that the value stands
        for, and s^2/sigma^2 with s the slope of the value by that factor.
    e_value, e_weight : ndarray, (m,)
        What the other rows and a prior say of e_n, with sigma^-2.
    log_scale : float
        Log of what stands before the integrals: of the likelihood and the priors.
    noises : tuple of (str, NoiseScale)
        The unknown noise of the tangential rows, then that of e_n, each with its name; empty where it is
        known.
    """

    law: Coefficients
    e_n: FreeParameter
    c: FreeParameter
    mu: FreeParameter
    tau: Array
    factor: Array
    weight: Array
    e_value: Array
    e_weight: Array
    log_scale: float
    noises: tuple[tuple[str, NoiseScale], ...] = ()

    @property
    def highest_kappa(self) -> float:
        """Below which the domain of kappa does not depend on e_n, eq. (8)."""
        return self.mu.upper * (1.0 + self.e_n.lower)

    @classmethod
    def of(cls, problem: Problem) -> _PlainQuestion | None:
        """None where the problem is not plain."""
        law = problem.closure.law(problem.inertia_factor)
        if not (isinstance(law, Coefficients) and law.b1 == 0.0 and law.a1 != 0.0 and law.b0 > 0.0):
            return None
        noise, parameters = problem.noise, problem.parameters
        # rows that stand for many have a scale of their own; errors in proportion to sigma are none of these
        if not (noise.is_known or noise.is_unknown) or (noise.scale is not None and noise.counts is None):
            return None
        if not problem.error_model.is_plain or problem.common is not None:
            return None
        if problem.offset is not None or any(one.separate for one in parameters):
            return None
        free = {one.name: one for one in problem.free_parameters}
        if len(free) != 3 or problem.closure.constant not in free:
            return None
        e_n, c, mu = free["e_n"], free[problem.closure.constant], free["mu"]
        if mu.prior is not None or mu.lower > 0.0:
            return None
        rows = _rows_of(problem)
        if rows is None:
            return None
        (tau, factor, weight), (e_value, e_weight) = rows
        if e_n.prior is not None:
            e_value, e_weight = np.append(e_value, e_n.prior[0]), np.append(e_weight, e_n.prior[1] ** -2.0)
        if not (tau.size and e_value.size and tau.min() > 0.0 and math.isfinite(float(tau.max()))):
            return None
        noises = _noises_of(problem, tau.size)
        if noises is None:
            return None
        scale = -float(np.log(noise.base).sum())
        if not noises:
            scale -= noise.sigma.size * _HALF_LOG_2PI
        for one in (e_n, c, mu):
            scale += one.log_scale - (0.0 if one.prior is None else math.log(one.prior[1]) + _HALF_LOG_2PI)
        order = np.argsort(tau, kind="stable")
        rows_of = tau[order], factor[order], weight[order]
        return cls(law, e_n, c, mu, *rows_of, e_value, e_weight, scale, noises)


def _rows_of(problem: Problem) -> tuple[list[Array], list[Array]] | None:
    """tau, impulse factor and weight of tangential rows; value and weight of those of e_n.

    None where a row is of neither kind, ties e_n to the impulse factor, or knows neither.
    """
    rows, sigma = problem.rows, problem.noise.base
    tangential, normal = [], []
    for observable, at, incidence in rows.by_observable:
        if observable.linear is not None and not observable.ties_e_n:
            offset, slope = observable.linear(incidence, problem.inertia_factor)
            if not slope.all():
                return None
            value = (rows.value[at] - offset) / slope
            tangential.append((rows.tau[at], value, (slope / sigma[at]) ** 2))
        elif observable.by_e_n is not None:
            per = observable.by_e_n(incidence)
            if not np.all(per):
                return None
            normal.append((rows.value[at] / per, (per / sigma[at]) ** 2 * np.ones(at.size)))
        else:
            return None
    if not tangential:
        return None
    of_e_n = [np.concatenate(part) for part in zip(*normal, strict=True)] if normal else [np.empty(0)] * 2
    return [np.concatenate(part) for part in zip(*tangential, strict=True)], of_e_n


def _noises_of(problem: Problem, n_tangential: int) -> tuple[tuple[str, NoiseScale], ...] | None:
    """Unknown noises: of the tangential rows, then of those of e_n; empty where they are known.

    None where there are others, few rows of one, or a prior beside them.
    """
    if problem.noise.is_known:
        return ()
    groups, bounds = problem.noise_groups(), problem.noise_bounds()
    if len(groups) != 2 or any(one.prior is not None for one in problem.free_parameters):
        return None
    normal = problem.rows.of_kind("normal")
    (first, one), (second, other) = sorted(groups.items(), key=lambda item: bool(normal[item[1]].any()))
    counts = [problem.noise.count(rows) for rows in (one, other)]
    if one.size != n_tangential or not normal[other].all() or min(counts) < _FEWEST:
        return None
    return tuple(
        (noise_name(name), NoiseScale(count, *bounds[name]))
        for name, count in zip((first, second), counts, strict=True)
    )


def _is_inside(noise: NoiseScale, least: float, most: float) -> bool:
    """Whether the bounds of sigma cut nothing off at sums of squares between these."""
    half = 0.5 * noise.n
    top, bottom = 0.5 * least / noise.lower**2, 0.5 * most / noise.upper**2
    return bool(top > gammainccinv(half, _NO_TAIL) and bottom < gammaincinv(half, _NO_TAIL))


def _log_constant(noise: NoiseScale) -> float:
    """Log of the likelihood of a sum of squares Q with sigma integrated out, over Q^(-n/2); eq. (5)."""
    half = 0.5 * noise.n
    return float(gammaln(half)) - half * (2.0 * _HALF_LOG_2PI - math.log(2.0)) - math.log(2.0 * noise.span)


@dataclass(frozen=True)
class _Cells:
    """Between two walls the same rows slide: chi2 is a quadratic in c and kappa.

    Least over c it is g0 + g1 q + g2 q^2, at c = m0 + m1 q, with q = kappa less a reference; it rises by
    ((c - m)/width)^2.

    Attributes
    ----------
    walls : ndarray, (n + 2,)
        Of kappa, from 0 to infinity.
    g : ndarray, (3, n + 1)
    middle : ndarray, (2, n + 1)
        m0 and m1.
    width : float
    bend : ndarray, (n + 1,)
        Coefficient of q^2 at a given c.
    best : float
        chi2 at the certified optimum.
    reference : float
        kappa there.
    noise : NoiseScale or None
        The unknown noise of the rows: then sums of squares are not over sigma^2.
    """

    walls: Array
    g: Array
    middle: Array
    width: float
    bend: Array
    best: float
    reference: float
    noise: NoiseScale | None

    @property
    def dof(self) -> float:
        """Of Student's law of c, where the noise is unknown; else infinite."""
        return math.inf if self.noise is None else self.noise.n - 1.0

    @classmethod
    def of(cls, question: _PlainQuestion, problem: Problem, start: LeastSquaresFit) -> _Cells:
        """Cells of the rows, about the certified optimum."""
        law, w, inverse = question.law, question.weight, 1.0 / question.tau
        places, theta = problem.parameters.positions, start.optimum.theta
        e_n, c, mu = (float(theta[places[name][0]]) for name in ("e_n", question.c.name, "mu"))
        kappa = mu * (1.0 + e_n)
        # about the optimum: sums of squares keep their digits
        rest = question.factor - (law.a0 + law.a1 * c)
        stick, slide = rest - law.b0, rest - kappa * inverse
        n = w.size
        p, s = np.zeros((2, n + 1)), np.zeros((5, n + 1))
        w_stick, w_slide, w_inverse = w * stick, w * slide, w * inverse
        np.cumsum((w_stick * stick, w_stick), axis=1, out=p[:, 1:])
        sliding = np.stack((w_slide * slide, w_slide, w_slide * inverse, w_inverse, w_inverse * inverse))
        s[:, :n] = sliding[:, ::-1].cumsum(axis=1)[:, ::-1]
        f0, f1 = p[0] + s[0], -2.0 * law.a1 * (p[1] + s[1])
        f2, f3, f4, f5 = -2.0 * s[2], law.a1**2 * float(w.sum()), 2.0 * law.a1 * s[3], s[4]
        if question.c.prior is not None:
            mean, sd = question.c.prior
            f0, f1, f3 = f0 + ((c - mean) / sd) ** 2, f1 + 2.0 * (c - mean) / sd**2, f3 + sd**-2.0
        m0, m1 = f1 / (-2.0 * f3), f4 / (-2.0 * f3)
        g = np.stack((f0 - f3 * m0**2, f2 - 2.0 * f3 * m0 * m1, f5 - f3 * m1**2))
        walls = np.concatenate(([0.0], law.b0 * question.tau, [math.inf]))
        best = float(f0[walls[1:-1].searchsorted(kappa)])
        noise = question.noises[0][1] if question.noises else None
        return cls(walls, g, np.stack((c + m0, m1)), 1.0 / math.sqrt(f3), f5, best, kappa, noise)

    def region(self, highest: float, lost: float) -> tuple[float, float, float] | None:
        """Ends of kappa between which all but exp(-lost) is, and how sharp it is there, as an sd.

        None where it reaches the end of the domain, or the bounds of c are far from what the rows say.
        """
        g0, g1, g2 = self.g
        low, high = self.walls[:-1] - self.reference, self.walls[1:] - self.reference
        with np.errstate(divide="ignore", invalid="ignore"):
            vertex = np.where(g2 > 0.0, -0.5 * g1 / g2, low)
        vertex = np.minimum(np.maximum(vertex, low), high)
        least = g0 + (g1 + g2 * vertex) * vertex
        lowest = float(least.min())
        variance = 1.0 if self.noise is None else lowest / self.dof
        if not variance > 0.0 or self.best - lowest > _OUTSIDE * variance:
            return None
        sharpest = float(self.bend[least < self.best + _NEAR * variance].max())
        if not sharpest > 0.0:
            return None
        sd = math.sqrt(variance / sharpest)
        rise = 2.0 * (lost + 3.0 * math.log1p(highest / sd))
        edge = self.best + rise if self.noise is None else self.best * math.exp(rise / self.dof)
        holds = np.flatnonzero(least < edge)
        first, last = int(holds[0]), int(holds[-1])
        if last == least.size - 1:
            return None  # nothing need slide
        ends = []
        for cell, side in ((first, -1.0), (last, 1.0)):
            a, b, c = float(g2[cell]), float(g1[cell]), float(g0[cell]) - edge
            if a > 0.0:
                end = (-b + side * math.sqrt(max(b * b - 4.0 * a * c, 0.0))) / (2.0 * a)
            else:
                end = side * math.inf
            ends.append(min(max(end, float(low[cell])), float(high[cell])) + self.reference)
        # the mass below 1e-12 of eq. (8) lies further out than these ends
        return (ends[0], ends[1], sd) if ends[1] < highest else None


@dataclass(frozen=True)
class _Transition:
    """The integral over kappa, and what c is at its nodes; levels are the rules and the coarse ones inside.

    Attributes
    ----------
    kappa, middle : ndarray, (nodes,)
        kappa, and the middle of c's normal law there.
    width : ndarray, (nodes,)
        Of that law.
    share : ndarray, (2, nodes)
        Probability of each node.
    height : ndarray, (2, nodes)
        The same over what the normal law holds between the bounds.
    law : PanelCdf
        Of kappa.
    log_mass : ndarray, (2,)
        Log of the integral of exp(-chi2/2) over kappa and c.
    cut : tuple of ndarray or None
        Standardised bounds of c at each node; None where they cut nothing off.
    dof : float
        Of Student's law in the place of the normal one; infinite where the noise is known.
    square : ndarray, (nodes,)
        Sum of squares, least over c.
    beyond : float
        Probability beyond the bounds of c that was left out.
    counts : ndarray of int
        Nodes that count in distribution functions.
    """

    kappa: Array
    middle: Array
    width: Array
    share: Array
    height: Array
    law: PanelCdf
    log_mass: Array
    cut: tuple[Array, Array] | None
    dof: float
    square: Array
    beyond: float
    counts: Index

    @classmethod
    def of(
        cls,
        cells: _Cells,
        region: tuple[float, float, float],
        c: FreeParameter,
        width: float,
        tolerance: float,
    ) -> _Transition | None:
        """None where it would take very many panels."""
        low, high, sd = region
        count = math.ceil((high - low) / (width * sd))
        kinks = cells.walls[1:-1]
        kinks = kinks[(kinks > low) & (kinks < high)]
        if count + kinks.size > _MOST_PANELS:
            return None
        order = _LOW_ORDER if kinks.size > count else _ORDER
        axis = QuadratureAxis.of(np.concatenate((kinks, np.linspace(low, high, count + 1))), order)
        inside = 0.5 * (axis.panels[:, 0] + axis.panels[:, 1])
        cell = cells.walls[1:-1].searchsorted(inside)
        nodes = axis.nodes().reshape(axis.shape)
        q = nodes - cells.reference
        g0, g1, g2 = cells.g[:, cell, None]
        m0, m1 = cells.middle[:, cell, None]
        middle, square = m0 + m1 * q, g0 + (g1 + g2 * q) * q
        if cells.noise is None:
            log_scale = math.log(cells.width) + _HALF_LOG_2PI - 0.5 * cells.best
            bare = np.exp(-0.5 * (square - cells.best))
            spread = np.full(square.shape, cells.width)
        else:
            if not square.min() > 0.0:
                return None
            half = 0.5 * cells.dof
            log_scale = _log_constant(cells.noise) + math.log(cells.width) - half * math.log(cells.best)
            log_scale += 0.5 * math.log(math.pi) + float(gammaln(half) - gammaln(half + 0.5))
            bare = (cells.best / square) ** half
            spread = cells.width * np.sqrt(square / cells.dof)
        below, above = (c.lower - middle) / spread, (c.upper - middle) / spread
        held, cut, tails = bare, None, None
        if cells.noise is not None:
            tails = (stdtr(cells.dof, below) + stdtr(cells.dof, -above)).reshape(-1)
        elif below.max() > -_FREE_OF_BOUNDS or above.min() < _FREE_OF_BOUNDS:
            cut = below.reshape(-1), above.reshape(-1)
            held = bare * (ndtr(above) - ndtr(below))
        weights, per = axis.weights(), held.reshape(-1)
        mass = weights @ per
        if not mass.min() > 0.0:
            return None
        weights /= mass[:, None]
        law = PanelCdf.of_levels(axis, per / mass[:, None])
        share, height = weights * per, weights * bare.reshape(-1)
        beyond = 0.0 if tails is None else float(share[0] @ tails)
        return cls(
            nodes.reshape(-1),
            middle.reshape(-1),
            spread.reshape(-1),
            share,
            height,
            law,
            np.log(mass) + log_scale,
            cut,
            cells.dof,
            square.reshape(-1),
            beyond,
            np.flatnonzero(share[0] > _NO_SHARE * tolerance),
        )

    def is_within(self, noises: Sequence[tuple[str, NoiseScale]]) -> bool:
        """Whether the bounds of an unknown noise cut nothing off."""
        if not noises:
            return True
        kept = self.square[self.counts]
        return _is_inside(noises[0][1], float(kept.min()), float(kept.max()))

    @cached_property
    def c_mean(self) -> tuple[Array, Array]:
        """Mean of c given kappa, times the probability of each node, (2, nodes); and of c, (2,)."""
        each = self.share * self.middle
        if self.cut is not None:
            low, high = (_PER_ROOT_2PI * np.exp(-0.5 * end * end) for end in self.cut)
            each = each + self.height * (self.width * (low - high))
        return each, each.sum(axis=1)

    def c_moments(self) -> list[tuple[float, float]]:
        """Mean and standard deviation of c by both levels."""
        mean = self.c_mean[1]
        offset = self.middle - mean[0]
        student = 1.0 if math.isinf(self.dof) else self.dof / (self.dof - 2.0)
        square = self.share @ (offset * offset + student * self.width**2)
        if self.cut is not None:
            low, high = self.cut
            at_low, at_high = (_PER_ROOT_2PI * np.exp(-0.5 * end * end) for end in self.cut)
            lean, slope = low * at_low - high * at_high, at_low - at_high
            square = square + self.height @ (self.width**2 * lean + 2.0 * offset * self.width * slope)
        variance = square - (mean - mean[0]) ** 2
        return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(mean, variance, strict=True)]

    def c_below(self, t: Array, levels: int) -> Array:
        """Distribution function of c: the mean of those given kappa, eq. (9)."""
        middle, width, height, cut = self._kept
        z = (t[:, None] - middle) / width
        if not math.isinf(self.dof):
            return np.asarray(height[:levels] @ stdtr(self.dof, z).T)
        if cut is None:
            return np.asarray(height[:levels] @ ndtr(z).T)
        low, high = cut
        below = ndtr(np.minimum(np.maximum(z, low), high)) - ndtr(low)
        return np.asarray(height[:levels] @ below.T)

    @cached_property
    def _kept(self) -> tuple[Array, Array, Array, tuple[Array, Array] | None]:
        """`middle`, `width`, `height` and `cut` of the nodes that count."""
        at = self.counts
        cut = None if self.cut is None else (self.cut[0][at], self.cut[1][at])
        return self.middle[at], self.width[at], self.height[:, at], cut

    def mean_product(self, one: str, other: str) -> float:
        """Mean of a product of two of "one", "kappa" and "c", by the rules; not of c with itself."""
        of_c = self.c_mean[0][0] if "c" in (one, other) else self.share[0]
        if one == other == "kappa":
            return float(of_c @ (self.kappa * self.kappa))
        return float(of_c @ self.kappa) if "kappa" in (one, other) else float(of_c.sum())


@dataclass(frozen=True)
class _Restitution:
    """The law of e_n: normal, or Student's, between its bounds, times the Jacobian 1/(1 + e_n).

    Attributes
    ----------
    nodes : ndarray, (nodes,)
    share : ndarray, (2, nodes)
        Probabilities.
    law : PanelCdf
    log_mass : ndarray, (2,)
        Log of the integral of the likelihood, up to the constant of known noise.
    middle, sd : float
        Of the normal law.
    is_whole : bool
        Whether it is normal, and the bounds cut nothing off.
    square : ndarray, (nodes,)
        Sum of squares.
    counts : ndarray of int
        Nodes that count.
    """

    nodes: Array
    share: Array
    law: PanelCdf
    log_mass: Array
    middle: float
    sd: float
    is_whole: bool
    square: Array
    counts: Index

    @classmethod
    def of(cls, question: _PlainQuestion, lost: float, width: float, tolerance: float) -> _Restitution | None:
        """None where the values lie outside the bounds."""
        value, weight = question.e_value, question.e_weight
        total = float(weight.sum())
        mean, sd = float(weight @ value) / total, 1.0 / math.sqrt(total)
        chi2 = float(weight @ (value - mean) ** 2)
        noise = question.noises[1][1] if question.noises else None
        reach = math.sqrt(2.0 * lost)
        if noise is not None:
            dof = noise.n - 1.0
            if not chi2 > 0.0:
                return None
            sd *= math.sqrt(chi2 / dof)
            reach = math.sqrt(dof * math.expm1(2.0 * lost / dof))
        lower, upper = question.e_n.lower, question.e_n.upper
        low, high = max(lower, mean - reach * sd), min(upper, mean + reach * sd)
        if mean < lower - 4.0 * sd or mean > upper + 4.0 * sd or not high > low:
            return None
        count = math.ceil((high - low) / (width * sd))
        if count > _MOST_PANELS:
            return None
        axis = QuadratureAxis.of(np.linspace(low, high, count + 1), _ORDER)
        nodes = axis.nodes()
        z = (nodes - mean) / sd
        if noise is None:
            log_scale, square = -0.5 * chi2, chi2 + z * z
            density = np.exp(-0.5 * z * z) / (1.0 + nodes)
        else:
            log_scale, square = (
                _log_constant(noise) - 0.5 * noise.n * math.log(chi2),
                chi2 * (1.0 + z * z / dof),
            )
            density = (chi2 / square) ** (0.5 * noise.n) / (1.0 + nodes)
        weights = axis.weights()
        mass = weights @ density
        share = weights * (density / mass[:, None])
        counts = np.flatnonzero(share[0] > _NO_SHARE * tolerance)
        if noise is not None:
            kept = square[counts]
            if not _is_inside(noise, float(kept.min()), float(kept.max())):
                return None
        law = PanelCdf.of_levels(axis, density / mass[:, None])
        is_whole = noise is None and low > lower and high < upper
        return cls(nodes, share, law, np.log(mass) + log_scale, mean, sd, is_whole, square, counts)

    def mean(self, of: Array) -> float:
        """Mean of what is given at the nodes, by the rules."""
        return float(self.share[0] @ of)

    def points(self, *, few: bool) -> tuple[Array, Array]:
        """1 + e_n at points for means of what varies little with it, (n,), and probabilities, (levels, n).

        By the rules of Gauss and Hermite, where few points are wanted and no bound cuts a normal law off; the
        points of the fine rule come first.
        """
        if not (few and self.is_whole):
            return 1.0 + self.nodes[self.counts], self.share[:, self.counts]
        factor = 1.0 + self.middle + self.sd * _HERMITE
        weight = _HERMITE_WEIGHTS / factor
        return factor, weight / weight.sum(axis=1, keepdims=True)


def _marginals(
    problem: Problem,
    question: _PlainQuestion,
    kappa: _Transition,
    e_n: _Restitution,
    tolerance: float,
    *,
    few: bool,
) -> dict[str, Marginal]:
    """Of the free entries of theta in their order, and of kappa."""
    of_kappa, of_e_n = _moments(kappa.share, kappa.kappa), _moments(e_n.share, e_n.nodes)
    inverse = _moments(e_n.share, 1.0 / (1.0 + e_n.nodes))
    of_mu = [_product(one, other) for one, other in zip(of_kappa, inverse, strict=True)]
    of_c = kappa.c_moments()
    every = {
        "e_n": (question.e_n, of_e_n, e_n.law.below_in_all),
        question.c.name: (question.c, of_c, kappa.c_below),
        "mu": (question.mu, of_mu, _quotient(kappa, e_n, of_kappa[0], of_e_n[0], few=few)),
    }
    found = {}
    for name in problem.parameters.free_names:
        one, moments, below = every[name]
        found[name] = Marginal(name, one.lower, one.upper, moments.__getitem__, below)
    name, below = problem.parameters.kappas[0].name, kappa.law.below_in_all
    found[name] = Marginal(name, 0.0, question.highest_kappa, of_kappa.__getitem__, below)
    if question.noises:
        (first, own), (second, other) = question.noises
        # with c integrated out, sigma knows a sum of squares of one row less
        negligible = _NO_SHARE * tolerance * kappa.kappa.size
        less = NoiseScale(own.n - 1.0, own.lower, own.upper)
        found[first] = noise_over_squares(less, DiscreteLaw.of(kappa.square, kappa.share), negligible, first)
        found[second] = noise_over_squares(other, DiscreteLaw.of(e_n.square, e_n.share), negligible, second)
    return found


def _quotient(
    kappa: _Transition,
    e_n: _Restitution,
    of_kappa: tuple[float, float],
    of_e_n: tuple[float, float],
    *,
    few: bool,
) -> Cdf:
    """Distribution function of mu, eq. (10): the mean over the narrower one of kappa and 1 + e_n."""
    ratio = of_e_n[1] / (1.0 + of_e_n[0]) * of_kappa[0] / of_kappa[1]
    if ratio > 1.0:
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
