"""A figure with its heading and its caption: whole, and a little smaller where that spares a page."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from reportlab.platypus import Flowable

from ifrfit.report.page.a4.pictures import Row
from ifrfit.report.page.a4.sheet_style import HEIGHT, add_to_outline

SHRUNK = 0.85  # of its size, so that a figure that stands alone fits into what is left of a sheet
_ENDLESS = 1e6  # points


class FigureBlock(Flowable):  # type: ignore[misc]
    """What stands around one row of figures.

    Parameters
    ----------
    parts : sequence of Flowable
        From top to bottom, one of them a row.
    """

    def __init__(self, parts: Sequence[Any]) -> None:
        super().__init__()
        self.parts = list(parts)
        (self.row,) = (part for part in self.parts if isinstance(part, Row))
        self.heights: list[float] = []

    def getSpaceBefore(self) -> float:  # noqa: N802
        """As the first part."""
        return float(self.parts[0].getSpaceBefore())

    def getSpaceAfter(self) -> float:  # noqa: N802
        """As the last part."""
        return float(self.parts[-1].getSpaceAfter())

    def wrap(self, width: float, height: float) -> tuple[float, float]:
        """Width and height that it takes; the row gives way where it may and that is enough."""
        self.row.shrunk = 1.0
        total = self._total(width)
        if total > height and not self.row.titled:
            tall = self.row.wrap(width, _ENDLESS)[1]
            share = 1.0 - (total - height) / tall
            if share >= SHRUNK:
                self.row.shrunk = share
                total = min(self._total(width), height)
        return width, total

    def split(self, _width: float, height: float) -> list[Any]:
        """Parts one by one where a whole sheet cannot hold them, as under an endless caption."""
        return self.parts if height > HEIGHT - 1.0 else []

    def draw(self) -> None:
        """Draw the parts from the top."""
        y = sum(self.heights) + sum(self._gaps())
        for part, height, gap in zip(self.parts, self.heights, [*self._gaps(), 0.0], strict=True):
            y -= height
            part.drawOn(self.canv, 0.0, y)
            add_to_outline(self.canv, part)
            y -= gap

    def _total(self, width: float) -> float:
        self.heights = [part.wrapOn(None, width, _ENDLESS)[1] for part in self.parts]
        return sum(self.heights) + sum(self._gaps())

    def _gaps(self) -> list[float]:
        return [max(a.getSpaceAfter(), b.getSpaceBefore()) for a, b in pairwise(self.parts)]
