"""Tables of a page that the reader sorts and filters."""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass
from html import escape  # of Markup would take three times as long

from markupsafe import Markup


@dataclass(frozen=True)
class Cell:
    """A cell: what is shown, what it is sorted by, and what stands below it in small letters."""

    text: str
    key: str
    note: str = ""


def cells(row: Iterable[Cell], numbers: Container[int], first: int = 0) -> Markup:
    """The cells of a row in HTML, escaped; a template would take ten times as long for thousands of rows.

    Parameters
    ----------
    row : iterable of Cell
    numbers : container of int
        Columns that hold numbers.
    first : int
        Column of the first cell.
    """
    return Markup("".join(_cell(cell, is_number=at in numbers) for at, cell in enumerate(row, first)))


def _cell(cell: Cell, *, is_number: bool) -> str:
    kind = ' class="number"' if is_number else ""
    note = f"<br><small>{escape(cell.note)}</small>" if cell.note else ""
    return f'<td data-key="{escape(cell.key)}"{kind}>{escape(cell.text)}{note}</td>'
