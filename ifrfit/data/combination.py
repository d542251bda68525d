"""Several sources in one set of observations, each impact once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ifrfit.data.angular_momentum import MomentumCheck
from ifrfit.data.observations import Observations, Source
from ifrfit.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd


def combine(parts: Sequence[Observations]) -> Observations:
    """Put several observations into one; series and impacts of different sources stay apart.

    Parameters
    ----------
    parts : sequence of Observations

    Returns
    -------
    Observations
        A second source of the same name is called ``NAME (2)``.

    Raises
    ------
    UsageError
        Nothing is given, or the same file is given twice.
    """
    import pandas as pd

    if not parts:
        raise UsageError("No data given: name at least one file or dataset.")
    if len(parts) == 1:
        return parts[0]
    tables: list[pd.DataFrame] = []
    sources: list[Source] = []
    notes: list[str] = []
    momentum: list[MomentumCheck] = []
    for part in parts:
        table, checks = part.table, part.momentum
        for source in part.sources:
            _refuse_duplicate(source, sources)
            name = _free_name(source.name, {s.name for s in sources})
            if name != source.name:
                table["source"] = table["source"].replace(source.name, name)
                checks = tuple(replace(c, source=name) if c.source == source.name else c for c in checks)
            sources.append(replace(source, name=name))
        tables.append(table)
        notes.extend(n for n in part.notes if n not in notes)
        momentum.extend(checks)
    table = pd.concat(tables, ignore_index=True)
    return Observations(table, tuple(sources), tuple(notes), tuple(momentum))


def _refuse_duplicate(source: Source, before: Sequence[Source]) -> None:
    for other in before:
        if source.sha256 and source.sha256 == other.sha256:
            same = source.name if source.name == other.name else f"{other.name} and {source.name}"
            raise UsageError(
                f"{same}: the same data are given twice and would be counted twice. Name them once."
            )


def _free_name(name: str, taken: set[str]) -> str:
    number = 2
    free = name
    while free in taken:
        free = f"{name} ({number})"
        number += 1
    return free
