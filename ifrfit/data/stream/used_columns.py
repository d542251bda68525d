"""Which observables and columns of a table are used where it is read some rows at a time.

What columns there are decides, and what was asked for by name: not their order, and no value in them.

* Of the observables (those asked for, else all) each is used, in the order of `OBSERVABLES`, that does not
  count an impact again which those before it count (`ifrfit.data.double_counting`); all, if the user vouches
  that they are independent.
* The others are used beside these, in impacts in which these are not measured, unless observables were asked
  for by name. Where each of these has a column of uncertainties, an observable beside them needs one.
* Uncertainties are used if every one of these has a column of them, else none is.
* Every file has to have the same of what counts: observables, their uncertainties, spins (`keys_that_count`).
* A column of spins in which no value was met is no column; nothing else is decided by counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ifrfit.data.column_layout import Layout
from ifrfit.data.double_counting import without_double_counting
from ifrfit.data.selection import Selection
from ifrfit.data.stream.files import NotStreamableError
from ifrfit.data.stream.refusals import refuse_tables_in_memory
from ifrfit.data.table_forms import check_uncertainties
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import joined

STREAMED = ("v_x", "v_n", "spin_y_after", "beta_cm", "e_n", "beta", "mu")  # linear, along the incoming path
SPINS = ("spin_x", "spin_y")


@dataclass(frozen=True)
class UsedColumns:
    """What is used of the columns of a table: as text the same in every process, for passes that go on.

    Attributes
    ----------
    observables : tuple of str
        Those that are used, in the order of `OBSERVABLES`.
    has_sigma : bool
        Whether every observable that is used has a column of uncertainties.
    keys : tuple of str
        What counts of the columns of a file, by the names of the schema: every file has the same.
    beside : tuple of str
        Observables that are used where those before them, of the same impacts, are not measured.
    empty_spins : tuple of str
        Columns of spins in which nothing stands: no spin, as if there were no column.
    notes : tuple of str
    """

    observables: tuple[str, ...] = ()
    has_sigma: bool = False
    keys: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    empty_spins: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, layout: Layout, selection: Selection) -> UsedColumns:
        """Choose by the columns of a table and what was asked for; no file is read.

        Raises
        ------
        NotStreamableError
            For a long table, raw velocities, or observables that are not among `STREAMED`.
        DataError
            There is no incidence angle, or an uncertainty of nothing.
        UsageError
            An observable that was asked for is not there, or there is none.
        """
        refuse_tables_in_memory(layout, STREAMED)
        used, others = _without_double_counting(layout, selection)
        _refuse_unreadable(layout, used)
        sigmas = [key for key in map(layout.sigma_key, used) if key is not None]
        has_sigma = len(sigmas) == len(used)
        # as in memory, unless one that was asked for by name
        beside = [] if selection.observable else [name for name in others if name in STREAMED]
        if has_sigma:
            beside = [name for name in beside if layout.sigma_key(name) is not None]
        notes = [_note_of_others(layout, used, others, beside)] if others else []
        if sigmas and not has_sigma:
            notes.append(
                f"{Path(layout.cells.file).name}: {layout.header(sigmas[0])} is not used, because "
                "not every observable has a column of uncertainties: errors are taken from the scatter"
            )
        observables = tuple(name for name in OBSERVABLES if name in used or name in beside)
        keys = keys_that_count(layout, observables, selection)
        return cls(observables, has_sigma, keys, tuple(beside), notes=tuple(notes))

    @property
    def spins(self) -> tuple[str, ...]:
        """Columns of spins before impact."""
        return tuple(name for name in SPINS if name in self.keys)

    @property
    def has_spin(self) -> bool:
        """Whether there is a spin before impact."""
        return self.empty_spins != self.spins

    def with_spins_met(self, counts: Mapping[str, int]) -> UsedColumns:
        """Knowing how many values the columns of spins hold: one that holds none is no column."""
        return replace(self, empty_spins=tuple(name for name in self.spins if not counts.get(name, 0)))


def keys_that_count(layout: Layout, used: Sequence[str], selection: Selection) -> tuple[str, ...]:
    """Observables, or those that were asked for; the uncertainties of those used; the spins before impact."""
    seen = used if selection.observable else [name for name in OBSERVABLES if layout.has(name)]
    sigmas = [f"sigma:{name}" for name in used] + (["sigma"] if len(used) == 1 else [])
    return tuple(key for key in (*seen, *sigmas, *SPINS) if layout.has(key))


def _without_double_counting(layout: Layout, selection: Selection) -> tuple[list[str], list[str]]:
    """Observables that count no impact twice, in the order of the registry, and the others."""
    there = [name for name in OBSERVABLES if layout.has(name)]
    if there:
        check_uncertainties(layout, there, there)
    asked = selection.observable or tuple(there)
    missing = [name for name in asked if name not in there]
    if missing or not asked:
        raise UsageError(
            f"{layout.cells.file}: there is no column of {missing[0] if missing else 'an observable'}. "
            f"There is {joined(there) or 'none'}."
        )
    if selection.independent:
        return [name for name in OBSERVABLES if name in asked], []
    return without_double_counting(asked)


def _refuse_unreadable(layout: Layout, used: Sequence[str]) -> None:
    """Refuse observables that are not streamed, or have no angle."""
    odd = [name for name in used if name not in STREAMED]
    if odd:
        raise NotStreamableError(
            f"{layout.cells.file}: {odd[0]} is read into memory; what is streamed is {', '.join(STREAMED)}. "
            "Choose one by --observable."
        )
    if any(OBSERVABLES[name].has_angle for name in used) and not layout.has_gamma:
        raise DataError(
            f"{layout.cells.file}: there is no incidence angle. Add a column gamma_deg (from the normal)."
        )


def _note_of_others(layout: Layout, used: Sequence[str], others: Sequence[str], beside: Sequence[str]) -> str:
    """What is said of observables that would count impacts twice."""
    rest = [name for name in others if name not in beside]
    words = [f"{joined(beside)} only where these are not measured"] if beside else []
    words += [f"{joined(rest)} left out"] if rest else []
    return (
        f"{Path(layout.cells.file).name}: {joined(used)} used, {joined(words)}: they are of the same impacts "
        "and would count them twice"
    )
