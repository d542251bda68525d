"""Which column of a table holds what, under the conventions that the user named."""

from __future__ import annotations

from dataclasses import replace

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_layout import Column, Layout, to_degrees
from ifrfit.data.column_names import Role, named_role, role_of
from ifrfit.data.conventions import OPEN_QUESTIONS, Conventions
from ifrfit.data.incidence_angle import choose_angle
from ifrfit.data.units import UNITS, parse_header, units_of
from ifrfit.data.unknown_columns import refuse_unknown
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.observables import OBSERVABLES

_WITH_UNIT = ("angle", "speed", "rate", "length")
_IN_PERCENT = ("observable", "open", "sigma", "sd")  # kinds of columns that may be, where they are numbers
# Half a turn about x takes a z that points out of the wall into one that points in: these change sign.
_TURNED = tuple(f"{vector}_{axis}" for vector in ("u", "v", "omega") for axis in "yz")


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
    roles = _roles(cells, conventions)
    unknown = [cells.headers[i] for i, role in roles.items() if role.kind == "unknown"]
    if unknown:
        refuse_unknown(cells, unknown, angled=any(map(_is_angle, roles.values())))
    long = any(role.name == "observable" for role in roles.values())
    angles: list[Column] = []
    for index, role in roles.items():
        header = cells.headers[index]
        if _is_angle(role):
            _check_unit(role, cells.at(header=header))
            angles.append(Column(index, header, role.name, role.dimension, role.unit))
        elif role.kind == "observable" and long:
            raise DataError(
                f"{cells.at(header=header)}: the table also has the columns of a long table (observable, "
                "value). Keep one of the two forms."
            )
        else:
            _add(layout, _column(index, header, role, layout))
    choose_angle(layout, angles)
    _raw_uncertainties(layout)
    _inherit_units(layout)
    _note_conventions(layout, {role.name for role in roles.values()})
    return layout


def _roles(cells: Cells, conventions: Conventions) -> dict[int, Role]:
    """Return what each column holds, by index, without those that are passed over."""
    passed = conventions.ignores(cells.headers)
    roles = {i: _role(h, conventions) for i, h in enumerate(cells.headers) if h not in passed}
    return {i: role for i, role in roles.items() if role.kind != "ignored"}


def _is_angle(role: Role) -> bool:
    return role.kind == "angle" or role.name in ("gamma", "tan_gamma")


def _role(header: str, conventions: Conventions) -> Role:
    unit = conventions.units.get(header)
    if header == conventions.angle_column:
        if conventions.angle_unit == "tan":
            return Role("angle", "tan_gamma", "number")
        found = role_of(header)
        stated = found.unit if found.dimension == "angle" else None
        if not stated:  # a name that says nothing may still have a unit
            short, own = parse_header(header).without_suffix(), parse_header(header).unit
            stated = own or (short.unit if short and UNITS[str(short.unit)][0] == "angle" else None)
        name = found.name if _is_angle(found) else "angle"
        dimension = "number" if name == "tan_gamma" else "angle"
        return Role("angle", name, dimension, conventions.angle_unit or unit or stated)
    if header in conventions.columns or unit is not None:
        return named_role(conventions.columns.get(header, header), header, unit)
    return role_of(header)


def _column(index: int, header: str, role: Role, layout: Layout) -> Column:
    """Turn a role into a column, or refuse what is left open."""
    at = layout.cells.at(header=header)
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
    if role.kind == "raw":
        sign = -1.0 if layout.conventions.out_of_wall and key.startswith(_TURNED) else 1.0
        key = f"raw:{key}"
    if role.kind == "sigma_raw":
        key = f"sigma:raw:{key}"
    return Column(index, header, key, role.dimension, role.unit, sign)


def _check_unit(role: Role, at: str) -> None:
    if role.unit is None or role.unit == "1":
        return
    known = UNITS.get(role.unit)
    has_unit = role.dimension in _WITH_UNIT or role.kind in _IN_PERCENT
    if known is None or known[0] != role.dimension or not has_unit:
        units = ", ".join(units_of(role.dimension)) if has_unit else "none"
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


def _raw_uncertainties(layout: Layout) -> None:
    """Take sigma_v_x without a unit as that of the velocity where the table has the velocity."""
    for name in ("v_x", "v_y", "v_n"):
        if layout.has(f"raw:{name}") and layout.has(f"sigma:{name}"):
            column = layout.columns.pop(f"sigma:{name}")
            _add(layout, replace(column, key=f"sigma:raw:{name}", dimension="speed"))


def _inherit_units(layout: Layout) -> None:
    """Give the uncertainty of an angle the unit of the angle where its header has none."""
    _inherit_percent(layout)
    for key, column in list(layout.columns.items()):
        of = {"sigma_gamma": "gamma"}.get(key, key.removeprefix("sigma:").removeprefix("sd:"))
        partner = layout.columns.get(of)
        if of != key and partner is not None and column.unit is None and column.dimension in _WITH_UNIT:
            unit = partner.unit
            if unit is None and partner.dimension == "angle":
                # Raises where the values do not tell; where they do, it can only be degrees.
                to_degrees(layout.cells.numbers(partner.index), partner, layout.cells)
                unit = "deg"
            layout.columns[key] = replace(column, unit=unit)


def _inherit_percent(layout: Layout) -> None:
    """Take the uncertainty of a value in percent in percent, too; refuse one of a value that is not."""
    measured = [key for key in layout.columns if key in OBSERVABLES]
    for key, column in list(layout.columns.items()):
        kind, _, of = key.partition(":")
        if kind not in ("sigma", "sd") or column.dimension != "number":
            continue
        # a column called sigma belongs to the one observable of the table
        of = of or (measured[0] if len(measured) == 1 else "")
        in_percent = of in layout.columns and layout.columns[of].unit == "%"
        if in_percent and column.unit is None:
            layout.columns[key] = replace(column, unit="%")
        elif column.unit == "%" and not in_percent:
            raise DataError(
                f"{layout.cells.at(header=column.header)}: could be in percent of the value, or in percent "
                f"beside a value that is not, {of}. Give the uncertainty as {of} is given."
            )


def _note_conventions(layout: Layout, there: set[str]) -> None:
    """Say what was turned, and which conventions changed nothing: misspelt, or meant for another file."""
    conventions, name = layout.conventions, layout.cells.name
    unused = []
    if conventions.angle_from and not (layout.has("gamma") or layout.has("tan_gamma")):
        unused.append(f"angle={conventions.angle_from}")
    for of, choice in conventions.choices.items():
        if of == "z":
            if not any(key.startswith("raw:") for key in layout.columns):
                unused.append(f"z={choice}")
            elif conventions.out_of_wall:
                layout.notes.append(
                    f"{name}: z was read as pointing out of the wall; velocities and spins along y and z "
                    "changed sign."
                )
            continue
        if of == "pair":
            layout.notes.append(
                f"{name}: read as collisions of two equal spheres, which are a wall in the relative frame: "
                "velocities are of one centre relative to the other, spins the sum of both spheres'."
            )
            continue
        wanted = {"psi", "tan_psi"} if of == "psi" else {of}
        if not layout.has("observable") and not there & wanted:
            unused.append(f"{of}={choice}")
    layout.notes.extend(f"{name}: convention {what} found nothing to apply to." for what in unused)
