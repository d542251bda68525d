"""What a chart shows, as values: panels with axes, marks in the units of their data, and a legend.

Places and sizes on the chart are in millimetres, line widths and letters in points, as in print.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ifrfit.report.axis_words import plain
from ifrfit.report.page.charts.scales import Linear, Scale, Ticks
from ifrfit.report.style import PANEL_WIDTH_MM, Dashes

Array = NDArray[np.float64]

TICK_LETTERS, LABEL_LETTERS = 7.5, 8.0  # points
LEFT, RIGHT, BOTTOM, TOP = 13.0, 3.0, 10.0, 3.0  # mm
NAMES_TOP, NAMES_BOTTOM, NAMES_RIGHT = 2.0, 11.0, 4.0


@dataclass(frozen=True)
class Line:
    """A line through points; it is broken where one is not finite.

    Attributes
    ----------
    x, y : ndarray, (n,)
    colour : str
        Hexadecimal, or a level of grey from "0" to "1".
    width : float
    dashes : str or tuple
        As `ifrfit.report.style.Dashes`.
    opacity : float
    halo : float
        Width of a white edge, which lifts it off a crowd; 0 for none.
    """

    x: Array
    y: Array
    colour: str = "0"
    width: float = 1.2
    dashes: Dashes = "-"
    opacity: float = 1.0
    halo: float = 0.0


@dataclass(frozen=True)
class Band:
    """The area between two curves over the same x, (n,) each."""

    x: Array
    low: Array
    high: Array
    colour: str
    opacity: float


@dataclass(frozen=True)
class Box:
    """A rectangle; infinite ends are the panel's.

    Attributes
    ----------
    x, y : tuple of float
        Ends.
    colour : str
    opacity : float
    edge : str
        Colour of its outline; empty for none.
    is_hatched : bool
    """

    x: tuple[float, float]
    y: tuple[float, float]
    colour: str
    opacity: float = 1.0
    edge: str = ""
    is_hatched: bool = False


@dataclass(frozen=True)
class Bars:
    """Error bars: a line from low to high at each place, (n,) each, along y or along x.

    Attributes
    ----------
    at, low, high : ndarray, (n,)
    along : {"x", "y"}
    colour : str
    width : float
    opacity : float
    cap : float
        Length of the caps; 0 for none.
    """

    at: Array
    low: Array
    high: Array
    along: Literal["x", "y"] = "y"
    colour: str = "0"
    width: float = 0.7
    opacity: float = 1.0
    cap: float = 0.0


@dataclass(frozen=True)
class Points:
    """The same mark at each of some places.

    Attributes
    ----------
    x, y : ndarray, (n,)
    marker : str
        One of `ifrfit.report.page.charts.svg.SHAPES`.
    size : float
        Across.
    fill, edge : str
        Colours; "none" for an open mark.
    edge_width : float
    opacity : float
    is_clipped : bool
        Whether a mark on the frame is cut there.
    """

    x: Array
    y: Array
    marker: str
    size: float
    fill: str
    edge: str
    edge_width: float = 0.8
    opacity: float = 1.0
    is_clipped: bool = True


@dataclass(frozen=True)
class Words:
    """A text at a place.

    Attributes
    ----------
    x, y : float
    text : str
        With symbols as LaTeX between dollars, see `ifrfit.report.page.charts.typesetting`.
    size : float
    colour : str
    anchor : {"start", "middle", "end"}
    height : {"top", "middle", "bottom"}
        Which part of the letters stands at y.
    turn : float
        Degrees, anticlockwise.
    is_bold : bool
    opacity : float
    """

    x: float
    y: float
    text: str
    size: float = 6.5
    colour: str = "0"
    anchor: Literal["start", "middle", "end"] = "middle"
    height: Literal["top", "middle", "bottom"] = "middle"
    turn: float = 0.0
    is_bold: bool = False
    opacity: float = 1.0


Mark = Line | Band | Box | Bars | Points | Words


@dataclass(frozen=True)
class Axis:
    """One axis of a panel.

    Attributes
    ----------
    low, high : float
        Values at its ends: left and right, bottom and top. They may fall.
    label : str
        Lines of it are separated by line feeds.
    scale : Scale
    ticks : Ticks or None
        None chooses: as many as fit, up to `most`.
    most : int
    whole : bool
        Whether chosen ticks are integers.
    mirrored : bool
        Whether there are tick marks on the other side, too.
    marked : bool
        Whether ticks have marks, not only labels.
    labelled : bool
        Whether ticks have labels.
    is_far : bool
        Whether labels stand on the other side: right, or on top.
    inside : bool
        Whether labels that would stand out beyond the ends are moved inwards: neighbours are near.
    label_turned : bool
        Whether the label of a vertical axis runs upwards; else it stands beside it, and is small.
    """

    low: float
    high: float
    label: str = ""
    scale: Scale = field(default_factory=Linear)
    ticks: Ticks | None = None
    most: int = 6
    whole: bool = False
    mirrored: bool = False
    marked: bool = True
    labelled: bool = True
    is_far: bool = False
    inside: bool = False
    label_turned: bool = True


@dataclass(frozen=True)
class Panel:
    """A frame with two axes, and marks in the order of drawing.

    Attributes
    ----------
    left, top, width, height : float
        Of the frame on the chart; top counts from above.
    x, y : Axis
    marks : tuple
    title : str
    has_frame : bool
    """

    left: float
    top: float
    width: float
    height: float
    x: Axis
    y: Axis
    marks: tuple[Mark, ...]
    title: str = ""
    has_frame: bool = True


@dataclass(frozen=True)
class Entry:
    """An entry of a legend: a line, a mark, or one on the other, and what it means."""

    label: str
    line: Line | None = None
    point: Points | None = None


@dataclass(frozen=True)
class Legend:
    """Entries in rows, centred under the panels.

    Attributes
    ----------
    top : float
        Of its first row, millimetres from above.
    rows : tuple of tuple of Entry
    """

    top: float
    rows: tuple[tuple[Entry, ...], ...]

    LETTERS: ClassVar[float] = 6.6
    ROW: ClassVar[float] = 3.7  # millimetres


@dataclass(frozen=True)
class Chart:
    """A whole chart.

    Attributes
    ----------
    width, height : float
        Millimetres.
    panels : tuple of Panel
    legend : Legend or None
    """

    width: float
    height: float
    panels: tuple[Panel, ...]
    legend: Legend | None = None


def one_panel(
    x: Axis,
    y: Axis,
    marks: Sequence[Mark],
    width: float = PANEL_WIDTH_MM,
    height: float = 58.0,
    *,
    left: float = LEFT,
) -> Chart:
    """A chart of one panel, millimetres."""
    panel = Panel(left, TOP, width - left - RIGHT, height - BOTTOM - TOP, x, y, tuple(marks))
    return Chart(width, height, (panel,))


def lines_panel(
    labels: Sequence[str],
    x: Axis,
    marks: Sequence[Mark],
    width: float,
    names: float,
    *,
    line: float = 6.0,
    below: float = 0.0,
) -> Chart:
    """A chart with a line `line` mm high for each label, the first on top, labels left of its panel.

    There is room for so many lines more `below` the last.
    """
    tall = 1.0 + line * (len(labels) + below)
    y = Axis(
        len(labels) - 0.4 + below,
        -0.6,
        ticks=Ticks(tuple(map(float, range(len(labels)))), tuple(plain(label) for label in labels)),
        marked=False,
    )
    panel = Panel(names, NAMES_TOP, width - names - NAMES_RIGHT, tall, x, y, tuple(marks))
    return Chart(width, NAMES_TOP + tall + NAMES_BOTTOM, (panel,))
