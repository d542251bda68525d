"""The columns of a table by what they hold, in the units and signs of the schema."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.angular_momentum import MomentumCheck
from ifrfit.data.cell_table import Cells
from ifrfit.data.column_names import UNITS, parse_header, units_of
from ifrfit.data.conventions import Conventions, suggest
from ifrfit.errors import DataError
from ifrfit.physics.observables import OBSERVABLES

_OF_FRACTIONS = 1.2  # largest size of a ratio that cannot be in percent in every row


@dataclass(frozen=True)
class Column:
    """One column of a table: where it stands, what it holds, and the factor to the schema.

    Attributes
    ----------
    index : int
    header : str
    key : str
        ``gamma``, ``beta``, ``sigma:beta``, ``sd:beta``, ``raw:u_x``, ``sigma:raw:u_x`` and so on.
    dimension : str
    unit : str or None
    sign : float
        -1 where the convention has the other sign.
    """

    index: int
    header: str
    key: str
    dimension: str
    unit: str | None = None
    sign: float = 1.0


@dataclass
class Layout:
    """The columns of a table by key, and what the user should hear about them.

    Attributes
    ----------
    cells : Cells
    columns : dict of str to Column
    angle_from : str
        ``from-normal`` or ``from-wall``.
    notes : list of str
    momentum : list of MomentumCheck
    note_sizes : callable or None
        Told of the values of each column that is used, in the place of refusing codes for "not measured": for
        rows that are only some of the table.
    note_open : callable or None
        Told of what the header of a column leaves open: the column, what is wrong with it unless some value
        answers, and whether one of these does. None: it is wrong at once.
    """

    cells: Cells
    conventions: Conventions
    columns: dict[str, Column] = field(default_factory=dict)
    angle_from: str = "from-normal"
    notes: list[str] = field(default_factory=list)
    momentum: list[MomentumCheck] = field(default_factory=list)
    note_sizes: Callable[[Cells, str, NDArray[np.float64]], None] | None = None
    note_open: Callable[[str, str, bool], None] | None = None

    def has(self, key: str) -> bool:
        """Tell whether the table has the column."""
        return key in self.columns

    def header(self, key: str, otherwise: str = "") -> str:
        """Return the header of a column as it stands in the file."""
        return self.columns[key].header if key in self.columns else otherwise or key

    def lines(self) -> Iterator[str]:
        """How each column is understood, in words."""
        for column in self.columns.values():
            said = [] if column.unit in (None, "1") else [str(column.unit)]
            if column.key in ("gamma", "tan_gamma"):
                said.append(self.angle_from.replace("from-", "from the "))
            if column.sign < 0.0:
                said.append("with the other sign")
            yield f"column '{column.header}' is {column.key}" + (f" ({', '.join(said)})" if said else "")

    def texts(self, key: str) -> list[str]:
        """Return a column of text; empty strings if the table has none."""
        return self.cells.texts(self.columns[key].index) if self.has(key) else [""] * len(self.cells)

    def numbers(self, key: str) -> NDArray[np.float64]:
        """Return a column in the units and signs of the schema; NaN if the table has none."""
        if not self.has(key):
            return np.full(len(self.cells), np.nan)
        column = self.columns[key]
        values = column.sign * self._numbers_of(column)
        if column.unit == "1" or (column.dimension == "number" and column.unit is None):
            return values
        if column.dimension == "angle":
            return self.degrees_of(column, values)
        if column.unit is None:
            unit = units_of(column.dimension)[0]
            raise DataError(
                f"{self.cells.at(header=column.header)}: no unit. Put one into the header, for example "
                f"{parse_header(column.header).name}_{unit.replace('/', '_')}, or say "
                f"{suggest(f'unit:{column.header}={unit}')}."
            )
        if column.unit == "%":
            self._refuse_fractions(column, values)
        return values * UNITS[column.unit][1]

    def sigma_key(self, name: str) -> str | None:
        """Key of the column with the uncertainties of an observable that has a column of its own."""
        return next((key for key in (f"sigma:{name}", "sigma") if self.has(key)), None)

    def sigmas(self, name: str) -> NDArray[np.float64]:
        """Uncertainties of the values of an observable that has a column of its own; NaN without any."""
        return self.numbers(self.sigma_key(name) or "sigma")

    def degrees_of(self, column: Column, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return angles in degrees; without a unit the values must tell, or the column is refused.

        Degrees are returned as they are: not a bit is lost.
        """
        if column.unit == "deg":
            return values
        if column.unit == "rad":
            return np.asarray(np.degrees(values))
        # an angle above this many units cannot be in radians: it would be outside its range
        observable = OBSERVABLES.get(column.key.removeprefix("sigma:"))
        largest = math.radians(90.0 if observable is None else observable.high)
        name = parse_header(column.header).name
        said = (
            f"{self.cells.at(header=column.header)}: could be in degrees or in radians. Call it {name}_deg "
            f"or {name}_rad, or say {suggest(f'unit:{column.header}=deg')}."
        )
        if column.key.startswith("sigma"):
            if not np.all(np.isnan(values)):
                raise DataError(said)
            return values
        self._answer(column, values, largest * (1 + 1e-9), said)
        return values

    def _refuse_fractions(self, column: Column, values: NDArray[np.float64]) -> None:
        """Refuse percent that is nowhere above 1: a spreadsheet shows 0.9 as 90 %, and writes 0.9."""
        if column.key in OBSERVABLES:
            known = np.abs(values[np.isfinite(values)])
            shown = "1.2" if self.note_open is not None else f"{known.max(initial=0.0):.3g}"
            said = (
                f"{self.cells.at(header=column.header)}: the header says percent, but no value is above "
                f"{shown}. If they are fractions take the % out of the header; if they are as small as that, "
                "write them as fractions."
            )
            self._answer(column, values, _OF_FRACTIONS, said)

    def _answer(self, column: Column, values: NDArray[np.float64], largest: float, said: str) -> None:
        """See whether a value is larger than what would leave its column open; where none is, say so."""
        size = np.abs(values[np.isfinite(values)])
        if not size.size:
            return
        answered = bool((size > largest).any())
        if self.note_open is not None:
            self.note_open(column.header, said, answered)
        elif not answered:
            raise DataError(said)

    def _numbers_of(self, column: Column) -> NDArray[np.float64]:
        """Numbers of a column as they stand in the file; codes for "not measured" are refused."""
        values = self.cells.numbers(column.index)
        if self.note_sizes is not None:
            self.note_sizes(self.cells, column.header, values)
        elif column.key != "n_repeats":
            refuse_missing_codes(self.cells, column.header, values)
        return values

    @property
    def has_gamma(self) -> bool:
        """Whether the table has the incidence angle, or its tangent."""
        return self.has("gamma") or self.has("tan_gamma")

    def gamma(self) -> NDArray[np.float64]:
        """Return the incidence angle from the normal in degrees; NaN if the table has none."""
        if self.has("tan_gamma"):
            angle = np.degrees(np.arctan(self._numbers_of(self.columns["tan_gamma"])))
        else:
            angle = self.numbers("gamma")
        return 90.0 - angle if self.angle_from == "from-wall" else angle


