"""What to say about columns that nothing is known about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_names import closest, uncertainty_of
from ifrfit.data.conventions import suggest
from ifrfit.data.units import parse_header, units_of
from ifrfit.errors import DataError

_SHOWN = 4
_LONGEST_REMEDY = 300


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
        raise DataError(f"{text}Rename it, say what it holds, {named}, or leave it out, {aside}.")
    shown = ", ".join(unknown[:_SHOWN])
    more = len(unknown) - _SHOWN
    shown += f" and {more} more" if more > 0 else ""
    line = f", line {cells.header_line}" if cells.word == "line" else ""
    holds = suggest(f"column:NAME={first}") if angle is None else _either_angle(angle)
    raise DataError(
        f"{cells.file}{line}: {len(unknown)} columns have unknown names, {shown}. Say what a column holds, "
        f"{holds}, or leave columns out, {_without(unknown)}."
    )


def _either_angle(header: str) -> str:
    """Return the two options for an incidence angle: from where it is measured, its header does not say."""
    return f"{suggest(f'angle={header}:from-normal')} or {suggest(f'angle={header}:from-wall')}"


def _hint(header: str) -> str:
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
