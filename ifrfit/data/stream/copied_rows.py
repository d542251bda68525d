"""How often each of some impacts stands in a stream: impacts that their own numbers choose, with all copies.

A sample that is drawn by places holds a row and its copy only by chance. One that is drawn by what stands in
the rows holds all copies of a row or none: those of the least hashed values (Cohen 1997, J. Comput. Syst.
Sci. 55, 441; Cormode & Muthukrishnan 2005, ICDE, 20), each with a count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.stream.sample import MIX_A, MIX_B, MIX_C, lot_of_some
from ifrfit.physics.compiled_incidence import read_only
from ifrfit.physics.compiling import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Bits = NDArray[np.uint64]

KEPT = 4096  # different impacts
_NOWHERE = np.uint64(2**64 - 1)
_FIRST, _AGAIN, _COUNT = range(3)
SETTING = 3  # columns of an impact before its values: angle and spins
_MIX_A, _MIX_B, _MIX_C = map(np.uint64, (MIX_A, MIX_B, MIX_C))  # of splitmix64


@dataclass
class CopiedRows:
    """The different impacts of the least lots, and where and how often each was met.

    Attributes
    ----------
    below : int
        Impacts of greater lots need not be counted: there are enough of others.
    lots : ndarray of uint64, (k,)
        Of angle and value.
    met : ndarray of uint64, (3, k)
        Place where an impact stands first, where next, and how often.
    impacts : ndarray, (3 + observables, k)
        Angle, spins, values (nan: not measured).
    waiting : list of (lots, met, impacts)
        Further ones, until `tidy` puts them to the others.
    """

    below: int
    lots: Bits = field(default_factory=lambda: np.empty(0, dtype=np.uint64))
    met: Bits = field(default_factory=lambda: np.empty((3, 0), dtype=np.uint64))
    impacts: Array = field(default_factory=lambda: np.empty((0, 0)))
    waiting: list[tuple[Bits, Bits, Array]] = field(default_factory=list)

    @staticmethod
    def below_of(rows: int, *, counted: bool) -> int:
        """See `ifrfit.data.stream.sample.lot_of_some`."""
        return lot_of_some(KEPT, rows, counted=counted)

    def add(self, setting: tuple[Array, Array, Array], columns: Sequence[Array], first: int) -> None:
        """Count some rows.

        Parameters
        ----------
        setting : tuple of ndarray, (n,) each
            Angle and spins.
        columns : sequence of ndarray, (n,) each
            Values, by observable; nan where not measured.
        first : int
            Place of the first row (`ifrfit.data.stream.row_places`).
        """
        told = columns[0]
        for column in columns[1:]:
            if not np.isnan(told.sum()):
                break
            told = np.where(np.isnan(told), column, told)
        lots, rows = compiled(_chosen)(
            *(read_only(each).view(np.uint64) for each in (setting[0], told)), np.uint64(self.below - 1)
        )
        rows, lots = (each[~np.isnan(told[rows])] for each in (rows, lots))
        if rows.size:
            places = np.uint64(first) + rows.astype(np.uint64)
            met = np.stack([places, np.full(rows.size, _NOWHERE), np.ones(rows.size, dtype=np.uint64)])
            # + 0.0: zero has no sign
            impacts = np.stack([each[rows] + 0.0 for each in (*setting, *columns)])
            self._join(lots, met, impacts)

    def merge(self, following: CopiedRows) -> None:
        """Add what was counted elsewhere."""
        for part in following.parts():
            self._join(*part)

    def parts(self) -> list[tuple[Bits, Bits, Array]]:
        """All that was counted, in the order of the rows."""
        known = [(self.lots, self.met, self.impacts)] if self.lots.size else []
        return known + self.waiting

    def _join(self, lots: Bits, met: Bits, impacts: Array) -> None:
        self.waiting.append((lots, met, impacts))
        if self.lots.size + sum(each[0].size for each in self.waiting) > 8 * KEPT:
            self.tidy()

    def tidy(self) -> None:
        """One entry for each impact, as many as are kept, in the order of the lots."""
        if self.waiting:
            parts = self.parts()
            self.lots = np.concatenate([lots for lots, _, _ in parts])
            self.met = np.hstack([met for _, met, _ in parts])
            self.impacts = np.hstack([impacts for _, _, impacts in parts])
            self.waiting = []
        if not self.lots.size:
            return
        content = _mixed(self.impacts)
        order = np.lexsort((self.met[_FIRST], content, self.lots))
        lots, content = self.lots[order], content[order]
        begins = np.flatnonzero(np.concatenate(([True], (np.diff(lots) != 0) | (np.diff(content) != 0))))
        first = self.met[_FIRST, order]
        # the next place is the second of its entries, or the one that an entry knows
        following = np.append(first[1:], _NOWHERE)
        ends = np.append(begins[1:], lots.size)
        following[ends - 1] = _NOWHERE
        again = np.minimum(np.minimum.reduceat(self.met[_AGAIN, order], begins), following[begins])
        count = np.add.reduceat(self.met[_COUNT, order], begins)
        kept = slice(0, KEPT)
        self.lots = lots[begins][kept]
        self.met = np.stack([first[begins], again, count])[:, kept]
        self.impacts = self.impacts[:, order[begins][kept]]

    @property
    def counts(self) -> Array:
        """How often each impact stands there, (k,)."""
        return np.asarray(self.met[_COUNT].astype(float))

    @property
    def different(self) -> float:
        """How many different impacts there are in all."""
        if self.lots.size >= KEPT:
            return (KEPT - 1) / max(float(self.lots[-1]) / 2.0**64, 2.0**-64)
        return self.lots.size / (self.below / 2.0**64)

    @property
    def holds_all(self) -> bool:
        """Whether every impact is counted."""
        return self.lots.size < KEPT and self.below >= 2**64 - 1

    def settings(self) -> Index:
        """Number of the setting (angle and spins) of each impact, (k,)."""
        return np.unique(_mixed(self.impacts[:SETTING]), return_inverse=True)[1].reshape(-1)

    def values(self) -> Array:
        """(observables, k)."""
        return self.impacts[SETTING:]

    def places(self, most: int) -> list[tuple[int, int]]:
        """Where the first copies stand, and the rows that they are those of."""
        copied = np.flatnonzero(self.met[_COUNT] > 1)
        first = copied[np.argsort(self.met[_AGAIN, copied], kind="stable")[:most]]
        return [(int(self.met[_AGAIN, k]), int(self.met[_FIRST, k])) for k in first]

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """What `of_arrays` takes."""
        self.tidy()
        return {"copied lots": self.lots, "copied met": self.met, "copied impacts": self.impacts}

    @classmethod
    def of_arrays(cls, below: int, arrays: Mapping[str, NDArray[np.generic]]) -> CopiedRows:
        """What `to_arrays` gave."""
        names = ("copied lots", "copied met", "copied impacts")
        return cls(below, *(arrays[name] for name in names))  # type: ignore[arg-type]


def _mixed(columns: Array) -> Bits:
    """A number of 64 bits of each column of numbers, (k,)."""
    bits = np.where(np.isnan(columns), np.nan, columns).view(np.uint64)
    mixed = np.zeros(columns.shape[1], dtype=np.uint64)
    for row in bits:
        mixed = (mixed ^ row) * _MIX_A
        mixed = (mixed ^ (mixed >> np.uint64(30))) * _MIX_B
        mixed = (mixed ^ (mixed >> np.uint64(27))) * _MIX_C
        mixed ^= mixed >> np.uint64(31)
    return mixed


def _chosen(gamma: Bits, value: Bits, most: int) -> tuple[Bits, Index]:
    """Lots of rows by the bits of angle and value, and which rows these are: those of small ones alone."""
    lots, rows = np.empty(gamma.size, dtype=np.uint64), np.empty(gamma.size, dtype=np.intp)
    count = 0
    for i in range(gamma.size):
        turned = (value[i] << np.uint64(21)) | (value[i] >> np.uint64(43))
        z = (gamma[i] + turned) * np.uint64(MIX_A)
        z = (z ^ (z >> np.uint64(32))) * np.uint64(MIX_B)
        if z <= most:
            lots[count], rows[count] = z, i
            count += 1
    return lots[:count], rows[:count]
