"""A report as PDF: pages of text, then a page a figure; by matplotlib, so that no browser is needed."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ifrfit.report.page.blocks import (
    Block,
    Code,
    Findings,
    Pairs,
    Paragraph,
    Picture,
    Pictures,
    Report,
    Table,
)
from ifrfit.report.page.drawings.canvas import blank, plain
from ifrfit.report.page.html import GENERATOR
from ifrfit.report.style import MM_PER_INCH, drawing

PAGE_MM = (210.0, 297.0)
MARGIN_MM = 18.0
COLUMNS = 104  # characters of the small type across the page
LINE_MM, SMALL = 3.9, 7.6
MONO = "DejaVu Sans Mono"


@dataclass(frozen=True)
class Line:
    """A line of text: its size in points, whether it is bold, whether it is of one width."""

    text: str
    size: float = SMALL
    bold: bool = False
    mono: bool = False


def pdf(report: Report) -> bytes:
    """The report as PDF pages of A4, the same bytes on every run; figures stay vector graphics."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    buffer = io.BytesIO()
    about: dict[str, Any] = {"Title": report.title, "Creator": GENERATOR, "Producer": "matplotlib"}
    about |= {"CreationDate": None, "ModDate": None}
    with drawing(), rc_context({"pdf.fonttype": 42}), PdfPages(buffer, metadata=about) as pages:
        _text_pages(pages, list(_text(report)))
        for section in report.sections:
            for block in section.blocks:
                if isinstance(block, Pictures):
                    for picture in block.items:
                        _figure_page(pages, section.title, picture, block.caption)
    return buffer.getvalue()


def _text(report: Report) -> Iterator[Line]:
    yield from _wrapped(report.title, 14.0, bold=True)
    yield Line("   ".join(badge.text for badge in report.badges), bold=True)
    yield Line("")
    for sentence in report.verdict:
        yield from _wrapped(sentence, 9.0)
    for section in report.sections:
        lines = [line for block in section.blocks for line in _lines(block)]
        if any(line.text for line in lines):
            yield Line("")
            yield Line(section.title, 10.5, bold=True)
            yield from lines
    yield Line("")
    yield Line(", ".join(f"{name} {text}" for name, text in report.made.items()))


def _lines(block: Block) -> Iterator[Line]:
    if isinstance(block, Paragraph):
        lead = "LOOK  " if block.tone == "look" else ""
        yield from _wrapped(lead + block.text, bold=block.tone in ("look", "stand-in"))
    elif isinstance(block, Findings):
        for kind, sentence in block.items:
            yield from _wrapped(f"{kind:<6}{sentence}", hang=6, bold=kind == "LOOK")
    elif isinstance(block, Pairs):
        for name, text in block.items:
            yield from _wrapped(f"{name}: {text}", hang=4)
    elif isinstance(block, Code):
        yield from _wrapped(block.words)
        yield from _wrapped(block.text, hang=4, mono=True)
    elif isinstance(block, Table):
        yield from _table(block)
    yield Line("", 4.0)


def _wrapped(
    text: str, size: float = SMALL, *, hang: int = 0, bold: bool = False, mono: bool = False
) -> Iterator[Line]:
    width = int(COLUMNS * SMALL / size * (1.0 if mono else 1.15))
    for part in textwrap.wrap(text, width, subsequent_indent=" " * hang, break_on_hyphens=False):
        yield Line(part, size, bold, mono)


def _table(table: Table) -> Iterator[Line]:
    """A table in type of one width; cells of the last column wrap under themselves."""
    yield from _wrapped(table.caption)
    rows = (table.head, *table.rows)
    widths = [max(len(row[i]) for row in rows) for i in range(len(table.head))]
    last = max(16, COLUMNS - sum(widths[:-1]) - 2 * (len(widths) - 1))
    for number, row in enumerate(rows):
        cells = [
            f"{cell:>{width}}" if i in table.numbers else f"{cell:<{width}}"
            for i, (cell, width) in enumerate(zip(row[:-1], widths, strict=False))
        ]
        start = "  ".join([*cells, ""])
        parts = textwrap.wrap(row[-1], last, break_on_hyphens=False) or [""]
        yield Line(start + parts[0], bold=number == 0, mono=True)
        for part in parts[1:]:
            yield Line(" " * len(start) + part, mono=True)


def _text_pages(pages: Any, lines: list[Line]) -> None:
    width, height = PAGE_MM
    figure, at = None, 0.0
    for line in lines:
        step = LINE_MM * line.size / SMALL
        if figure is None or at - step < MARGIN_MM:
            if figure is not None:
                pages.savefig(figure)
            figure, at = blank(width, height), height - MARGIN_MM
        at -= step
        figure.text(
            MARGIN_MM / width,
            at / height,
            plain(line.text),
            fontsize=line.size,
            family=MONO if line.mono else None,
            weight="bold" if line.bold else "normal",
            va="baseline",
        )
    if figure is not None:
        pages.savefig(figure)


def _figure_page(pages: Any, section: str, picture: Picture, caption: str) -> None:
    """A figure as it is, on a page of A4 around it, with its heading and caption."""
    from matplotlib.transforms import Bbox

    figure = picture.figure
    width, height = (float(x) for x in figure.get_size_inches())
    page_width, page_height = (x / MM_PER_INCH for x in PAGE_MM)
    scale = max(1.0, width / (page_width - 0.5), height / (page_height - 2.5))
    page_width, page_height = page_width * scale, page_height * scale
    left = (page_width - width) / 2.0
    bottom = page_height - 1.2 * scale - height
    heading = f"{section}: {picture.title}"
    words = "\n".join(textwrap.wrap(caption, COLUMNS))
    margin = MARGIN_MM / MM_PER_INCH * scale
    added = [
        figure.text(0.5, 1.0 + 0.3 * scale / height, plain(heading), ha="center", weight="bold"),
        figure.text((margin - left) / width, -0.25 * scale / height, plain(words), va="top"),
    ]
    for text, size in zip(added, (10.0, SMALL), strict=True):
        text.set_fontsize(size * scale)
    # a legend outside the axes keeps to the figure, not to the page around it
    for legend in figure.legends:
        legend.set_bbox_to_anchor((0.0, 0.0, 1.0, 1.0), figure.transFigure)
    try:
        pages.savefig(figure, bbox_inches=Bbox([[-left, -bottom], [page_width - left, page_height - bottom]]))
    finally:
        for text in added:
            text.remove()
