"""Beside Fig. 5: the same scene with a normal restitution that follows from yield of the wall."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ifrfit.paper.axes import Abscissa, Ordinate
from ifrfit.paper.given_curves import Model, Setting
from ifrfit.physics import CLOSURES, OBSERVABLES
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.effects import Contact, Impacts, Outcome, compose
from ifrfit.physics.scenes.bodies import read_bodies
from ifrfit.physics.scenes.toml_table import Table
from ifrfit.report.plot_elements import Curve

SPEED = 27.0  # m/s, of Reagle et al. (2013)
# quartz stands for Arizona road dust, whose main mineral it is: a choice; 30 um is the middle of the sizes
BODIES = {
    "sphere": {"diameter_um": 30, "material": "quartz"},
    "wall": {"material": "stainless-304"},
}


def dust_on_steel() -> tuple[Contact, float]:
    """Contact of the scene, and the radius in m."""
    bodies = read_bodies(Table(BODIES, "", "Fig. 5"))
    return bodies.contact, 0.5 * float(bodies.diameter.grid[0])


@dataclass(frozen=True)
class ElasticPlastic(Model):
    """A line whose e_n is that of an elastic, perfectly plastic impact (Thornton 1997) at each angle.

    e_t and mu are the printed ones. It is no model of Yu & Tafti, whose equations are not openly published.
    """

    speed: float = field(default=SPEED)

    def restitution(self, gamma: Array) -> Array:
        """e_n at incidence angles in degrees."""
        return np.asarray(self._outcome(gamma).e_n)

    def curve(self, x: Abscissa, y: Ordinate, setting: Setting) -> Curve:
        """The line."""
        at = np.asarray(x.grid)
        outcome = self._outcome(x.gamma(at))
        values = OBSERVABLES[y.observable].value(outcome, np.asarray(self.constants["mu"]))
        return Curve(self.kind, self.label, at, y.sign * values, self.pen)

    def _outcome(self, gamma: Array) -> Outcome:
        contact, radius = dust_on_steel()
        same = np.ones(np.shape(gamma))
        impacts = Impacts(
            Incidence.of(gamma, degrees=True),
            self.speed * same,
            radius * same,
            CLOSURES["ifr"],
            same,
            self.constants["e_t"] * same,
            self.constants["mu"] * same,
        )
        return compose(contact, impacts, ("plasticity",))
