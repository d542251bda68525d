"""The columns of a table by what they hold, in the units and signs of the schema."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.angular_momentum import MomentumCheck
from ifrfit.data.cell_table import Cells
from ifrfit.data.conventions import Conventions, suggest
from ifrfit.data.missing_codes import refuse_missing_codes
from ifrfit.data.units import UNITS, parse_header, units_of
from ifrfit.errors import DataError
from ifrfit.physics.observables import OBSERVABLES


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
    """

    cells: Cells
    conventions: Conventions
    columns: dict[str, Column] = field(default_factory=dict)
    angle_from: str = "from-normal"
    notes: list[str] = field(default_factory=list)
    momentum: list[MomentumCheck] = field(default_factory=list)

    def has(self, key: str) -> bool:
        """Tell whether the table has the column."""
        return key in self.columns

    def header(self, key: str, otherwise: str = "") -> str:
        """Return the header of a column as it stands in the file."""
        return self.columns[key].header if key in self.columns else otherwise or key

    def texts(self, key: str) -> list[str]:
        """Return a column of text; empty strings if the table has none."""
        return self.cells.texts(self.columns[key].index) if self.has(key) else [""] * len(self.cells)

    def numbers(self, key: str) -> NDArray[np.float64]:
        """Return a column in the units and signs of the schema; NaN if the table has none."""
        if not self.has(key):
            return np.full(len(self.cells), np.nan)
        column = self.columns[key]
        values = self._numbers_of(column)
        if column.sign < 0:
            values = -values
        if column.unit == "1" or (column.dimension == "number" and column.unit is None):
            return values
        if column.dimension == "angle":
            return to_degrees(values, column, self.cells)
        if column.unit is None:
            unit = units_of(column.dimension)[0]
            raise DataError(
                f"{self.cells.at(header=column.header)}: no unit. Put one into the header, for example "
                f"{parse_header(column.header).name}_{unit.replace('/', '_')}, or say "
                f"{suggest(f'unit:{column.header}={unit}')}."
            )
        factor = UNITS[column.unit][1]
        return values if factor == 1.0 else values * factor

    def _numbers_of(self, column: Column) -> NDArray[np.float64]:
        """Numbers of a column as they stand in the file; codes for "not measured" are refused."""
        values = self.cells.numbers(column.index)
        if column.key != "n_repeats":
            refuse_missing_codes(self.cells, column.header, values)
        return values

    def gamma(self) -> NDArray[np.float64]:
        """Return the incidence angle from the normal in degrees; NaN if the table has none."""
        if self.has("tan_gamma"):
            angle = np.degrees(np.arctan(self._numbers_of(self.columns["tan_gamma"])))
        else:
            angle = self.numbers("gamma")
        return 90.0 - angle if self.angle_from == "from-wall" else angle


def to_degrees(values: NDArray[np.float64], column: Column, cells: Cells) -> NDArray[np.float64]:
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
    if column.key.startswith("sigma") or not np.any(np.abs(values) > largest * (1 + 1e-9)):
        if np.all(np.isnan(values)):
            return values
        name = parse_header(column.header).name
        raise DataError(
            f"{cells.at(header=column.header)}: could be in degrees or in radians. Call it {name}_deg or "
            f"{name}_rad, or say {suggest(f'unit:{column.header}=deg')}."
        )
    return values
