"""What each figure of the paper shows, from ``figures.toml``: every choice, before anything is fitted."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Literal

from ifrfit.paper import axes
from ifrfit.paper.axes import INCIDENCE, Abscissa, Ordinate
from ifrfit.paper.elastic_plastic import ElasticPlastic
from ifrfit.paper.given_curves import MISPRINTS, Model, Setting
from ifrfit.report.plot_elements import Pen
from ifrfit.report.style import COLOURS

PRINTED_PEN = Pen("black", (0, (5, 1.6)), 1.1)


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
        Name of the fit that it shows, see `ifrfit.paper.cases`.
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
        own["x"] = getattr(axes, own["x"].upper().replace("-", "_"))
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
