"""Choose the rows a fit uses: by observable, series, angle, speed and row, and never an impact twice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.derived_columns import contradictions
from ifrfit.data.double_counting import COUNTED_ALREADY, count, double_counted, shares_e_n
from ifrfit.data.observations import Observations, Source, word_of
from ifrfit.data.repeat_readings import repeat_readings
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.observables import OBSERVABLES

if TYPE_CHECKING:
    import pandas as pd


Mask = NDArray[np.bool_]
# column, unit and word of what a range is about
_CONDITIONS = {"gamma": ("gamma_deg", "degrees", "angle"), "speed": ("speed_m_s", "m/s", "speed")}


@dataclass(frozen=True)
class Selection:
    """What the user chose; empty or None means no restriction.

    Attributes
    ----------
    observable, series : tuple of str
        Only these.
    gamma_min, gamma_max : float or None
        Degrees from the normal, both ends included. Rows without an angle (e_n, mu) stay.
    speed_min, speed_max : float or None
        m/s, both ends included. Rows without a speed are left out.
    exclude : tuple of str or int
        Rows (``7``, ``impacts.csv:7``) or impacts (``drop 3``, ``id:7``).
    independent : bool
        Rows of the same impacts are used together: the user vouches that they are independent.
    """

    observable: tuple[str, ...] = ()
    series: tuple[str, ...] = ()
    gamma_min: float | None = None
    gamma_max: float | None = None
    speed_min: float | None = None
    speed_max: float | None = None
    exclude: tuple[str | int, ...] = ()
    independent: bool = False

    @property
    def ranges(self) -> dict[str, tuple[float | None, float | None]]:
        """Ends of the ranges that restrict the rows, by ``gamma`` and ``speed``."""
        both = {"gamma": (self.gamma_min, self.gamma_max), "speed": (self.speed_min, self.speed_max)}
        return {name: ends for name, ends in both.items() if ends != (None, None)}


def select(obs: Observations, selection: Selection) -> Observations:
    """Return the rows that were chosen, without counting any impact twice.

    Rows that share an impact_id, or whose series a descriptor declares to be faces of the same impacts, are
    used as far as they come from different measurements: at most one of the centre's velocity along the wall,
    one of the spin, one of the normal velocity. A descriptor's default selection holds where the user chose
    nothing; else measured velocities come first, then centre plus spin, beta, psi, mu_app, delta, beta_tot,
    lambda.

    Parameters
    ----------
    obs : Observations
    selection : Selection

    Returns
    -------
    Observations
        With notes on what was left out, and `Source.rows_used`, ``rows_skipped`` and ``selection`` brought up
        to date.

    Raises
    ------
    UsageError
        A name is unknown, a range is empty, or the observables or series named would count impacts twice.
    DataError
        Nothing is left.
    """
    table = obs.stored
    _check(table, selection)
    why = np.full(len(table), "", dtype=object)
    for reason, keep in _filters(table, selection):
        why[(why == "") & ~keep] = reason
    word = word_of(obs.sources)
    unwanted = [excluded(table, str(entry).strip(), word) for entry in selection.exclude]
    why[(why == "") & np.any(unwanted, axis=0)] = "excluded"
    if not np.any(why == ""):
        raise DataError(_nothing_left(why, selection))
    notes: list[str] = []
    redundant = None
    if not selection.independent:
        why[(why == "") & ~_default_selection(obs, table, selection, why == "", notes)] = "not selected"
        left = np.flatnonzero(why == "")
        rows = table if left.size == len(table) else table.iloc[left]
        faces = {s.name: s.descriptor.faces for s in obs.sources if s.descriptor}
        double, said = double_counted(rows, faces, selection.observable, selection.series)
        why[left[double]] = COUNTED_ALREADY
        notes.extend([*said, *contradictions(rows, double)])
        redundant = rows.loc[double].reset_index(drop=True) if double.any() else None
        left = left[~double]
        for repeat in repeat_readings(table.iloc[left]):
            why[left[repeat.rows]] = "read off twice"
            notes.append(repeat.said)
    keep = why == ""
    kept = table if keep.all() else table.loc[keep].reset_index(drop=True)
    notes.extend(shares_e_n(kept) if not selection.independent else [])
    sources = tuple(_update(source, table, why, selection) for source in obs.sources)
    return replace(obs, table=kept, sources=sources, redundant=redundant).with_note(*notes)


def _check(table: pd.DataFrame, selection: Selection) -> None:
    for option, names, column in (
        ("--observable", selection.observable, "observable"),
        ("--series", selection.series, "series"),
    ):
        there = list(dict.fromkeys(table[column].to_numpy())) if names else []
        for name in names:
            if name not in there:
                known = " It is known, but not among these data." if name in OBSERVABLES else ""
                raise UsageError(f"{option} {name}: not in the data.{known} There is {', '.join(there)}.")
    check_ranges(selection)


def check_ranges(selection: Selection) -> None:
    """Refuse ranges in which no number can lie.

    Raises
    ------
    UsageError
        An end is nan, or the lower one above the upper.
    """
    for name, (low, high) in selection.ranges.items():
        if any(x is not None and np.isnan(x) for x in (low, high)):
            raise UsageError(f"--{name}-min and --{name}-max need numbers, not nan.")
        if low is not None and high is not None and low > high:
            raise UsageError(f"--{name}-min {low:g} is above --{name}-max {high:g}: no row can lie between.")


def _filters(table: pd.DataFrame, selection: Selection) -> list[tuple[str, Mask]]:
    filters: list[tuple[str, Mask]] = []
    for names, column in ((selection.observable, "observable"), (selection.series, "series")):
        if names:
            filters.append(("not selected", table[column].isin(names).to_numpy()))
    for name, (low, high) in selection.ranges.items():
        values = table[_CONDITIONS[name][0]].to_numpy()
        if name == "speed":
            filters.append(("no speed given", ~np.isnan(values)))
        outside = (values < (-np.inf if low is None else low)) | (values > (np.inf if high is None else high))
        filters.append((f"outside {name} range", ~outside))
    return filters


def _default_selection(
    obs: Observations, table: pd.DataFrame, selection: Selection, left: Mask, notes: list[str]
) -> Mask:
    """Apply each descriptor's default for what the user did not choose, if that leaves anything."""
    keep = np.ones(len(table), dtype=bool)
    for source in obs.sources:
        if source.descriptor is None:
            continue
        here = left & (table["source"] == source.name).to_numpy()
        for column, chosen, default in (
            ("series", selection.series, source.descriptor.default_series),
            ("observable", selection.observable, source.descriptor.default_observables),
        ):
            wanted = table[column].isin(default).to_numpy()
            if chosen or not default or not np.any(here & keep & wanted):
                continue
            dropped = list(dict.fromkeys(table.loc[here & keep & ~wanted, column]))
            keep &= ~here | wanted
            if dropped:
                verb = "is" if len(default) == 1 else "are"
                notes.append(
                    f"{source.name}: by default only {', '.join(default)} {verb} used, {', '.join(dropped)} "
                    f"left out. --{column} chooses otherwise."
                )
    return keep


