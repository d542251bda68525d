"""A fit as strict JSON (schema ifrfit/result/1) and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit._version import __version__
from ifrfit.data import Source
from ifrfit.inference.io.json_text import render, write_whole
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, FitStatistics, Noise, State

SCHEMA = "ifrfit/result/1"
MOST_ROWS = 100_000
# sentences that begin like this speak about the file, not about the fit: reading takes them away again
NULL_MARK = "Written as null: "
# what the noise common to all rows is called in the file; every other noise has a slash in its name
FACTOR = "factor"


class _Nulls:
    """What had to be written as null, and why."""

    def __init__(self) -> None:
        self.open_ends = False
        self.values: list[str] = []
        self.columns: list[str] = []
        self.rows = 0

    def number(self, value: float, path: str) -> float | None:
        if math.isfinite(value):
            return value
        word = "not a number" if math.isnan(value) else "infinite"
        self.values.append(f"{path} ({word})")
        return None

    def sentences(self) -> list[str]:
        said = []
        if self.open_ends:
            said.append("ends of intervals and bounds that are infinite")
        if self.values:
            said.append(", ".join(self.values))
        if self.columns:
            said.append(f"cells without a finite number in the columns {', '.join(self.columns)} of points")
        if self.rows:
            said.append(f"points, as {self.rows} rows are more than the {MOST_ROWS} that a result keeps")
        return [f"{NULL_MARK}{what}." for what in said]


def to_dict(result: FitResult) -> dict[str, Any]:
    """Exactly the content of result.json.

    Parameters
    ----------
    result : FitResult

    Returns
    -------
    dict
        Keys in the order of the schema; only str, int, float, bool, None, list and dict. nan and infinity
        are None, with the reason in ``warnings``. Points beyond 100000 rows are left out (None).
    """
    nulls = _Nulls()
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "ifrfit": result.versions.get("ifrfit", __version__),
        "created": result.created,
        "command": result.command,
        "seed": int(result.seed),
        "versions": dict(result.versions),
        "input": [_source(source, i, nulls) for i, source in enumerate(result.inputs)],
        "closure": result.closure,
        "inertia_factor": float(result.inertia_factor),
        "method": result.method,
        "noise": _noise(result.noise, nulls),
        **({"asked": {c.name: _asked(c, nulls) for c in result.asked}} if result.asked else {}),
        **({"effort": _plain(asdict(result.effort), "effort", nulls)} if result.effort is not None else {}),
        "constants": _estimates(result.constants, "constants", nulls),
        "derived": _estimates(result.derived, "derived", nulls),
        "correlation": {
            "names": list(result.correlation[0]),
            "matrix": _plain(result.correlation[1], "correlation.matrix", nulls),
        },
        "fit": _plain({f.name: getattr(result.fit, f.name) for f in fields(FitStatistics)}, "fit", nulls),
        "facts": {
            name: {
                "ok": bool(fact.ok),
                "says": fact.says,
                "figures": _plain(fact.figures, f"facts.{name}.figures", nulls),
                "threshold": fact.threshold,
            }
            for name, fact in result.facts.items()
        },
        **({"scene": _plain(asdict(result.scene), "scene", nulls)} if result.scene else {}),
        **(
            {"effects": [_plain(asdict(line), "effects", nulls) for line in result.effects]}
            if result.effects
            else {}
        ),
        "warnings": [],
        "state": _state(result.state, nulls),
        "points": _points(result.points, nulls),
    }
    content["warnings"] = [*result.warnings, *nulls.sentences()]
    return content


def dumps(result: FitResult) -> str:
    """The text of result.json: strict JSON, one line a list, ends with a line feed."""
    return render(to_dict(result)) + "\n"


def save(result: FitResult, path: Path) -> None:
    """Write result.json; it appears whole or not at all.

    Parameters
    ----------
    result : FitResult
    path : Path
        File to write or replace; its folder must be there.
    """
    write_whole(dumps(result), Path(path))


def _plain(value: Any, path: str, nulls: _Nulls) -> Any:
    """Any value as JSON knows it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item, f"{path}.{key}", nulls) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple, set, frozenset)):
        items = sorted(value, key=str) if isinstance(value, (set, frozenset)) else value
        return [_plain(item, f"{path}[{i}]", nulls) for i, item in enumerate(items)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return nulls.number(value, path)
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)


