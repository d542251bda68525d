"""Numbers that stand for several readings: copied down or into a gap, and impacts that stand in two lines."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy import special

from ifrfit.data.observations import word_of
from ifrfit.inference.diagnostics.as_read import as_read
from ifrfit.inference.diagnostics.residuals import exclude_name
from ifrfit.inference.diagnostics.rounding_step import step_of_readings
from ifrfit.inference.diagnostics.thresholds import FACTS, FEWEST_ALIKE, REFUTED
from ifrfit.inference.model.noise import resolution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index, numbered
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_MOST_NAMED = 6  # rows
_FEWEST_FILLED = 3  # cells of one number that may be the mean of the others
_MORE = 2.0  # times as many as of any other number
AS_MANY = 2.0  # as many impacts alike as expected, whose number is known from the scatter of a fit


def repeated_number(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Find one number in the place of readings: of the rebound in every row, a mean in gaps or a last line.

    Returns
    -------
    Fact or None
        None where there is none. Figures: observables, and rows of the first.
    """
    copied = list(_copied_down(problem))
    says = []
    if copied:
        says = [
            f"{'; '.join(says for *_, says in copied)}: a mean that was copied down is one reading, not "
            f"{copied[0][1]}, and the interval of e_n is too short; leave it in one row, with its standard "
            "error, or give it by --prior. Readings of each impact would scatter, unless they are rounded "
            "too coarsely to show it"
        ]
    filled = list(_filled_in(problem, found))
    if filled:
        says.append(
            f"{'; '.join(says for *_, says in filled)}: the mean that fills a gap is no reading, and moves "
            "the constants and shortens their intervals. Leave these cells empty"
        )
    summaries = list(_summary_rows(problem))
    if summaries:
        says.append(
            f"{'; '.join(says for *_, says in summaries)}: a line under the table that holds the mean of its "
            "columns is no impact. Leave it out, --exclude LINE"
        )
    if not says:
        return None
    every = [*copied, *filled, *summaries]
    figures = {"observables": sorted({name for name, *_ in every}), "rows": every[0][1]}
    return Fact(False, "; ".join(says), figures, FACTS["repeated_number"])


def _copied_down(problem: Problem) -> Iterator[tuple[str, int, str]]:
    """Observable, rows, and words of measured readings that are the same in every row of a series."""
    rows, table = problem.rows, problem.observations.table
    measured = (table["provenance"] != "simulated").to_numpy()
    several = len(problem.series) > 1
    for observable in rows.observables:
        if observable.kind != "normal":
            continue
        for number, series in enumerate(problem.series):
            own = rows.rows_of(observable.name)
            own = own[(rows.series[own] == number) & measured[own]]
            if own.size >= FEWEST_ALIKE and np.ptp(rows.value[own]) == 0.0:
                of = f" of {series}" if several else ""
                says = f"{observable.name}{of} is {rows.value[own[0]]:.6g} in all {own.size} rows"
                yield observable.name, int(own.size), says


def _filled_in(problem: Problem, found: LeastSquaresFit) -> Iterator[tuple[str, int, str]]:
    """Observable, rows, and words of readings that are equal to one another and to the mean of all others.

    The mean is that of the table or of a series. The number that rounding and noise put into its cell is
    taken as Poisson distributed; the cells beside it count, too, as means are rounded.
    """
    every = list(as_read(problem, found))
    series = [np.ones(len(problem.rows), dtype=bool)]
    if len(problem.series) > 1:
        series += [problem.rows.series == number for number in range(len(problem.series))]
    looks = 3 * len(every) * len(series)
    seen: set[str] = set()
    for own in series:
        for readings in every:
            value = readings.value[own[readings.rows]]
            given, counts = np.unique(value, return_counts=True)
            if given.size <= FEWEST_ALIKE or readings.observable in seen:
                continue
            at, count = float(given[np.argmax(counts)]), int(counts.max())
            if count < _FEWEST_FILLED or count <= _MORE * int(np.sort(counts)[-2]):
                continue
            if abs(at - float(value[value != at].mean())) > readings.step:
                continue
            p = looks * float(special.gammainc(count, readings.expected(at, 0.5 * readings.step)))
            if p < REFUTED:
                seen.add(readings.observable)
                rows = readings.rows[own[readings.rows] & (readings.value == at)]
                those = f"{word_of(problem.observations.sources)}s {_lines(problem, rows.tolist())}"
                says = (
                    f"{count} of {value.size} values of {readings.words} are {at:.6g} exactly, the mean of "
                    f"all others ({those}; p = {p_text(p)} by noise)"
                )
                yield readings.observable, count, says


