"""Closures side by side, or why they are not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ifrfit.report.page.blocks import Paragraph, Section, Table
from ifrfit.report.page.material import Material
from ifrfit.report.page.wording import sentence

if TYPE_CHECKING:
    import pandas as pd


ANCHOR, TITLE = "closures", "Closures compared"


class Verdict(Protocol):
    """Which closure the data prefer."""

    @property
    def says(self) -> str:
        """One sentence, with how strongly."""


class Comparison(Protocol):
    """What a comparison of closures must give to be shown."""

    @property
    def verdict(self) -> Verdict:
        """Which closure the data prefer, and how strongly."""

    def table(self) -> pd.DataFrame:
        """One row a closure (index: its name), one column a criterion."""


def section(material: Material) -> Section | None:
    """Verdict and table of a comparison, or the sentence that says why there is none."""
    comparison = material.comparison
    if comparison is None:
        missing = material.without_comparison
        return Section(ANCHOR, TITLE, (Paragraph(sentence(missing)),)) if missing else None
    table = comparison.table()
    rows = tuple(
        (str(name), *(_cell(cell) for cell in cells))
        for name, *cells in table.itertuples(index=True, name=None)
    )
    head = ("closure", *(str(column).replace("_", " ") for column in table.columns))
    return Section(
        ANCHOR,
        TITLE,
        (
            Paragraph(sentence(comparison.verdict.says)),
            Table("Criteria by closure.", head, rows, frozenset(range(1, len(head)))),
        ),
    )


def _cell(cell: object) -> str:
    if isinstance(cell, float):
        return "-" if cell != cell else f"{cell:.5g}"
    return str(cell)
