"""Whether the closures are compared for a report: it takes about a second, where the problem is small."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ifrfit.errors import IfrfitError
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.observables import OBSERVABLES

if TYPE_CHECKING:
    from ifrfit.inference.comparison import Comparison

MOST_ROWS = 2000
MOST_CURVED = 60  # rows that no closure is linear in: each of them is computed at every node
MOST_CONSTANTS = 6


def compared(result: FitResult) -> tuple[Comparison | None, str]:
    """All closures by the question of a result; or none, and the sentence that says why."""
    from ifrfit.inference.comparison import compare_again

    why = _too_much(result)
    if why:
        return None, f"{why}: ifrfit compare puts the closures side by side"
    try:
        return compare_again(result), ""
    except IfrfitError as error:
        return None, f"They cannot be compared here. {error}"


def _too_much(result: FitResult) -> str:
    free = sum(found.status != "fixed" for found in result.flat_constants().values())
    if len(result.points) > MOST_ROWS or free > MOST_CONSTANTS:
        return f"{len(result.points)} rows and {free} free constants take long"
    curved = int(result.points["observable"].map(lambda name: OBSERVABLES[name].kind == "curved").sum())
    if curved > MOST_CURVED:
        return f"{curved} rebound angles or total restitutions take long"
    error_model = result.noise.error_model
    if not error_model.is_plain and result.noise.policy != "known":
        return "Such a scatter with a noise that is not known takes long"
    return ""
