"""What somebody says of a figure: what its axes are, and which of its points are meant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ifrfit.errors import UsageError

ONE_PIXEL = 1.0
KEYS = ("x", "y", "axes", "dataset", "series", "pixels", "bars")  # as conventions have them


@dataclass(frozen=True)
class FigureQuestion:
    """What somebody says of a figure.

    Attributes
    ----------
    x, y : str
        The columns of a table that the axes are, with units, as in its headers: ``gamma_deg``, ``beta``;
        empty where nothing was said.
    axes : str or None
        Name of the axes, where the file has several.
    datasets : tuple of str
        Names of the datasets or curves; empty for all on these axes.
    series : tuple of str
        Names of the series, for each dataset in turn; one alone is that of all. Empty: as the datasets.
    pixels : float or None
        Standard error of a click in each direction; None: one pixel.
    bars : float or None
        How many standard errors half an error bar is; None: nothing is said of bars.
    """

    x: str
    y: str
    axes: str | None = None
    datasets: tuple[str, ...] = ()
    series: tuple[str, ...] = ()
    pixels: float | None = None
    bars: float | None = None

    def require_axes(self) -> None:
        """Refuse a question that does not say what both axes are.

        Raises
        ------
        UsageError
        """
        for key, header in (("x", self.x), ("y", self.y)):
            if not header:
                raise UsageError(
                    f"--{key}: a figure is read once it is said what both its axes are, as --x gamma_deg "
                    "--y beta."
                )


def figure_question(
    x: str | None,
    y: str | None,
    axes: str | None = None,
    datasets: Sequence[str] = (),
    series: Sequence[str] = (),
    pixels: float | str | None = None,
    bars: float | str | None = None,
) -> FigureQuestion | None:
    """The question that options make; None where none is given.

    Raises
    ------
    UsageError
        ``pixels`` is no positive number, or ``bars`` nothing known.
    """
    given = (x, y, axes, pixels, bars)
    if all(each is None for each in given) and not datasets and not series:
        return None
    from ifrfit.data.figures.error_bars import standard_errors  # tables are read without it

    axes_said = (x or "").strip(), (y or "").strip(), axes
    return FigureQuestion(
        *axes_said, tuple(datasets), tuple(series), _positive(pixels), standard_errors(bars)
    )


def _positive(pixels: float | str | None) -> float | None:
    if pixels is None:
        return None
    try:
        found = float(pixels)
    except (TypeError, ValueError):
        found = math.nan
    if not (math.isfinite(found) and found > 0.0):
        raise UsageError(
            f"--pixels {pixels}: the standard error of a click must be a positive number of pixels, such as 1."
        )
    return found
