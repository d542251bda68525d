"""A scene: which impacts, of what on what, by which constants and effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.effects.plan import Requested
from ifrfit.physics.scenes.bodies import Bodies
from ifrfit.physics.scenes.quantities import Quantity

AXES = ("gamma_deg", "speed_m_s", "spin_x", "spin_y", "diameter_m")


@dataclass(frozen=True, kw_only=True)
class Scene(Bodies):
    """What a scene file says: the bodies, and the impacts.

    Attributes
    ----------
    name : str
        File without its suffix.
    title : str
    sha256 : str
        Of the file, hexadecimal.
    conditions : mapping
        `AXES` to their quantities: degrees, m/s, spins as `spin_unit` says, m.
    spin_unit : str
        ``""``: R omega/u; ``"rad/s"``: omega.
    closure : str
    constants : mapping
        Name to quantity; empty where they come from a fit.
    result : Path or None
        result.json whose posterior is propagated.
    series : str
        Whose constants, where the fit has separate ones.
    effects : "auto" or tuple of str
    observables : tuple of str
    accuracy : float
        Change of an observable allowed to all dropped effects together; angles in radians.
    noise : mapping
        Observable to the standard deviation of the noise that is added.
    """

    name: str
    title: str
    sha256: str
    conditions: Mapping[str, Quantity]
    spin_unit: str
    closure: str
    constants: Mapping[str, Quantity]
    result: Path | None
    series: str
    effects: Requested
    observables: tuple[str, ...]
    accuracy: float
    noise: Mapping[str, float] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[str, ...]:
        """Conditions that run over a grid."""
        return tuple(name for name in AXES if self.conditions[name].kind == "grid")

    @property
    def points(self) -> int:
        """Number of grid points."""
        return math.prod(self.conditions[name].grid.size for name in AXES)

    def grid(self) -> dict[str, Array]:
        """Each condition at each grid point, flat; nan where it is drawn. `AXES` vary slowest first."""
        grids = np.meshgrid(*(self.conditions[name].grid for name in AXES), indexing="ij")
        return {name: grid.ravel() for name, grid in zip(AXES, grids, strict=True)}

    @property
    def random(self) -> bool:
        """Whether anything is drawn."""
        drawn = (*self.conditions.values(), *self.constants.values())
        return self.result is not None or any(quantity.random for quantity in drawn)
