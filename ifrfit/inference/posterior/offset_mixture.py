"""The exact posterior with an unknown offset of the set angles: a mixture of posteriors at given offsets.

At a given offset the posterior is one of `adaptive_quadrature`, with evidence Z(offset). The offset itself
has the density Z(offset) times its prior, which a trapezoidal rule integrates: with equal steps over the
whole line it converges faster than any power of the step where the integrand is smooth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.distributions.mixture import Mixture, Tabulated
from ifrfit.inference.distributions.truncated_normal import TruncatedNormal
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import OFFSET, Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares, refit
from ifrfit.inference.posterior.adaptive_quadrature import TOLERANCE, integrate
from ifrfit.inference.posterior.adaptive_quadrature import log_evidence as evidence_of_constants
from ifrfit.inference.posterior.quadrature_posterior import QuadraturePosterior

Array = NDArray[np.float64]

_FINEST = 1.0 / 16.0  # least step between nodes, in sd of the law that they are laid by
_OUTERMOST = 5  # sd of that law to the first and last node
_TAIL = 1e-5  # share of the mass that an outermost node may have
_WIDER = 1.6  # factor on the sd of that law where it has more
_TRIES = 6
_DEEP = 12.0  # of minus twice the log likelihood: other minima that lie higher have no weight
_SMOOTH = 1.3  # sd of a component from the mean of one to the next; more would leave bumps in their sum
_COUNTED = 1e-4  # weight of components that are looked at for that
_NOTHING = 1e-8  # weight of components that are left out
_DENSE = 1.0 / 32.0  # step at which the density of the offset is tabulated, in sd of the law


def integrate_over_offset(
    problem: Problem, tolerance: float = TOLERANCE, start: LeastSquaresFit | None = None
) -> Mixture:
    """Integrate the posterior of a problem with an unknown offset of the set angles.

    Parameters
    ----------
    problem : Problem
        With an unknown offset.
    tolerance : float
        Of means, standard deviations and quantiles in posterior standard deviations, and of the log evidence.
    start : LeastSquaresFit, optional
        The optimum, over the offset as well, where it is known already.

    Raises
    ------
    DataError, UsageError
        As `ifrfit.inference.posterior.integrate`.
    """
    nodes = _nodes(problem, tolerance, start)
    step, error = nodes.converged_step()
    while True:
        weights, components = nodes.components(step)
        if step <= _FINEST or _is_smooth(weights, components):
            break
        step *= 0.5
    own = float(weights @ [each.error for each in components])
    return Mixture(
        OFFSET,
        nodes.offsets(step)[nodes.has_weight(step)],
        weights,
        components,
        nodes.marginal(step),
        nodes.log_evidence(step),
        max(error, own),
        max(error, float(weights @ [each.error_evidence for each in components])),
        tolerance,
    )


def log_evidence(
    problem: Problem, tolerance: float = TOLERANCE, start: LeastSquaresFit | None = None
) -> float:
    """Log of the integral of the normalised likelihood times the normalised prior, without the marginals.

    Parameters
    ----------
    problem : Problem
        With an unknown offset of the set angles.
    tolerance : float
        Of the log evidence: the last change between two rules.
    start : LeastSquaresFit, optional
        The optimum, where it is known already.

    Raises
    ------
    DataError, UsageError
        As `ifrfit.inference.posterior.integrate`.
    """
    nodes = _nodes(problem, tolerance, start)
    step, _ = nodes.converged_step()
    return nodes.log_evidence(step)


def _nodes(problem: Problem, tolerance: float, start: LeastSquaresFit | None) -> _Nodes:
    """Nodes about the optimum, and about every other minimum that may have weight."""
    start = least_squares(problem) if start is None else start
    offset = start.angle_offset
    assert problem.offset is not None
    assert offset is not None
    places = [offset.value, *(place for rise, place in offset.minima if rise <= _DEEP)]
    center = 0.5 * (min(places) + max(places))
    sd = offset.sd + 0.5 * (max(places) - min(places)) / _OUTERMOST
    for _ in range(_TRIES):
        law = TruncatedNormal(center, center, sd, problem.offset.lower, problem.offset.upper)
        nodes = _Nodes(problem, problem.offset, law, tolerance, start)
        if nodes.cover_the_mass:
            break
        sd *= _WIDER
    return nodes


def _is_smooth(weights: Array, components: tuple[QuadraturePosterior, ...]) -> bool:
    """Whether neighbours overlap in every quantity, so that their sum has no bumps."""
    counted = weights > _COUNTED
    for name in components[0].names:
        mean = np.array([each.mean(name) for each in components])
        sd = np.array([each.sd(name) for each in components])
        near = counted[:-1] & counted[1:]
        if (np.abs(np.diff(mean)) > _SMOOTH * np.minimum(sd[:-1], sd[1:]))[near].any():
            return False
    return True


@dataclass(frozen=True)
class _Nodes:
    """Posteriors at offsets that are equally spaced in x, the normal score of a law of the offset.

    Attributes
    ----------
    problem : Problem
    prior : FreeParameter
        Of the offset.
    law : TruncatedNormal
        The closer it is to the posterior of the offset, the fewer nodes are needed.
    tolerance : float
    start : LeastSquaresFit
        The optimum, over the offset as well.
    """

    problem: Problem
    prior: FreeParameter
    law: TruncatedNormal
    tolerance: float
    start: LeastSquaresFit
    _evaluated: dict[float, tuple[float, LeastSquaresFit]] = field(default_factory=dict)
    _posteriors: dict[float, QuadraturePosterior] = field(default_factory=dict)

    def offset_at(self, x: float) -> float:
        """The offset, degrees, at a normal score."""
        return self.law.quantile(float(special.ndtr(x)))

    def _at(self, x: float) -> tuple[float, LeastSquaresFit]:
        """Log density over x, and the optimum at the offset there."""
        if x not in self._evaluated:
            offset = self.offset_at(x)
            problem = self.problem.at_offset(offset)
            # only a search needs a place to begin
            near = None if problem.closure.bilinear else self.start.optimum.theta
            fit = refit(problem, self.start.sigma, near)
            evidence, _ = evidence_of_constants(problem, self.tolerance, fit)
            low, score, high = (
                (end - self.law.center) / self.law.sd for end in (self.law.lower, offset, self.law.upper)
            )
            # of the offset by x: ratio of the normal density and of that of the law
            mass = special.ndtr(high) - special.ndtr(low)
            log_slope = 0.5 * (score**2 - x**2) + math.log(self.law.sd) + math.log(mass)
            self._evaluated[x] = evidence + float(self.prior.log_prior(np.array(offset))) + log_slope, fit
        return self._evaluated[x]

    def _places(self, step: float) -> list[float]:
        count = round(_OUTERMOST / step)
        return [step * number for number in range(-count, count + 1)]

    def offsets(self, step: float) -> Array:
        """Offsets of the nodes with a step."""
        return np.array([self.offset_at(x) for x in self._places(step)])

    def _log_density(self, step: float) -> Array:
        return np.array([self._at(x)[0] for x in self._places(step)])

    def log_evidence(self, step: float) -> float:
        """Log of the integral over the offset by the trapezoidal rule."""
        return float(special.logsumexp(self._log_density(step))) + math.log(step)

    def _weights(self, step: float) -> Array:
        return np.asarray(special.softmax(self._log_density(step)))

    @property
    def cover_the_mass(self) -> bool:
        """Whether the outermost nodes have next to none of the mass."""
        weights = self._weights(1.0)
        return bool(max(weights[0], weights[-1]) <= _TAIL)

    def converged_step(self) -> tuple[float, float]:
        """The largest step half of which changes evidence, mean and sd within the tolerance; the change."""
        step = 1.0
        while True:
            change = self._change(step)
            if change <= self.tolerance or step <= 2.0 * _FINEST:
                return step, change
            step *= 0.5

    def _change(self, step: float) -> float:
        """How much the evidence, and mean and sd of the offset over its sd, change with half the step."""
        (mean, sd), (finer_mean, finer_sd) = self._moments(step), self._moments(0.5 * step)
        return max(
            abs(self.log_evidence(step) - self.log_evidence(0.5 * step)),
            abs(mean - finer_mean) / finer_sd,
            abs(sd - finer_sd) / finer_sd,
        )

    def _moments(self, step: float) -> tuple[float, float]:
        weights, offsets = self._weights(step), self.offsets(step)
        mean = float(weights @ offsets)
        return mean, math.sqrt(float(weights @ (offsets - mean) ** 2))

    def has_weight(self, step: float) -> NDArray[np.bool_]:
        """Which nodes count."""
        return np.asarray(self._weights(step) > _NOTHING)

    def components(self, step: float) -> tuple[Array, tuple[QuadraturePosterior, ...]]:
        """Weights and posteriors of the nodes that count."""
        counted = self.has_weight(step)
        weights = self._weights(step)[counted]
        places = [x for x, counts in zip(self._places(step), counted, strict=True) if counts]
        for x in places:
            if x not in self._posteriors:
                problem = self.problem.at_offset(self.offset_at(x))
                self._posteriors[x] = integrate(problem, self.tolerance, self._at(x)[1])
        return weights / weights.sum(), tuple(self._posteriors[x] for x in places)

    def marginal(self, step: float) -> Tabulated:
        """The distribution of the offset: the logarithm of its density over x, between the nodes a spline."""
        from scipy.interpolate import CubicSpline

        places, log_density = np.array(self._places(step)), self._log_density(step)
        x = np.arange(-_OUTERMOST, _OUTERMOST + _DENSE, _DENSE)
        density = np.exp(CubicSpline(places, log_density - log_density.max())(x))
        below = np.concatenate(([0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))))
        return Tabulated(np.array([self.offset_at(each) for each in x]), below / below[-1])
