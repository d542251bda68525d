"""Tables of a page that the reader sorts and filters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Cell:
    """A cell: what is shown, what it is sorted by, and what stands below it in small letters."""

    text: str
    key: str
    note: str = ""
