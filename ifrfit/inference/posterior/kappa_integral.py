"""The integral over kappa, with the closure constant in closed form given kappa.

Section 11 of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtr, stdtr

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.plain_question import MOST_PANELS, NO_SHARE, PlainQuestion
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_ORDER = 16  # of the rules, with those of half the order inside them
_LOW_ORDER = 8  # where most panels end at transitions, and are narrow
_NEAR = 32.0  # of chi2 above the best, within which a cell says how sharp kappa is
_OUTSIDE = 16.0  # of chi2 by which the optimum without bounds may lie below the one inside
_FREE_OF_BOUNDS = 9.0  # sd between c and its bounds from which nothing is cut off
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)
_PER_ROOT_2PI = 1.0 / math.sqrt(2.0 * math.pi)


class Region(NamedTuple):
    """Ends of kappa between which all but a negligible mass is, and how sharp it is there, as an sd."""

    low: float
    high: float
    sd: float


@dataclass(frozen=True)
class SlidingCells:
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
    def of(cls, question: PlainQuestion, problem: Problem, start: LeastSquaresFit) -> SlidingCells:
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
        sliding = np.array((w_slide * slide, w_slide, w_slide * inverse, w_inverse, w_inverse * inverse))
        s[:, :n] = sliding[:, ::-1].cumsum(axis=1)[:, ::-1]
        f0, f1 = p[0] + s[0], -2.0 * law.a1 * (p[1] + s[1])
        f2, f3, f4, f5 = -2.0 * s[2], law.a1**2 * float(w.sum()), 2.0 * law.a1 * s[3], s[4]
        if question.c.prior is not None:
            mean, sd = question.c.prior
            f0, f1, f3 = f0 + ((c - mean) / sd) ** 2, f1 + 2.0 * (c - mean) / sd**2, f3 + sd**-2.0
        m0, m1 = f1 / (-2.0 * f3), f4 / (-2.0 * f3)
        g = np.array((f0 - f3 * m0**2, f2 - 2.0 * f3 * m0 * m1, f5 - f3 * m1**2))
        walls = np.concatenate(([0.0], law.b0 * question.tau, [math.inf]))
        best = float(f0[walls[1:-1].searchsorted(kappa)])
        noise = question.noises[0][1] if question.noises else None
        return cls(walls, g, np.array((c + m0, m1)), 1.0 / math.sqrt(f3), f5, best, kappa, noise)

    def region(self, c: FreeParameter, highest: float, furthest: float, lost: float) -> Region | None:
        """Where kappa is, up to the furthest one; None where the bounds of c are far from what the rows say.

        Parameters
        ----------
        c : FreeParameter
            The closure constant, with its bounds.
        highest : float
            What its domain is compared with: the wider, the less density may be left out.
        furthest : float
            End of the domain.
        lost : float
            All but exp(-lost) is to be between the ends.
        """
        inside = int(self.walls[1:-1].searchsorted(furthest)) + 1
        g0, g1, g2 = self.g[:, :inside]
        low = self.walls[:inside] - self.reference
        high = np.minimum(self.walls[1 : inside + 1], furthest) - self.reference
        curved = g2 > 0.0
        vertex = np.where(curved, -0.5 * g1 / np.where(curved, g2, 1.0), low)
        vertex = np.minimum(np.maximum(vertex, low), high)
        bare = least = g0 + (g1 + g2 * vertex) * vertex
        if least[-1] < self._edge(4.0 * lost):  # all may slide as well as all stick, but for the bounds of c
            least = bare + self._outside(c, low, high)
        best_cell = int(least.argmin())
        variance = 1.0 if self.noise is None else float(least[best_cell]) / self.dof
        lowest, above = float(bare[best_cell]), float(least[best_cell]) - self.best
        if not variance > 0.0 or max(self.best - lowest, above) > _OUTSIDE * variance:
            return None
        sharpest = float(self.bend[:inside][least < self.best + _NEAR * variance].max())
        if not sharpest > 0.0:
            return None
        sd = math.sqrt(variance / sharpest)
        edge = self._edge(2.0 * (lost + 3.0 * math.log1p(highest / sd)))
        holds = np.flatnonzero(least < edge)
        first, last = int(holds[0]), int(holds[-1])
        ends = [
            min(max(self._end(cell, side, edge, float(bare[cell]), c), float(low[cell])), float(high[cell]))
            for cell, side in ((first, -1.0), (last, 1.0))
        ]
        if not ends[0] < ends[1]:  # as where a best mu lies beyond the end of its domain
            return None
        return Region(ends[0] + self.reference, ends[1] + self.reference, sd)

    def _edge(self, rise: float) -> float:
        """Sum of squares at which twice the log density has fallen so far from that of the optimum."""
        return self.best + rise if self.noise is None else self.best * math.exp(rise / self.dof)

    def _outside(self, c: FreeParameter, low: Array, high: Array) -> Array:
        """What the bounds of c add at least to the sum of squares between ends of each cell."""
        m0, m1 = self.middle[:, : low.size]
        one, other = m0 + m1 * low, m0 + m1 * high
        beyond = np.maximum(c.lower - np.maximum(one, other), np.minimum(one, other) - c.upper)
        return np.asarray((np.maximum(beyond, 0.0) / self.width) ** 2)

    def _end(self, cell: int, side: float, edge: float, least: float, c: FreeParameter) -> float:
        """Where a cell's sum of squares has risen to an edge, on a side, or c gone far beyond its bounds."""
        g0, g1, g2 = self.g[:, cell].tolist()
        m0, m1 = self.middle[:, cell].tolist()
        end = side * math.inf
        if g2 > 0.0:
            end = (-g1 + side * math.sqrt(max(g1 * g1 - 4.0 * g2 * (g0 - edge), 0.0))) / (2.0 * g2)
        if m1 != 0.0:
            room = self.width * math.sqrt(max(edge - least, 0.0))
            limit = ((c.upper + room if side * m1 > 0.0 else c.lower - room) - m0) / m1
            end = side * min(side * end, side * limit)
        return end

    def edges(self, region: Region, width: float) -> tuple[Array, Array] | None:
        """Walls inside a region, and even panels of a width in its sd; None for very many."""
        low, high, sd = region
        count = math.ceil((high - low) / (width * sd))
        return (
            None
            if count > MOST_PANELS
            else (self.walls_between(low, high), np.linspace(low, high, count + 1))
        )

    def walls_between(self, low: float, high: float) -> Array:
        """Walls of kappa between two others."""
        walls = self.walls[1:-1]
        return walls[(walls > low) & (walls < high)]


