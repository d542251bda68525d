"""A report as what stands on sheets one after another: paragraphs, tables, rows of figures."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from reportlab.platypus import BaseDocTemplate, CondPageBreak, Frame, KeepTogether, PageTemplate, Spacer

from ifrfit.report.page.a4 import sheet_style as look
from ifrfit.report.page.a4.pictures import Place, rows_of
from ifrfit.report.page.a4.sheet_style import literal_paragraph
from ifrfit.report.page.a4.tables import table_flowable
from ifrfit.report.page.blocks import (
    Block,
    Code,
    Findings,
    Pairs,
    Paragraph,
    Pictures,
    Report,
    Section,
    Table,
)

BETWEEN = " · "
FEW = 12  # rows of a table that is not cut
_BEGINNING = 70.0  # points of a longer table that stand under its caption at least
_HEADING = 30.0  # points of a heading


@dataclass(frozen=True)
class Group:
    """What stands together.

    Attributes
    ----------
    parts : tuple
        Flowables.
    room : float or None
        Points of its beginning that are not cut; None: it is not cut at all.
    """

    parts: tuple[Any, ...]
    room: float | None = None

    def with_heading(self, heading: Any) -> Group:
        """The same with its heading, which is never the last thing on a sheet."""
        return Group((heading, *self.parts), None if self.room is None else self.room + _HEADING)

    def flowables(self) -> list[Any]:
        """For the sheets."""
        if self.room is None:
            return [KeepTogether(list(self.parts))] if len(self.parts) > 1 else list(self.parts)
        return [CondPageBreak(self.room), *self.parts]


def sheets(report: Report) -> tuple[bytes, list[Place]]:
    """The sheets without their figures, and where these belong.

    Returns
    -------
    bytes
        A PDF, the same on every run.
    list of Place
    """
    look.fonts()
    places: list[Place] = []
    parts = list(_top(report))
    for section in report.sections:
        for group in _section(section, places):
            parts += group.flowables()
    parts += [
        Spacer(0.0, 6.0),
        literal_paragraph(", ".join(f"{name} {text}" for name, text in report.footer.items()), look.CAPTION),
    ]
    buffer = io.BytesIO()
    _Sheets(buffer, report).build(parts)
    return buffer.getvalue(), places


class _Sheets(BaseDocTemplate):  # type: ignore[misc]
    """Sheets of A4 with a foot, and an outline of the headings."""

    def __init__(self, buffer: io.BytesIO, report: Report) -> None:
        # invariant: neither times nor chance
        super().__init__(buffer, pagesize=look.PAGE, invariant=1, pageCompression=1)
        frame = Frame(look.MARGIN, look.FOOT, look.WIDTH, look.HEIGHT, 0, 0, 0, 0)
        self.addPageTemplates(PageTemplate("sheet", [frame], onPage=self._foot))
        loud = [badge.text for badge in report.badges if badge.tone in ("look", "stand-in")]
        self.name = BETWEEN.join([report.title, *loud])

    def _foot(self, canvas: Any, _document: Any) -> None:
        canvas.setFont(look.PLAIN, look.SMALL)
        canvas.drawString(look.MARGIN, 0.6 * look.FOOT, self.name)
        canvas.drawRightString(look.MARGIN + look.WIDTH, 0.6 * look.FOOT, str(canvas.getPageNumber()))

    def afterFlowable(self, flowable: Any) -> None:  # noqa: N802
        """Put a heading into the outline."""
        look.add_to_outline(self.canv, flowable)


def _top(report: Report) -> Iterator[Any]:
    yield literal_paragraph(report.title, look.TITLE)
    yield literal_paragraph(BETWEEN.join(badge.text for badge in report.badges), look.LOUD)
    for sentence in report.verdict:
        yield literal_paragraph(sentence, look.VERDICT)


def _section(section: Section, places: list[Place]) -> Iterator[Group]:
    """Nothing where a section has only what sheets cannot show."""
    heading = literal_paragraph(section.title, look.HEADING)
    for number, group in enumerate(group for block in section.blocks for group in _groups(block, places)):
        yield group if number else group.with_heading(heading)


def _groups(block: Block, places: list[Place]) -> Iterator[Group]:
    if isinstance(block, Paragraph):
        loud = block.tone in ("look", "stand-in")
        lead = "LOOK  " if block.tone == "look" else ""
        yield Group((literal_paragraph(lead + block.text, look.LOUD if loud else look.BODY),))
    elif isinstance(block, Findings):
        for kind, sentence in block.items:
            yield Group(
                (literal_paragraph(sentence, look.LOUD_ITEM if kind == "LOOK" else look.ITEM, mark=kind),)
            )
    elif isinstance(block, Pairs):
        for name, text in block.items:
            yield Group((literal_paragraph(f"{name}: {text}", look.PAIR),))
    elif isinstance(block, Code):
        yield Group((literal_paragraph(block.words, look.BODY), literal_paragraph(block.text, look.CODE)))
    elif isinstance(block, Table):
        caption = literal_paragraph(block.caption, look.CAPTION)
        yield Group((caption, table_flowable(block)), None if len(block.rows) <= FEW else _BEGINNING)
    elif isinstance(block, Pictures):
        *before, last = rows_of(block.items, places)
        for row in before:
            yield Group((row,))
        yield Group((last, literal_paragraph(block.caption, look.CAPTION)))
