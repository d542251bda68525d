"""A transition that so many impacts leave open that these are not held: narrow intervals stand for them, too.

Within an interval of tau condensed rows and impacts differ only by the kink of the closure, the less the
narrower it is. Intervals are parted until what this may change of minus twice the log likelihood, wherever
the transition lies, is proven to be small (docs/theory/sufficient-statistics.md, eq. 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.sufficient_statistics.accumulated import MOST_SUMS, Accumulated
from ifrfit.inference.sufficient_statistics.passes import Reader
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.transition_window import FAR, Question, Solved
from ifrfit.physics.compiled_incidence import PARTS

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_LARGEST_ERROR = 1e-3  # of minus twice the log likelihood: moves a mean by less than half of that in sd
_PASSES = 8
_MOST_LEVELS = 6  # by which an interval is parted at once


def solve_condensed(questions: Sequence[Question], reader: Reader) -> list[Solved]:
    """The problem of each question with its optimum, no impact of which stands for itself.

    Parameters
    ----------
    questions : sequence of Question
        Put to the same sums.
    reader : Reader
        Of the stream, which is read again for each finer set of intervals.

    Raises
    ------
    DataError
        Too many intervals would be needed.
    """
    for _ in range(_PASSES):
        of = questions[0].of
        none = np.zeros((len(of.series), of.intervals.count), dtype=bool)
        solved, levels = [], np.zeros(of.intervals.count, dtype=np.intp)
        for question in questions:
            problem = question.problem({}, none)
            optimum = least_squares(problem)
            value = question.value(problem, optimum.optimum.theta)
            needed = question.least_values < value + FAR
            sizes, misfits = (np.where(needed, each, 0.0) for each in question.kinks(value))
            # each series that has a transition of its own has an error of its own
            errors = _errors(sizes, misfits).max(axis=1)
            error = float(errors.max() if question.has_one_transition else errors.sum())
            solved.append(Solved(problem, optimum, needed, question, error))
            allowed = _LARGEST_ERROR / (1 if question.has_one_transition else len(of.series))
            levels = np.maximum(levels, _levels(sizes, misfits, allowed).max(axis=0))
        if all(found.error <= _LARGEST_ERROR for found in solved):
            return solved
        most = MOST_SUMS // len(of.groups)
        finer = _parted(of.intervals, levels)
        while finer.count > most and levels.any():
            levels = np.maximum(np.minimum(levels, levels.max() - 1), 0)
            finer = _parted(of.intervals, levels)
        if finer == of.intervals:
            break
        again = reader.accumulate(of.weighted, finer, _keeping_none)
        questions = [replace(question, of=again) for question in questions]
    raise DataError(
        f"{of.stream.path}: the data leave open where sliding ends, so much that {MOST_SUMS:,} sums by "
        f"intervals of {len(of.groups)} series and observables would not tell minus twice the log likelihood "
        f"to {_LARGEST_ERROR:g}. Fit a part of the data, as by --series or --observable, or say more by "
        "--fix, --prior or --bounds."
    )


def _errors(sizes: Array, misfits: Array) -> Array:
    """How far the value may be off, docs/theory/sufficient-statistics.md, eq. (5)."""
    return np.asarray(4.0 * sizes * (misfits + sizes) + sizes**2)


def _levels(sizes: Array, misfits: Array, allowed: float) -> Index:
    """How often each interval is to be parted, if the impacts in it are spread evenly, (series, bins)."""
    found = np.zeros(sizes.shape, dtype=np.intp)
    open_ = _errors(sizes, misfits) > allowed
    while open_.any() and found.max() < _MOST_LEVELS:
        found[open_] += 1
        sizes = sizes / PARTS**1.5  # weights and squares of distances are smaller
        misfits = np.sqrt(FAR + misfits**2 / PARTS)
        open_ = open_ & (_errors(sizes, misfits) > 0.5 * allowed)
    return found


def _parted(intervals: Intervals, levels: Index) -> Intervals:
    """Each interval parted so often."""
    while levels.any():
        intervals, former = intervals.part(levels > 0)
        levels = np.maximum(levels[former] - 1, 0)
    return intervals


def _keeping_none(found: Accumulated, coming: int) -> Accumulated:
    """No impact is kept by itself."""
    found.window.narrow(np.zeros(found.intervals.count, dtype=bool))
    return found
