"""Tables that are handed over in Python: data frames, Arrow tables and mappings of arrays, as cells."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
import pandas as pd

from ifrfit.data.cell_table import CellColumn, Cells
from ifrfit.data.tabular import arrow_column, check_headers
from ifrfit.errors import DataError, UsageError

TABLE = "table"  # what a table without a name is called, in messages and as a series

_ARROW = "__arrow_c_stream__"  # Arrow's own protocol: polars, pyarrow, duckdb and others


def is_table(given: object) -> bool:
    """Whether an object is a table in itself: a data frame, an Arrow table, or a mapping."""
    if isinstance(given, pd.DataFrame | Mapping) or is_records(given):
        return True
    return hasattr(given, _ARROW) and (hasattr(given, "columns") or hasattr(given, "column_names"))


def is_records(given: object) -> bool:
    """Whether an object is a structured array, or a list with a mapping of names to values for each row."""
    if isinstance(given, np.ndarray):
        return given.dtype.names is not None
    return isinstance(given, list | tuple) and bool(given) and all(map(_is_row, given))


def _is_row(given: object) -> bool:
    """Whether an object is one row: a mapping of names to single values."""
    return isinstance(given, Mapping) and bool(given) and all(np.ndim(value) == 0 for value in given.values())


def refuse_other(given: object) -> NoReturn:
    """Say what a table is.

    Raises
    ------
    UsageError
        With the remedy.
    """
    if isinstance(given, np.ndarray):
        raise UsageError(
            f"An array of shape {given.shape} is no table of impacts, because its columns have no names: "
            'give a mapping, as {"gamma_deg": array[:, 0], "beta": array[:, 1]}.'
        )
    if isinstance(given, pd.Series):
        raise UsageError(
            f"A Series ({given.name!r:.40}) is one column of a table: give a data frame, or columns by "
            "keyword (gamma_deg=[...], beta=[...])."
        )
    shown = " ".join(repr(given).split())
    raise UsageError(
        f"{shown:.40} ({type(given).__name__}) is no table of impacts: give a path, a data frame, or a "
        "mapping of columns."
    )


def tables_of(given: Any) -> dict[str, Any]:
    """The tables in an object by name: itself, or those that a mapping of names to tables holds."""
    if isinstance(given, Mapping) and given and all(is_table(value) for value in given.values()):
        return {str(name): table for name, table in given.items()}
    return {TABLE: given}


def cells_of_table(table: Any, name: str = TABLE) -> Cells:
    """The cells of a table.

    Parameters
    ----------
    table : pandas.DataFrame, polars.DataFrame, Arrow table, mapping of str to array_like, or records
        Records are a structured array, or a list with a mapping for each row. A number among the columns of
        a mapping stands in every row. Missing values are None or nan.
    name : str
        For messages.

    Returns
    -------
    Cells
        Rows are numbered by the index of a pandas frame where this holds different whole numbers,
        else from 0.

    Raises
    ------
    DataError
        For no rows, columns of different lengths or more than one dimension, and headers without a name or
        twice.
    """
    counted = "counted from 0"
    labels: tuple[str, ...] = ()
    if is_records(table):
        table = _of_records(table)
    if not isinstance(table, pd.DataFrame | Mapping):
        import pyarrow as pa

        given = pa.table(table)
        names = [str(each).strip() for each in given.column_names]
        columns = [arrow_column(given.column(i), each, name, pa) for i, each in enumerate(names)]
        rows = np.arange(given.num_rows)
    else:
        frame = table if isinstance(table, pd.DataFrame) else _frame(table, name)
        names = [_header(each) for each in frame.columns]
        columns = [_column(frame.iloc[:, i], each, name) for i, each in enumerate(names)]
        rows, labels = _row_numbers(frame), _labels(frame)
        if rows[:1].any() or (np.diff(rows) != 1).any():
            counted = "as the index has it"
    if not names:
        raise DataError(f"{name}: there is no column. Give an angle and what was measured.")
    if not rows.size:
        raise DataError(f"{name}: there is no row. Give one impact a row.")
    cells = Cells(
        name,
        _digest(names, columns),
        names,
        0,
        rows,
        columns,
        word="row",
        counted=counted,
        labels=labels,
        in_memory=True,
    )
    check_headers(cells)
    return cells


def _of_records(records: Any) -> pd.DataFrame:
    """A frame of a structured array, or of rows."""
    if isinstance(records, np.ndarray):
        return pd.DataFrame({name: records[name].reshape(-1) for name in records.dtype.names or ()})
    return pd.DataFrame(list(records))


def _frame(table: Mapping[Any, Any], name: str) -> pd.DataFrame:
    """A frame of columns of one length; single values stand in every row."""
    given = [(header, values) for header, values in table.items() if isinstance(values, pd.Series)]
    for header, values in given[1:]:
        if not values.index.equals(given[0][1].index):
            raise DataError(
                f"{name}: the Series {given[0][0]} and {header} have different indexes. Put them into one "
                "data frame, which pairs their rows, or give their values alone (.to_numpy())."
            )
    columns = {
        _header(header): _values(values, f"{name}, column {header}") for header, values in table.items()
    }
    lengths = {
        header: len(values) for header, values in columns.items() if isinstance(values, list | np.ndarray)
    }
    if columns and not lengths:
        lengths = dict.fromkeys(list(columns)[:1], 1)
    different = [header for header, n in lengths.items() if n != next(iter(lengths.values()))]
    if different:
        first, other = next(iter(lengths)), different[0]
        raise DataError(
            f"{name}: column {first} has {lengths[first]} values, {other} has {lengths[other]}. Give one of "
            "each for every impact."
        )
    return pd.DataFrame(columns, index=range(next(iter(lengths.values()), 0)))


def _values(values: Any, where: str) -> Any:
    """A column of a mapping as a list or an array of one dimension, or one value for all rows."""
    if values is None or isinstance(values, str | int | float):
        return values
    if isinstance(values, np.ma.MaskedArray):
        return values.tolist()  # None where it is masked
    if isinstance(values, set | frozenset | dict):
        raise DataError(f"{where}: a {type(values).__name__} is no column. Give a list or an array.")
    if isinstance(values, Iterator):
        return list(values)
    if isinstance(values, pd.Series):
        return values.array if isinstance(values.dtype, pd.CategoricalDtype) else values.to_numpy()
    if isinstance(values, Sequence):
        return list(values)
    array = np.asarray(values)
    if array.ndim == 0:
        return array.item()
    if array.ndim > 1:
        raise DataError(f"{where}: has {array.ndim} dimensions. Give one value for each impact.")
    return array


def _header(name: Any) -> str:
    return " ".join(str(part) for part in name if str(part)) if isinstance(name, tuple) else str(name).strip()


def _column(values: pd.Series, header: str, name: str) -> CellColumn | DataError:
    """Numbers or texts; what is neither comes as the error to raise when somebody wants to use it."""
    kind = values.dtype
    if pd.api.types.is_bool_dtype(kind) or pd.api.types.is_datetime64_any_dtype(kind):
        return DataError(f"{name}, column {header}: holds {kind}, neither numbers nor text. Convert it.")
    if pd.api.types.is_complex_dtype(kind):
        return DataError(f"{name}, column {header}: holds complex numbers. Give real ones.")
    if pd.api.types.is_numeric_dtype(kind):
        return np.asarray(values.to_numpy(dtype=np.float64, na_value=math.nan))
    cells = values.to_numpy(dtype=object)
    if all(isinstance(cell, int | float | np.number) or cell is None or cell is pd.NA for cell in cells):
        return np.array([math.nan if cell is None or cell is pd.NA else float(cell) for cell in cells])
    return ["" if cell is None or cell is pd.NA or cell != cell else str(cell) for cell in cells]


def _row_numbers(frame: pd.DataFrame) -> np.ndarray[Any, np.dtype[np.int64]]:
    index = frame.index
    if pd.api.types.is_integer_dtype(index.dtype) and index.is_unique and len(index) and index.min() >= 0:
        return np.asarray(index, dtype=np.int64)
    return np.arange(len(frame))


def _labels(frame: pd.DataFrame) -> tuple[str, ...]:
    """What the index calls each row; nothing where it holds numbers."""
    if pd.api.types.is_numeric_dtype(frame.index.dtype):
        return ()
    return tuple(str(each) for each in frame.index)


def _digest(names: Sequence[str], columns: Sequence[CellColumn | DataError]) -> str:
    """SHA-256 of names and values: the same numbers have the same one, whatever held them."""
    sha = hashlib.sha256()
    for part in _bytes_of(names, columns):
        sha.update(len(part).to_bytes(8, "little"))
        sha.update(part)
    return sha.hexdigest()


def _bytes_of(names: Sequence[str], columns: Sequence[CellColumn | DataError]) -> Iterator[bytes]:
    for name, column in zip(names, columns, strict=True):
        yield name.encode()
        if isinstance(column, np.ndarray):
            yield np.ascontiguousarray(column, dtype="<f8").tobytes()
        elif not isinstance(column, DataError):
            yield "\x1f".join(column).encode()
