"""A fit as the content of result.json (schema ifrfit/result/1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit._version import __version__
from ifrfit.data import Source
from ifrfit.inference.accuracy.effort import Effort
from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine, SceneOfData
from ifrfit.inference.io.plain import OPTIONAL, Nulls, Shape, to_plain
from ifrfit.inference.model.error_model import PLAIN, ErrorModel
from ifrfit.inference.result.types import (
    Angles,
    Constants,
    Estimate,
    Fact,
    FitStatistics,
    FloatOrNan,
    Interval,
    NoiseSummary,
    State,
)

if TYPE_CHECKING:
    from ifrfit.inference.result.findings import Findings

SCHEMA = "ifrfit/result/1"
MOST_ROWS = 100_000
# sentences that begin like this speak about the file, not about the fit: reading takes them away again
NULL_MARK = "Written as null: "
# what the noise common to all rows is called in the file; every other noise has a slash in its name
FACTOR = "factor"


@dataclass(frozen=True)
class NoiseInFile:
    """The noise: what is common to all rows is named, and the error model stands as the user chose it."""

    policy: str
    sigma: Mapping[str, FloatOrNan]
    estimates: Mapping[str, Estimate] = field(default_factory=dict, metadata=OPTIONAL)
    prior: Mapping[str, Interval] = field(default_factory=dict, metadata=OPTIONAL)
    scatter: ErrorModel | None = field(default=None, metadata=OPTIONAL)
    separate: bool | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True)
class ParameterInFile:
    """What the user asked of a constant: enough to put the same question again."""

    bounds: Interval
    fixed: float | None
    prior: Interval | None
    separate: bool
    passive: Interval | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True)
class Correlation:
    """Correlation matrix of the free constants."""

    names: tuple[str, ...]
    matrix: Annotated[NDArray[np.float64], Shape(("names", "names"))]


@dataclass(frozen=True, kw_only=True)
class ResultFile:
    """Everything in result.json in its order; `points` and the draws in `state` by column."""

    schema: str
    ifrfit: str
    created: str
    command: str
    seed: int
    versions: Mapping[str, str]
    input: tuple[Source, ...]
    closure: str
    inertia_factor: float
    method: str
    noise: NoiseInFile
    asked: Mapping[str, ParameterInFile] = field(default_factory=dict, metadata=OPTIONAL)
    effort: Effort | None = field(default=None, metadata=OPTIONAL)
    constants: Constants
    derived: Mapping[str, Estimate | Mapping[str, Angles]]
    correlation: Correlation
    fit: FitStatistics
    facts: Mapping[str, Fact]
    scene: SceneOfData | None = field(default=None, metadata=OPTIONAL)
    effects: tuple[EffectLine, ...] = field(default=(), metadata=OPTIONAL)
    warnings: tuple[str, ...]
    state: State
    points: Any


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
    own: dict[str, Any] = {
        "schema": SCHEMA,
        "ifrfit": result.versions.get("ifrfit", __version__),
        "input": result.inputs,
        "inertia_factor": float(result.inertia_factor),
        "noise": _noise(result.noise),
        "asked": {
            c.name: ParameterInFile((c.lower, c.upper), c.fixed, c.prior, c.separate, c.passive)
            for c in result.asked
        },
        "correlation": Correlation(*result.correlation),
        "points": None,
    }
    same = {each.name: getattr(result, each.name) for each in fields(ResultFile) if each.name not in own}
    file = ResultFile(**own, **same)
    content: dict[str, Any] = to_plain(file, nulls)
    names, sample = result.state.names, result.state.sample
    if sample is not None:  # a column a name: one line each, so that the file stays readable
        columns = dict(zip(names, sample.T, strict=True))
        content["state"]["sample"] = to_plain(columns, nulls, "state.sample")
    content["points"], missing = _points(result.points)
    said = ["ends of intervals and bounds that are infinite"] if nulls.open_ends else []
    said += [", ".join(nulls.values)] if nulls.values else []
    content["warnings"] += [f"{NULL_MARK}{what}." for what in (*said, *missing)]
    return content


def _noise(noise: NoiseSummary) -> NoiseInFile:
    error_model = None if noise.error_model == PLAIN else noise.error_model
    estimates = {name or FACTOR: estimate for name, estimate in noise.estimates.items()}
    prior = {name or FACTOR: bounds for name, bounds in noise.prior.items()}
    return NoiseInFile(noise.policy, noise.sigma, estimates, prior, error_model, noise.separate or None)


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
