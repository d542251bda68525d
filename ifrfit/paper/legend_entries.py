"""What the legend under a figure of the paper says."""

from __future__ import annotations

import textwrap
from typing import Any

from ifrfit.paper.scene import Scene
from ifrfit.report.figures import NON_BREAKING
from ifrfit.report.markers import handle
from ifrfit.report.style import GREY

LONGEST = 60  # characters of a line at column width


def entries_of(scene: Scene) -> tuple[tuple[Any, str], ...]:
    """Handles with their labels: series, lines, bands, marks, then transitions and notes."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries = [*_points(scene), *_curves(scene), *_marks(scene)]
    nothing = Line2D([], [], ls="none")
    shade = Patch(fc="0.5", alpha=0.3, lw=0)
    mark = (shade, Line2D([], [], ls="none", marker="|", ms=8.0, color=GREY), shade)
    banded = any(mark.low is not None for part in scene.regimes for mark in part.marks)
    for note in scene.notes:
        entries.append((mark if banded and note.startswith("transition") else nothing, note))
    return tuple((handle, _wrapped(label)) for handle, label in entries)


def _wrapped(label: str) -> str:
    # signs of mathematics take no room of their own
    extra = sum(label.count(sign) for sign in ("$", "\\mathrm", "{", "}", "_"))
    return textwrap.fill(label, LONGEST + extra).replace(NON_BREAKING, " ")


def _points(scene: Scene) -> list[tuple[Any, str]]:
    entries: list[tuple[Any, str]] = []
    for points in scene.points:
        own, open_all = points.series_style, points.sticking is not None and points.sticking.all()
        mark = handle(own.marker, 3.8, "white" if open_all else own.colour, own.colour)
        entries.append((mark, points.label))
    return entries


def _curves(scene: Scene) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles_by_label: dict[str, list[Any]] = {}
    for curve in scene.curves:
        line = Line2D([], [], color=curve.pen.colour, ls=curve.pen.dashes, lw=curve.pen.width)
        handles = handles_by_label.setdefault(curve.label, [])
        if not handles or curve.kind == "recovered":
            handles.append(line)
    entries = [(tuple(lines), label) for label, lines in handles_by_label.items()]
    banded = {curve.label for curve in scene.curves if curve.credible is not None}
    if banded:
        light, dark = (Patch(fc=GREY, alpha=alpha, lw=0) for alpha in (0.18, 0.4))
        dots = Line2D([], [], color=GREY, lw=0.6, ls=(0, (1, 1.5)))
        bands = "68, 95 % credible; dotted: 95 % of further measurements"
        place = max(i for i, (_, label) in enumerate(entries) if label in banded)
        entries.insert(place + 1, ((light, dark, dots), bands))
    return entries


def _marks(scene: Scene) -> list[tuple[Any, str]]:
    entries: list[tuple[Any, str]] = []
    sticking = [bool(s) for p in scene.points if p.sticking is not None for s in p.sticking]
    if any(sticking) and not all(sticking):
        open_and_filled = handle("o", 3.8, "white"), handle("o", 3.8, GREY)
        entries.append((open_and_filled, "open: sticks; filled: slides"))
    if any(p.is_outlier is not None and p.is_outlier.any() for p in scene.points):
        entries.append((handle("o", 8.0, "none", "black"), "ringed: outlier"))
    return entries
