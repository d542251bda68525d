"""Reading result.json back: what is missing or of the wrong kind is named by its key."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.data.schema import TABLE_COLUMNS, TEXT_COLUMNS
from ifrfit.errors import DataError
from ifrfit.inference.io.plain import REMEDY, Node, from_fields, from_plain
from ifrfit.inference.io.write_result import NULL_MARK, SCHEMA, ParameterInFile
from ifrfit.inference.option_fields import check_form
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import State

if TYPE_CHECKING:
    import pandas as pd

_COUNT_COLUMNS = ("n_repeats", "row")
_POINT_COLUMNS = (*TABLE_COLUMNS, "sigma_used", "fitted", "residual", "standardised", "tau", "sticking")


def load_result(path: str | Path) -> FitResult:
    """Read a result.json.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    FitResult
        Equal to the one that was saved, up to points beyond 100000 rows, which are not kept.

    Raises
    ------
    DataError
        If the file is missing, not JSON, not a result, or of an unknown schema version; names file and key.

    Examples
    --------
    >>> import ifrfit
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ifrfit.fit("cornell-glass").save(f"{folder}/result.json")
    ...     again = ifrfit.load_result(f"{folder}/result.json")
    >>> f"{again.constants.mu:.2uS}"
    '0.0894(88)'
    """
    check_form("path", "path", path)
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise DataError(f"{path}: there is no such file. Name the result.json of a fit.") from None
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not text"
        raise DataError(f"{path}: cannot be read ({why}). Name the result.json of a fit.") from None
    try:
        content = json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        remedy = REMEDY if text.lstrip()[:1] in ("", "{") else "Name the result.json of a fit."
        raise DataError(
            f"{path}, line {error.lineno}, column {error.colno}: this is not JSON ({error.msg}). {remedy}"
        ) from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: this is not strict JSON ({error}). {REMEDY}") from None
    return from_dict(content, name=str(path))


def _refuse_constant(word: str) -> None:
    raise ValueError(f"it holds {word}")


def from_dict(content: Any, *, name: str = "result") -> FitResult:
    """Build a result from the content of a result.json.

    Parameters
    ----------
    content : dict
        As `FitResult.to_dict` gives it.
    name : str
        Of the file, for messages.

    Returns
    -------
    FitResult

    Raises
    ------
    DataError
        If something is missing or of the wrong kind; the key is named.
    """
    root = Node(content, "", name)
    root.check(dict, "the file")
    version = root.value.get("schema")
    if version != SCHEMA:
        stated = f"schema {version!r}" if version is not None else "no key 'schema'"
        raise DataError(
            f"{name}: has {stated}; this version of ifrfit reads '{SCHEMA}'. "
            "Name the result.json of a fit, or use the ifrfit that wrote the file."
        )
    values = from_fields(FitResult, root)
    state: State = values["state"]
    if "sample" in root["state"].value:
        state = replace(state, sample=_sample(root["state"]["sample"], state.names))
    asked: Mapping[str, ParameterInFile] = {}
    if "asked" in root.value:
        asked = from_plain(Mapping[str, ParameterInFile], root["asked"])
    own: dict[str, Any] = {
        "warnings": tuple(says for says in values["warnings"] if not says.startswith(NULL_MARK)),
        "state": state,
        "points": _points(root["points"]),
        "asked": tuple(each.parameter(name) for name, each in asked.items()),
    }
    return FitResult(**values | own)


def _sample(node: Node, names: tuple[str, ...]) -> Any:
    """Draws of the posterior, (n, names), from one list a name."""
    columns = [_finite(node[name]) for name in names]
    lengths = [len(column) for column in columns]
    if not columns or min(lengths) == 0:
        node.fail("an object of lists that are not empty")
    for name, length in zip(names, lengths, strict=True):
        if length != lengths[0]:
            node[name].fail(f"as long as {node.path}.{names[0]} ({lengths[0]})")
    sample = np.column_stack(columns)
    sample.flags.writeable = False
    return sample


def _finite(node: Node) -> Any:
    """A vector of any length, all of it finite numbers."""
    node.check(list)
    if not set(map(type, node.value)) <= {int, float}:
        node.each(Node.number)
    try:
        numbers = np.array(node.value, dtype=float)
    except OverflowError:
        numbers = np.full(1, math.inf)
    if not np.isfinite(numbers).all():
        node.fail("a list of finite numbers")
    return numbers


def _points(node: Node) -> pd.DataFrame:
    """The table of rows used; without rows where the file does not keep them."""
    import pandas as pd

    given = {name: Node([], name, node.file) for name in _POINT_COLUMNS}
    if node.value is not None:
        node.check(dict)
        given = {name: node[name] for name in dict.fromkeys((*_POINT_COLUMNS, *node.value))}
    columns = {name: _column(name, column) for name, column in given.items()}
    lengths = {name: len(column) for name, column in columns.items()}
    for name, length in lengths.items():
        if length != lengths["value"]:
            given[name].fail(f"as long as points.value ({lengths['value']})")
    table = pd.DataFrame(columns)
    for name in TEXT_COLUMNS:
        table[name] = table[name].astype("str")
    # the slip ratio at grazing incidence: infinite, which JSON does not know
    table.loc[table["tau"].isna() & table["gamma_deg"].notna(), "tau"] = math.inf
    return table


def _column(name: str, node: Node) -> Any:
    """One column; the kinds of its cells are looked at together, cell by cell only to name a wrong one."""
    import pandas as pd

    node.check(list)
    kinds = set(map(type, node.value))
    if name in TEXT_COLUMNS:
        if not kinds <= {str}:
            node.each(lambda cell: cell.scalar(str))
        return pd.Series(node.value, dtype=object)
    if name in _COUNT_COLUMNS:
        if not kinds <= {int}:
            node.each(lambda cell: cell.scalar(int))
        return pd.Series(node.value, dtype="int64")
    if name == "sticking" or kinds == {bool}:
        if not kinds <= {bool, type(None)}:
            node.each(lambda cell: cell.check(bool) if cell.value is not None else None)
        return pd.Series(node.value, dtype=object if type(None) in kinds else bool)
    if not kinds <= {int, float, type(None)}:
        node.each(lambda cell: cell.number(math.nan))
    return pd.Series(node.value, dtype=float)