@dataclass(frozen=True)
class KappaIntegral:
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
    density : ndarray, (2, nodes)
        Of kappa.
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
    density: Array
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
        cells: SlidingCells,
        edges: tuple[Array, Array],
        c: FreeParameter,
        tolerance: float,
    ) -> KappaIntegral | None:
        """On panels between edges, of which the first ones are walls; None where there are very many."""
        kinks, others = edges
        if others.size + kinks.size > MOST_PANELS + 1:
            return None
        order = _LOW_ORDER if kinks.size >= others.size else _ORDER
        axis = QuadratureAxis.of(np.concatenate(edges), order)
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
            log_scale = cells.noise.log_constant + math.log(cells.width) - half * math.log(cells.best)
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
        density = per / mass[:, None]
        law = PanelCdf.of_levels(axis, density)
        share, height = weights * per, weights * bare.reshape(-1)
        beyond = 0.0 if tails is None else float(share[0] @ tails)
        return cls(
            nodes.reshape(-1),
            middle.reshape(-1),
            spread.reshape(-1),
            share,
            height,
            density,
            law,
            np.log(mass) + log_scale,
            cut,
            cells.dof,
            square.reshape(-1),
            beyond,
            np.flatnonzero(share[0] > NO_SHARE * tolerance),
        )

    def times(self, weight: Array, tolerance: float) -> KappaIntegral:
        """The law with a weight at each node, (2, nodes), up to a constant; `log_mass` has its logarithm."""
        share = self.share * weight
        kept = share.sum(axis=1)
        weight = weight / kept[:, None]
        share, density = share / kept[:, None], self.density * weight
        return replace(
            self,
            share=share,
            height=self.height * weight,
            density=density,
            law=PanelCdf.of_levels(self.law.axis, density),
            log_mass=self.log_mass + np.log(kept),
            beyond=self.beyond / float(kept[0]),
            counts=np.flatnonzero(share[0] > NO_SHARE * tolerance),
        )

    def is_within(self, noises: Sequence[tuple[str, NoiseScale]]) -> bool:
        """Whether the bounds of an unknown noise cut nothing off."""
        if not noises:
            return True
        kept = self.square[self.counts]
        return noises[0][1].keeps_all(float(kept.min()), float(kept.max()))

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

    @cached_property
    def centres(self) -> dict[str, float]:
        """Means of kappa and of c, by the rules."""
        return {"kappa": float(self.share[0] @ self.kappa), "c": float(self.c_mean[1][0])}

    def mean_product(self, one: str, other: str, factor: Array | float = 1.0) -> float:
        """Mean of a product of two of "one", "kappa" and "c", by the rules; not of c with itself.

        And of a factor that is given at the nodes. kappa and c are taken about their centres: products of
        what is known to eight digits lose all that two of them say of one another.
        """
        share, centres = self.share[0], self.centres
        each = (self.c_mean[0][0] - centres["c"] * share if "c" in (one, other) else share) * factor
        about = self.kappa - centres["kappa"]
        if one == other == "kappa":
            return float(each @ (about * about))
        return float(each @ about) if "kappa" in (one, other) else float(each.sum())
