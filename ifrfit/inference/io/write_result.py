"""A fit as the content of result.json (schema ifrfit/result/1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit._version import __version__
from ifrfit.inference.io.plain import OPTIONAL, Nulls, to_plain
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.prior_laws import ShapedLaw, read_law
from ifrfit.inference.result.types import (
    Interval,
)

if TYPE_CHECKING:
    from ifrfit.inference.result.findings import Findings

SCHEMA = "ifrfit/result/1"
MOST_ROWS = 100_000
# sentences that begin like this speak about the file, not about the fit: reading takes them away again
NULL_MARK = "Written as null: "


@dataclass(frozen=True)
class ParameterInFile:
    """What the user asked of a constant: enough to put the same question again."""

    bounds: Interval
    fixed: float | None
    prior: Interval | None
    separate: bool
    passive: Interval | None = field(default=None, metadata=OPTIONAL)
    law: str | None = field(default=None, metadata=OPTIONAL)
    ties: Mapping[str, str] | None = field(default=None, metadata=OPTIONAL)

    @classmethod
    def of(cls, asked: Parameter) -> ParameterInFile:
        """As it stands in the file."""
        law = None if asked.shape is None else asked.shape.exactly
        ends, ties = (asked.lower, asked.upper), dict(asked.ties) or None
        return cls(ends, asked.fixed, asked.prior, asked.separate, asked.passive, law, ties)

    def parameter(self, name: str) -> Parameter:
        """As it was."""
        law = None if self.law is None else read_law(self.law)
        shape = law if isinstance(law, ShapedLaw) else None
        ties = tuple((self.ties or {}).items())
        return Parameter(name, *self.bounds, self.fixed, self.prior, self.separate, self.passive, shape, ties)


def to_dict(result: Findings) -> dict[str, Any]:
    """Exactly the content of result.json.

    Parameters
    ----------
    result : Findings

    Returns
    -------
    dict
        Keys in the order of the schema; only str, int, float, bool, None, list and dict. nan and infinity
        are None, with the reason in ``warnings``. Points beyond 100000 rows are left out (None).
    """
    nulls = Nulls()
    content: dict[str, Any] = {"schema": SCHEMA, "ifrfit": result.versions.get("ifrfit", __version__)}
    for key, value in to_plain(result, nulls).items():
        content[key] = value
        if key == "noise" and result.asked:
            content["asked"] = {c.name: to_plain(ParameterInFile.of(c), nulls) for c in result.asked}
    names, sample = result.state.names, result.state.sample
    if sample is not None:  # a column a name: one line each, so that the file stays readable
        columns = dict(zip(names, sample.T, strict=True))
        content["state"]["sample"] = to_plain(columns, nulls, "state.sample")
    content["points"], missing = _points(result.points)
    said = ["ends of intervals and bounds that are infinite"] if nulls.open_ends else []
    said += [", ".join(nulls.values)] if nulls.values else []
    content["warnings"] += [f"{NULL_MARK}{what}." for what in (*said, *missing)]
    return content


def _points(points: Any) -> tuple[dict[str, list[Any]] | None, list[str]]:
    """The columns of a table; and what of it had to be written as null, in words."""
    if len(points) > MOST_ROWS:
        return None, [f"points, as {len(points)} rows are more than the {MOST_ROWS} that a result keeps"]
    content, gaps = {}, []
    for name in points.columns:
        missing = points[name].isna().to_numpy()
        cells = points[name].tolist()
        cells = [None if gone else _cell(cell) for cell, gone in zip(cells, missing, strict=True)]
        if any(cell is None for cell in cells):
            gaps.append(str(name))
        content[str(name)] = cells
    words = f"cells without a finite number in the columns {', '.join(gaps)} of points"
    return content, [words] if gaps else []


def _cell(cell: Any) -> Any:
    if isinstance(cell, np.generic):
        cell = cell.item()
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell
