"""Which column of a table holds what, under the conventions that the user named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from ifrfit.data.cell_table import NUMBER, Cells
from ifrfit.data.column_layout import Column, Layout
from ifrfit.data.column_names import (
    UNITS,
    WALL_ANGLE,
    Role,
    closest,
    named_role,
    numbered_role,
    parse_header,
    role_of,
    uncertainty_of,
    units_of,
)
from ifrfit.data.common_errors import dimension_of
from ifrfit.data.conventions import OPEN_QUESTIONS, Conventions, suggest
from ifrfit.data.tracks.track_headers import looks_like_tracks
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import joined

_WITH_UNIT = ("angle", "speed", "rate", "length")
_IN_PERCENT = ("observable", "open", "sigma", "sd")  # kinds of columns that may be, where they are numbers
# Half a turn about x takes a z that points out of the wall into one that points in: these change sign.
_SPINS = {"spin": "omega_y", "spin_after": "omega_y_after"}
_TURNED = tuple(f"{vector}_{axis}" for vector in ("u", "v", "omega") for axis in "yz")


def identify(
    cells: Cells, conventions: Conventions, *, note_open: Callable[[str, str, bool], None] | None = None
) -> Layout:
    """Find out what each column holds.

    Parameters
    ----------
    cells : Cells
    conventions : Conventions
    note_open : callable, optional
        As `Layout.note_open`, for rows that are only some of the table.

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
    layout = Layout(cells, conventions, note_open=note_open)
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
        elif role.kind == "common_error":
            _check_unit(role, cells.at(header=header))
            _add(layout, Column(index, header, role.name, role.dimension, role.unit))
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
    _of_the_observable(layout)
    _note_conventions(layout, {role.name for role in roles.values()})
    return layout


def _roles(cells: Cells, conventions: Conventions) -> dict[int, Role]:
    """Return what each column holds, by index, without those that are passed over."""
    passed = conventions.ignores(cells.headers)
    roles = {i: _role(h, conventions) for i, h in enumerate(cells.headers) if h not in passed}
    found = {i: role for i, role in roles.items() if role.kind != "ignored"}
    return {i: role for i, role in found.items() if role.kind != "unknown" or not _is_counter(cells, i)}


def _is_counter(cells: Cells, index: int) -> bool:
    """Whether a column is the one that reset_index of pandas makes of row numbers: index, 0 to n - 1."""
    column = cells.columns[index]
    if not (cells.in_memory and cells.headers[index] == "index" and isinstance(column, np.ndarray)):
        return False
    return bool(np.array_equal(column, np.arange(column.size)))


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
    role = role_of(header)
    return numbered_role(header) if role.kind == "unknown" and "sports" in conventions.choices else role


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
    if role.kind in ("raw", "sigma_raw") and key in _SPINS:
        key, sign = _spin(role, layout, at)
    elif role.kind == "raw":
        sign = -1.0 if layout.conventions.out_of_wall and key.startswith(_TURNED) else 1.0
    if role.kind == "raw" and key.startswith("angle_after"):
        key = _angle_after(header, role, layout, at)
    if role.kind in ("raw", "sigma_raw"):
        key = f"raw:{key}" if role.kind == "raw" else f"sigma:raw:{key}"
        sign = sign if role.kind == "raw" else 1.0
    return Column(index, header, key, role.dimension, role.unit, sign)


def _spin(role: Role, layout: Layout, at: str) -> tuple[str, float]:
    """Return the component that a spin without one is, and its sign.

    With z into the wall and x the way it goes, it is along y. A ball that rolls on the way it goes turns
    against y in this frame: its topspin is -omega_y.
    """
    choice = layout.conventions.choices.get("spin")
    if choice is None and role.kind == "raw":
        raise DataError(f"{at}: {OPEN_QUESTIONS['spin']}.")
    return _SPINS[role.name], -1.0 if choice == "topspin" else 1.0


def _angle_after(header: str, role: Role, layout: Layout, at: str) -> str:
    """Return the key of an angle after impact with the side from which it is measured."""
    said = layout.conventions.angle_from
    if role.name != "angle_after":
        return role.name
    if said is None:
        raise DataError(
            f"{at}: could be measured from the wall or from its normal. Say which, for angles before and "
            f"after "
            f"alike: {suggest('angle=from-wall')} or {suggest('angle=from-normal')}; or call this one "
            f"angle_out_from_wall_deg or angle_out_from_normal_deg."
        )
    return f"angle_after_{said.replace('-', '_')}"


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


