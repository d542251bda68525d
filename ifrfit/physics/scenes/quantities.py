"""Numbers of a scene: a value, a grid, or a distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ifrfit.physics.angles import Array

Kind = Literal["value", "grid", "normal", "uniform", "lognormal"]
RANDOM: tuple[Kind, ...] = ("normal", "uniform", "lognormal")


@dataclass(frozen=True)
class Quantity:
    """One number of a scene, in SI units (angles in degrees).

    Attributes
    ----------
    kind : str
    numbers : tuple of float
        value: itself; grid: its values; normal: mean, sd; uniform: low, high; lognormal: median, geometric
        standard deviation.
    low, high : float
        What is possible: distributions are cut there.
    """

    kind: Kind
    numbers: tuple[float, ...]
    low: float
    high: float

    @classmethod
    def of(cls, value: float) -> Quantity:
        """One value without bounds."""
        return cls("value", (value,), -np.inf, np.inf)

    @property
    def random(self) -> bool:
        """Whether it is drawn."""
        return self.kind in RANDOM

    @property
    def grid(self) -> Array:
        """The values of a grid; one value for everything else (nan where it is drawn)."""
        if self.random:
            return np.array([np.nan])
        return np.array(self.numbers)

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Independent draws of a distribution, cut at its bounds by drawing again.

        Parameters
        ----------
        n : int
        rng : numpy.random.Generator

        Returns
        -------
        ndarray, shape (n,)
        """
        found = self._uncut(n, rng)
        while True:
            outside = np.flatnonzero((found < self.low) | (found > self.high))
            if not outside.size:
                return found
            found[outside] = self._uncut(outside.size, rng)

    def _uncut(self, n: int, rng: np.random.Generator) -> Array:
        first, second = self.numbers
        if self.kind == "uniform":
            return rng.uniform(first, second, n)
        if self.kind == "lognormal":
            return np.asarray(first * second ** rng.standard_normal(n))
        return rng.normal(first, second, n)
