"""Intervals of three methods side by side, for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ifrfit.inference.diagnostics.interval_disagreements import disagreements
from ifrfit.report.terminal import aligned, finding_lines, interval_column
from ifrfit.text import decimals

if TYPE_CHECKING:
    import pandas as pd

METHODS = ("covariance", "profile", "exact")
_SDS = 4.0  # an interval of 95 % is about four standard deviations wide


def side_by_side(table: pd.DataFrame) -> str:
    """95 % intervals by covariance, profile and exact posterior, and where they disagree.

    Parameters
    ----------
    table : DataFrame
        What `FitResult.intervals` returned.

    Returns
    -------
    str
        One line a constant, then one sentence a disagreement; at most 100 columns unless a name is very long.
        Ends without a line feed.
    """
    if table.empty:
        return "  every constant is fixed: there are no intervals to compare"
    columns = {method: _column(table, method) for method in METHODS}
    names = [str(name).replace("[", " [") for name in table.index]
    rows = [("", *METHODS), *zip(names, *columns.values(), strict=True)]
    lines = ["  central 95 % intervals by three methods", "", *aligned(rows, "<<<<", "   "), ""]
    disagreeing = [("LOOK", sentence) for sentence in disagreements(table)]
    for kind, sentence in disagreeing or [("ok", "the three methods agree")]:
        lines += finding_lines(kind, sentence)
    return "\n".join(lines)


def _column(table: pd.DataFrame, method: str) -> list[str]:
    """Intervals of one method, with the digits that the exact one deserves and their ends aligned."""
    low, high = (table[f"{method}_{end}"].to_numpy(dtype=float).tolist() for end in ("low", "high"))
    places = [_places(table, i) for i in range(len(table))]
    return interval_column(list(zip(low, high, strict=True)), places)


def _places(table: pd.DataFrame, row: int) -> int | None:
    span = float(table["exact_high"].iloc[row] - table["exact_low"].iloc[row])
    return decimals(span / _SDS) if span > 0.0 else None