# 99 and 999 with a decimal 9 are written as codes, too; a code fills the width of a column
CODES = np.array([99.0, 99.9, 99.99, 999.0, 999.9, 999.99, 9999.0, 9999.9, 99999.0, 999999.0])
# short ones may be values: they count where several cells hold exactly the same
SHORT_CODES = np.array([9.0, 9.9, 9.99, 9.999, 9.9999])
SEVERAL = 3
FAR = 3.0  # times the largest other value from which a code is none of the rest


def refuse_missing_codes(cells: Cells, header: str, values: NDArray[np.float64]) -> None:
    """Refuse the first cell of a column that holds a code for "not measured".

    A number counts as a code where it is written in nines and is several times larger than every other
    value of its column; in a column of nothing else, where it is negative. One of the size of a value, as
    9.99, has to stand there at least three times.

    Parameters
    ----------
    cells : Cells
    header : str
    values : ndarray, (n,)
        As they stand in the file.

    Raises
    ------
    DataError
        With file, line, column and remedy.
    """
    size = np.abs(values)
    largest = size.max(where=np.isfinite(size), initial=0.0)
    if largest < SHORT_CODES[0]:  # as in most columns: nothing is as large as a code
        return
    suspect = np.isin(size, CODES[largest >= CODES])
    for code in SHORT_CODES:
        short = size == code
        if short.sum() >= SEVERAL and (~short & np.isfinite(values)).any():
            suspect |= short
    if not suspect.any():
        return
    others = size[~suspect & np.isfinite(values)]
    if others.size:
        suspect &= size > FAR * others.max()
    else:
        suspect &= values < 0.0
    cells.refuse_first(
        suspect,
        header,
        lambda row: said_of_code(f"{values[row]:g}"),
    )


def said_of_code(number: str) -> str:
    """What is said of a code."""
    return (
        f"{number} looks like a code for 'not measured', as every other value is far smaller. Leave such "
        "cells empty."
    )
