"""A report as Markdown, with its figures as PNG beside it: for a lab book."""

from __future__ import annotations

import io

from ifrfit.report.page.blocks import Block, Code, Findings, Pairs, Paragraph, Pictures, Report, Table
from ifrfit.report.page.plugins import GENERATOR, ReportFormat
from ifrfit.report.style import drawing

_SPECIAL = "\\`*_{}[]<>|#"


def markdown_files(report: Report, stem: str) -> dict[str, bytes]:
    """``STEM.md`` and ``STEM-figures/NAME.png``; the same bytes on every run.

    PNG, because lab books and word processors take it everywhere.
    """
    folder = f"{stem}-figures"
    figures: dict[str, bytes] = {}
    lines = [f"<!-- {GENERATOR} -->", f"# {escaped(report.title)}", ""]
    lines += [" · ".join(f"**{escaped(badge.text)}**" for badge in report.badges), ""]
    lines += [part for sentence in report.verdict for part in (f"> {escaped(sentence)}", ">")][:-1]
    for section in report.sections:
        lines += ["", f"## {escaped(section.title)}", ""]
        for block in section.blocks:
            lines += [*_block(block, folder, figures), ""]
    lines += ["---", "", escaped(", ".join(f"{name} {text}" for name, text in report.footer.items())), ""]
    text = "\n".join(lines)
    return {f"{stem}.md": text.encode("utf-8"), **figures}


def escaped(text: str) -> str:
    """Text whose characters mean nothing in Markdown."""
    text = " ".join(text.split())
    return "".join(f"\\{character}" if character in _SPECIAL else character for character in text)


def _block(block: Block, folder: str, figures: dict[str, bytes]) -> list[str]:
    """Lines of a block; the interactive panel and links into the page have no place here."""
    if isinstance(block, Paragraph):
        lead = "**LOOK** " if block.tone == "look" else ""
        text = escaped(block.text)
        return [f"**{text}**" if block.tone == "stand-in" else lead + text]
    if isinstance(block, Findings):
        return [f"- **{kind}** {escaped(sentence)}" for kind, sentence in block.items]
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, Pairs):
        return [f"- {escaped(name)}: {escaped(text)}" for name, text in block.items]
    if isinstance(block, Pictures):
        found = []
        for picture in block.items:
            place = f"{folder}/{picture.name}.png"
            figures[place] = _png(picture.figure)
            found.append(f"![{escaped(picture.title)}]({place.replace(' ', '%20')})")
        return [*found, "", f"*{escaped(block.caption)}*"]
    if isinstance(block, Code):
        return [escaped(block.words), "", f"    {' '.join(block.text.split())}"]
    return []


def _table(table: Table) -> list[str]:
    rule = ("---:" if i in table.numbers else "---" for i in range(len(table.head)))
    rows = [f"| {' | '.join(map(escaped, row))} |" for row in (table.head, *table.rows)]
    return [f"*{escaped(table.caption)}*", "", rows[0], f"| {' | '.join(rule)} |", *rows[1:]]


def _png(figure: object) -> bytes:
    from matplotlib.figure import Figure

    assert isinstance(figure, Figure)
    buffer = io.BytesIO()
    with drawing():
        figure.savefig(buffer, format="png", metadata={"Software": "ifrfit"})
    return buffer.getvalue()


FORMAT = ReportFormat("md", markdown_files)