def _summary_rows(problem: Problem) -> Iterator[tuple[str, int, str]]:
    """Observable, readings, and words of a last line of a table or series that is the mean of those above.

    Angle, values and speed are to be those means, as far as their decimals go; that noise makes them so has
    the probability of as many steps of the last decimal, in sd, about the mean of a normal distribution.
    """
    import pandas as pd

    rows, table = problem.rows, problem.observations.table
    (source, _), line = pd.factorize(table["source"]), table["row"].to_numpy()
    numbers = {"gamma_deg": rows.gamma_deg, "value": rows.value, "speed": problem.speeds}
    parts = [source == number for number in range(source.max(initial=0) + 1)]
    if len(problem.series) > 1:
        parts += [part & (rows.series == number) for part in parts for number in range(len(problem.series))]
    for part in parts:
        last = part & (line == line[part].max(initial=0))
        p = float(len(parts))
        for place in np.flatnonzero(last).tolist():
            above = part & ~last & (rows.which == rows.which[place])
            if np.count_nonzero(above) < FEWEST_ALIKE:
                p = math.inf
                break
            for each in numbers.values():
                others, sd = each[above], float(np.std(each[above]))
                if np.isfinite(others).all() and sd > 0.0:
                    step = resolution(each[above | last])
                    is_mean = abs(float(others.mean() - each[place])) <= 0.51 * step
                    p *= min(step / (sd * math.sqrt(2.0 * math.pi)), 1.0) if is_mean else math.inf
        if p < REFUTED:
            place = int(np.flatnonzero(last)[0])
            count, name = np.unique(line[part]).size - 1, exclude_name(problem, place)
            word = word_of(problem.observations.sources)
            says = f"{word} {name} is the mean of the {count} {word}s above it (p = {p_text(p)} by chance)"
            yield rows.names[rows.which[place]], int(last.sum()), says


def _lines(problem: Problem, rows: list[int]) -> str:
    """The first lines that rows stand in."""
    shown = joined([exclude_name(problem, row) for row in rows[:_MOST_NAMED]])
    return f"{shown} ..." if len(rows) > _MOST_NAMED else shown


