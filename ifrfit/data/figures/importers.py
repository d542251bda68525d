"""The importers of figures, by name: each reads the files of one digitiser.

One of your own is a `FigureImporter`, which `ifrfit.register` takes; the first that recognises a file reads it.
"""

from __future__ import annotations

from ifrfit.data.figures.digitised_figure import FigureImporter
from ifrfit.data.figures.engauge import ENGAUGE
from ifrfit.data.figures.point_pairs import POINT_PAIRS
from ifrfit.data.figures.webplotdigitizer import WEBPLOTDIGITIZER
from ifrfit.registry import Registry

FIGURE_IMPORTERS: Registry[FigureImporter] = Registry(
    "importer of figures",
    FigureImporter,
    (WEBPLOTDIGITIZER, ENGAUGE, POINT_PAIRS),
    # those that take any table come last: they would recognise what is meant for others
    order=lambda entry: 0 if entry.has_pixels else 1,
)


def importer_of(head: bytes, *, as_points: bool) -> FigureImporter | None:
    """The importer of a file that begins so.

    Parameters
    ----------
    head : bytes
        The first 512.
    as_points : bool
        Whether it is said to be a figure: without, a table is a table of impacts.
    """
    for each in FIGURE_IMPORTERS.values():
        if (as_points or each.has_pixels) and each.recognises(head):
            return each
    return None
