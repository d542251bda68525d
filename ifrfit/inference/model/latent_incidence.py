"""True angles and spins behind the observed ones: their laws, and nodes to integrate over them.

One coordinate of each impact is the split one: the angle, or the spin where the angle is exact. Its integral
is cut where sticking turns into sliding, so that each piece is smooth; errors of the other coordinates are
integrated by Gauss and Hermite, outside of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.model.rows import Index
from ifrfit.physics.angles import Incidence

Array = NDArray[np.float64]

HALF_WIDTH = 5.5  # sd of the true value to either side: what lies beyond is 4e-8
_HERMITE = 9
_STEEPEST = 1e8  # transition beyond which every impact sticks


@dataclass(frozen=True)
class Latent:
    """Laws of the true incidence of impacts, normal and cut off at the ends.

    Attributes
    ----------
    gamma, spin_x, spin_y : ndarray, (U,)
        Observed; degrees, and R omega/u.
    sd_gamma, sd_x, sd_y : ndarray, (U,)
        Their standard uncertainties; zero where exact.
    ends : (float, float)
        Degrees between which true angles lie.
    order : ndarray of int, (U,)
        Nodes on each piece.
    """

    gamma: Array
    spin_x: Array
    spin_y: Array
    sd_gamma: Array
    sd_x: Array
    sd_y: Array
    ends: tuple[float, float]
    order: Index

    def take(self, at: Index) -> Latent:
        """The same for some impacts."""
        fields = ("gamma", "spin_x", "spin_y", "sd_gamma", "sd_x", "sd_y", "order")
        return replace(self, **{name: getattr(self, name)[at] for name in fields})

    @property
    def by_angle(self) -> NDArray[np.bool_]:
        """Whether the angle is the split coordinate; the spin is, where the angle is exact."""
        return self.sd_gamma > 0.0

    def spins(self) -> Iterator[tuple[Array, Array, float]]:
        """Spins (U,) of the outer rule with their weight; one that is the split coordinate stands still."""
        t, w = np.polynomial.hermite_e.hermegauss(_HERMITE)
        w = w / w.sum()
        outer_y = np.where(self.by_angle, self.sd_y, 0.0)
        along_x = zip(t, w, strict=True) if (self.sd_x > 0.0).any() else iter([(0.0, 1.0)])
        for tx, wx in list(along_x):
            along_y = zip(t, w, strict=True) if (outer_y > 0.0).any() else iter([(0.0, 1.0)])
            for ty, wy in along_y:
                yield self.spin_x + tx * self.sd_x, self.spin_y + ty * outer_y, float(wx * wy)

    def limits(self) -> tuple[Array, Array]:
        """Ends (U,) of the split coordinate."""
        center, sd = self._split()
        low, high = center - HALF_WIDTH * sd, center + HALF_WIDTH * sd
        angle = self.by_angle
        return (
            np.where(angle, np.maximum(low, self.ends[0]), low),
            np.where(angle, np.minimum(high, self.ends[1]), high),
        )

    def _split(self) -> tuple[Array, Array]:
        angle = self.by_angle
        return np.where(angle, self.gamma, self.spin_y), np.where(angle, self.sd_gamma, self.sd_y)

    def roots(self, x: Array, spin_x: Array, spin_y: Array) -> Array:
        """Split coordinate at which |U_t|/U_n is the transition x, (2, P, U); beyond the ends where nowhere.

        Parameters
        ----------
        x : ndarray, (P,)
        spin_x, spin_y : ndarray, (U,)
        """
        x = np.minimum(x, _STEEPEST)[:, None]
        with np.errstate(invalid="ignore"):
            # (1 + x^2) S^2 + 2 s_y S + s^2 - x^2 = 0 in S = sin(gamma)
            n = 1.0 + x * x
            reach = np.sqrt(x * x * (n - spin_x**2 - spin_y**2) - spin_x**2)
            sines = [(-spin_y - reach) / n, (-spin_y + reach) / n]
            angles = [np.degrees(np.arcsin(np.where((s >= 0.0) & (s <= 1.0), s, np.nan))) for s in sines]
            sine, cosine = np.sin(np.radians(self.gamma)), np.cos(np.radians(self.gamma))
            half = np.sqrt((x * cosine) ** 2 - spin_x**2)
            spins = [-sine - half, -sine + half]
        found = np.stack([np.where(self.by_angle, a, s) for a, s in zip(angles, spins, strict=True)])
        low, high = self.limits()
        return np.sort(np.clip(np.where(np.isnan(found), high, found), low, high), axis=0)

    def nodes(self, cuts: Array, spin_x: Array, spin_y: Array) -> tuple[Incidence, Array]:
        """Incidence at the nodes of all pieces, and their weights, (P, U, pieces * order); one order for all.

        Parameters
        ----------
        cuts : ndarray, (c, P, U)
            Where pieces meet, ascending; none for one piece.
        spin_x, spin_y : ndarray, (U,)
        """
        low, high = self.limits()
        shape = cuts.shape[1:]
        edges = np.concatenate((np.broadcast_to(low, (1, *shape)), cuts, np.broadcast_to(high, (1, *shape))))
        t, w = np.polynomial.legendre.leggauss(int(self.order[0]))
        half = 0.5 * np.diff(edges, axis=0)[..., None]
        middle = 0.5 * (edges[1:] + edges[:-1])[..., None]
        at = np.moveaxis(middle + half * t, 0, 2).reshape(*shape, -1)
        width = np.moveaxis(half * w, 0, 2).reshape(*shape, -1)
        # a piece of no width may stand at an end of the angles, where some observables are not defined
        at = np.where(width > 0.0, at, 0.5 * (low + high)[:, None])
        center, sd = (y[:, None] for y in self._split())
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (at - center) / sd
            share = special.ndtr((high - center[:, 0]) / sd[:, 0]) - special.ndtr(
                (low - center[:, 0]) / sd[:, 0]
            )
            weight = width / sd * np.exp(-0.5 * z * z) / (np.sqrt(2.0 * np.pi) * share[:, None])
        exact = sd == 0.0  # one value: any node will do, with all the weight
        weight = np.where(exact, 1.0 / at.shape[-1], weight)
        at = np.where(exact, center, at)
        angle = self.by_angle[:, None]
        gamma = np.where(angle, at, self.gamma[:, None])
        s_y = np.where(angle, spin_y[:, None], at)
        return Incidence.of(gamma, np.broadcast_to(spin_x[:, None], at.shape), s_y, degrees=True), weight
