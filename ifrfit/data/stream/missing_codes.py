"""Codes for "not measured" in columns that are read some rows at a time, judged when all rows were seen.

Whether 999 is a code or a value depends on all others of its column
(`ifrfit.data.column_layout.refuse_missing_codes`), which no batch of rows knows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_layout import CODES, FAR, SEVERAL, SHORT_CODES, said_of_code
from ifrfit.errors import DataError

Array = NDArray[np.float64]


@dataclass
class SizesMet:
    """What was met in a column.

    Attributes
    ----------
    largest : float
        Largest size of a value that is not written like a code; negative without one.
    counts : dict of float to int
        How often each size that is written like a code was met.
    first, first_negative : dict of float to str
        Where first, and where first with a minus sign.
    """

    largest: float = -1.0
    counts: dict[float, int] = field(default_factory=dict)
    first: dict[float, str] = field(default_factory=dict)
    first_negative: dict[float, str] = field(default_factory=dict)

    def note_largest(self, size: float) -> None:
        """See the largest size of some values that are none of the codes; negative without a value."""
        self.largest = max(self.largest, size)
        if self.largest > SHORT_CODES[-1]:  # short codes are values then
            for known in (self.counts, self.first, self.first_negative):
                for code in known.keys() & set(SHORT_CODES.tolist()):
                    del known[code]

    def note(self, cells: Cells, header: str, values: Array) -> None:
        """See some more values, as they stand in the file."""
        size = np.abs(values)
        if not (size >= SHORT_CODES[0]).any():
            self.note_largest(float(size.max(where=np.isfinite(size), initial=-1.0)))
            return
        is_code = np.isin(size, SHORT_CODES) | np.isin(size, CODES)
        largest = float(size.max(where=np.isfinite(size) & ~is_code, initial=-1.0))
        for code in np.unique(size[is_code]).tolist():
            rows = np.flatnonzero(size == code)
            negative = rows[values[rows] < 0.0]
            self.counts[code] = self.counts.get(code, 0) + rows.size
            # lines of text before a place are counted when it is named
            if code not in self.first:
                self.first[code] = cells.at(int(rows[0]), header)
            if negative.size and code not in self.first_negative:
                self.first_negative[code] = cells.at(int(negative[0]), header)
        self.note_largest(largest)

    def merge(self, following: SizesMet) -> None:
        """Add what was met in later rows."""
        for code, count in following.counts.items():
            self.counts[code] = self.counts.get(code, 0) + count
        for ours, theirs in (
            (self.first, following.first),
            (self.first_negative, following.first_negative),
        ):
            for code, place in theirs.items():
                ours.setdefault(code, place)
        self.note_largest(following.largest)

    def refuse(self) -> None:
        """Refuse a code for "not measured", by the rule of a table that is held in memory.

        Raises
        ------
        DataError
            With the first place.
        """
        total = sum(self.counts.values())
        # a short one that stands alone is a value; and so is each where there is nothing else
        others = {
            code
            for code, count in self.counts.items()
            if code in SHORT_CODES and (count < SEVERAL or (count == total and self.largest < 0.0))
        }
        largest = max([self.largest, *others])
        for code in sorted(self.counts.keys() - others):
            places = self.first if largest >= 0.0 else self.first_negative
            if code in places and (largest < 0.0 or code > FAR * largest):
                minus = "-" if places[code] == self.first_negative.get(code) else ""
                raise DataError(f"{places[code]}: {said_of_code(f'{minus}{code:g}')}")

    def to_dict(self) -> dict[str, Any]:
        """As JSON takes it."""
        pairs = (self.counts, self.first, self.first_negative)
        return {"largest": self.largest, "codes": [list(each.items()) for each in pairs]}

    @classmethod
    def of_dict(cls, found: dict[str, Any]) -> SizesMet:
        """What `to_dict` gave."""
        return cls(found["largest"], *(dict(map(tuple, pairs)) for pairs in found["codes"]))
