"""Impacts that stand in a stream more than once, told from those that rounding alone makes alike."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.data.stream.copied_rows import SETTING, CopiedRows
from ifrfit.data.stream.row_places import places_of
from ifrfit.inference.diagnostics.copied_readings import AS_MANY
from ifrfit.inference.diagnostics.rounding_step import rounding_step
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.text import joined, p_text

Array = NDArray[np.float64]

_MOST_NAMED = 3
_CERTAIN = 3.0  # pairs of one setting that may be there where none was met, and sds of their number


@dataclass(frozen=True)
class CopiedImpacts:
    """What copies do.

    Attributes
    ----------
    fact : Fact
    effect : float
        Variance of a mean over that of one of as many independent impacts: sum of m^2 over that of m, where
        m is how often an impact stands there (Kish 1965, Survey Sampling, section 11.7, with weights m).
    """

    fact: Fact
    effect: float


def copied_impacts(of: Accumulated, problem: Problem, fit: LeastSquaresFit) -> CopiedImpacts | None:
    """Whether more impacts are alike in every decimal than rounding and noise make of different ones.

    Pairs of impacts that are alike are counted against pairs of one setting (angle and spins) that differ:
    of these, rounded to steps of r, the share r/(2 sqrt(pi) sigma) is alike in an observable, or as many as
    any two of its values are. The rule is that of `ifrfit.inference.diagnostics.copied_readings.duplicates`,
    by impacts that their own numbers choose, and asks for twice as many of each observable besides.

    Returns
    -------
    CopiedImpacts or None
        None where nothing is copied.
    """
    copies = of.copies
    copies.tidy()
    count = copies.counts
    alike = float((0.5 * count * (count - 1.0)).sum())
    if not alike:
        return None
    chance = _chance(of, copies, problem, fit)
    expected = _pairs_of_a_setting(copies) * chance / (1.0 - chance) if chance < 1.0 else math.inf
    # twice as many of each observable: noise that differs from impact to impact makes more of them alike
    if alike < AS_MANY ** len(of.stream.observables) * expected:
        return None
    p = float(special.gammainc(alike, expected)) if expected > 0.0 else 0.0
    if p >= REFUTED:
        return None
    share = float((count - 1.0).sum() / count.sum())
    rows = of.tally.rows
    numbers = [each for pair in copies.places(_MOST_NAMED) for each in pair]
    places = places_of(numbers, of.stream.portions, of.stream.path, of.tally.read)
    named = [f"{again} is {first}" for again, first in zip(places[::2], places[1::2], strict=True)]
    number = (
        f"{(count - 1.0).sum():,.0f}" if copies.holds_all else f"about {float(f'{share * rows:.2g}'):,.0f}"
    )
    effect = float((count**2).sum() / count.sum())
    says = (
        f"{number} of {rows:,} rows ({100.0 * share:.2g} %) are copies of others, alike in every decimal "
        f"({joined(named)}{' ...' if (count > 1).sum() > _MOST_NAMED else ''}; p = {p_text(p)} by noise and "
        "rounding): each is counted as an impact of its own, so that standard deviations are too small. "
        "Leave each impact in one row"
    )
    figures = {"p": p, "share": share, "effect": effect, "n": share * rows}
    return CopiedImpacts(Fact(False, says, figures, FACTS["duplicates"]), effect)


def _pairs_of_a_setting(copies: CopiedRows) -> float:
    """How many pairs of rows with another impact of the same setting there are, among those that are counted.

    Those that were met tell it where all impacts are counted; of some, there may be more.
    """
    count, setting = copies.counts, copies.settings()
    of_setting, different = np.bincount(setting, count), np.bincount(setting).astype(float)
    met = 0.5 * float((of_setting**2).sum() - (count**2).sum())
    if copies.holds_all or count.size < 2:
        return met
    pairs = 0.5 * float((different * (different - 1.0)).sum())
    rows_in_a_pair = met / pairs if pairs else float(count.mean()) ** 2
    most = pairs + _CERTAIN * (math.sqrt(pairs) + 1.0)
    return most * rows_in_a_pair * (copies.different - 1.0) / (count.size - 1.0)


def _chance(of: Accumulated, copies: CopiedRows, problem: Problem, fit: LeastSquaresFit) -> float:
    """Probability that two impacts of one setting are written alike."""
    chance = 1.0
    names = of.stream.observables
    table = problem.observations.table["observable"].to_numpy(dtype=object)
    for number, (name, values) in enumerate(zip(names, copies.values(), strict=True)):
        read = ~np.isnan(values)
        value = values[read]
        rows = np.flatnonzero(table == name)
        if value.size < 2 or not rows.size:
            continue
        setting, series = copies.impacts[:SETTING, read], np.zeros(value.size, dtype=np.intp)
        step = min(known.last_decimal for known in of.groups[number :: len(names)])
        step = max(step, rounding_step(value, list(setting), series))
        sigma = problem.noise.per_measurement(fit.sigma, rows)
        each = np.unique(value, return_counts=True)[1].astype(float)
        of_any = float((each * (each - 1.0)).sum()) / (value.size * (value.size - 1.0))
        chance *= min(1.0, max(step / (2.0 * math.sqrt(math.pi) * sigma), of_any))
    return chance
