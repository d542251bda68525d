"""Which column of a table holds what, under the conventions that the user named."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cells import Cells
from ifrfit.data.columns import COMMON, RAW, WALL_ANGLE, Role, closest, role_of
from ifrfit.data.conventions import OPEN_QUESTIONS, Conventions
from ifrfit.data.schema import OBSERVABLES
from ifrfit.data.units import UNITS, parse_header, units_of
from ifrfit.errors import DataError, UsageError

# An angle above this many units cannot be in radians: it would be outside its range.
_LARGEST_RAD = {"lambda_deg": math.pi}


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
    """

    cells: Cells
    conventions: Conventions
    columns: dict[str, Column] = field(default_factory=dict)
    angle_from: str = "from-normal"
    notes: list[str] = field(default_factory=list)

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
        values = self.cells.numbers(column.index)
        if column.sign < 0:
            values = -values
        if column.dimension == "number" or column.unit == "1":
            return values
        if column.dimension == "angle":
            return to_degrees(values, column, self.cells)
        if column.unit is None:
            raise DataError(
                f"{self.cells.at(header=column.header)}: no unit. Put one into the header, for example "
                f"{parse_header(column.header).name}_{units_of(column.dimension)[0].replace('/', '_')}."
            )
        factor = UNITS[column.unit][1]
        return values if factor == 1.0 else values * factor

    def gamma(self) -> NDArray[np.float64]:
        """Return the incidence angle from the normal in degrees; NaN if the table has none."""
        if self.has("tan_gamma"):
            angle = np.degrees(np.arctan(self.cells.numbers(self.columns["tan_gamma"].index)))
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
    largest = _LARGEST_RAD.get(column.key.removeprefix("sigma:"), math.pi / 2)
    if column.key.startswith("sigma") or not np.any(np.abs(values) > largest * (1 + 1e-9)):
        if np.all(np.isnan(values)):
            return values
        name = parse_header(column.header).name
        raise DataError(
            f"{cells.at(header=column.header)}: could be in degrees or in radians. Call it {name}_deg or "
            f"{name}_rad, or say --convention unit:{column.header}=deg."
        )
    return values


def identify(cells: Cells, conventions: Conventions) -> Layout:
    """Find out what each column holds.

    Raises
    ------
    DataError
        A column is unknown, ambiguous, has an impossible unit, or two hold the same.
    UsageError
        A convention names a column that is not there.
    """
    for header in conventions.headers:
        if header not in cells.headers:
            raise UsageError(
                f"--convention names the column '{header}', which {cells.file} does not have. It has "
                f"{', '.join(cells.headers)}."
            )
    layout = Layout(cells, conventions)
    angles: list[Column] = []
    ignored: list[str] = []
    for index, header in enumerate(cells.headers):
        role = _role(header, conventions)
        if role.kind == "ignored":
            continue
        if role.kind == "angle" or role.name in ("gamma", "tan_gamma"):
            _check_unit(role, cells.at(header=header))
            angles.append(Column(index, header, role.name, role.dimension, role.unit))
        elif role.kind == "observable" and "observable" in map(str.lower, cells.headers):
            ignored.append(header)
        else:
            _add(layout, _column(index, header, role, layout))
    if ignored:
        raise DataError(
            f"{cells.at(header=ignored[0])}: the table also has the columns of a long table (observable, "
            "value). Keep one of the two forms."
        )
    _choose_angle(layout, angles)
    _inherit_units(layout)
    _unused_conventions(layout)
    return layout


def _role(header: str, conventions: Conventions) -> Role:
    unit = conventions.units.get(header)
    if header == conventions.angle_column:
        if conventions.angle_unit == "tan":
            return Role("common", "tan_gamma", "number")
        found = role_of(header)
        stated = found.unit if found.dimension == "angle" else None
        name = "tan_gamma" if found.name == "tan_gamma" else "gamma"
        return Role("common", name, "angle", conventions.angle_unit or unit or stated)
    if header in conventions.columns:
        name = conventions.columns[header]
        stated = unit or parse_header(header).unit
        if name in RAW and name not in OBSERVABLES:
            return Role("raw", name, RAW[name], stated)
        if name in COMMON:
            return Role("common", name, COMMON[name], stated)
        of = name.removeprefix("sigma_")
        dimension = "angle" if OBSERVABLES[of].unit == "deg" else "number"
        return Role("observable" if of == name else "sigma", of, dimension, stated)
    role = role_of(header)
    return role if unit is None else Role(role.kind, role.name, role.dimension, unit)


