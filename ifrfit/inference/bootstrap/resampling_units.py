"""Impacts, and which of them are of one kind: drawn for one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index


@dataclass(frozen=True)
class Kind:
    """Impacts of one series that measure the same things.

    Attributes
    ----------
    series : str
    observables : tuple of str
    impacts : ndarray of int
    """

    series: str
    observables: tuple[str, ...]
    impacts: Index

    def __str__(self) -> str:
        n = self.impacts.size
        return f"{n} impact{'' if n == 1 else 's'} with {', '.join(self.observables)} in {self.series}"


def number_impacts(problem: Problem) -> Index:
    """Impact of each row; a row without an impact_id is an impact of its own."""
    return Density(problem).impact


def kinds_of(problem: Problem, impact: Index) -> list[Kind]:
    """Sort impacts by series, and within it by what they measure.

    Impacts that share an observable are of one kind, and so are those that a third one links: a missing cell
    makes no kind of its own. An impact with rows in several series counts to that of its first row.
    """
    rows = problem.rows
    first = np.unique(impact, return_index=True)[1]
    series = rows.series[first]
    measures = np.zeros((first.size, len(rows.names)), dtype=bool)
    measures[impact, rows.which] = True
    kinds = []
    for number, name in enumerate(problem.series):
        left = np.flatnonzero(series == number)
        while left.size:
            seen = measures[left[0]]
            while True:
                linked = (measures[left] & seen).any(axis=1)
                wider = measures[left[linked]].any(axis=0)
                if (wider == seen).all():
                    break
                seen = wider
            observables = tuple(n for n, is_seen in zip(rows.names, seen, strict=True) if is_seen)
            kinds.append(Kind(name, observables, left[linked]))
            left = left[~linked]
    return kinds
