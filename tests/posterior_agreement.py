"""How far a posterior is from what is known about it, in posterior standard deviations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from posterior_questions import LEVELS


def distances(post: Any, known: Mapping[str, Any]) -> dict[str, float]:
    """Every mean, sd and quantile against the known one, in known sd; the log evidence absolute.

    `known`: log_evidence and quantities, each with mean, sd and, where they are known, quantiles at `LEVELS`.
    """
    found = {"log evidence": abs(post.log_evidence - known["log_evidence"])}
    for name, law in known["quantities"].items():
        sd = law["sd"]
        found[f"mean {name}"] = abs(post.mean(name) - law["mean"]) / sd
        found[f"sd {name}"] = abs(post.sd(name) / sd - 1.0)
        if "quantiles" in law:
            off = np.abs(np.asarray(post.quantile(name, np.array(LEVELS))) - np.array(law["quantiles"])) / sd
            for level, x in zip(LEVELS, off.tolist(), strict=True):
                found[f"{100 * level:g} % {name}"] = x
    return found


def check(post: Any, known: Mapping[str, Any], tolerance: float) -> None:
    """Every known number within the tolerance, the names as they should be, and the claims honest."""
    assert set(post.names) == set(known["quantities"]), (post.names, tuple(known["quantities"]))
    far = {what: x for what, x in distances(post, known).items() if not x <= tolerance}
    assert not far, far
    assert post.converged, (post.error, post.error_evidence)
