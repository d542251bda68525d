"""Lines that follow from given constants: those the paper prints, others beside them, and its misprints."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ifrfit.paper.axes import Abscissa, Ordinate
from ifrfit.paper.scene import Kind
from ifrfit.physics import CLOSURES, OBSERVABLES, Rebound, rebound, transition_angles, transition_tau
from ifrfit.physics.angles import Array
from ifrfit.report.plot_elements import Curve, Pen
from ifrfit.report.shading import Mark

_STEP = 1e-9  # degrees on either side of a transition: a jump is drawn as one


@dataclass(frozen=True)
class Setting:
    """One series of a figure: its label in the dataset, and the spin that the paper states."""

    series: str
    spin_x: float = 0.0
    spin_y: float = 0.0


@dataclass(frozen=True)
class Model:
    """A line of given constants.

    Attributes
    ----------
    constants : mapping
        e_n, e_t, mu, or those of its closure.
    label : str
    kind : str
        As in figN.csv.
    pen : Pen
    observable : str
        What the values are taken for, where it is not the observable of the figure.
    misprint : callable, optional
        From the rebound to the values as the paper's printed equation has them, in the figure's unit.
    closure : str
    """

    constants: Mapping[str, float]
    label: str
    kind: Kind
    pen: Pen
    observable: str = ""
    misprint: Callable[[Rebound], Array] | None = None
    closure: str = "ifr"

    def transitions(self, setting: Setting) -> tuple[float, ...]:
        """Transition angles in degrees."""
        kappa = self.constants["mu"] * (1.0 + self.constants["e_n"])
        closure = CLOSURES[self.closure]
        own = self.constants[closure.own.name] if closure.own else 0.0
        tau = transition_tau(closure, own, kappa)
        return transition_angles(tau, setting.spin_x, setting.spin_y)

    def curve(self, x: Abscissa, y: Ordinate, setting: Setting) -> Curve:
        """The line, with the transition angle among its points."""
        kinks = [] if x.spin else [a + d for a in self.transitions(setting) for d in (-_STEP, 0.0, _STEP)]
        at = np.unique(np.concatenate([x.grid, x.of_gamma(np.array(kinks, dtype=float))]))
        at = at[(at >= min(x.low, x.grid[0])) & (at <= x.high)]
        spin_x = at if x.spin else setting.spin_x
        impact = rebound(
            x.gamma(at),
            spin_x,
            setting.spin_y,
            closure=self.closure,
            degrees=True,
            **self.constants,
        )
        if self.misprint is not None:
            values = self.misprint(impact)
        else:
            read_out = OBSERVABLES[self.observable or y.observable]
            values = read_out.value(impact, np.asarray(self.constants["mu"]))
        return Curve(self.kind, self.label, at, y.sign * values, self.pen)

    def marks(self, x: Abscissa, setting: Setting) -> tuple[Mark, ...]:
        """Transitions, at their places on the axis."""
        if x.spin:
            return ()
        label = f"transition of {self.label}" + (f", {setting.series}" if setting.series else "")
        return tuple(Mark(self.kind, label, x.inside(angle)) for angle in self.transitions(setting))


def deviation_as_printed(impact: Rebound) -> Array:
    """Lateral deviation in degrees by Eqs (34) and (35) as printed: (34) lacks the minus sign."""
    i = impact.incidence
    with np.errstate(divide="ignore", invalid="ignore"):
        sticking = np.arctan(impact.impulse_factor * i.slip_y / (i.sine - impact.impulse_factor * i.slip_x))
    return np.asarray(np.degrees(np.where(impact.sticking, sticking, impact.lambda_)))


def total_as_printed(impact: Rebound) -> Array:
    """Total restitution by the text after Eq. (29) as printed: beta stands where beta_cm belongs."""
    i = impact.incidence
    return np.asarray(np.hypot(impact.e_n * i.cosine, impact.beta * i.sine))


MISPRINTS = {"deviation": deviation_as_printed, "total": total_as_printed}
