"""Readings that pile up where a sensor, a camera or a record has its end.

Clipped readings are equal to the largest or smallest one of their observable, in the units in which they were
read. Of speeds before impact no law says how often one repeats, and some are set: there an end is one where
what is read after the impact scatters more than elsewhere, by the errors of speeds that truly lie beyond.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from ifrfit.data.observations import word_of
from ifrfit.inference.diagnostics.as_read import as_read, without_last_bits
from ifrfit.inference.diagnostics.residuals import exclude_name
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Bool, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_FEWEST_PILED = 3  # readings of one value that pile up
_MORE = 2.0  # times as many as of any value that is no end
_RESOLVED = 2.0  # steps by which the other readings scatter
# impacts at the largest speed from which it may be an end, their share of all, and that of different others
_MANY, _SHARE, _SHARE_OF_OTHERS = 4, 0.1, 0.7
_MOST_NAMED = 6  # rows


def censoring(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Look for readings that pile up at the largest or smallest value of their observable, or of a speed.

    The number of readings that rounding and noise put into the cell of the outermost one is taken as Poisson
    distributed.

    Returns
    -------
    Fact or None
        None where none do.
    """
    every = list(as_read(problem, found))
    looks = 2 * len(every)
    for readings in every:
        given, counts = np.unique(readings.value, return_counts=True)
        elsewhere = int(counts[1:-1].max(initial=1))
        for end, word in ((-1, "largest"), (0, "smallest")):
            at, count = float(given[end]), int(counts[end])
            rest = readings.value != at
            if count < _FEWEST_PILED or count <= _MORE * elsewhere or not rest.any():
                continue
            scatter = float(np.sqrt(((readings.value - readings.fitted)[rest] ** 2).mean()))
            if scatter < _RESOLVED * readings.step:
                continue
            expected = readings.expected(at, 0.5 * readings.step)
            p = min(1.0, looks * float(special.gammainc(count - 1, expected)))
            if p < REFUTED:
                says = (
                    f"{count} of {readings.rows.size} values of {readings.words} are {at:.6g} exactly, the "
                    f"{word} of all (p = {p_text(p)} by rounding and noise): values beyond look clipped, and "
                    "the constants are off by as much as they miss. Give them as they were read, or leave "
                    "out whole settings, those at which noise reaches that value (not these impacts alone)"
                )
                figures = {"observable": readings.observable, "value": at, "n": count, "p": p}
                return Fact(False, says, figures, FACTS["censoring"])
    return _end_of_speeds(problem, found)


def _end_of_speeds(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Impacts of the largest speed before where readings scatter more than in the others."""
    rows, speed = problem.rows, problem.speeds
    residual = (rows.value - problem.predict(found.optimum.theta)) / found.sigma
    parts = {
        "speed": speed,
        "speed along the wall": speed * rows.incidence.sine,
        "speed across the wall": speed * rows.incidence.cosine,
    }
    looks = len(parts) * len(rows.names)
    for words, value in parts.items():
        at_end = _pile(value, rows.impacts)
        if at_end is None:
            continue
        for name in rows.names:
            own = rows.which == rows.names.index(name)
            p, ratio = _scatter_more(residual[own & at_end], residual[own & ~at_end])
            p = min(1.0, looks * p)
            if p < REFUTED:
                size = float(value[at_end].max())
                lines = [
                    exclude_name(problem, i) for i in np.flatnonzero(own & at_end)[:_MOST_NAMED].tolist()
                ]
                count = np.unique(rows.impacts[at_end]).size
                named = f"{word_of(problem.observations.sources)}s {joined(lines)}"
                says = (
                    f"{count} impacts have the largest {words} before, {size:.4g} m/s exactly, and {name} "
                    f"scatters {ratio:.2g} times as much in them as in the others (p = {p_text(p)}): a "
                    "sensor or a camera seems to end there, and true speeds lie beyond. Leave these out "
                    f"({named}{' ...' if count > _MOST_NAMED else ''})"
                )
                figures = {"observable": name, "value": size, "n": int(count), "p": p}
                return Fact(False, says, figures, FACTS["censoring"])
    return None


def _pile(value: Array, impacts: Index) -> Bool | None:
    """Rows of the impacts at the largest value, where many are and the others hardly repeat."""
    _, first = np.unique(impacts, return_index=True)
    known = first[np.isfinite(value[first])]
    if not known.size:
        return None
    value = without_last_bits(np.where(np.isfinite(value), value, 0.0))
    largest = float(value[known].max())
    others = value[known][value[known] != largest]
    count = known.size - others.size
    if count < max(_MANY, _SHARE * known.size) or np.unique(others).size < _SHARE_OF_OTHERS * others.size:
        return None
    return np.asarray(value == largest) if others.size else None


def _scatter_more(here: Array, elsewhere: Array) -> tuple[float, float]:
    """p that residuals scatter as much as others, against more (F), and the ratio of their scatter."""
    if here.size < _MANY or elsewhere.size < _MANY:
        return 1.0, 1.0
    rest = float(elsewhere.var(ddof=1))
    if rest <= 0.0:
        return 1.0, 1.0
    ratio = float(here.var(ddof=1)) / rest
    return float(special.fdtrc(here.size - 1, elsewhere.size - 1, ratio)), float(np.sqrt(ratio))
