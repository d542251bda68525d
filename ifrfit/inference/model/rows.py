"""The rows of a problem as arrays: what was set, what was measured, and which rows are of which kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ifrfit.data.double_counting import impact_numbers
from ifrfit.inference.model.slip_intervals import SlipIntervals
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observable import Observable
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Bool = NDArray[np.bool_]

LOWEST = 1e-3  # e_n below which a value over the outgoing normal velocity is not meant seriously
_BLOCK = 20_000  # rows
_FEW = 1000  # rows up to which labels are numbered by a dictionary, in a fifth of the time
OBLIQUE = ("tangential", "curved")  # kinds of observables that know the closure


@dataclass(frozen=True)
class Rows:
    """What each row measures, as numbers; n rows.

    Attributes
    ----------
    incidence : Incidence
    tau : ndarray, (n,)
        |U_t|/U_n.
    names : tuple of str
        The observables that occur.
    which : ndarray of int, (n,)
        Observable of each row, an index into `names`.
    series : ndarray of int, (n,)
        Series of each row, an index into the series of the `ParameterSet`.
    value : ndarray, (n,)
    impact : ndarray of int, (n,)
        Impact of each row: rows of the same number were measured on the same impact.
    gamma_deg : ndarray, (n,)
        Angle of incidence in degrees; 0 where none is given.
    sigma_gamma_deg : ndarray, (n,)
        Standard uncertainty of the angle in degrees; nan where none is stated.
    sigma_spin_x, sigma_spin_y : ndarray, (n,)
        Standard uncertainties of the spins R omega/u; 0 where none is stated.
    """

    incidence: Incidence
    tau: Array
    names: tuple[str, ...]
    which: Index
    series: Index
    value: Array
    impact: Index
    gamma_deg: Array
    sigma_gamma_deg: Array
    sigma_spin_x: Array
    sigma_spin_y: Array

    @classmethod
    def of(cls, table: pd.DataFrame) -> tuple[Rows, tuple[str, ...]]:
        """Rows of a table in the common schema, and the names of its series."""
        columns = {
            name: table[name].to_numpy(dtype=float)
            for name in ("gamma_deg", "spin_x", "spin_y", "value", "sigma_gamma_deg")
        }
        columns["value"] = columns["value"] + 0.0  # no zero has a sign, in numbers or in text
        gamma = np.nan_to_num(columns["gamma_deg"])
        incidence = Incidence.of(gamma, columns["spin_x"], columns["spin_y"], degrees=True)
        series, series_index = _codes(table["series"])
        names, which = _codes(table["observable"])
        spins = (np.nan_to_num(table[f"sigma_spin_{x}"].to_numpy(dtype=float)) for x in ("x", "y"))
        rows = cls(
            incidence,
            incidence.tau,
            names,
            which,
            series_index,
            columns["value"],
            _impacts(table),
            gamma,
            columns["sigma_gamma_deg"],
            *spins,
        )
        return rows, series

    def __getstate__(self) -> dict[str, object]:
        """The fields alone, for workers: observables are looked up again where they are needed."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def __len__(self) -> int:
        return int(self.value.size)

    @cached_property
    def observables(self) -> tuple[Observable, ...]:
        """The observables that occur, in the order of `names`."""
        return tuple(OBSERVABLES[name] for name in self.names)

    @cached_property
    def measured(self) -> tuple[Observable, ...]:
        """The observables that have a row; some rows of a table keep the names of all."""
        if len(self.names) == 1:
            return self.observables if len(self) else ()
        count = np.bincount(self.which, minlength=len(self.names))
        return tuple(each for each, n in zip(self.observables, count, strict=True) if n)

    def is_any_of(self, names: Sequence[str]) -> Bool:
        """Which rows have one of these observables, (n,)."""
        return self._mask([name in names for name in self.names])

    def measures(self, *kinds: str) -> bool:
        """Whether a row has an observable of one of these kinds."""
        return any(o.kind in kinds for o in self.measured)

    def measures_scale(self, scale: str) -> bool:
        """Whether a row has a tangential observable of this scale."""
        return any(o.kind == "tangential" and o.scale == scale for o in self.measured)

    @cached_property
    def by_observable(self) -> tuple[tuple[Observable, Index, Incidence], ...]:
        """The observables that occur, each with its rows and the incidence of those."""
        found = []
        for name, observable in zip(self.names, self.observables, strict=True):
            at = self.rows_of(name)
            if at.size:  # some rows of a table keep the names of all
                own = self.incidence if at.size == len(self) else self.incidence.take(as_slice(at))
                found.append((observable, at, own))
        return tuple(found)

    @cached_property
    def places(self) -> tuple[tuple[Observable, Index | slice, Incidence], ...]:
        """`by_observable`, with a slice for rows that are evenly spaced: of these no copy is taken."""
        return tuple((observable, as_slice(at), own) for observable, at, own in self.by_observable)

    def linear_parts(self, inertia_factor: float) -> tuple[Array, Array]:
        """Offset and slope in the impulse factor of each tangential row, (n,); zero for the others."""
        offset, slope = np.zeros(len(self)), np.zeros(len(self))
        for observable, at, incidence in self.by_observable:
            if observable.linear is not None:
                offset[at], slope[at] = observable.linear(incidence, inertia_factor)
        return offset, slope

    def rows_of(self, name: str) -> Index:
        """Rows of one observable."""
        if len(self.names) == 1:
            return np.arange(self.which.size)
        return np.flatnonzero(self.which == self.names.index(name))

    def has_kind(self, *kinds: str) -> bool:
        """Whether any observable is of one of these kinds."""
        return any(o.kind in kinds for o in self.observables)

    def of_kind(self, *kinds: str) -> Bool:
        """Which rows have an observable of one of these kinds, (n,)."""
        return self._mask([o.kind in kinds for o in self.observables])

    def of_scale(self, scale: str) -> Bool:
        """Which rows have a tangential observable of this scale, (n,)."""
        return self._mask([o.kind == "tangential" and o.scale == scale for o in self.observables])

    @property
    def is_oblique(self) -> Bool:
        """Which rows know the closure: they measure neither e_n nor mu alone, (n,)."""
        return self.of_kind(*OBLIQUE)

    @property
    def has_angle(self) -> Bool:
        """Which rows have an observable that the angle of incidence enters, (n,)."""
        return self._mask([o.has_angle for o in self.observables])

    @property
    def lowest_e_n(self) -> float:
        """The e_n below which a value over the outgoing normal velocity is not meant seriously; else 0."""
        return LOWEST if any(o.scale == "rebound" for o in self.observables) else 0.0

    def _mask(self, of_observable: Sequence[bool]) -> Bool:
        """Rows of some observables."""
        return np.array(of_observable, dtype=bool)[self.which]

    @cached_property
    def impacts(self) -> Index:
        """Impact of each row, (n,), numbered from 0 as they first occur."""
        _, first, inverse = np.unique(self.impact, return_index=True, return_inverse=True)
        number = np.empty(first.size, dtype=np.intp)
        number[np.argsort(first)] = np.arange(first.size)
        return number[inverse]

    @cached_property
    def shared_incidence(self) -> tuple[Index, Index] | None:
        """A row of each impact, and the impact of each row, (n,).

        None where no impact has several rows, or rows of one differ in series, angle or spins.
        """
        impact, i = self.impacts, self.incidence
        first = np.unique(impact, return_index=True)[1]
        if first.size == impact.size:
            return None
        own = (i.sine, i.cosine, i.spin_x, i.spin_y, self.gamma_deg, self.series)
        return (first, impact) if all(np.array_equal(x, x[..., first[impact]]) for x in own) else None

    @cached_property
    def by_tau(self) -> Index:
        """The rows in ascending order of tau."""
        return self.tau.argsort()

    @cached_property
    def slip_intervals(self) -> SlipIntervals | None:
        """The rows by intervals of tau."""
        return SlipIntervals.of(self.tau)

    @cached_property
    def setting(self) -> Index:
        """Setting of each row, (n,): rows of one number have the same series, angle and spins."""
        i = self.incidence
        return numbered(self.series, i.sine, i.cosine, i.spin_x, i.spin_y)

    @cached_property
    def repeated(self) -> Index:
        """Observable and setting of each row as one number, (n,): rows of one number repeat one another."""
        return np.asarray(np.unique(self.setting * len(self.names) + self.which, return_inverse=True)[1])

    def normal_factor(self, at: Index | Bool) -> Array:
        """What e_n is multiplied by in rows of the normal kind, of which `at` are some."""
        factor = np.ones(self.which.size)
        for number, observable in enumerate(self.observables):
            if observable.by_e_n is not None:
                here = self.which == number
                factor[here] = observable.by_e_n(self.incidence)[here]
        return np.asarray(factor[at])

    def take(self, rows: Index) -> Rows:
        """The same for some rows."""
        if rows.size == self.value.size and bool((np.diff(rows) == 1).all()):
            return self
        return self._at(rows)

    def _at(self, rows: Index | slice) -> Rows:
        rows = rows if isinstance(rows, slice) else as_slice(rows)
        incidence = self.incidence.map(lambda part: part[..., rows])
        return Rows(incidence, names=self.names, **{name: getattr(self, name)[..., rows] for name in _BY_ROW})

    @property
    def blocks(self) -> tuple[tuple[slice, Rows], ...]:
        """All rows in parts, for what needs so many numbers of each that it must not hold all at once.

        A part shares its arrays with the whole.
        """
        if len(self) <= _BLOCK:
            return ((slice(None), self),)  # kept by itself it would be freed late
        return self._parts

    @cached_property
    def _parts(self) -> tuple[tuple[slice, Rows], ...]:
        places = (slice(first, first + _BLOCK) for first in range(0, len(self), _BLOCK))
        return tuple((place, self._at(place)) for place in places)

    def turned(self, degrees: float | Array) -> Rows:
        """The same where the angle of incidence is larger, in rows that it enters; see `Problem.at_offset`.

        Parameters
        ----------
        degrees : float, or ndarray, (m, 1)
            Of several each has its own incidence, tau and gamma_deg, (m, n); all else stays one number a row.
        """
        gamma = self.gamma_deg + np.where(self.has_angle, degrees, 0.0)
        incidence = Incidence.of(gamma, self.incidence.spin_x, self.incidence.spin_y, degrees=True)
        return replace(self, incidence=incidence, tau=incidence.tau, gamma_deg=gamma)


