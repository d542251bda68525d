"""A comparison as strict JSON (schema ifrfit/compare/1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ifrfit.inference.comparison.result import Comparison, Entry
from ifrfit.inference.comparison.types import Loo, PsiPlane, Slope
from ifrfit.inference.io.json_text import render, write_whole
from ifrfit.inference.result.types import Interval

SCHEMA = "ifrfit/compare/1"

# of each fit, as in result.json
_COMMON = ("ifrfit", "created", "command", "seed", "versions", "input", "inertia_factor")
_OWN = ("noise", "constants", "derived", "fit", "facts", "warnings")


def to_dict(comparison: Comparison) -> dict[str, Any]:
    """Exactly the content of compare.json: only str, int, float, bool, None, list and dict."""
    fits = {name: entry.fit.to_dict() for name, entry in comparison.entries.items()}
    best = fits[comparison.ranked[0]]
    content: dict[str, Any] = {"schema": SCHEMA} | {key: best[key] for key in _COMMON}
    verdict = comparison.verdict
    content["verdict"] = {
        "kind": verdict.kind,
        "says": verdict.says,
        "tied": list(verdict.tied),
        "next": verdict.next,
        "log_bayes_factor": verdict.log_bayes_factor,
        "strength": verdict.strength,
        "over_priors": list(verdict.over_priors) if verdict.over_priors else None,
    }
    content["closures"] = {
        name: _entry(comparison.entries[name]) | {key: fits[name][key] for key in _OWN}
        for name in comparison.ranked
    }
    content["priors"] = [
        {"varied": row.varied, "log_evidence": dict(row.log_evidence)} for row in comparison.priors
    ]
    content["psi_plane"] = _plane(comparison.psi_plane)
    content["notes"] = list(comparison.notes)
    return content


def dumps(comparison: Comparison) -> str:
    """The text of compare.json: strict JSON, ends with a line feed."""
    return render(to_dict(comparison)) + "\n"


def save(comparison: Comparison, path: Path) -> None:
    """Write compare.json; it appears whole or not at all."""
    write_whole(dumps(comparison), path)


def _entry(entry: Entry) -> dict[str, Any]:
    return {
        "free": entry.free,
        "aicc": entry.aicc,
        "log_evidence": entry.log_evidence,
        "log_bayes_factor": entry.log_bayes_factor,
        "probability": entry.probability,
        "prior": {name: dict(ends) for name, ends in entry.prior.items()},
        "loo": None if entry.loo is None else _loo(entry.loo),
    }


def _loo(loo: Loo) -> dict[str, Any]:
    return {
        "elpd": loo.elpd,
        "se": _finite(loo.se),
        "p_loo": loo.p_loo,
        "difference": loo.difference,
        "se_difference": _finite(loo.se_difference),
        "n_draws": loo.n_draws,
        "threshold": loo.threshold,
        "refitted": list(loo.refitted),
        "doubtful": list(loo.doubtful),
        "impacts": list(loo.impacts),
        "pointwise": [_finite(float(x)) for x in loo.pointwise],
        "pareto_k": [_finite(float(x)) for x in loo.pareto_k],
    }


def _plane(plane: PsiPlane) -> dict[str, Any]:
    return {
        "available": not plane.reason,
        "reason": plane.reason,
        "n": plane.n,
        "n_sticking": plane.n_sticking,
        "n_sliding": plane.n_sliding,
        "sliding_slope": _slope(plane.sliding),
        "sliding_minus_sticking": _slope(plane.difference),
        "left_out": dict(plane.left_out),
    }


def _slope(slope: Slope | None) -> dict[str, Any] | None:
    if slope is None:
        return None
    expected: Mapping[str, Interval | None] = slope.expected
    return {
        "value": slope.value,
        "stderr": slope.stderr,
        "interval95": [_finite(end) for end in slope.interval95],
        "expected": {name: None if ends is None else list(ends) for name, ends in expected.items()},
        "contradicts": list(slope.contradicts),
    }


def _finite(x: float) -> float | None:
    return x if math.isfinite(x) else None
