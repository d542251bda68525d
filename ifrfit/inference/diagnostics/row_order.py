"""Whether the order of the rows may be that in which they were measured."""

from __future__ import annotations

import numpy as np

from ifrfit.inference.model.problem import Problem

_FEWEST_STEPS = 7  # that differ from 0, from which an order is told
_AGAINST = 0.05  # share of steps against the order, of a table that was sorted but for a few rows


def is_sorted_by_values(problem: Problem) -> bool:
    """Whether the values of an observable rise or fall along each series, nearly without exception.

    Such a table was sorted by it. A drift does not look so: readings of noise s that drift by d from row to
    row take a step back with the probability Phi(-d/(s sqrt 2)), which is over 5 % for d up to 2.3 s.
    """
    for observable in range(len(problem.rows.names)):
        up = down = 0
        for rows in problem.groups().values():
            if problem.rows.which[rows[0]] != observable:
                continue
            steps = np.diff(problem.rows.value[rows[np.argsort(problem.rows.impacts[rows], kind="stable")]])
            up, down = up + int((steps > 0.0).sum()), down + int((steps < 0.0).sum())
        if up + down >= _FEWEST_STEPS and min(up, down) <= _AGAINST * (up + down):
            return True
    return False