def _column(index: int, header: str, role: Role, layout: Layout) -> Column:
    """Turn a role into a column, or refuse what is unknown or left open."""
    at = layout.cells.at(header=header)
    if role.kind == "unknown":
        near = closest(header)
        hint = f", the closest known one is {near}" if near else ""
        remedy = "Rename it, remove it, or begin it with 'note' to have the column ignored"
        if len(layout.cells.headers) == 1:
            remedy += "; columns are separated by commas, semicolons or tabs"
        raise DataError(f"{at}: unknown name{hint}. {remedy}.")
    if role.kind == "magnitude":
        raise DataError(f"{at}: {OPEN_QUESTIONS['magnitude']}.")
    _check_unit(role, at)
    key, sign = role.name, 1.0
    if role.kind in ("observable", "open", "sigma", "sd"):
        meaning = layout.conventions.observable(role.name)
        if meaning is None:
            raise DataError(f"{at}: {OPEN_QUESTIONS[role.name]}.")
        key, sign = meaning
    if role.kind in ("sigma", "sd"):
        return Column(index, header, f"{role.kind}:{key}", role.dimension, role.unit)
    if role.kind in ("raw", "sigma_raw"):
        key = f"raw:{key}" if role.kind == "raw" else f"sigma:raw:{key}"
    return Column(index, header, key, role.dimension, role.unit, sign)


def _check_unit(role: Role, at: str) -> None:
    if role.unit is None or role.unit == "1":
        return
    known = UNITS.get(role.unit)
    if known is None or known[0] != role.dimension:
        units = ", ".join(units_of(role.dimension)) if role.dimension not in ("text", "number") else "none"
        raise DataError(f"{at}: the unit '{role.unit}' does not fit here. Known are: {units}.")


def _add(layout: Layout, column: Column) -> None:
    other = layout.columns.get(column.key)
    if other is not None:
        what = column.key.replace("raw:", "").replace(":", " of ")
        raise DataError(
            f"{layout.cells.file}: the columns {other.header} and {column.header} both give {what}, perhaps "
            "in two conventions. Remove one."
        )
    layout.columns[column.key] = column


def _choose_angle(layout: Layout, found: list[Column]) -> None:
    """Take the one incidence angle, or refuse if there are two or its reference is open."""
    conventions, cells = layout.conventions, layout.cells
    if conventions.angle_column:
        for other in found:
            if other.header != conventions.angle_column:
                layout.notes.append(
                    f"{cells.name}: column {other.header} is ignored, the angle is another column."
                )
        found = [c for c in found if c.header == conventions.angle_column]
    if not found:
        return
    if len(found) > 1:
        names = ", ".join(f"'{c.header}'" for c in found[:-1]) + f" and '{found[-1].header}'"
        number = "two" if len(found) == 2 else str(len(found))
        raise DataError(
            f"{cells.file}: {number} columns could be the incidence angle, {names}. Name it: --convention "
            f"angle={found[0].header}:from-wall"
        )
    column = found[0]
    name = role_of(column.header).name
    stated = column.header in conventions.columns or name in ("gamma", "tan_gamma", WALL_ANGLE)
    if conventions.angle_from is None and not stated:
        raise DataError(
            f"{cells.at(header=column.header)}: could be measured from the wall or from its normal. Say "
            f"which: --convention angle={column.header}:from-wall or angle={column.header}:from-normal"
        )
    key = "tan_gamma" if column.key == "tan_gamma" or conventions.angle_unit == "tan" else "gamma"
    unit = conventions.angle_unit if conventions.angle_unit in ("deg", "rad") else column.unit
    layout.columns[key] = Column(column.index, column.header, key, "angle", unit)
    layout.angle_from = conventions.angle_from or ("from-wall" if name == WALL_ANGLE else "from-normal")
    if layout.angle_from == "from-wall":
        layout.notes.append(f"{cells.name}: column {column.header} was read as the angle from the wall.")


def _inherit_units(layout: Layout) -> None:
    """Give the uncertainty of an angle the unit of the angle where its header has none."""
    for key, column in list(layout.columns.items()):
        of = {"sigma_gamma": "gamma"}.get(key, key.removeprefix("sigma:").removeprefix("sd:"))
        partner = layout.columns.get(of)
        if of != key and partner is not None and column.unit is None and column.dimension in _WITH_UNIT:
            unit = partner.unit
            if unit is None and partner.dimension == "angle":
                # Raises where the values do not tell; where they do, it can only be degrees.
                to_degrees(layout.cells.numbers(partner.index), partner, layout.cells)
                unit = "deg"
            layout.columns[key] = Column(column.index, column.header, key, column.dimension, unit)


_WITH_UNIT = ("angle", "speed", "rate", "length")


def _unused_conventions(layout: Layout) -> None:
    """Say which conventions changed nothing: they may be misspelt, or meant for another file."""
    conventions, name = layout.conventions, layout.cells.name
    there = {role_of(header).name for header in layout.cells.headers}
    unused = []
    if conventions.angle_from and not (layout.has("gamma") or layout.has("tan_gamma")):
        unused.append(f"angle={conventions.angle_from}")
    for of, choice in conventions.choices.items():
        wanted = {"psi", "tan_psi"} if of == "psi" else {of}
        if not layout.has("observable") and not there & wanted:
            unused.append(f"{of}={choice}")
    layout.notes.extend(f"{name}: convention {what} found nothing to apply to." for what in unused)
