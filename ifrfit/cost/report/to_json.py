"""Measured costs as strict JSON (schema ifrfit/cost/1)."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from ifrfit.cost.machine import Machine
from ifrfit.cost.result import Costs
from ifrfit.cost.timing import Kind
from ifrfit.inference.io.json_text import render

SCHEMA = "ifrfit/cost/1"

# as in result.json
_OF_FIT = (
    "ifrfit",
    "created",
    "command",
    "seed",
    "versions",
    "input",
    "closure",
    "inertia_factor",
    "noise",
    "asked",
)


def to_dict(costs: Costs) -> dict[str, Any]:
    """The rows of cost.csv and what is said about them.

    Returns
    -------
    dict
        Only str, int, float, bool, None, list and dict, in the order of cost.schema.json. An error that
        there is none to state of is None.
    """
    fit = costs.fit.to_dict()
    content: dict[str, Any] = {"schema": SCHEMA} | {key: fit[key] for key in _OF_FIT}
    content["machine"] = asdict(Machine.this())
    content["kinds"] = {kind: _kind(costs, kind) for kind in costs.kinds}
    content["costs"] = [
        {name: _finite(value) for name, value in row.items()} for row in costs.table().to_dict("records")
    ]
    content["notes"] = list(costs.notes)
    content["warnings"] = list(costs.fit.warnings)
    return content


def dumps(costs: Costs) -> str:
    """The text of `to_dict`: strict JSON, ends with a line feed."""
    return render(to_dict(costs)) + "\n"


def _kind(costs: Costs, kind: Kind) -> dict[str, Any]:
    found: dict[str, Any] = {"at": costs.about.get(kind), "says": list(costs.sentences(kind))}
    if kind == "inference" and costs.reference is not None:
        found["reference"] = asdict(costs.reference)
    return found


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
