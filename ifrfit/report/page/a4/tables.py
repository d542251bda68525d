"""Tables: columns as wide as their contents need, the head repeated where a table goes on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from reportlab.lib import colors
from reportlab.lib.enums import TA_LEFT, TA_RIGHT
from reportlab.lib.styles import ParagraphStyle
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.platypus import Table as Drawn

from ifrfit.report.page.a4.sheet_style import BOLD, PLAIN, WIDTH, literal_paragraph
from ifrfit.report.page.blocks import Table

PADDING = 4.0  # points, left and right of a cell together
_SIZE = 7.2
_LEAST = 5.0  # below this type is not made smaller: words are cut instead


def table_flowable(table: Table) -> Drawn:
    """The table as wide as it needs, at most as the text; what does not fit wraps inside its cell."""
    natural, least = _widths(table, _SIZE)
    # smaller type where the longest words do not fit side by side
    size = max(_LEAST, _SIZE * min(1.0, WIDTH / sum(least)))
    share = size / _SIZE
    widths = column_widths([share * x for x in natural], [share * x for x in least], WIDTH)
    rows = [
        [
            _cell(cell, widths[i], size, head=number == 0, right=i in table.numbers)
            for i, cell in enumerate(row)
        ]
        for number, row in enumerate((table.head, *table.rows))
    ]
    commands: list[tuple[Any, ...]] = [
        ("FONT", (0, 0), (-1, 0), BOLD, size, 1.25 * size),
        ("FONT", (0, 1), (-1, -1), PLAIN, size, 1.25 * size),
        ("LEFTPADDING", (0, 0), (-1, -1), 0.5 * PADDING),
        ("RIGHTPADDING", (0, 0), (-1, -1), 0.5 * PADDING),
        ("TOPPADDING", (0, 0), (-1, -1), 1.5),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 1.5),
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("LINEBELOW", (0, 0), (-1, 0), 0.6, colors.black),
        ("LINEBELOW", (0, 1), (-1, -1), 0.25, colors.lightgrey),
    ]
    commands += [("ALIGN", (i, 0), (i, -1), "RIGHT") for i in table.numbers]
    return Drawn(rows, widths, repeatRows=1, hAlign="LEFT", style=commands, spaceAfter=6.0)


def column_widths(natural: Sequence[float], least: Sequence[float], room: float) -> list[float]:
    """Widths of columns: their natural ones, or as much of what they have to give that all fit.

    Parameters
    ----------
    natural, least : sequence of float
        What a column takes on one line, and where its longest word is not cut.
    room : float
        For all of them.
    """
    if sum(natural) <= room:
        return list(natural)
    if sum(least) >= room:
        return [each * room / sum(least) for each in least]
    share = (room - sum(least)) / (sum(natural) - sum(least))
    return [a + share * (b - a) for a, b in zip(least, natural, strict=True)]


def _widths(table: Table, size: float) -> tuple[list[float], list[float]]:
    """Natural and least widths; numbers stay on one line, what stands above them may wrap."""
    natural, least = [], []
    for i, name in enumerate(table.head):
        cells = [row[i] for row in table.rows]
        words = [(word, BOLD) for word in name.split()]
        words += [
            (word, PLAIN) for cell in cells for word in ([cell] if i in table.numbers else cell.split())
        ]
        # a hair more than the text, which may not wrap by rounding
        extra = PADDING + 0.1
        natural.append(_widest([(name, BOLD), *((cell, PLAIN) for cell in cells)], size) + extra)
        least.append(_widest(words, size) + extra)
    return natural, least


def _widest(texts: Iterable[tuple[str, str]], size: float) -> float:
    return max((stringWidth(text, font, size) for text, font in texts), default=0.0)


def _cell(text: str, width: float, size: float, *, head: bool, right: bool) -> Any:
    font = BOLD if head else PLAIN
    if stringWidth(text, font, size) + PADDING <= width:
        return text
    style = ParagraphStyle(
        "cell", fontName=font, fontSize=size, leading=1.25 * size, alignment=TA_RIGHT if right else TA_LEFT
    )
    return literal_paragraph(text, style)
