"""A header of two rows: titles over several columns, as ``before | after``, and names below them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from ifrfit.data.cell_table import NUMBER, show
from ifrfit.data.column_names import UNITS, parse_header, role_of, uncertainty_of
from ifrfit.errors import DataError

# first and last column of each title that the file says to be merged over several, by row
Spans = dict[int, dict[int, int]]
_OF_ITSELF = ("value", "mean", "average")  # below a title: the quantity that the title names
_UNCERTAIN = ("sigma", "sd")


def merge_headers(
    titles: Sequence[str],
    names: Sequence[str],
    is_header: Callable[[str], bool],
    spans: dict[int, int] | None,
    at: str,
) -> list[str] | None:
    """The headers that two rows say together, or None where the upper one is no row of titles.

    A title holds for the columns that it is merged over; where the file does not say these, for its own and
    the empty cells to its right. A title over an empty cell is a name.

    Parameters
    ----------
    titles, names : sequence of str
        The cells of the two rows.
    is_header : callable
        Tells whether a text is known as a header.
    spans : dict or None
        Of the row of titles.
    at : str
        File and line of the titles, for messages.

    Raises
    ------
    DataError
        It cannot be told whether a title is about a column.
    """
    width = max(len(titles), len(names))
    upper = [cell.strip() for cell in titles] + [""] * (width - len(titles))
    lower = [cell.strip() for cell in names] + [""] * (width - len(names))
    if any(NUMBER.fullmatch(cell) for cell in (*upper, *lower)) or not any(lower):
        return None
    over_each = _title_of_each(upper, spans or {})
    headers, together = [], 0
    for column, (title, name) in enumerate(zip(upper, lower, strict=True)):
        if not name:
            if title and not is_header(title):
                return None
            headers.append(title)
            together += bool(title)
            continue
        over, is_sure = over_each[column]
        joined = next(filter(is_header, _joined(over, name)), None) if over else None
        if joined is None and over and not is_header(name):
            joined = next((each for each in _joined(over, name) if uncertainty_of(each)), None)
        if joined is None and title:
            return None
        if joined is not None and not is_sure:
            _refuse_ambiguous(over, name, joined, lower, is_header, at)
        headers.append(joined or name)
        together += joined is not None
    return headers if together else None


def _title_of_each(upper: Sequence[str], spans: dict[int, int]) -> list[tuple[str, bool]]:
    """The title of each column, and whether the file says so."""
    over_each: list[tuple[str, bool]] = []
    over, last = "", None
    for column, title in enumerate(upper):
        if title:
            over, last = title, spans.get(column, column if spans else None)
        if last is not None and column > last:
            over, last = "", None
        over_each.append((over, bool(title) or last is not None))
    return over_each


def _joined(title: str, name: str) -> Iterator[str]:
    """What a title and a name below it can mean together, with the unit of either."""
    above, below = parse_header(title), parse_header(name)
    above, below = above.without_suffix() or above, below.without_suffix() or below
    unit = below.unit or above.unit
    behind = f" [{unit}]" if unit in UNITS and unit != "1" else ""
    if below.name in _OF_ITSELF:
        yield title
    if below.name in _UNCERTAIN:
        yield f"{below.name}_{above.name}{behind}"
    yield f"{below.name} {above.name}{behind}"
    yield f"{above.name}_{below.name}{behind}"
    words = above.name.split("_")
    if len(words) > 1:  # velocity before, over x and z
        yield f"{words[0]}_{below.name} {'_'.join(words[1:])}{behind}"


def _refuse_ambiguous(
    title: str, name: str, joined: str, names: Sequence[str], is_header: Callable[[str], bool], at: str
) -> None:
    """Refuse a column that has a meaning of its own, and another one below the title to its left."""
    if is_header(name) and names.count(name) == 1 and role_of(name) != role_of(joined):
        raise DataError(
            f"{at}: {show(title)} may end before the column {show(name)} or hold for it, too, which makes it "
            f"{show(joined)}. Write the title over every column that it is about, or that name into the "
            f"header."
        )
