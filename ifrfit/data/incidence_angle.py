"""The one incidence angle of a table, and from where it is measured."""

from __future__ import annotations

from ifrfit.data.column_layout import Column, Layout
from ifrfit.data.column_names import WALL_ANGLE
from ifrfit.data.conventions import suggest
from ifrfit.errors import DataError

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
            f"{suggest(f'angle={found[0].header}:from-normal')} or "
            f"{suggest(f'angle={found[0].header}:from-wall')}"
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
