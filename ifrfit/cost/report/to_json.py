"""Measured costs as strict JSON (schema ifrfit/cost/1)."""

from __future__ import annotations

from typing import Any

from ifrfit.cost.result import Costs
from ifrfit.cost.timing import Kind, machine
from ifrfit.inference.io.plain import to_plain

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
    own = {
        "machine": machine(),
        "kinds": {kind: _kind(costs, kind) for kind in costs.kinds},
        "costs": costs.table().to_dict("records"),
        "notes": costs.notes,
        "warnings": costs.fit.warnings,
    }
    content: dict[str, Any] = {"schema": SCHEMA} | {key: fit[key] for key in _OF_FIT} | to_plain(own)
    return content


def _kind(costs: Costs, kind: Kind) -> dict[str, Any]:
    found: dict[str, Any] = {"at": costs.about.get(kind), "says": costs.sentences(kind)}
    if kind == "inference" and costs.reference is not None:
        found["reference"] = costs.reference
    return found
