"""Panels along one coordinate, refined where the data ask for it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.clenshaw_curtis import rule

Array = NDArray[np.float64]


@dataclass
class QuadratureAxis:
    """Panels along one coordinate, (low, high) each, and the order of the rule on them."""

    panels: Array
    order: int

    @classmethod
    def of(cls, edges: Array, order: int) -> QuadratureAxis:
        """Panels between neighbouring edges."""
        edges = np.unique(edges)
        return cls(np.column_stack((edges[:-1], edges[1:])), order)

    @property
    def low(self) -> Array:
        """Lower ends."""
        return self.panels[:, 0]

    @property
    def width(self) -> Array:
        """Widths."""
        return self.panels[:, 1] - self.panels[:, 0]

    @property
    def shape(self) -> tuple[int, int]:
        """Panels, and nodes on each."""
        return self.panels.shape[0], self.order + 1

    @property
    def size(self) -> int:
        """Nodes on all panels."""
        return math.prod(self.shape)

    def errors(self, density: Array) -> Array:
        """Largest difference between the rules in each panel, up to its end or inside.

        Parameters
        ----------
        density : ndarray, (rows, panels, nodes)
        """
        difference = np.abs(density @ rule(self.order).differences.T).sum(axis=0)
        return np.asarray(difference.max(axis=-1) * self.width)

    def nodes(self) -> Array:
        """All nodes in turn."""
        return np.asarray((self.low[:, None] + self.width[:, None] * rule(self.order).nodes).reshape(-1))

    def weights(self) -> Array:
        """Weights (2, nodes): fine and coarse."""
        return np.asarray((self.width[:, None] * rule(self.order).weights[:, None, :]).reshape(2, -1))

    def weights_between(self, limits: tuple[Array, Array] | None) -> Array:
        """Weights (2, m, n, nodes) of integrals between limits (m, n); None for the whole axis.

        A panel that a limit cuts keeps its nodes: the polynomial through them is integrated up to the limit.
        """
        if limits is None:
            return self.weights()[:, None, None, :]
        r = rule(self.order)
        share = [np.clip((end[..., None] - self.low) / self.width, 0.0, 1.0) for end in limits]
        chebyshev = [np.cos(np.arange(self.order + 2) * np.arccos(2.0 * v[..., None] - 1.0)) for v in share]
        between = (chebyshev[1] - chebyshev[0]) * self.width[:, None]
        found = np.stack([between @ r.antiderivative[level] for level in (0, 1)])
        return np.asarray(found.reshape(*found.shape[:3], -1))

    def refine(self, mass: Array, error: Array, allowed: float) -> bool:
        """Halve the panels whose error is not allowed, drop those without mass; whether any was halved."""
        if not (error > allowed / error.size).any():
            return False
        # masses whose errors are larger say nothing of where there is none
        keep = (mass > 1e-8 * allowed / mass.size * mass.sum()) | (error.sum() > mass.sum())
        self.panels, error = self.panels[keep], error[keep]
        worst = error > allowed / mass.size
        halved = self.panels[worst]
        middle = halved.mean(axis=1)
        parts = [
            self.panels[~worst],
            np.column_stack((halved[:, 0], middle)),
            np.column_stack((middle, halved[:, 1])),
        ]
        panels = np.concatenate(parts)
        self.panels = panels[np.argsort(panels[:, 0])]
        return True

    def drop(self, mass: Array, share: float) -> None:
        """Drop the panels that hold less than a share of the mass."""
        keep = mass > share * mass.sum()
        if keep.any():
            self.panels = self.panels[keep]

    def split(self, points: Array) -> bool:
        """Split the panels that hold one of the points well inside, there; whether there were any."""
        before = self.panels.shape[0]
        for point in points:
            low, high = self.panels[:, 0], self.panels[:, 1]
            margin = 1e-4 * (high - low)
            for i in np.flatnonzero((point > low + margin) & (point < high - margin)):
                parts = np.array([[low[i], point], [point, high[i]]])
                self.panels = np.concatenate((self.panels[:i], parts, self.panels[i + 1 :]))
        return bool(self.panels.shape[0] > before)
