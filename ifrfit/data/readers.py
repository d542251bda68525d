"""Read a table of impacts into the common schema."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import Cells, show
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_names import role_of
from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import Conventions, parse_conventions
from ifrfit.data.observations import Observations, Source, combine, make_table
from ifrfit.data.raw_velocities import is_raw, read_raw
from ifrfit.data.schema import PROVENANCES, provenance_name
from ifrfit.data.table_forms import Piece, read_long, read_wide, source_headers
from ifrfit.data.tabular import read_cells
from ifrfit.data.validate import drop_missing, refuse_restarted_impacts, refuse_summary_rows, validate
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.observables import OBSERVABLES

_LOG = logging.getLogger(__name__)


class NothingMeasuredError(DataError):
    """A table in which no row holds a measurement."""


def read(
    data: Any, *, convention: Sequence[str] | Mapping[str, str] = (), inertia_factor: float = 0.4
) -> Observations:
    """Read a table of impacts, from a file or as it is held: long, wide, or raw velocities before and after.

    Comma, semicolon or tab; decimal comma; UTF-8, UTF-16 with BOM or Latin-1; lines that begin with ``#`` and
    titles before the header are passed over; units stand in the headers. Empty cells and NaN are "not
    measured": skipped and counted in ``sources[0].rows_skipped``. Nothing is averaged and no convention is
    guessed.

    Parameters
    ----------
    data : str, Path, pandas.DataFrame, polars.DataFrame, Arrow table, or mapping of str to array_like
        A CSV, TSV, blank-separated, .xlsx, .ods or Parquet file; or a table, which may be a structured array
        or a list of rows, a mapping each. Its rows are called as the index
        of a pandas frame does where this holds different whole numbers, else from 0. A mapping of names to
        tables makes a series of each.
    convention : sequence of ``NAME=CHOICE`` or mapping, optional
        ``angle``, ``beta``, ``e_t``, ``psi``, ``z``, ``pair``, ``column:NAME``, ``unit:HEADER``,
        ``ignore``, ``provenance``, ``sheet``; see `ifrfit.data.conventions.parse_conventions`.
    inertia_factor : float
        J = I/(m R^2), used by the check of angular momentum of raw velocities.

    Returns
    -------
    Observations
        Angles in degrees from the normal, velocities and spins per incoming speed.

    Raises
    ------
    DataError
        The file is refused; the message names file, line and column and what to do.
    UsageError
        A convention is unknown or names a column that is not there, or the inertia factor is not positive.

    Examples
    --------
    >>> import ifrfit
    >>> table = {"alpha_deg": [80, 50, 20], "beta": [0.40, 0.35, -0.41]}
    >>> ifrfit.read(table, convention="angle=alpha_deg:from-wall")
    Observations(table: 3 rows of beta; provenance not stated)
    """
    conventions = parse_conventions(convention)
    if isinstance(data, str | Path):
        return observe(read_table(Path(data), conventions), conventions, inertia_factor)
    from ifrfit.data.table_objects import cells_of_table, is_table, refuse_other, tables_of

    if not is_table(data):
        refuse_other(data)
    if conventions.figure is not None or conventions.sheet is not None:
        said = "sheet=..." if conventions.figure is None else "x=..."
        raise UsageError(f"--convention {said}: is about a file, and a table was given. Leave it away.")
    tables = tables_of(data)
    try:
        cells = [cells_of_table(table, name) for name, table in tables.items()]
        return combine([observe(each, conventions, inertia_factor) for each in cells])
    except DataError as error:
        levels = max(
            (getattr(getattr(each, "columns", None), "nlevels", 1) for each in tables.values()), default=1
        )
        if levels == 1:
            raise
        raise DataError(
            f"{error.in_shell} Its columns have {levels} levels of names: to keep the last one alone, "
            "table.columns = table.columns.get_level_values(-1)."
        ) from None


def read_table(path: Path, conventions: Conventions) -> Cells:
    """The cells of a file, its header found with the columns that the conventions name.

    Raises
    ------
    DataError
        As `ifrfit.data.tabular.read_cells`.
    """
    from ifrfit.data.figures.figure_table import cells_of_figure  # which tables in memory do not need

    named = conventions.mentioned
    figure = cells_of_figure(path, conventions)
    if figure is not None:
        return figure
    return read_cells(
        path, lambda text: text.strip() in named or role_of(text).kind != "unknown", conventions.sheet
    )


def observe(cells: Cells, conventions: Conventions, inertia_factor: float = 0.4) -> Observations:
    """What the cells of a file say, in the common schema; see `read`.

    Raises
    ------
    DataError, UsageError
        As `read`.
    """
    if not (math.isfinite(inertia_factor) and inertia_factor > 0):
        raise UsageError(f"The inertia factor J = I/(m R^2) must be positive, not {inertia_factor:g}.")
    layout = identify(cells, conventions)
    if _LOG.isEnabledFor(logging.INFO):
        for line in layout.lines():
            _LOG.info("%s: %s", cells.file, line)
    refuse_summary_rows(layout)
    pieces = _read_form(layout, inertia_factor)
    kept: list[Piece] = []
    skipped: Counter[str] = Counter()
    for piece in pieces:
        some, why = drop_missing(piece)
        validate(some, layout)
        kept.append(some)
        skipped.update(why)
    return _assemble(layout, kept, dict(skipped))


def _read_form(layout: Layout, inertia_factor: float) -> list[Piece]:
    if layout.has("observable") or layout.has("value"):
        pieces = read_long(layout)
    elif is_raw(layout):
        return read_raw(layout, inertia_factor)
    else:
        pieces = read_wide(layout)
    if not layout.has_gamma:
        _require_no_angle(pieces, layout)
    return pieces


def _require_no_angle(pieces: Sequence[Piece], layout: Layout) -> None:
    for piece in pieces:
        for name in dict.fromkeys(piece.columns["observable"]):
            if OBSERVABLES[name].has_angle:
                raise DataError(
                    f"{layout.cells.file}: there is no incidence angle, which {name} needs. Add a column "
                    "gamma_deg (from the normal), or name one: --convention angle=COLUMN:from-normal or "
                    "--convention angle=COLUMN:from-wall"
                )


def _assemble(layout: Layout, pieces: Sequence[Piece], skipped: Mapping[str, int]) -> Observations:
    """Join the pieces in the order of the file."""
    cells = layout.cells
    rows = np.concatenate([piece.rows for piece in pieces])
    reasons = "; ".join(f"{count} {reason}" for reason, count in skipped.items())
    if not rows.size:
        raise NothingMeasuredError(
            f"{cells.file}: no row can be used ({reasons}). Fill in what was measured."
        )
    order = np.argsort(rows, kind="stable")
    rows = rows[order]
    columns: dict[str, Any] = {}
    for name in pieces[0].columns:
        parts = [np.asarray(piece.columns[name]) for piece in pieces]
        columns[name] = parts[0] if len(parts) == 1 else np.concatenate(parts)[order]
    refuse_restarted_impacts(layout, columns, rows)
    columns["series"] = _labels(layout, "series", _as_text(cells.label))[rows]
    provenance = _provenances(layout)[rows]
    columns |= {"provenance": provenance, "source": _as_text(cells.name), "row": cells.lines[rows]}
    stated = ", ".join(str(p) for p in dict.fromkeys(provenance) if p)
    source = Source(
        name=_as_text(cells.name),
        sha256=cells.sha256,
        rows=len(rows) + sum(skipped.values()),
        rows_used=len(rows),
        rows_skipped=skipped,
        provenance=stated,
        word="row" if cells.word == "row" else "line",
        headers=source_headers(layout),
    )
    notes = (*cells.notes, *layout.notes)
    return Observations(make_table(columns), (source,), notes, tuple(layout.momentum), cells.calibration)


def _as_text(name: str) -> str:
    """A file name as text: bytes that are no UTF-8, as on old disks, become question marks."""
    return name.encode("utf-8", "replace").decode("utf-8")


def _labels(layout: Layout, key: str, default: str) -> NDArray[np.object_]:
    """Return a column of text with the default in its empty cells."""
    if not layout.has(key):
        return np.full(len(layout.cells), default, dtype=object)
    return np.array([text or default for text in layout.texts(key)], dtype=object)


def _provenances(layout: Layout) -> NDArray[np.object_]:
    """Return the provenance of each row; what the user said holds for rows that do not state theirs."""
    cells, said = layout.cells, layout.conventions.provenance
    texts = _labels(layout, "provenance", "")
    names = {text: provenance_name(text) for text in dict.fromkeys(texts)}
    cells.refuse_first(
        np.array([names[text] is None for text in texts]),
        layout.header("provenance"),
        lambda row: (
            f"{show(texts[row])} is no provenance. "
            f"Known are {', '.join(PROVENANCES)}; empty means not stated."
        ),
    )
    if said and "" not in names.values():
        layout.notes.append(f"{cells.name}: convention provenance={said} found nothing to apply to.")
    return np.array([names[text] or said for text in texts], dtype=object)
