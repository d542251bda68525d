"""Write docs/paper.md: paper_page.md beside this file, with rows from the package's own table of figures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ifrfit.data.descriptor import read_package
from ifrfit.data.locations import entry
from ifrfit.paper.cases import case_named
from ifrfit.paper.figures import PAPER, PaperFigure

PAGE = Path(__file__).resolve().parent.parent / "docs" / "paper.md"

TEMPLATE = Path(__file__).with_name("paper_page.md")


def page() -> str:
    """The page's text."""
    notes = [f"- **{_called(figure)}** {figure.note}" for figure in PAPER if figure.note]
    return TEMPLATE.read_text(encoding="utf-8").format(rows="\n".join(_rows()), notes="\n".join(notes))


def _rows() -> Iterator[str]:
    for figure in PAPER:
        cells = (
            f"[{figure.name}](../figures/{figure.stem}.svg)",
            figure.says,
            figure.uses,
            _constants(figure),
            _transition(figure),
            _provenance(figure),
        )
        yield f"| {' | '.join(cells)} |"


def _called(figure: PaperFigure) -> str:
    return f"Fig. {figure.name}."


def _constants(figure: PaperFigure) -> str:
    if not figure.models:
        return ""
    return ", ".join(f"{name} = {value:.2f}" for name, value in figure.models[0].constants.items())


def _transition(figure: PaperFigure) -> str:
    if not figure.models:
        return ""
    if figure.x.spin:
        return "none: all slide"
    found = []
    for setting in figure.settings:
        angles = ", ".join(f"{a:.2f}°" for a in figure.models[0].transitions(setting)) or "none: all slide"
        found.append(f"{setting.series}: {angles}" if len(figure.settings) > 1 else angles)
    return "; ".join(found)


def _provenance(figure: PaperFigure) -> str:
    if figure.kind == "scheme":
        return "own drawing"
    if not figure.case:
        return "theory"
    dataset = case_named(figure.case).dataset
    return f"{read_package(entry(dataset).bundled)['ifrfit']['provenance']} (`{dataset}`)"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
