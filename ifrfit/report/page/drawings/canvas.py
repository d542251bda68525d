"""Small figures with fixed margins, and how constants are called on their axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ifrfit.inference.model.entry_names import split_name
from ifrfit.report.constants_rows import constant_symbols
from ifrfit.report.style import MM_PER_INCH, PANEL_WIDTH_MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT, RIGHT, BOTTOM, TOP = 13.0, 3.0, 10.0, 3.0  # mm

_SYMBOLS = {
    "e_n": r"$e_n$",
    "mu": r"$\mu$",
    "kappa": r"$\kappa$",
    "beta_sticking": r"$\beta$ in sticking",
    "transition_angle_deg": "transition (deg)",
}


def blank(width_mm: float, height_mm: float) -> Figure:
    """An empty figure that pyplot does not know; to be called within `ifrfit.report.style.drawing`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_mm / MM_PER_INCH, height_mm / MM_PER_INCH))
    FigureCanvasAgg(figure)
    return figure


def panel(
    width_mm: float = PANEL_WIDTH_MM, height_mm: float = 58.0, *, left: float = LEFT
) -> tuple[Figure, Axes]:
    """A figure with one pair of axes, margins in mm: no solver, so the layout is the same on every run."""
    figure = blank(width_mm, height_mm)
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
