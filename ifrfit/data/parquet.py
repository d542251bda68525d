"""Parquet files to columns."""

from __future__ import annotations

import io
import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np

from ifrfit.data.cell_table import CellColumn
from ifrfit.errors import DataError


def read_parquet(raw: bytes, file: str) -> tuple[list[str], Sequence[CellColumn | DataError], int]:
    """Return the names, the columns and the number of rows of a Parquet file.

    A column is a float array, a sequence of text, or the error that its use raises.

    Raises
    ------
    DataError
        The file is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(raw))
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0] if str(error) else "damaged"
        raise DataError(f"{file}: not a readable Parquet file ({reason:.100}). Write it again.") from None
    names = [str(name).strip() for name in table.column_names if not str(name).startswith("__index_level_")]
    return names, [_column(table.column(name), name, file, pa) for name in names], table.num_rows


def _column(column: Any, name: str, file: str, pa: Any) -> CellColumn | DataError:
    """Return numbers or texts; what is neither comes as the error to raise when somebody wants to use it."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = column.type
    if (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_decimal(kind)
        or pa.types.is_null(kind)
    ):
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind):
        return [cell if cell is not None else "" for cell in column.to_pylist()]
    return DataError(
        f"{file}, column {name}: holds {kind}, neither numbers nor text. Convert it, or leave it out: "
        f"--convention {shlex.quote(f'ignore={name}')}."
    )
