"""Which choices are best for some accuracy: the Pareto front of time and error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from ifrfit.cost.timing import Cost, Kind, Timing


@dataclass(frozen=True)
class Choice:
    """A method at a setting, with all that was measured of it.

    Attributes
    ----------
    kind, method, setting : str
    time : Timing
    errors : mapping of str to float
        By quantity.
    error_unit : str
    on_front : bool
        Whether nothing else that answers the same question is both as fast and as exact.
    """

    kind: Kind
    method: str
    setting: str
    time: Timing
    errors: Mapping[str, float]
    error_unit: str
    on_front: bool = False

    @property
    def question(self) -> tuple[str, str]:
        """What it competes in: its kind; in arithmetic each setting, which says which impacts."""
        return self.kind, self.setting if self.kind == "arithmetic" else ""

    @property
    def error(self) -> float:
        """The largest over the quantities; nan where one of them has none to state."""
        values = list(self.errors.values())
        return math.nan if any(math.isnan(value) for value in values) else max(values)


def choices_of(costs: Iterable[Cost]) -> tuple[Choice, ...]:
    """Put the quantities of each method and setting together, and mark the front of each question."""
    found: dict[tuple[str, str, str], Choice] = {}
    for cost in costs:
        key = cost.kind, cost.method, cost.setting
        if key in found:
            found[key] = replace(found[key], errors={**found[key].errors, cost.quantity: cost.error})
        else:
            errors = {cost.quantity: cost.error}
            found[key] = Choice(cost.kind, cost.method, cost.setting, cost.time, errors, cost.error_unit)
    every = list(found.values())
    return tuple(replace(one, on_front=not _beaten(one, every)) for one in every)


def _beaten(choice: Choice, others: Sequence[Choice]) -> bool:
    if math.isnan(choice.error):
        return True
    return any(
        other.question == choice.question
        and other.time.median <= choice.time.median
        and other.error <= choice.error
        and (other.time.median < choice.time.median or other.error < choice.error)
        for other in others
    )


def cheapest(choices: Iterable[Choice], error: float) -> Choice | None:
    """The fastest choice whose error is at most this; None where there is none."""
    enough = [choice for choice in choices if choice.error <= error]
    return min(enough, key=lambda choice: choice.time.median, default=None)


def best_for(choices: Sequence[Choice], targets: Sequence[float]) -> list[tuple[float, float, Choice]]:
    """The cheapest choice for each target, neighbours with the same one put together.

    Parameters
    ----------
    choices : sequence of Choice
    targets : sequence of float
        From loose to tight.

    Returns
    -------
    list of (float, float, Choice)
        The loosest and the tightest target, and the choice; targets that nothing meets are not there.
    """
    found: list[tuple[float, float, Choice]] = []
    for target in targets:
        best = cheapest(choices, target)
        if best is None:
            continue
        if found and found[-1][2] is best:
            found[-1] = (found[-1][0], target, best)
        else:
            found.append((target, target, best))
    return found