_BY_ROW = tuple(f.name for f in fields(Rows) if f.name not in ("incidence", "names"))  # one number a row


def as_slice(rows: Index) -> Index | slice:
    """The same rows as a slice, of which no copy is taken, where they are evenly spaced."""
    if rows.size < 2:
        return rows
    step = int(rows[1] - rows[0])
    is_even = step > 0 and bool((rows[1:] - rows[:-1] == step).all())
    return slice(int(rows[0]), int(rows[-1]) + 1, step) if is_even else rows


def numbered(*columns: Array | Index) -> Index:
    """Rows of several columns as one number: rows of one number are alike in all.

    Numbers go from 0 up in the order of the first column, where that is the same of the second, and so on.
    """
    differing = [column for column in columns if (column != column[:1]).any()]  # nan differs from itself
    number = np.zeros(columns[0].size, dtype=np.intp)
    if differing:
        order = np.lexsort(differing[::-1])
        begins = np.zeros(order.size - 1, dtype=bool)
        for column in differing:
            here = column[order]
            begins |= (here[1:] != here[:-1]) & ~(np.isnan(here[1:]) & np.isnan(here[:-1]))
        number[order[1:]] = np.cumsum(begins)
    return number


def _codes(column: pd.Series) -> tuple[tuple[str, ...], Index]:
    if len(column) <= _FEW:
        number: dict[str, int] = {}
        few = [number.setdefault(label, len(number)) for label in column.tolist()]
        return tuple(map(str, number)), np.array(few, dtype=np.intp)
    codes, labels = pd.factorize(column)
    return tuple(str(label) for label in labels), np.asarray(codes, dtype=np.intp)


def _impacts(table: pd.DataFrame) -> Index:
    """Impact of each row, numbered as they first occur; a row without an impact_id is its own."""
    number = impact_numbers(table)
    alone = number < 0
    if alone.all():
        return np.arange(number.size)
    number[alone] = -1 - np.flatnonzero(alone)
    codes, _ = pd.factorize(number)
    return np.asarray(codes, dtype=np.intp)
