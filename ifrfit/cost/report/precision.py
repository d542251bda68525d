"""Where single precision is enough and where it is not: tables and sentences of arithmetic costs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ifrfit.cost.arithmetic_costs import DOUBLE, GIVEN, SINGLE, VELOCITIES
from ifrfit.cost.timing import Cost
from ifrfit.report.terminal import aligned
from ifrfit.text import power_of_ten

ACCURACY = 1e-3
_HEADS = {VELOCITIES: "v, spin"}


def precision_table(costs: Sequence[Cost], precision: str) -> list[list[str]]:
    """Largest errors in one precision: a row a kind of impacts, a column a quantity.

    Parameters
    ----------
    costs : sequence of Cost
        From `ifrfit.cost.arithmetic_costs.arithmetic_costs`.
    precision : {"float32", "float64"}

    Returns
    -------
    list of list of str
        The first row holds the heads. Velocities and spins over 1 + |s|, angles in radians; empty where a
        quantity makes no sense.
    """
    own = [cost for cost in costs if cost.method == precision]
    quantities = list(dict.fromkeys(cost.quantity for cost in own if cost.setting != GIVEN))
    found = {(cost.setting, cost.quantity): _digit(cost.error) for cost in own}
    rows = [["impacts", *(_HEADS.get(name, name) for name in quantities)]]
    for kind in dict.fromkeys(cost.setting for cost in own):
        rows.append([kind, *(found.get((kind, name), "") for name in quantities)])
    return rows


def precision_lines(costs: Sequence[Cost]) -> list[str]:
    """Both tables for a terminal, at most 100 columns."""
    lines: list[str] = []
    for precision in (SINGLE, DOUBLE):
        head, *rows = precision_table(costs, precision)
        head[0] = precision
        lines += aligned([head, *rows], "<".ljust(len(head), ">"))
        lines.append("")
    return lines[:-1]


def precision_sentences(
    costs: Sequence[Cost], accuracy: float = ACCURACY, *, times: bool = True
) -> list[str]:
    """Where which precision is enough.

    Parameters
    ----------
    costs : sequence of Cost
        From `ifrfit.cost.arithmetic_costs.arithmetic_costs`.
    accuracy : float
        Error of an observable that is allowed; angles in radians.
    times : bool
        Whether to say how much faster single precision is.

    Returns
    -------
    list of str
        Without a full stop.
    """
    single, double = ([cost for cost in costs if cost.method == name] for name in (SINGLE, DOUBLE))
    worst = max(cost.error for cost in single if cost.quantity == VELOCITIES)
    statements = [
        f"Single precision keeps velocities and spins to {_digit(worst)} of 1 + |s| in all of these"
    ]
    lost = [cost for cost in single if cost.quantity != VELOCITIES and cost.error > accuracy]
    kinds = dict.fromkeys(cost.setting for cost in lost)
    others = "everything else" if kinds else "everything"
    if kinds:
        parts = [f"{kind} ({_named(cost for cost in lost if cost.setting == kind)})" for kind in kinds]
        statements.append(f"What is read off them loses more than {accuracy:g} there: {'; '.join(parts)}")
    statements.append(f"Single precision is enough for {accuracy:g} of {others} that is read off them")
    deepest = max((cost for cost in double if cost.quantity != VELOCITIES), key=lambda cost: cost.error)
    statements.append(
        f"Double precision loses at most {_digit(deepest.error)}: {deepest.quantity}, {deepest.setting}"
    )
    if times:
        ns = [1e9 * part[0].time.median for part in (single, double)]
        statements.append(f"An impact takes {ns[0]:.2g} ns in single and {ns[1]:.2g} ns in double precision")
    return statements


def _named(costs: Iterable[Cost]) -> str:
    return ", ".join(f"{cost.quantity} {_digit(cost.error)}" for cost in costs)


def _digit(error: float) -> str:
    """One digit and its power of ten, as 8e-8."""
    return "lost" if math.isinf(error) else power_of_ten(error)
