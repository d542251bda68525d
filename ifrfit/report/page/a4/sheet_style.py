"""Sheets, type and styles."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import matplotlib
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.platypus import Paragraph

PAGE = A4
MARGIN, FOOT = 18.0 * mm, 17.0 * mm
WIDTH = PAGE[0] - 2.0 * MARGIN
HEIGHT = PAGE[1] - MARGIN - FOOT

# the type of the figures, which has Greek letters and comes with matplotlib
PLAIN, BOLD, MONO = "DejaVuSans", "DejaVuSans-Bold", "DejaVuSansMono"
SIZE, LEADING = 7.6, 10.4  # points
SMALL = 6.8
HANG = 30.0  # points from a mark to its sentence


@cache
def fonts() -> None:
    """Make the type known."""
    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    for name in (PLAIN, BOLD, MONO):
        pdfmetrics.registerFont(TTFont(name, str(folder / f"{name}.ttf")))


def _style(name: str, font: str = PLAIN, size: float = SIZE, **more: float) -> ParagraphStyle:
    leading = size * LEADING / SIZE
    return ParagraphStyle(name, fontName=font, fontSize=size, leading=leading, spaceAfter=3.0, **more)


TITLE = _style("title", BOLD, 15.0)
VERDICT = _style("verdict", size=9.0)
HEADING = _style("heading", BOLD, 11.0, spaceBefore=9.0)
BODY = _style("body")
LOUD = _style("loud", BOLD)
ITEM = _style("item", leftIndent=HANG)
LOUD_ITEM = _style("loud item", BOLD, leftIndent=HANG)
PAIR = _style("pair", leftIndent=10.0, firstLineIndent=-10.0)
CODE = _style("code", MONO, 7.2, leftIndent=10.0, firstLineIndent=-10.0)
CAPTION = _style("caption", size=SMALL)


def literal_paragraph(text: str, style: ParagraphStyle, mark: str = "") -> Paragraph:
    """A paragraph of text as it is: nothing in it is taken for markup.

    Parameters
    ----------
    text : str
    style : ParagraphStyle
    mark : str
        Stands before an indented paragraph.
    """
    if mark:
        style = ParagraphStyle(style.name, style, bulletFontName=style.fontName, bulletFontSize=SIZE)
    return Paragraph(escape(text), style, bulletText=mark or None)


def add_to_outline(canvas: Any, flowable: Any) -> None:
    """Put what was just drawn into the outline, if it is a heading."""
    if getattr(flowable, "style", None) is HEADING:
        title = flowable.getPlainText()
        key = f"{canvas.getPageNumber()} {title}"
        canvas.bookmarkPage(key)
        canvas.addOutlineEntry(title, key)