# values whose uncertainty is called otherwise than they are
_PARTNERS = {
    "sigma_gamma": ("gamma",),
    "sigma:raw:speed": ("speed",),
    "sigma:raw:angle_after": ("raw:angle_after_from_normal", "raw:angle_after_from_wall"),
}


def _inherit_units(layout: Layout) -> None:
    """Give the uncertainty of an angle the unit of the angle where its header has none."""
    _inherit_percent(layout)
    for key, column in list(layout.columns.items()):
        of = _PARTNERS.get(key, (key.removeprefix("sigma:").removeprefix("sd:"),))
        partner = next((layout.columns[each] for each in of if each != key and layout.has(each)), None)
        if partner is not None and column.unit is None and column.dimension in _WITH_UNIT:
            unit = partner.unit
            if unit is None and partner.dimension == "angle":
                # Raises where the values do not tell; where they do, it can only be degrees.
                layout.degrees_of(partner, layout.cells.numbers(partner.index))
                unit = "deg"
            layout.columns[key] = replace(column, unit=unit)


def _of_the_observable(layout: Layout) -> None:
    """Take a common error in a wide table in unit and sign of the one observable that it moves.

    Raises
    ------
    DataError
        There are several observables.
    """
    shared = [key for key in layout.columns if dimension_of(key) == "number"]
    if not shared or layout.has("observable") or layout.has("value"):
        return
    measured = [layout.columns[key] for key in layout.columns if key in OBSERVABLES]
    if not measured:  # velocities, or nothing: refused where these are read
        return
    if len(measured) > 1:
        header = layout.header(shared[0])
        raise DataError(
            f"{layout.cells.at(header=header)}: an error that rows have in common moves one value a row, and "
            f"a row here has {len(measured)}. Give a long table, with columns observable and value."
        )
    for key in shared:
        own = layout.columns[key]
        layout.columns[key] = replace(
            own, dimension=measured[0].dimension, unit=measured[0].unit, sign=measured[0].sign
        )


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
    if conventions.angle_from and not layout.has_gamma:
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
        if of == "sports":
            continue
        if of == "spin":
            _note_spin(layout, choice, there, unused)
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


def _note_spin(layout: Layout, choice: str, there: set[str], unused: list[str]) -> None:
    """Say how spins without an axis were read."""
    if there & set(_SPINS):
        layout.notes.append(
            f"{layout.cells.name}: spins were read as positive for {choice}, the way a ball "
            f"{'rolls on' if choice == 'topspin' else 'would roll back'} along its own motion."
        )
    else:
        unused.append(f"spin={choice}")


_REFERENCE = ("gamma", "tan_gamma", WALL_ANGLE)


def choose_angle(layout: Layout, found: list[Column]) -> None:
    """Take the one incidence angle.

    Parameters
    ----------
    layout : Layout
        Gets the angle and what is worth telling about it.
    found : list of Column
        All that could be the angle, with what their names say as key.

    Raises
    ------
    DataError
        There are several, or it is open from where the angle is measured.
    """
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
            f"{cells.file}: {number} columns could be the incidence angle, {names}. Name it: "
            f"{_either_angle(found[0].header)}"
        )
    column = found[0]
    if conventions.angle_from is None and column.key not in _REFERENCE:
        named = f"{column.header}:" if conventions.angle_column else ""
        raise DataError(
            f"{cells.at(header=column.header)}: could be measured from the wall or from its normal. Say "
            f"which: {suggest(f'angle={named}from-wall')} or {suggest(f'angle={named}from-normal')}"
        )
    key = "tan_gamma" if column.key == "tan_gamma" or conventions.angle_unit == "tan" else "gamma"
    unit = conventions.angle_unit if conventions.angle_unit in ("deg", "rad") else column.unit
    layout.columns[key] = Column(column.index, column.header, key, "angle", unit)
    wall = "from-wall" if column.key == WALL_ANGLE else "from-normal"
    layout.angle_from = conventions.angle_from or wall
    if layout.angle_from == "from-wall":
        layout.notes.append(f"{cells.name}: column {column.header} was read as the angle from the wall.")


_SHOWN = 4
_LONGEST_REMEDY = 300
_WEIGHTS = ("weight", "weights", "w")


