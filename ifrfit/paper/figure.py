"""One figure of the paper: what it shows, before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ifrfit.paper.axes import INCIDENCE, Abscissa, Ordinate
from ifrfit.paper.given_curves import Model, Setting


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
        points: data, a fit and lines; theory: lines only; kharaz: the bundled real data; scheme: a drawing.
    case : str
        Name of the fit that it shows, see `ifrfit.paper.cases`.
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
    kind: Literal["points", "theory", "kharaz", "scheme"]
    case: str = ""
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
        return f"fig{self.name}" if self.kind != "kharaz" else self.name