def _estimates(value: Any, path: str, nulls: _Nulls) -> Any:
    """Estimates in whatever mapping or tuple they come; None stays None."""
    if isinstance(value, Estimate):
        return _estimate(value, path, nulls)
    if isinstance(value, Mapping):
        return {str(key): _estimates(item, f"{path}.{key}", nulls) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_estimates(item, f"{path}[{i}]", nulls) for i, item in enumerate(value)]
    return _plain(value, path, nulls)


def _asked(constant: Parameter, nulls: _Nulls) -> dict[str, Any]:
    """What the user asked of a constant: enough to put the same question again."""
    return {
        "bounds": _ends((constant.lower, constant.upper), nulls),
        "fixed": constant.fixed,
        "prior": None if constant.prior is None else [float(number) for number in constant.prior],
        "separate": constant.separate,
    }


def _estimate(estimate: Estimate, path: str, nulls: _Nulls) -> dict[str, Any]:
    mean = {} if estimate.mean is None else {"mean": _plain(estimate.mean, f"{path}.mean", nulls)}
    return {
        "value": _plain(estimate.value, f"{path}.value", nulls),
        **mean,
        "stderr": _plain(estimate.stderr, f"{path}.stderr", nulls),
        "interval68": _ends(estimate.interval68, nulls),
        "interval95": _ends(estimate.interval95, nulls),
        "status": estimate.status,
        "reason": estimate.reason,
    }


def _noise(noise: Noise, nulls: _Nulls) -> dict[str, Any]:
    """Sigma; and where the method has them, what is known of it and under which prior."""
    content: dict[str, Any] = {
        "policy": noise.policy,
        "sigma": _plain(noise.sigma, "noise.sigma", nulls),
    }
    if noise.estimates:
        named = {name or FACTOR: estimate for name, estimate in noise.estimates.items()}
        content["estimates"] = _estimates(named, "noise.estimates", nulls)
    if noise.prior:
        content["prior"] = {name or FACTOR: _ends(bounds, nulls) for name, bounds in noise.prior.items()}
    if noise.error_model.words:
        content["scatter"] = {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in noise.error_model.choices().items()
        }
    return content


def _ends(values: Any, nulls: _Nulls) -> list[float | None]:
    """Ends of an interval, or bounds: infinite ones are null, which is said once for all of them."""
    ends = [float(value) for value in values]
    nulls.open_ends |= not all(math.isfinite(end) for end in ends)
    return [end if math.isfinite(end) else None for end in ends]


def _source(source: Source, number: int, nulls: _Nulls) -> dict[str, Any]:
    content: dict[str, Any] = {
        "name": source.name,
        "sha256": source.sha256,
        "rows": int(source.rows),
        "rows_used": int(source.rows_used),
        "rows_skipped": {reason: int(count) for reason, count in source.rows_skipped.items()},
        "provenance": source.provenance,
        "selection": source.selection,
    }
    if source.descriptor is not None:
        content["descriptor"] = _plain(asdict(source.descriptor), f"input[{number}].descriptor", nulls)
    return content


def _state(state: State, nulls: _Nulls) -> dict[str, Any]:
    content: dict[str, Any] = {
        "names": list(state.names),
        "point": _plain(state.point, "state.point", nulls),
        "center": _plain(state.center, "state.center", nulls),
        "covariance": _plain(state.covariance, "state.covariance", nulls),
        "lower": _ends(state.lower, nulls),
        "upper": _ends(state.upper, nulls),
    }
    if state.sample is not None:
        # a column a name: one line each, so that the file stays readable
        content["sample"] = {
            name: _plain(column, f"state.sample.{name}", nulls)
            for name, column in zip(state.names, state.sample.T, strict=True)
        }
    return content


def _points(points: Any, nulls: _Nulls) -> dict[str, list[Any]] | None:
    if len(points) > MOST_ROWS:
        nulls.rows = len(points)
        return None
    content = {}
    for name in points.columns:
        missing = points[name].isna().to_numpy()
        cells = points[name].tolist()
        cells = [None if gone else _cell(cell) for cell, gone in zip(cells, missing, strict=True)]
        if missing.any() or any(cell is None for cell in cells):
            nulls.columns.append(str(name))
        content[str(name)] = cells
    return content


def _cell(cell: Any) -> Any:
    if isinstance(cell, np.generic):
        cell = cell.item()
    if isinstance(cell, float) and not math.isfinite(cell):
        return None
    return cell
