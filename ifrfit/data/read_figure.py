"""Points read off a published figure, in the common schema."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ifrfit.data.conventions import parse_conventions
from ifrfit.data.figures.figure_table import cells_of_figure
from ifrfit.data.figures.question import figure_question
from ifrfit.data.observations import Observations
from ifrfit.data.readers import observe
from ifrfit.errors import UsageError


def read_figure(
    file: str | Path,
    *,
    x: str,
    y: str,
    axes: str | None = None,
    dataset: str | Sequence[str] = (),
    series: str | Sequence[str] = (),
    pixels: float | None = None,
    bars: str | float | None = None,
    convention: Sequence[str] | Mapping[str, str] = (),
    inertia_factor: float = 0.4,
) -> Observations:
    r"""Read the points that were digitised from a figure.

    Values are made anew from the pixels by the calibration of the file. A click is uncertain by `pixels`,
    on a point and on the axes: the first is ``sigma`` and ``sigma_gamma_deg`` of each row; the second moves
    all points of the figure together, is no part of sigma, and is told in the notes with its largest size.

    Parameters
    ----------
    file : str or Path
        A project of WebPlotDigitizer (JSON of version 3 or 4, or its tar), one of Engauge Digitizer (.dig),
        or text with two columns, or a pair of columns for each series; more by `ifrfit.register`.
    x, y : str
        What the axes are, as the header of a table would call it: an angle of incidence or its tangent, and
        an observable.
    axes : str, optional
        Name of the axes, where several have points.
    dataset : str or sequence of str
        Datasets or curves by name; all on the axes if not given.
    series : str or sequence of str
        Names of the series, one for each dataset or one for all; else those of the datasets.
    pixels : float, optional
        Standard error of a click in each direction, 1 if not given; refused where the file has no pixels.
    bars : str or float, optional
        What half an error bar is, where their ends were read off: ``"sigma"``, ``"2sigma"``, ``"95%"`` or so
        many standard errors; bars are left out if not given. They are points of groups beside the first, or
        datasets called as another with ``upper`` or ``lower`` behind.
    convention : sequence of ``NAME=CHOICE`` or mapping
        As in `ifrfit.read`, such as ``angle=from-wall``.
    inertia_factor : float
        As in `ifrfit.read`.

    Returns
    -------
    Observations
        Of provenance digitised.

    Raises
    ------
    DataError
        The file is refused; the message names the file and the place in it.
    UsageError
        The axes or datasets that are asked for are not there, or x is no angle, or y no observable.

    Examples
    --------
    >>> import ifrfit
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "figure2.csv"
    >>> _ = file.write_text("10, 0.41\n40, 0.02\n70, -0.66\n")
    >>> ifrfit.read_figure(file, x="gamma_deg", y="beta")
    Observations(figure2.csv: 3 rows of beta; digitised)
    """
    conventions = parse_conventions(convention)
    if conventions.figure is not None:
        raise UsageError("--convention x=...: what the axes are is given as --x and --y, too. Keep one.")
    said = figure_question(x, y, axes, _names(dataset), _names(series), pixels, bars)
    cells = cells_of_figure(Path(file), replace(conventions, figure=said))
    assert cells is not None  # everything is a figure where it is said what its axes are
    return observe(cells, conventions, inertia_factor)


def _names(given: str | Sequence[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)
