"""What each figure of the paper shows, from ``figures.toml``: every choice, before anything is fitted."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any, Literal

import numpy as np

from ifrfit.paper import scene
from ifrfit.paper.scene import INCIDENCE, Abscissa, Kind, Ordinate
from ifrfit.physics import CLOSURES, OBSERVABLES, Rebound, rebound, transition_angles, transition_tau
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.effects import Contact, Impacts, Outcome, compose
from ifrfit.physics.scenes.bodies import read_bodies
from ifrfit.physics.scenes.toml_table import Table
from ifrfit.report.panels import Curve, Pen
from ifrfit.report.regimes import Mark
from ifrfit.report.style import COLOURS

_STEP = 1e-9  # degrees on either side of a transition: a jump is drawn as one
SPEED = 27.0  # m/s, of Reagle et al. (2013)
# quartz stands for Arizona road dust, whose main mineral it is: a choice; 30 um is the middle of the sizes
BODIES = {
    "sphere": {"diameter_um": 30, "material": "quartz"},
    "wall": {"material": "stainless-304"},
}
PRINTED_PEN = Pen("black", (0, (5, 1.6)), 1.1)


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


@dataclass(frozen=True)
class PaperFigure:
    """One figure.

    Attributes
    ----------
    name : str
        As in `--figure`; files are fig{name}.svg, .png and .csv.
    title : str
        What is shown, in the picture.
    kind : str
        points: data of the paper, a fit and lines; theory: lines only; real: bundled real data; scheme: a
        drawing.
    case : str
        Name of the fit that it shows, see `ifrfit.paper.recovered_constants`.
    label : str
        Of real data: what its curve is called.
    other, other_label : str
        Of real data: name of a second fit, drawn as a line, and what it is called.
    direct : str
        Of real data: a series that is drawn and not fitted.
    x, y : Abscissa, Ordinate
    settings : tuple of Setting
    models : tuple of Model
        Lines of given constants; the first one is that of the constants the paper prints.
    says : str
        What the caption says, in our words.
    uses : str
        Equations that are really used.
    note : str
        What else its reader should know.
    """

    name: str
    title: str
    kind: Literal["points", "theory", "real", "scheme"]
    case: str = ""
    label: str = "recovered"
    other: str = ""
    other_label: str = ""
    direct: str = ""
    x: Abscissa = INCIDENCE
    y: Ordinate | None = None
    settings: tuple[Setting, ...] = (Setting(""),)
    models: tuple[Model, ...] = ()
    says: str = ""
    uses: str = ""
    note: str = ""

    @property
    def stem(self) -> str:
        """Name of its files without suffix."""
        return f"fig{self.name}" if self.kind != "real" else self.name


def constants_words(constants: Mapping[str, float]) -> str:
    """Values of e_n, e_t and mu with true minus signs."""
    symbols = {"e_n": "$e_n$", "e_t": "$e_t$", "mu": "μ"}
    return ", ".join(f"{symbols[name]} {value:.2f}".replace("-", "−") for name, value in constants.items())


def _figure(entry: Mapping[str, Any]) -> PaperFigure:
    """A figure from its table in ``figures.toml``."""
    own = dict(entry)
    own["models"] = tuple(_model(**line) for line in own.pop("line", ()))
    if "x" in own:
        own["x"] = getattr(scene, own["x"].upper().replace("-", "_"))
    if "y" in own:
        own["y"] = Ordinate(**own["y"])
    if "settings" in own:
        own["settings"] = tuple(Setting(**setting) for setting in own["settings"])
    return PaperFigure(**own)


def _model(
    constants: Mapping[str, float],
    pen: Mapping[str, Any] | None = None,
    misprint: str = "",
    elastic_plastic: bool = False,
    **more: Any,
) -> Model:
    """A line; without a pen it is that of the printed constants."""
    if pen is None:
        return Model(constants, f"printed: {constants_words(constants)}", "printed_constants", PRINTED_PEN)
    colour = pen["colour"] if isinstance(pen["colour"], str) else COLOURS[pen["colour"]]
    own = Pen(colour, (0, tuple(pen["dashes"])), pen["width"])
    kind = ElasticPlastic if elastic_plastic else Model
    return kind(constants, pen=own, misprint=MISPRINTS.get(misprint), **more)


_TEXT = files("ifrfit.paper").joinpath("figures.toml").read_text("utf-8")
FIGURES = tuple(_figure(entry) for entry in tomllib.loads(_TEXT)["figure"])
PAPER = tuple(figure for figure in FIGURES if figure.kind != "real")
