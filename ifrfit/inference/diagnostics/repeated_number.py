"""Readings of e_n that are one number in every row: a mean that was copied down is one reading."""

from __future__ import annotations

import numpy as np

from ifrfit.inference.diagnostics.thresholds import FACTS, FEWEST_ALIKE
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.result.types import Fact


def repeated_number(problem: Problem) -> Fact | None:
    """Find measured readings of the normal rebound that are the same in every decimal, in every row.

    Returns
    -------
    Fact or None
        None where readings differ. Figures: observables, and rows of the first.
    """
    rows, table = problem.rows, problem.observations.table
    measured = (table["provenance"] != "simulated").to_numpy()
    several = len(problem.series) > 1
    found: list[tuple[str, int, str]] = []
    for observable in rows.observables:
        if observable.kind != "normal":
            continue
        for number, series in enumerate(problem.series):
            own = rows.rows_of(observable.name)
            own = own[(rows.series[own] == number) & measured[own]]
            if own.size >= FEWEST_ALIKE and np.ptp(rows.value[own]) == 0.0:
                of = f" of {series}" if several else ""
                says = f"{observable.name}{of} is {rows.value[own[0]]:.6g} in all {own.size} rows"
                found.append((observable.name, int(own.size), says))
    if not found:
        return None
    size = found[0][1]
    says = (
        f"{'; '.join(says for *_, says in found)}: a mean that was copied down is one reading, not {size}, "
        "and the interval of e_n is too short; leave it in one row, with its standard error, or give it by "
        "--prior. Readings of each impact would scatter, unless they are rounded too coarsely to show it"
    )
    figures = {"observables": sorted({name for name, *_ in found}), "rows": size}
    return Fact(False, says, figures, FACTS["repeated_number"])
