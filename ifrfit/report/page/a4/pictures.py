"""Figures in rows: their places on the sheets, where they are put as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from reportlab.lib.units import inch, mm
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.platypus import Flowable

from ifrfit.report.page.a4.sheet_style import BOLD, HEIGHT, SMALL, WIDTH
from ifrfit.report.page.blocks import Picture
from ifrfit.report.page.drawings.canvas import shortened

GAP = 3.0 * mm
SMALLEST = 0.9  # of its size, for one more figure in a row
TALLEST = HEIGHT - 45.0 * mm  # leaves room for a heading and a caption
_TITLE = 11.0  # points


@dataclass(frozen=True)
class Place:
    """Where a figure stands.

    Attributes
    ----------
    picture : Picture
    page : int
        From 0.
    x, y : float
        Of its lower left corner, points from that of the page.
    scale : float
        1 is its own size.
    """

    picture: Picture
    page: int
    x: float
    y: float
    scale: float


class Row(Flowable):  # type: ignore[misc]
    """Figures side by side, their titles above; it is never cut.

    Parameters
    ----------
    pictures : sequence of Picture
    scale : float
    places : list of Place
        Takes the place of each when the row is drawn.
    titled : bool
        Whether to write the titles.
    """

    def __init__(self, pictures: Sequence[Picture], scale: float, places: list[Place], titled: bool) -> None:
        super().__init__()
        self.pictures, self.scale, self.places, self.titled = pictures, scale, places, titled

    def wrap(self, width: float, _height: float) -> tuple[float, float]:
        """Width and height that it takes."""
        tall = max(size_of(picture)[1] for picture in self.pictures) * self.scale
        return width, tall + (_TITLE if self.titled else 0.0)

    def draw(self) -> None:
        """Write the titles, and note the places."""
        _, height = self.wrap(WIDTH, HEIGHT)
        top = height - (_TITLE if self.titled else 0.0)
        x, scale = 0.0, self.scale
        for picture in self.pictures:
            wide, tall = (length * scale for length in size_of(picture))
            if self.titled:
                self.canv.setFont(BOLD, SMALL)
                self.canv.drawString(x, top + 3.0, _fitting(picture.title, wide))
            left, bottom = self.canv.absolutePosition(x, top - tall)
            page = self.canv.getPageNumber() - 1
            self.places.append(Place(picture, page, left, bottom, scale))
            x += wide + GAP


def rows_of(pictures: Sequence[Picture], places: list[Place]) -> list[Row]:
    """Rows as full as figures of `SMALLEST` of their size make them; too large for a sheet is shrunk."""
    rows: list[list[Picture]] = [[]]
    for picture in pictures:
        if rows[-1] and _scale([*rows[-1], picture]) < SMALLEST:
            rows.append([])
        rows[-1].append(picture)
    scales = [_scale(row) for row in rows]
    # those of one block are of one size, but for what is too large
    common = min((scale for scale in scales if scale >= SMALLEST), default=1.0)
    titled = len(pictures) > 1
    return [Row(row, min(scale, common), places, titled) for row, scale in zip(rows, scales, strict=True)]


def _scale(pictures: Sequence[Picture]) -> float:
    sizes = [size_of(picture) for picture in pictures]
    room = WIDTH - GAP * (len(sizes) - 1)
    wide, tall = sum(size[0] for size in sizes), max(size[1] for size in sizes)
    return float(min(1.0, room / wide, TALLEST / tall))


def _fitting(title: str, room: float) -> str:
    """A title cut to the width of its figure."""
    longest = len(title)
    while longest > 1 and stringWidth(shortened(title, longest), BOLD, SMALL) > room:
        longest -= 1
    return shortened(title, longest)


def size_of(picture: Picture) -> tuple[float, float]:
    """Width and height of a figure in points."""
    wide, tall = picture.figure.get_size_inches()
    return float(wide) * inch, float(tall) * inch
