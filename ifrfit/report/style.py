"""How figures look: colours that work without colour vision, sizes for one column of a paper, saving."""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL_WIDTH_MM = 85.0
MM_PER_INCH = 25.4
SUFFIXES = ("svg", "png")
_LOOKS = Path(__file__).with_name("figures.mplstyle")

# Okabe & Ito (2008), without the yellow that vanishes on white
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "h")
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
STICKING_SHADE = "#0000000D"
GREY = "0.35"
RESIDUAL_DASHES = (0, (4, 3))
_CLIPPED = re.compile(r'(clip-path="url\(#|<clipPath id=")(p[0-9a-f]{10})')


Dashes = str | tuple[int, tuple[float, ...]]


@dataclass(frozen=True)
class SeriesStyle:
    """Colour, marker and line of one series; each of the three tells it from the next ones."""

    colour: str
    marker: str
    line: Dashes


def series_styles(series: list[str]) -> dict[str, SeriesStyle]:
    """Give each series its look, in order of appearance."""
    return {
        name: SeriesStyle(COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)], LINES[i % len(LINES)])
        for i, name in enumerate(series)
    }


def new_figure(width_mm: float, height: float, layout: Literal["constrained"] | None = None) -> Figure:
    """An empty figure that pyplot does not know; to be called within `drawing`.

    Parameters
    ----------
    width_mm : float
    height : float
        Inches, since lines of text are counted in them.
    layout : {"constrained"}, optional
        Whether axes make room for what stands around them; `fix_layout` ends that.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_mm / MM_PER_INCH, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def filled(text: str, width_mm: float, letters: float = 15.0) -> str:
    """A title wrapped to the width of its figure at so many letters an inch, with dollars as they are."""
    return textwrap.fill(text, int(letters * width_mm / MM_PER_INCH)).replace("$", r"\$")


@contextmanager
def drawing() -> Iterator[None]:
    """Draw in our style whatever the user's matplotlibrc says, and leave no trace of it."""
    from matplotlib import style

    with style.context(["default", _LOOKS]):
        yield


def write_watermark(axes: Axes, *, size: float, height: float = 0.5) -> None:
    """Write across a panel, behind everything that is drawn there, that its data are a stand-in."""
    axes.text(
        0.5,
        height,
        "STAND-IN",
        transform=axes.transAxes,
        ha="center",
        va="center",
        rotation=18,
        fontsize=size,
        weight="bold",
        color="0.55",
        alpha=0.2,
        zorder=0.6,
    )


def fix_layout(figure: Figure) -> None:
    """Fix the layout: the last bit of its solver depends on addresses, and ids in an svg on that bit.

    To be called within `drawing`, where no engine is the default: a figure that has one, if only one that
    does nothing, is drawn twice to be saved.
    """
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine(None)
    for axes in figure.axes:
        axes.set_position(tuple(round(x, 6) for x in axes.get_position().bounds))


def save_svg_and_png(figure: Figure, folder: Path, stem: str) -> list[str]:
    """Write a figure as svg and as png.

    Returns
    -------
    list of str
        Names of the files.
    """
    names = [f"{stem}.{suffix}" for suffix in SUFFIXES]
    for name in names:
        save_figure(figure, folder / name)
    return names


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure by the suffix of `path`: svg with its text kept as text, png at 200 dpi.

    The same figure gives the same bytes on every run.
    """
    if path.suffix == ".svg":
        path.write_text(svg_text(figure), encoding="utf-8", newline="\n")
        return
    with drawing():
        figure.savefig(path, metadata={"Software": "ifrfit"})


def svg_text(figure: Figure) -> str:
    """A figure as svg, without a date, its clipped regions numbered in order.

    matplotlib names them by a hash of their corners, whose last bits depend on processor and addresses.
    """
    text = io.StringIO()
    with drawing():
        figure.savefig(text, format="svg", metadata={"Date": None})
    numbers: dict[str, int] = {}
    return _CLIPPED.sub(lambda m: f"{m[1]}clip{numbers.setdefault(m[2], len(numbers) + 1)}", text.getvalue())
