"""What was met while rows were read: how many, which were left out and why, and from where they come."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import Cells
from ifrfit.data.stream.missing_codes import SizesMet
from ifrfit.errors import DataError, UsageError

_FEW_PLACES = 3
_MOST_SERIES = 200


@dataclass
class Tally:
    """Counts of rows and values.

    Attributes
    ----------
    rows : int
    read : dict of int to int
        Rows of each piece of a file, by the place of its first (`ifrfit.data.stream.row_places`).
    excluded : dict of (int, int)
        Rows met that were to be left out, by file and row in it.
    series : list of str
        Those met, in their order.
    skipped : Counter
        Values left out, by reason.
    places : dict
        First places of each reason.
    provenances : dict
        Those met, in their order.
    least_sigma : dict
        Least uncertainty of each observable, and the file.
    sizes : dict of str to SizesMet
        By the header of a column.
    open : dict of str to (str, bool)
        What a header leaves open: what is wrong unless a value answers, and whether one did; by the header.
    cut : dict of str to (int, float, float, float)
        Values of an observable left out just below its least one, as noise may make them: how many, the
        least of them, the least angle of incidence at which one stands, degrees, and the sum of their slopes
        with e_n over sigma.
    below : dict of str to dict of str to (int, float, float, float)
        Of the same values, by observable and series: how many have a weight, and sums of w s z, w s s and
        w z z of values z, slopes s of their constant and weights w = sigma^-2, 1 without a sigma.
    """

    rows: int = 0
    series: list[str] = field(default_factory=list)
    skipped: Counter[str] = field(default_factory=Counter)
    places: dict[str, list[str]] = field(default_factory=dict)
    provenances: dict[str, None] = field(default_factory=dict)
    least_sigma: dict[str, tuple[float, str]] = field(default_factory=dict)
    sizes: dict[str, SizesMet] = field(default_factory=dict)
    open: dict[str, tuple[str, bool]] = field(default_factory=dict)
    read: dict[int, int] = field(default_factory=dict)
    excluded: dict[tuple[int, int], None] = field(default_factory=dict)
    cut: dict[str, tuple[int, float, float, float]] = field(default_factory=dict)
    below: dict[str, dict[str, tuple[int, float, float, float]]] = field(default_factory=dict)

    def note_cut(self, name: str, count: int, least: float, gamma: float, pull: float) -> None:
        """Count values of an observable that are left out just below its least one, see `cut`."""
        known = self.cut.get(name, (0, math.inf, math.inf, 0.0))
        self.cut[name] = (
            known[0] + count,
            min(known[1], least),
            min(known[2], gamma),
            known[3] + pull,
        )

    def note_below(self, name: str, series: str, count: int, sums: tuple[float, float, float]) -> None:
        """Add sums of such values of one series, see `below`."""
        of_series = self.below.setdefault(name, {})
        known = of_series.get(series, (0, 0.0, 0.0, 0.0))
        of_series[series] = (
            known[0] + count,
            known[1] + sums[0],
            known[2] + sums[1],
            known[3] + sums[2],
        )

    def note_sizes(self, cells: Cells, header: str, values: NDArray[np.float64]) -> None:
        """See whether a column holds what may be a code for "not measured"."""
        self.sizes.setdefault(header, SizesMet()).note(cells, header, values)

    def note_largest(self, header: str, largest: float) -> None:
        """See the largest size in a column of which no value may be such a code; negative without a value."""
        self.sizes.setdefault(header, SizesMet()).note_largest(largest)

    def note_open(self, header: str, said: str, answered: bool) -> None:
        """See whether values answer what the header of a column leaves open."""
        known, before = self.open.get(header, (said, False))
        self.open[header] = (known, before or answered)

    def refuse_open(self) -> None:
        """Refuse what headers leave open and no value answers.

        Raises
        ------
        DataError
            With the column, and the remedy.
        """
        for said, answered in self.open.values():
            if not answered:
                raise DataError(said)

    def leave_out(self, bad: NDArray[np.bool_], reason: str, cells: Cells) -> None:
        """Count values that are left out; those outside of a range that was asked for have no places."""
        count = int(np.count_nonzero(bad))
        if not count:
            return
        self.skipped[reason] += count
        if reason != "excluded" and not reason.startswith("outside "):
            self._name(reason, [cells.at(row) for row in np.flatnonzero(bad)[:_FEW_PLACES].tolist()])

    def note_sigma(self, name: str, sigma: NDArray[np.float64], file: Path | str) -> None:
        """See whether an observable has a smaller uncertainty than before."""
        least = float(sigma.min(initial=math.inf))
        if least < self.least_sigma.get(name, (math.inf, ""))[0]:
            self.least_sigma[name] = (least, str(file))

    def numbers_of(self, names: list[str]) -> NDArray[np.intp]:
        """Place of each series among those met.

        Raises
        ------
        UsageError
            There are too many.
        """
        self.series += [name for name in dict.fromkeys(names) if name not in self.series]
        if len(self.series) > _MOST_SERIES:
            raise UsageError(
                f"There are more than {_MOST_SERIES} series in these data. ifrfit campaign fits each by "
                "itself."
            )
        return np.array([self.series.index(name) for name in names], dtype=np.intp)

    def merge(self, following: Tally) -> NDArray[np.intp]:
        """Add what was met later; gives the place here of each of its series."""
        self.rows += following.rows
        self.skipped.update(following.skipped)
        for reason, places in following.places.items():
            self._name(reason, places)
        self.provenances.update(following.provenances)
        for name, (least, file) in following.least_sigma.items():
            self.note_sigma(name, np.array([least]), file)
        for header, sizes in following.sizes.items():
            self.sizes.setdefault(header, SizesMet()).merge(sizes)
        self.read.update(following.read)
        self.excluded.update(following.excluded)
        for header, (said, answered) in following.open.items():
            self.note_open(header, said, answered)
        for name, cut in following.cut.items():
            self.note_cut(name, *cut)
        for name, of_series in following.below.items():
            for series, (count, *sums) in of_series.items():
                self.note_below(name, series, count, (sums[0], sums[1], sums[2]))
        return self.numbers_of(following.series)

    def to_dict(self) -> dict[str, Any]:
        """As JSON takes it."""
        return {
            "rows": self.rows,
            "series": self.series,
            "skipped": dict(self.skipped),
            "places": self.places,
            "provenances": list(self.provenances),
            "least_sigma": self.least_sigma,
            "sizes": {header: sizes.to_dict() for header, sizes in self.sizes.items()},
            "open": self.open,
            "read": list(self.read.items()),
            "excluded": list(self.excluded),
            "cut": self.cut,
            "below": self.below,
        }

    @classmethod
    def of_dict(cls, found: dict[str, Any]) -> Tally:
        """What `to_dict` gave."""
        return cls(
            found["rows"],
            found["series"],
            Counter(found["skipped"]),
            found["places"],
            dict.fromkeys(found["provenances"]),
            {name: (least, file) for name, (least, file) in found["least_sigma"].items()},
            {header: SizesMet.of_dict(sizes) for header, sizes in found["sizes"].items()},
            {header: (said, answered) for header, (said, answered) in found["open"].items()},
            dict(map(tuple, found["read"])),
            dict.fromkeys(found["excluded"]),
            {name: (cut[0], cut[1], cut[2], cut[3]) for name, cut in found["cut"].items()},
            {
                name: {series: (one[0], one[1], one[2], one[3]) for series, one in of_series.items()}
                for name, of_series in found["below"].items()
            },
        )

    def _name(self, reason: str, places: list[str]) -> None:
        known = self.places.setdefault(reason, [])
        known += [place for place in dict.fromkeys(places) if place not in known][: _FEW_PLACES - len(known)]
