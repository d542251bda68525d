"""Impacts that stand in a table several times: alike in every decimal, beyond what rounding explains."""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.outliers import exclude_name
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.noise import resolution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_MOST_NAMED = 6  # rows


def duplicates(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Count impacts of one setting whose values agree, and compare with what noise and rounding make of them.

    Two readings of one setting agree with probability r/(2 sqrt(pi) sigma) in an observable that is rounded
    to steps of r; the number of pairs that do is taken as Poisson distributed. Repeats of single readings are
    left out: what steps an instrument has is not known.

    Returns
    -------
    Fact or None
        None where the test is passed.
    """
    rows = problem.rows
    chance = _chance_to_agree(problem, found.sigma)
    speed = np.nan_to_num(problem.observations.table["speed_m_s"].to_numpy(dtype=float), nan=-1.0)
    i = rows.incidence
    keys = np.column_stack((rows.series, rows.which, rows.gamma_deg, i.spin_x, i.spin_y, speed))
    members: dict[int, list[int]] = {}
    for row, impact in enumerate(rows.impacts.tolist()):
        members.setdefault(impact, []).append(row)
    settings: dict[tuple[object, ...], list[list[int]]] = {}
    for own in members.values():
        own.sort(key=lambda row: tuple(keys[row]))
        settings.setdefault(tuple(map(tuple, keys[own].tolist())), []).append(own)
    repeated = [impacts for impacts in settings.values() if len(impacts) > 1]
    if any(len(own[0]) == 1 and np.ptp(rows.value[own]) > 0.0 for own in map(np.array, repeated)):
        # single readings that are repeated: an instrument's own steps may be coarser than the last decimal
        repeated = [impacts for impacts in repeated if len(impacts[0]) > 1]
    expected, pairs, copies = 0.0, 0, []
    for impacts in repeated:
        expected += 0.5 * len(impacts) * (len(impacts) - 1) * float(np.prod(chance[impacts[0]]))
        first: dict[tuple[float, ...], int] = {}
        for own in impacts:
            value = tuple(rows.value[own].tolist())
            pairs += first.get(value, 0)
            first[value] = first.get(value, 0) + 1
            if first[value] > 1:
                copies.append(own[0])
    p = float(special.gammainc(pairs, expected)) if pairs and expected > 0.0 else 1.0
    if p >= REFUTED:
        return None
    return _fact(problem, copies, p)


def _chance_to_agree(problem: Problem, sigma: Array) -> Array:
    """Probability that two readings of one setting are rounded to the same number, by row, (n,)."""
    chance = np.empty(sigma.size)
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        step = resolution(problem.rows.value[own])
        chance[own] = np.minimum(1.0, step / (2.0 * math.sqrt(math.pi) * sigma[own]))
    return chance


def _fact(problem: Problem, copies: list[int], p: float) -> Fact:
    lines = [exclude_name(problem, row) for row in copies]
    more = " ..." if len(lines) > _MOST_NAMED else ""
    shown = lines[:_MOST_NAMED]
    says = (
        f"{len(lines)} impact{'s stand' if len(lines) > 1 else ' stands'} in the table twice, alike in every "
        f"decimal (lines {joined(shown)}{more}; p = {p_text(p)} by noise and rounding): remove them, or "
        f"{' '.join(f'--exclude {line}' for line in shown)}{more}"
    )
    return Fact(False, says, {"p": p, "n": len(lines), "rows": lines}, FACTS["duplicates"])