def duplicates(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Count impacts of one setting whose values agree, and compare with what noise and rounding make of them.

    Two readings of one setting agree with probability r/(2 sqrt(pi) sigma) in an observable that is rounded
    to steps of r; the number of pairs that do is taken as Poisson distributed. Where the noise differs from
    impact to impact more of them do: about half as many as differ by one step in one observable. No
    fewer than twice what is expected are called copies. Of repeats of single readings
    but those of two series count, in their order, and each agrees as often as any two readings do at least:
    what steps an instrument has is not known.

    Returns
    -------
    Fact or None
        None where the test is passed.
    """
    rows, i = problem.rows, problem.rows.incidence
    chance = _chance_to_agree(problem, found.sigma)
    speed = np.nan_to_num(problem.speeds, nan=-1.0)
    key = numbered(rows.which, rows.gamma_deg, i.spin_x, i.spin_y, speed)
    order = np.lexsort((key, rows.impacts))
    count = np.bincount(rows.impacts)[rows.impacts[order]]
    expected, pairs, beside = 0.0, 0, 0.0
    copies: list[tuple[int, int]] = []
    for size in np.unique(count).tolist():
        own = order[count == size].reshape(-1, size)  # rows of each impact, in the same order of all
        setting = numbered(*key[own].T)
        own, setting = _several(own, setting)
        if size == 1 and numbered(setting, rows.value[own[:, 0]]).max(initial=-1) > setting.max(initial=-1):
            # single readings, repeated: steps of an instrument may be coarser than the last decimal
            series = rows.series[own[:, 0]]
            own, setting = _several(own, numbered(setting, _place(numbered(setting, series))))
            chance = np.maximum(chance, _share_alike(problem))
        if not len(own):
            continue
        group = numbered(setting)
        among = np.bincount(group)
        alike_by_chance = np.bincount(group, chance[own].prod(axis=1)) / among
        expected += float((0.5 * among * (among - 1)) @ alike_by_chance)
        _, once, alike = np.unique(
            numbered(setting, *rows.value[own].T), return_index=True, return_inverse=True
        )
        equal = np.bincount(alike)
        pairs += int((equal * (equal - 1) // 2).sum())
        beside += _pairs_beside(problem, own, setting)
        again = np.delete(np.arange(len(own)), once)
        copies += zip(own[once[alike[again]], 0].tolist(), own[again, 0].tolist(), strict=True)
    expected = max(expected, beside)
    p = float(special.gammainc(pairs, expected)) if pairs and expected > 0.0 else 1.0
    if p >= REFUTED or pairs < AS_MANY * expected:
        return None
    return _doubled(problem, sorted(copies, key=lambda pair: pair[1]), p)


def _several(own: Index, setting: Index) -> tuple[Index, Index]:
    """The impacts whose setting others have, too."""
    among = np.bincount(setting)[setting] > 1
    return own[among], setting[among]


def _place(group: Index) -> Index:
    """Place of each among those of its group, in their order, from 0."""
    order = np.argsort(group, kind="stable")
    start = np.concatenate(([0], np.cumsum(np.bincount(group))))
    place = np.empty_like(group)
    place[order] = np.arange(group.size) - start[group[order]]
    return place


def _pairs_beside(problem: Problem, own: Index, setting: Index) -> float:
    """Half of the pairs of impacts of one setting that differ by one step in one observable, the most of any.

    As many as are equal, where values scatter over several steps.
    """
    values = problem.rows.value[own]
    most = 0.0
    for column in range(values.shape[1]):
        step = step_of_readings(problem, own[:, column])
        ranks = np.rint(values[:, column] / step)
        others = np.delete(values, column, axis=1)
        rest = numbered(setting, *others.T)
        key = numbered(np.tile(rest, 2), np.concatenate((ranks, ranks + 1.0)))
        here, below = np.bincount(key[: len(own)], minlength=key.max() + 1), np.bincount(key[len(own) :])
        most = max(most, float(here[: below.size] @ below))
    return 0.5 * most


def _share_alike(problem: Problem) -> Array:
    """Share of the pairs of readings of an observable that are equal, at any settings, by row, (n,)."""
    share = np.ones(len(problem.rows))
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        count = np.unique(problem.rows.value[own], return_counts=True)[1]
        share[own] = float((count * (count - 1)).sum()) / max(own.size * (own.size - 1), 1)
    return share


def _chance_to_agree(problem: Problem, sigma: Array) -> Array:
    """Probability that two readings of one setting are rounded to the same number, by row, (n,)."""
    chance = np.empty(sigma.size)
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        of_all = step_of_readings(problem, own)
        order = own[np.argsort(problem.rows.series[own], kind="stable")]
        # an instrument may be one of a series
        for part in np.split(order, np.flatnonzero(np.diff(problem.rows.series[order])) + 1):
            step = max(of_all, step_of_readings(problem, part))
            chance[part] = np.minimum(1.0, step / (2.0 * math.sqrt(math.pi) * sigma[part]))
    return chance


def _doubled(problem: Problem, copies: list[tuple[int, int]], p: float) -> Fact:
    """The fact, from first rows of impacts and of those that are the same."""
    rows, count = problem.rows, len(copies)
    lines = [exclude_name(problem, row) for _, row in copies]
    more = " ..." if count > _MOST_NAMED else ""
    shown = lines[:_MOST_NAMED]
    series = {(int(rows.series[one]), int(rows.series[other])) for one, other in copies}
    one, other = (problem.series[number] for number in min(series))
    stand = f"{count} impact{'s stand' if count > 1 else ' stands'} in the table twice"
    if len(series) == 1 and one != other:
        whole = np.unique(rows.impacts[rows.series == min(series)[1]]).size == count
        stand = (
            f"{'all ' if whole else ''}{count} impact{'s' if count > 1 else ''} of {other} are those of {one}"
        )
    alone = stand.startswith("all") and len(problem.series) == 2
    remedy = f"--series {one}" if alone else " ".join(f"--exclude {line}" for line in shown) + more
    where = f"{word_of(problem.observations.sources)}s {joined(shown)}{more}"
    says = (
        f"{stand}, alike in every decimal ({where}; p = {p_text(p)} by noise and "
        f"rounding): remove them, or {remedy}"
    )
    return Fact(False, says, {"p": p, "n": count, "rows": lines}, FACTS["duplicates"])
