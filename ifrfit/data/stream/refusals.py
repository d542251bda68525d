"""What is refused of tables that are read some rows at a time, and of what was met in them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_roles import identify
from ifrfit.data.common_errors import dimension_of
from ifrfit.data.conventions import Conventions
from ifrfit.data.stream.files import NotStreamableError
from ifrfit.data.stream.sample import Sample
from ifrfit.data.stream.table_batches import is_number, labels_of
from ifrfit.data.stream.tally import Tally
from ifrfit.data.table_folders import same_rows
from ifrfit.data.validate import SUMMARIES, TINY_SHARE, lone_sigmas, tiny_sigma
from ifrfit.errors import DataError, UsageError
from ifrfit.text import joined

if TYPE_CHECKING:
    import pyarrow as pa


def refuse_tables_in_memory(layout: Layout, streamed: Sequence[str]) -> None:
    """Refuse a table that is one for the reader that holds it in memory.

    Raises
    ------
    NotStreamableError
        With what is streamed.
    """
    path = layout.cells.file
    if layout.has("observable") or layout.has("value"):
        raise NotStreamableError(
            f"{path}: a long table is held in memory; a folder or a compressed file is read in parts. Name "
            "the file itself, unpacked, or give the table a column for each observable."
        )
    shared = next((key for key in layout.columns if dimension_of(key) is not None), None)
    if shared is not None:
        raise NotStreamableError(
            f"{path}: {layout.header(shared)}: errors that rows have in common need the table in memory. "
            "Fit a part of it."
        )
    others = [
        key for key in layout.columns if key.startswith(("raw:", "sigma:raw:", "sd:")) or key == "n_repeats"
    ]
    if others:
        raise NotStreamableError(
            f"{path}: {layout.header(others[0])} needs the reader that holds the table in memory; a "
            f"table that is streamed has columns of {', '.join(streamed)}."
        )


def refuse_other_columns(layout: Layout, expected: Collection[str], found: Collection[str]) -> None:
    """Refuse a file that holds more or less than the first one: what is not there is no zero."""
    names = {
        key: layout.header(key) if key in found else key.replace("sigma:", "sigma_")
        for key in sorted(set(expected) ^ set(found))
    }
    file = layout.cells.file
    for key, header in names.items():
        if key in found:
            raise DataError(
                f"{file}: there is a column {header}, which other files do not have. Give all files the "
                "same columns, or name what is to be used by --observable."
            )
        raise DataError(f"{file}: there is no column {header}, which other files have.")


def refuse_same_rows(one: Cells, other: Cells) -> None:
    """Refuse the rows of one table in another one, as far as their first rows tell.

    Raises
    ------
    DataError
        With both names.
    """
    if same_rows(one, other):
        raise DataError(
            f"{other.file}: begins with the rows of {Path(one.file).name}, which would be counted twice. "
            "Remove one of them."
        )


def refuse_summaries(batch: pa.RecordBatch, layout: Layout) -> None:
    """Refuse an impact that is called a mean, a standard deviation or a total of others."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if not layout.has("impact_id") or is_number(batch.column(layout.columns["impact_id"].index).type):
        return
    told = pa.array([name for one in SUMMARIES for name in (one, one.capitalize(), one.upper())])
    texts = labels_of(batch, layout, "impact_id")
    if pc.any(pc.is_in(texts, told)).as_py():
        name = texts.filter(pc.is_in(texts, told))[0]
        raise DataError(
            f"{layout.cells.file}, column {layout.header('impact_id')}: '{name}' names a summary of other "
            "rows, not an impact. Remove the row."
        )


def check_series(path: Path, requested: Sequence[str], met: Sequence[str]) -> None:
    """Refuse series that were asked for and not met, and those named as summaries of others.

    Raises
    ------
    UsageError, DataError
        With what there is.
    """
    for name in requested:
        if name not in met:
            raise UsageError(f"--series {name}: not in the data. There is {joined(met)}.")
    summaries = [name for name in met if name.lower() in SUMMARIES]
    if summaries and len(summaries) < len(met):
        raise DataError(
            f"{path}: the series '{summaries[0]}' names a summary of other rows, not impacts. Remove "
            "its rows."
        )


def refuse_tiny_sigmas(
    path: Path, conventions: Conventions, tally: Tally, sample: Sample, largest: Mapping[str, float]
) -> None:
    """Refuse an uncertainty so far below those of a sample that its value would outweigh all others.

    Parameters
    ----------
    path, conventions, tally, sample
        Of the stream.
    largest : mapping of str to float
        The largest uncertainty of each observable: the sample is not looked at unless one is far below it.

    Raises
    ------
    DataError
        With the file, and the remedy.
    """
    suspect = [name for name, (least, _) in tally.least_sigma.items() if least < TINY_SHARE * largest[name]]
    if not (suspect and sample.drawn):
        return
    layout = identify(sample.cells(path), conventions)
    for name in suspect:
        least, file = tally.least_sigma[name]
        found = lone_sigmas(np.append(layout.sigmas(name), least))
        if found is not None and least <= found[0]:
            raise DataError(f"{file}: {tiny_sigma(name, found[1]).format(f'{least:.6g}')}")
