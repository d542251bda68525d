"""The law of e_n apart from all else but a Jacobian: normal, or Student's, between bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.plain_question import MOST_PANELS, NO_SHARE, PlainQuestion
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_ORDER = 16  # of the rules, with those of half the order inside them


def _hermite(fine: int, coarse: int) -> tuple[Array, Array]:
    """Points of two rules of Gauss and Hermite for the standard normal law, and their weights, (2, n)."""
    (x, w), (y, v) = (np.polynomial.hermite_e.hermegauss(order) for order in (fine, coarse))
    weights = np.zeros((2, fine + coarse))
    weights[0, :fine], weights[1, fine:] = w, v
    return np.concatenate((x, y)), weights


_HERMITE, _HERMITE_WEIGHTS = _hermite(12, 6)


class RestitutionLaw(NamedTuple):
    """What rows say of e_n: a normal law, or Student's, and where its bounds and its tails end it.

    Attributes
    ----------
    mean, sd : float
        Of the normal law; where the noise is unknown, middle and scale of Student's.
    chi2 : float
        Sum of squares at the mean.
    noise : NoiseScale or None
        The unknown noise.
    low, high : float
        Bounds, or where all but exp(-lost) is between.
    is_whole : bool
        Whether it is normal, and the bounds cut nothing off.
    """

    mean: float
    sd: float
    chi2: float
    noise: NoiseScale | None
    low: float
    high: float
    is_whole: bool

    @classmethod
    def of(cls, question: PlainQuestion, lost: float) -> RestitutionLaw | None:
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
        return cls(mean, sd, chi2, noise, low, high, noise is None and low > lower and high < upper)


@dataclass(frozen=True)
class RestitutionIntegral:
    """The law of e_n: normal, or Student's, between its bounds, times the Jacobian 1/(1 + e_n).

    Attributes
    ----------
    nodes : ndarray, (nodes,)
    share : ndarray, (2, nodes)
        Probabilities.
    density : ndarray, (2, nodes)
    law : PanelCdf
    log_mass : ndarray, (2,)
        Log of the integral of the likelihood, up to the constant of known noise.
    likelihood : RestitutionLaw
    square : ndarray, (nodes,)
        Sum of squares.
    counts : ndarray of int
        Nodes that count.
    """

    nodes: Array
    share: Array
    density: Array
    law: PanelCdf
    log_mass: Array
    likelihood: RestitutionLaw
    square: Array
    counts: Index

    @classmethod
    def of(
        cls, likelihood: RestitutionLaw, width: float, tolerance: float, kinks: Array | None = None
    ) -> RestitutionIntegral | None:
        """On panels of a width, in sd, that end at kinks; None where there would be very many."""
        mean, sd, chi2, noise = likelihood.mean, likelihood.sd, likelihood.chi2, likelihood.noise
        low, high = likelihood.low, likelihood.high
        count = math.ceil((high - low) / (width * sd))
        if count + (0 if kinks is None else kinks.size) > MOST_PANELS:
            return None
        edges = np.linspace(low, high, count + 1)
        axis = QuadratureAxis.of(edges if kinks is None else np.concatenate((edges, kinks)), _ORDER)
        nodes = axis.nodes()
        z = (nodes - mean) / sd
        if noise is None:
            log_scale, square = -0.5 * chi2, chi2 + z * z
            density = np.exp(-0.5 * z * z) / (1.0 + nodes)
        else:
            log_scale, square = (
                noise.log_constant - 0.5 * noise.n * math.log(chi2),
                chi2 * (1.0 + z * z / (noise.n - 1.0)),
            )
            density = (chi2 / square) ** (0.5 * noise.n) / (1.0 + nodes)
        weights = axis.weights()
        mass = weights @ density
        density = density / mass[:, None]
        share = weights * density
        counts = np.flatnonzero(share[0] > NO_SHARE * tolerance)
        if noise is not None:
            kept = square[counts]
            if not noise.keeps_all(float(kept.min()), float(kept.max())):
                return None
        law = PanelCdf.of_levels(axis, density)
        return cls(nodes, share, density, law, np.log(mass) + log_scale, likelihood, square, counts)

    def times(self, weight: Array, tolerance: float) -> RestitutionIntegral:
        """The law with a weight at each node, (2, nodes), up to a constant; `log_mass` has its logarithm."""
        share = self.share * weight
        kept = share.sum(axis=1)
        share, density = share / kept[:, None], self.density * (weight / kept[:, None])
        return replace(
            self,
            share=share,
            density=density,
            law=PanelCdf.of_levels(self.law.axis, density),
            log_mass=self.log_mass + np.log(kept),
            counts=np.flatnonzero(share[0] > NO_SHARE * tolerance),
        )

    def mean(self, of: Array) -> float:
        """Mean of what is given at the nodes, by the rules."""
        return float(self.share[0] @ of)

    def points(self, *, few: bool) -> tuple[Array, Array]:
        """1 + e_n at points for means of what varies little with it, (n,), and probabilities, (levels, n).

        By the rules of Gauss and Hermite, where few points are wanted and no bound cuts a normal law off; the
        points of the fine rule come first.
        """
        if not (few and self.likelihood.is_whole):
            return 1.0 + self.nodes[self.counts], self.share[:, self.counts]
        factor = 1.0 + self.likelihood.mean + self.likelihood.sd * _HERMITE
        weight = _HERMITE_WEIGHTS / factor
        return factor, weight / weight.sum(axis=1, keepdims=True)
