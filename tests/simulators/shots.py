"""Impacts that are shot at a wall in a simulator, and what comes back."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Incidence

Array = NDArray[np.float64]

RADIUS = 0.01  # m
DENSITY = 2500.0  # kg/m^3
GAP = 0.1  # m between spheres that are shot at once: they never meet


@dataclass(frozen=True)
class Shots:
    """Impacts in the x-z plane, the wall at z = 0.

    Attributes
    ----------
    angle : ndarray, (n,)
        Degrees from the normal.
    approach : ndarray, (n,)
        Normal speed before, m/s.
    spin : ndarray, (n,)
        R omega over the speed before, in the signs of ifrfit: positive is back-spin.
    """

    angle: Array
    approach: Array
    spin: Array

    @classmethod
    def over(cls, angles: Array, approaches: Array, spins: Array) -> Shots:
        """All combinations."""
        rows = np.array(list(product(angles, approaches, spins)), dtype=float)
        return cls(*rows.T)

    @property
    def speed(self) -> Array:
        """Of the centre before, m/s."""
        return np.asarray(self.approach / np.cos(np.radians(self.angle)))

    @property
    def along(self) -> Array:
        """Velocity along the wall before, m/s."""
        return np.asarray(self.approach * np.tan(np.radians(self.angle)))

    @property
    def omega(self) -> Array:
        """Right-handed spin about y, rad/s; back-spin is negative."""
        return np.asarray(-self.spin * self.speed / RADIUS)

    @property
    def incidence(self) -> Incidence:
        """As the package has it."""
        return Incidence.of(self.angle, 0.0, self.spin, degrees=True)

    def rebounds(self, v_x: Array, v_z: Array, omega: Array) -> Rebounds:
        """What came back, m/s and rad/s."""
        return Rebounds(self, v_x / self.speed, v_z / self.speed, -RADIUS * omega / self.speed)


@dataclass(frozen=True)
class Rebounds:
    """Velocities and spin after, per speed before; each (n,)."""

    shots: Shots
    v_x: Array
    v_n: Array
    spin: Array

    @property
    def e_n(self) -> Array:
        """Normal restitution."""
        return np.asarray(self.v_n / self.shots.incidence.cosine)

    @property
    def beta(self) -> Array:
        """Restitution of the contact point."""
        return np.asarray(-(self.v_x + self.spin) / self.shots.incidence.slip_x)
