"""What an effort came to, in words."""

from __future__ import annotations

from ifrfit.inference.accuracy.types import Effort
from ifrfit.text import duration, power_of_ten


def says(effort: Effort) -> str:
    """Method and setting, what was reached, in which time, and what was asked."""
    taken = f"in {duration(effort.seconds)}"
    why = f" ({effort.why})" if effort.why else ""
    asked = _asked(effort)
    if effort.method == "lsq":
        return f"least squares {taken}{why}; how far from the posterior is not known; asked: {asked}"
    return f"{_setting(effort)} reached {_reached(effort)} {taken}{why}; asked: {asked}"


def missed(effort: Effort) -> str:
    """That the accuracy was not reached."""
    assert effort.accuracy is not None
    within = "" if effort.budget is None else f" within {duration(effort.budget)}"
    start = f"the asked accuracy of {power_of_ten(effort.accuracy)} of an sd was not reached{within}"
    if effort.method == "lsq":
        return f"{start}: least squares do not tell how far they are from the posterior"
    return f"{start}: {_setting(effort)} came to {_reached(effort)}"


def short(sentence: str) -> str:
    """Of a refusal what it is about, without the remedy and the full stop."""
    return sentence.partition(". ")[0].partition(": ")[0].rstrip(".")


def _setting(effort: Effort) -> str:
    if effort.tolerance is not None:
        return f"exact, tolerance {power_of_ten(effort.tolerance)},"
    return f"mcmc, {effort.steps:,} steps,"


def _reached(effort: Effort) -> str:
    if effort.reached is None:
        return "no standard error yet"
    kind = "a standard error of " if effort.method == "mcmc" else ""
    return f"{kind}{power_of_ten(effort.reached)} of an sd"


def _asked(effort: Effort) -> str:
    parts = [power_of_ten(effort.accuracy)] if effort.accuracy is not None else []
    if effort.budget is not None:
        parts.append(f"{'at most' if parts else 'the best in'} {duration(effort.budget)}")
    return ", ".join(parts)
