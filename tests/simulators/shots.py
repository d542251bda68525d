"""Impacts that are shot at a wall in a simulator, and what comes back."""

from __future__ import annotations

from dataclasses import dataclass, fields
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
    """Impacts that move in the x-z plane, the wall at z = 0.

    Attributes
    ----------
    angle : ndarray, (n,)
        Degrees from the normal.
    approach : ndarray, (n,)
        Normal speed before, m/s.
    spin : ndarray, (n,)
        About y: R omega over the speed before, in the signs of ifrfit: positive is back-spin.
    lateral : ndarray, (n,)
        About x, along the motion; it moves the contact point across.
    twist : ndarray, (n,)
        About the wall's normal, which no point of contact feels.
    """

    angle: Array
    approach: Array
    spin: Array
    lateral: Array
    twist: Array

    @classmethod
    def over(
        cls, angles: Array, approaches: Array, spins: Array, laterals: Array = (0.0,), twists: Array = (0.0,)
    ) -> Shots:
        """All combinations."""
        rows = np.array(list(product(angles, approaches, spins, laterals, twists)), dtype=float)
        return cls(*rows.T)

    def take(self, rows: Array) -> Shots:
        """These shots only."""
        return Shots(*(getattr(self, each.name)[rows] for each in fields(self)))

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
        """Right-handed spins about x, y, z, rad/s, (n, 3); back-spin is negative."""
        turns = np.column_stack([self.lateral, -self.spin, self.twist])
        return np.asarray(turns * self.speed[:, None] / RADIUS)

    @property
    def incidence(self) -> Incidence:
        """As the package has it."""
        return Incidence.of(self.angle, self.lateral, self.spin, degrees=True)

    def rebounds(self, velocity: Array, omega: Array) -> Rebounds:
        """What came back, m/s and rad/s, (n, 3) each."""
        v_x, v_y, v_z = velocity.T / self.speed
        about_x, about_y, about_z = RADIUS * omega.T / self.speed
        return Rebounds(self, v_x, v_y, v_z, -about_y, about_x, about_z)


@dataclass(frozen=True)
class Rebounds:
    """Velocities and spin after, per speed before; each (n,)."""

    shots: Shots
    v_x: Array
    v_y: Array
    v_n: Array
    spin: Array
    lateral: Array
    twist: Array

    @property
    def e_n(self) -> Array:
        """Normal restitution."""
        return np.asarray(self.v_n / self.shots.incidence.cosine)

    @property
    def beta(self) -> Array:
        """Restitution of the contact point."""
        return np.asarray(-(self.v_x + self.spin) / self.shots.incidence.slip_x)
