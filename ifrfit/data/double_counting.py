"""No impact is counted twice: centre velocity and spin are measured, what is computed from them is not.

Each observable takes up measurements of its impact (`Observable.takes`): the centre's velocity along the
wall, the spin, the normal velocity after. In the order of `OBSERVABLES`, an observable is used if all it
takes is still free.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.physics.observables import OBSERVABLES

if TYPE_CHECKING:
    import pandas as pd

Mask = NDArray[np.bool_]

COUNTED_ALREADY = "same impacts counted already"  # why a value is left out
_NORMAL = ("e_n", "v_n")
_BIT = {"Tx": 1, "Ty": 2, "Sx": 4, "Sy": 8, "N": 16}


def double_counted(
    table: pd.DataFrame,
    faces: Mapping[str, Sequence[Sequence[str]]],
    observable: Sequence[str],
    series: Sequence[str],
) -> tuple[Mask, list[str]]:
    """Find the rows that would count an impact a second time.

    Parameters
    ----------
    table : DataFrame
        Rows that are left after the user's choice.
    faces : mapping of str to groups of str
        By source: series that are faces or repeat readings of the same impacts.
    observable, series : sequence of str
        What the user named; a conflict among these is refused rather than resolved.

    Returns
    -------
    double : (n,) bool array
    notes : list of str

    Raises
    ------
    UsageError
        Observables or series that were named would count impacts twice.
    """
    impacts = impact_numbers(table)
    if not any(faces.values()) and not (impacts >= 0).any():
        return np.zeros(len(table), dtype=bool), []
    names = table["observable"].to_numpy(dtype=object)
    labels = table["series"].to_numpy(dtype=object)
    named = (("--observable", observable, names), ("--series", series, labels))
    double = np.zeros(len(table), dtype=bool)
    for source, groups in faces.items():
        here = (table["source"] == source).to_numpy()
        for group in groups:
            members = here & table["series"].isin(list(group)).to_numpy()
            links = np.where(members, 0, -1)
            later = _taken(links, names, labels)
            if later.any():
                _refuse_named(table, links, named)
            double |= later
    within = _taken(np.where(double, -1, impacts), names, np.arange(len(table)))
    if within.any():
        _refuse_named(table, impacts, named)
    double |= within
    return double, _notes(table, names, labels, double)


class TakenMeasurements:
    """Which measurements of each impact are taken up, while observables come in the order of `OBSERVABLES`.

    Parameters
    ----------
    impacts : int
        How many.
    """

    def __init__(self, impacts: int) -> None:
        self._bits = np.zeros(impacts, dtype=np.uint8)

    def take(self, name: str, impacts: NDArray[np.intp]) -> Mask:
        """Let an observable take up all it takes of some impacts, as far as all of it is free.

        Parameters
        ----------
        name : str
        impacts : ndarray of int, (k,)
            By number; one that stands there several times is treated alike each time.

        Returns
        -------
        ndarray of bool, (k,)
            Whether it was free.
        """
        bits = np.uint8(_bits_of(name))
        free: Mask = (self._bits[impacts] & bits) == 0
        self._bits[impacts[free]] |= bits
        return free


def without_double_counting(names: Collection[str]) -> tuple[list[str], list[str]]:
    """Observables of one impact that count it once, in the order of `OBSERVABLES`, and the others."""
    taken, impact = TakenMeasurements(1), np.zeros(1, dtype=np.intp)
    used: list[str] = []
    others: list[str] = []
    for name in (each for each in OBSERVABLES if each in names):
        (used if taken.take(name, impact).all() else others).append(name)
    return used, others


def _bits_of(name: str) -> int:
    """Which measurements an observable takes up, as bits."""
    return sum(_BIT[slot] for slot in OBSERVABLES[name].takes)


def _taken(links: NDArray[np.int64], names: NDArray[np.object_], readings: NDArray[Any]) -> Mask:
    """Go through the observables in order and keep, impact by impact, what is not yet taken up.

    Parameters
    ----------
    links : (n,) int array
        Impact of each row, or the faces it belongs to, which need not share angles or identifiers; -1 for
        none.
    names : (n,) object array
        Observable of each row.
    readings : (n,) array
        Rows of one reading stay together.
    """
    out = np.zeros(len(names), dtype=bool)
    taken = TakenMeasurements(int(links.max(initial=-1)) + 1)
    for name in (o for o in OBSERVABLES if _bits_of(o)):
        rows = np.flatnonzero((links >= 0) & (names == name))
        if not rows.size:
            continue
        _, first, which = np.unique(links[rows], return_index=True, return_inverse=True)
        same = readings[rows] == readings[rows[first]][which]
        out[rows] = True
        out[rows[same]] = ~taken.take(name, links[rows[same]])
    return out


def _refuse_named(
    table: pd.DataFrame,
    links: NDArray[np.int64],
    named: Sequence[tuple[str, Sequence[str], NDArray[np.object_]]],
) -> None:
    """Refuse a conflict among several observables, or several series, that the user named."""
    bits = table["observable"].map(_bits_of).to_numpy(dtype=np.uint8)
    for option, chosen, column in named:
        if len(set(chosen)) < 2:
            continue
        found = _same_measurement(links, bits, column)
        if found is not None:
            here, values = found
            where = f"{table['source'].iloc[here]}:{table['row'].iloc[here]}"
            raise UsageError(
                f"{option} {' '.join(chosen)}: {' and '.join(values)} are of the same impacts ({where}, for "
                "one) and would count them twice. Name one of them, or say --independent if they were "
                "measured independently."
            )


def _same_measurement(
    links: NDArray[np.int64], bits: NDArray[np.uint8], column: NDArray[np.object_]
) -> tuple[int, list[str]] | None:
    """Return a row, and the different values of `column`, that take the same measurement of one impact."""
    for bit in _BIT.values():
        rows = np.flatnonzero((bits & bit > 0) & (links >= 0))
        first: dict[int, str] = {}
        for row, link, value in zip(rows, links[rows], column[rows], strict=True):
            if first.setdefault(link, value) != value:
                return int(row), [first[link], value]
    return None


def _notes(
    table: pd.DataFrame, names: NDArray[np.object_], labels: NDArray[np.object_], double: Mask
) -> list[str]:
    notes: list[str] = []
    if not double.any():
        return notes
    for source in dict.fromkeys(table["source"].to_numpy()[double]):
        here = (table["source"] == source).to_numpy()
        used, lost = here & ~double, here & double
        what = _words(names, labels, lost, used)
        notes.append(
            f"{source}: {what[0]} used, {what[1]} left out ({count(int(lost.sum()))}): they are of the same "
            "impacts and would count them twice. --observable or --series chooses otherwise."
        )
    return notes


def count(rows: int) -> str:
    """Return a number of rows in words."""
    return f"{rows} row{'' if rows == 1 else 's'}"


def _words(
    names: NDArray[np.object_], labels: NDArray[np.object_], lost: Mask, used: Mask
) -> tuple[str, str]:
    """Name what was used and left out by observable if that tells them apart, else by series too."""
    by_name = [list(dict.fromkeys(names[rows])) for rows in (used, lost)]
    if not set(by_name[0]) & set(by_name[1]):
        return ", ".join(by_name[0]), ", ".join(by_name[1])
    both = [
        list(dict.fromkeys(f"{n} of {s}" for n, s in zip(names[r], labels[r], strict=True)))
        for r in (used, lost)
    ]
    if set(both[0]) & set(both[1]):
        return ", ".join(by_name[0]), "repeated readings"
    return ", ".join(both[0]), ", ".join(both[1])


def impact_numbers(table: pd.DataFrame) -> NDArray[np.int64]:
    """Return one number per impact; -1 where a row is not tied to one."""
    import pandas as pd

    tied = table["impact_id"].to_numpy(dtype=object) != ""
    numbers = np.full(len(table), -1)
    if tied.any():
        ids, labels = pd.factorize(table["impact_id"])
        sources, _ = pd.factorize(table["source"])
        numbers[tied] = (sources * len(labels) + ids)[tied]
    return numbers


def shares_e_n(table: pd.DataFrame) -> list[str]:
    """Say where an observable computed with the normal velocity stands beside that very velocity."""
    names = table["observable"].to_numpy(dtype=object)
    there, of_both = set(names.tolist()), {o.name for o in OBSERVABLES.values() if o.with_e_n}
    if there.isdisjoint(of_both) or there.isdisjoint(_NORMAL):
        return []
    mixed, normal = np.isin(names, list(of_both)), np.isin(names, _NORMAL)
    links = impact_numbers(table)
    shared = mixed & (links >= 0) & np.isin(links, links[normal])
    if not shared.any():
        return []
    which = ", ".join(dict.fromkeys(names[shared]))
    return [
        f"{which} is computed with the normal velocity that {', '.join(dict.fromkeys(names[normal]))} gives "
        "for the same impacts: the errors are correlated, which the fit does not take into account."
    ]