def _nothing_left(why: NDArray[np.object_], selection: Selection) -> str:
    options = {"not selected": "--observable and --series together", "excluded": "--exclude"}
    for name, ends in selection.ranges.items():
        _, unit, what = _CONDITIONS[name]
        options[f"outside {name} range"] = f"the {what} range ({_range(*ends)} {unit})"
        options[f"no {name} given"] = f"the {what} range ({_range(*ends)} {unit}), as the {what} is not given"
    what = "; ".join(f"{options[reason]} ({count(number)})" for reason, number in Counter(why).items())
    return f"No row is left. Removed by {what}; choose a wider one."


def _range(low: float | None, high: float | None) -> str:
    if low is None:
        return "any" if high is None else f"up to {high:g}"
    return f"from {low:g}" if high is None else f"{low:g} to {high:g}"


def _update(source: Source, table: pd.DataFrame, why: NDArray[np.object_], selection: Selection) -> Source:
    here = table["source"].to_numpy(dtype=object) == source.name  # a tenth of the time of comparing columns
    skipped = Counter(dict(source.rows_skipped))
    skipped.update(why[here & (why != "")])
    used = table.loc[here & (why == "")]
    words = []
    if len(used) < int(here.sum()):
        words.append("observable " + ", ".join(dict.fromkeys(used["observable"])))
        words.append("series " + ", ".join(dict.fromkeys(used["series"])))
    words += [f"{name} {_range(*ends)} {_CONDITIONS[name][1]}" for name, ends in selection.ranges.items()]
    if selection.exclude:
        words.append("without " + ", ".join(map(str, selection.exclude)))
    if selection.independent:
        words.append("rows of the same impacts taken as independent")
    text = ("; ".join(words) or source.selection) if len(used) else "nothing"
    return replace(source, rows_used=len(used), rows_skipped=dict(skipped), selection=text)


NO_SIGMA = "without a sigma, beside others that have one"


