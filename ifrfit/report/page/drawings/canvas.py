"""Small figures with fixed margins, and how constants are called on their axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ifrfit.inference.model.entry_names import split_name
from ifrfit.report.constants_rows import constant_symbols
from ifrfit.report.style import MM_PER_INCH, PANEL_WIDTH_MM, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT, RIGHT, BOTTOM, TOP = 13.0, 3.0, 10.0, 3.0  # mm

_SYMBOLS = {
    "beta_sticking": r"$\beta$ in sticking",
    "transition_angle_deg": "transition (deg)",
}


def panel(
    width_mm: float = PANEL_WIDTH_MM, height_mm: float = 58.0, *, left: float = LEFT
) -> tuple[Figure, Axes]:
    """A figure with one pair of axes, margins in mm: no solver, so the layout is the same on every run."""
    figure = new_figure(width_mm, height_mm / MM_PER_INCH)
    axes = figure.add_axes(
        (
            left / width_mm,
            BOTTOM / height_mm,
            (width_mm - left - RIGHT) / width_mm,
            (height_mm - BOTTOM - TOP) / height_mm,
        )
    )
    axes.tick_params(top=False, right=False)
    return figure, axes


def lines_panel(
    labels: Sequence[str], width_mm: float, names_mm: float, line_mm: float = 6.0
) -> tuple[Figure, Axes]:
    """A figure with a line for each label, the first on top, and the labels left of its axes."""
    count, height_mm = len(labels), 13.0 + line_mm * len(labels)
    figure = new_figure(width_mm, height_mm / MM_PER_INCH)
    axes = figure.add_axes(
        (names_mm / width_mm, 10.0 / height_mm, 1.0 - (names_mm + 4.0) / width_mm, 1.0 - 12.0 / height_mm)
    )
    axes.set_ylim(count - 0.4, -0.6)
    axes.set_yticks(range(count), [plain(label) for label in labels])
    axes.tick_params(axis="y", length=0)
    return figure, axes


def symbol(name: str, longest: int = 24) -> str:
    """A constant as axes write it; its series in brackets as it is, cut where it is longer than `longest`."""
    kind, series = split_name(name)
    shown = (_SYMBOLS | constant_symbols()).get(kind, plain(kind))
    return shown + (plain(f" [{shortened(series, longest)}]") if series else "")


def plain(text: str) -> str:
    """Text that matplotlib must not read as mathematics."""
    return text.replace("$", r"\$")


def shortened(text: str, longest: int) -> str:
    """Text cut to a length, with an ellipsis where something is missing."""
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