def refuse_unknown(cells: Cells, unknown: Sequence[str], *, angled: bool) -> NoReturn:
    """Refuse all unknown columns at once, with what can be said on the command line.

    Parameters
    ----------
    cells : Cells
    unknown : sequence of str
        Headers.
    angled : bool
        Whether another column could be the incidence angle.

    Raises
    ------
    DataError
        Always.
    """
    if looks_like_tracks(cells.headers):
        raise DataError(
            f"{cells.file}: looks like positions frame by frame, {joined(cells.headers[:4])}, not like "
            f"impacts. Make "
            f"these of it: 'ifrfit import {cells.file} --tracks --out impacts.csv'."
        )
    if len(cells.headers) == 1:
        raise DataError(
            f"{cells.at(header=unknown[0])}: unknown name{_hint(unknown[0])}. Rename it; columns are "
            "separated by commas, semicolons or tabs."
        )
    angle = None if angled else next(filter(_in_degrees, unknown), None)
    first = unknown[0] if angle is None else angle
    if len(unknown) == 1:
        near = closest(first)
        named = suggest(f"column:{near or 'NAME'}={first}")
        aside = suggest(f"ignore={first}")
        text = f"{cells.at(header=first)}: unknown name{_hint(first)}. "
        if angle is not None:
            text += f"If it is the incidence angle, say {_either_angle(first)}; otherwise "
            raise DataError(f"{text}name it, {named}, or leave it out, {aside}.")
        if near is None and _is_label(cells, first):
            text += f"If it says which rows belong together, it is the series: {_as_series(first)}. "
        if first == "index" and cells.in_memory:
            text += "If reset_index made it, say reset_index(drop=True). "
        raise DataError(f"{text}Rename it, say what it holds, {named}, or leave it out, {aside}.")
    shown = ", ".join(unknown[:_SHOWN])
    more = len(unknown) - _SHOWN
    shown += f" and {more} more" if more > 0 else ""
    line = f", line {cells.header_line}" if cells.word == "line" else ""
    holds = suggest(f"column:NAME={first}") if angle is None else _either_angle(angle)
    label = next((each for each in unknown if _is_label(cells, each)), None)
    series = "" if label is None else f" {label} may say which rows belong together: {_as_series(label)}."
    raise DataError(
        f"{cells.file}{line}: {len(unknown)} columns have unknown names, {shown}. Say what a column holds, "
        f"{holds}, or leave columns out, {_without(unknown)}.{series}"
    )


def _is_label(cells: Cells, header: str) -> bool:
    """Whether a column holds words that come again and again, as names of materials do."""
    column = cells.columns[cells.headers.index(header)]
    if isinstance(column, DataError | np.ndarray):
        return False
    words = [text.strip() for text in column]
    different = set(words)
    is_number = any(NUMBER.fullmatch(text) for text in different)
    return not is_number and "" not in different and 1 <= len(different) <= len(words) // 2


def _as_series(header: str) -> str:
    return suggest(f"column:series={header}")


def _either_angle(header: str) -> str:
    """Return the two options for an incidence angle: from where it is measured, its header does not say."""
    return f"{suggest(f'angle={header}:from-normal')} or {suggest(f'angle={header}:from-wall')}"


def _hint(header: str) -> str:
    if parse_header(header).name in _WEIGHTS:
        return (
            ", which some write for 1/sigma and some for 1/sigma^2: give a column sigma, and --noise scaled "
            "where only its proportions are known"
        )
    sigma = uncertainty_of(header)
    if sigma is not None:
        return f", which looks like an uncertainty: one standard uncertainty is a column {sigma}"
    near = closest(header)
    return f", the closest known one is {near}" if near else ""


def _in_degrees(header: str) -> bool:
    parsed = parse_header(header)
    short = parsed.without_suffix()
    return (parsed.unit or (short.unit if short else None)) in units_of("angle")


def _without(unknown: Sequence[str]) -> str:
    """Return the option that leaves all of them out, as far as it stays readable."""
    if any("," in header for header in unknown):
        return f"{suggest(f'ignore={unknown[0]}')} and so on"
    text = suggest(f"ignore={','.join(unknown)}")
    return (
        text if len(text) <= _LONGEST_REMEDY else f"{suggest(f'ignore={unknown[0]},{unknown[1]}')} and so on"
    )