def rows_with_sigma(obs: Observations) -> Observations:
    """Leave rows without a sigma out where most of their series and observable have one.

    What sets such a row apart may be its noise, which one row cannot tell; the sigma of the others holds for
    them all the same. Where most lack it, what is given is used for none of them, and a note says so; where
    no row of a series and observable has a sigma, all of them stay.

    Parameters
    ----------
    obs : Observations

    Returns
    -------
    Observations
        With `Source.rows_used` and ``rows_skipped`` brought up to date.
    """
    table = obs.table
    sigma = table["sigma"].to_numpy(dtype=float).copy()
    given = np.isfinite(sigma)
    if given.all() or not given.any():
        return obs
    kinds = [table["series"].to_numpy(dtype=object), table["observable"].to_numpy(dtype=object)]
    lacks = np.zeros(len(table), dtype=bool)
    notes = []
    for series, observable in dict.fromkeys(zip(*kinds, strict=True)):
        rows = np.flatnonzero((kinds[0] == series) & (kinds[1] == observable))
        known = int(np.count_nonzero(given[rows]))
        if not 0 < known < rows.size:
            continue
        if 2 * known < rows.size:
            first = table.iloc[rows[~given[rows]][0]]
            notes.append(_used_for_none(first, word_of(obs.sources, first["source"]), known, rows.size))
            sigma[rows] = np.nan
        else:
            lacks[rows] = ~given[rows]
    if not (lacks.any() or notes):
        return obs
    why = np.where(lacks, NO_SIGMA, "").astype(object)
    sources = tuple(_counted(source, table, why) for source in obs.sources)
    kept = table.assign(sigma=sigma).loc[~lacks].reset_index(drop=True)
    return replace(obs, table=kept, sources=sources).with_note(*notes)


def _used_for_none(first: Mapping[str, Any], word: str, known: int, n: int) -> str:
    """What is said where most values of a series and observable lack the sigma that others have."""
    return (
        f"{first['source']}, {word} {first['row']}: no sigma, and only {known} of {n} values of "
        f"{first['observable']} in {first['series']} have one, which is not used: the noise of all comes "
        "from the misfit. Give it to the others, or leave them out."
    )


def _counted(source: Source, table: pd.DataFrame, why: NDArray[np.object_]) -> Source:
    """A source whose rows were left out further, as its counts have it."""
    here = table["source"].to_numpy(dtype=object) == source.name
    skipped = Counter(dict(source.rows_skipped))
    skipped.update(why[here & (why != "")])
    return replace(source, rows_used=int(np.count_nonzero(here & (why == ""))), rows_skipped=dict(skipped))


def excluded(table: pd.DataFrame, entry: str, word: str = "line") -> Mask:
    """Return which rows an entry names: ``7`` or ``FILE:7`` is a line, ``id:7`` or other text an impact_id.

    Parameters
    ----------
    table : DataFrame
    entry : str
    word : {"line", "row"}
        What a number counts, in messages.

    Raises
    ------
    UsageError
        It names nothing, or could mean more than one thing.
    """
    impacts = (table["impact_id"] == entry).to_numpy() & (entry != "")
    if entry.startswith("id:") and not impacts.any():
        impacts = (table["impact_id"] == entry[3:]).to_numpy()
        rows = np.zeros(len(table), dtype=bool)
    else:
        rows = _rows(table, entry, word)
    both = bool(rows.any() and impacts.any())
    if both and not np.array_equal(rows, impacts):
        name = table["source"].to_numpy()[rows][0]
        raise UsageError(
            f"--exclude {entry}: could be {word} {entry} or the impact called {entry}. Write {name}:{entry} "
            f"for the {word}, id:{entry} for the impact."
        )
    found = rows | impacts
    if not found.any():
        where = "line of the file, FILE:LINE" if word == "line" else "row of the table, TABLE:ROW"
        raise UsageError(
            f"--exclude {entry}: names no row and no impact of the data. Give the number of a {where}, or an "
            "impact_id."
        )
    return found


def _rows(table: pd.DataFrame, entry: str, word: str) -> Mask:
    source, colon, number = entry.rpartition(":")
    if not number.isdecimal():
        return np.zeros(len(table), dtype=bool)
    here = (table["row"] == int(number)).to_numpy()
    if colon:
        # a path works as well as the name of the file, which is what the table keeps
        name = source.replace("\\", "/").rsplit("/", 1)[-1]
        return here & table["source"].isin([source, name]).to_numpy()
    sources = list(dict.fromkeys(table["source"].to_numpy()[here]))
    if len(sources) > 1:
        raise UsageError(
            f"--exclude {entry}: there is a {word} {entry} in {' and in '.join(sources)}. Write "
            f"{sources[0]}:{entry}."
        )
    return here
