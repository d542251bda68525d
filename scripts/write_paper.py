"""Write docs/paper.md: pages/paper.md, with rows from the package's own table of figures."""

from __future__ import annotations

from collections.abc import Iterator

from studies import DOCS, markdown, render

from ifrfit.data.catalogue import entry
from ifrfit.data.descriptor import read_package
from ifrfit.paper.figures import PAPER, PaperFigure
from ifrfit.paper.recovered_constants import case_named

TITLES = (
    "figure",
    "what the caption says",
    "equations really used",
    "constants",
    "transition",
    "provenance",
)


def page() -> str:
    """The page's text."""
    notes = [f"- **Fig. {figure.name}.** {figure.note}" for figure in PAPER if figure.note]
    return render("paper.md", figures=markdown(TITLES, _rows()), notes="\n".join(notes))


def _rows() -> Iterator[tuple[str, ...]]:
    for figure in PAPER:
        yield (
            f"[{figure.name}](../figures/{figure.stem}.svg)",
            figure.says,
            figure.uses,
            _constants(figure),
            _transition(figure),
            _provenance(figure),
        )


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
    (DOCS / "paper.md").write_text(page(), encoding="utf-8")
