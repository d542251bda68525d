"""Charts of one panel with fixed margins, and how constants are called on their axes."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.inference.model.entry_names import split_name
from ifrfit.report.constants_rows import constant_symbols
from ifrfit.report.page.charts.chart import Axis, Chart, Mark, Panel
from ifrfit.report.page.charts.scales import Ticks
from ifrfit.report.style import PANEL_WIDTH_MM

LEFT, RIGHT, BOTTOM, TOP = 13.0, 3.0, 10.0, 3.0  # mm
NAMES_TOP, NAMES_BOTTOM, NAMES_RIGHT = 2.0, 11.0, 4.0

_SYMBOLS = {
    "beta_sticking": r"$\beta$ in sticking",
    "transition_angle_deg": "transition (deg)",
}


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


def symbol(name: str, longest: int = 24) -> str:
    """A constant as axes write it; its series in brackets as it is, cut where it is longer than `longest`."""
    kind, series = split_name(name)
    shown = (_SYMBOLS | constant_symbols()).get(kind, plain(kind))
    return shown + (plain(f" [{shortened(series, longest)}]") if series else "")


def plain(text: str) -> str:
    """Text that must not be read as mathematics."""
    return text.replace("$", r"\$")


def shortened(text: str, longest: int) -> str:
    """Text cut to a length, with an ellipsis where something is missing."""
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
