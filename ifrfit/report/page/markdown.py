"""A report as Markdown, with its pictures as svg beside it: for a lab book."""

from __future__ import annotations

from ifrfit.report.page.blocks import Pictures, Report
from ifrfit.report.page.plugins import GENERATOR, ReportFormat
from ifrfit.report.page.svg import file_text
from ifrfit.report.templating import environment

_SPECIAL = "\\`*_{}[]<>|#"


def markdown_files(report: Report, stem: str) -> dict[str, bytes]:
    """``STEM.md`` and ``STEM-figures/NAME.svg``; the same bytes on every run."""
    folder = f"{stem}-figures"
    found = environment(autoescape=False)
    found.filters["md"] = escaped
    footer = ", ".join(f"{name} {text}" for name, text in report.footer.items())
    text = found.get_template("report.md.j2").render(
        report=report, folder=folder, footer=footer, generator=GENERATOR
    )
    blocks = (block for section in report.sections for block in section.blocks)
    pictures = (picture for block in blocks if isinstance(block, Pictures) for picture in block.items)
    figures = {f"{folder}/{picture.name}.svg": file_text(picture).encode("utf-8") for picture in pictures}
    return {f"{stem}.md": text.encode("utf-8"), **figures}


def escaped(text: str) -> str:
    """Text whose characters mean nothing in Markdown."""
    text = " ".join(text.split())
    return "".join(f"\\{character}" if character in _SPECIAL else character for character in text)


FORMAT = ReportFormat("md", markdown_files)
