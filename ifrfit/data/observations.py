"""What was measured: one tidy table, where it came from, and what the user should be told about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.data.angular_momentum import MomentumCheck
from ifrfit.data.common_errors import common_columns_in, numbers_in, renumbered
from ifrfit.data.schema import NUMBER_COLUMNS, TABLE_COLUMNS, TEXT_COLUMNS
from ifrfit.errors import UsageError
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Descriptor:
    """What is known about a dataset beside its numbers.

    Attributes
    ----------
    name, title : str
        Short name and one-line title.
    provenance : str
        ``measured``, ``published``, ``digitised``, ``simulated`` or ``stand-in``.
    conditions : mapping
        Diameter, material, wall, speed, spin and so on, as the source states them.
    default_observables, default_series : tuple of str
        What is used when the user chooses nothing; empty means everything.
    noise : str or None
        Default noise policy (``known``, ``scaled``, ``unknown``), or None where the data decide.
    faces : tuple of tuple of str
        Groups of series that are faces, or repeat readings, of the same impacts; never counted twice
        together.
    inertia_factor : float
        J = I/(m R^2): 2/5 for a homogeneous sphere.
    assumptions : tuple of str
        What was assumed where the source is silent.
    printed_constants : mapping
        Constants that the source prints; empty if none.
    licence, source : str
        Licence of the numbers, and where they come from.
    """

    name: str
    title: str
    provenance: str
    conditions: Mapping[str, object] = field(default_factory=dict)
    default_observables: tuple[str, ...] = ()
    default_series: tuple[str, ...] = ()
    noise: str | None = None
    faces: tuple[tuple[str, ...], ...] = ()
    inertia_factor: float = 0.4
    assumptions: tuple[str, ...] = ()
    printed_constants: Mapping[str, float] = field(default_factory=dict)
    licence: str = ""
    source: str = ""


@dataclass(frozen=True)
class Source:
    """One file or dataset that went into the observations.

    Attributes
    ----------
    name : str
        File name or dataset name.
    sha256 : str
        SHA-256 of the bytes that were read, hexadecimal.
    rows : int
        Rows of the common schema that the source offers: ``rows_used`` plus everything in ``rows_skipped``.
        A wide table offers one for every observable of every line.
    rows_used : int
        Rows still in the table.
    rows_skipped : mapping of str to int
        Count of the others by reason.
    provenance : str
        ``measured``, ``published``, ``digitised``, ``simulated``, ``stand-in``, several joined by ``, ``,
        or empty: not stated.
    selection : str
        What was chosen from the source, in words; empty where all of it is used.
    descriptor : Descriptor or None
        For bundled or installed datasets.
    word : {"line", "row"}
        What `row` of the table counts: lines of a text, or rows of a table.
    headers : mapping of str to tuple of str
        Columns of the file that a column of the schema comes from, for the uncertainties of angle and spin;
        under ``spin`` those of the spin before impact.
    """

    name: str
    sha256: str
    rows: int
    rows_used: int
    rows_skipped: Mapping[str, int] = field(default_factory=dict)
    provenance: str = ""
    selection: str = ""
    descriptor: Descriptor | None = field(default=None, metadata={"optional": True})
    word: str = field(default="line", metadata={"optional": True})
    headers: Mapping[str, tuple[str, ...]] = field(default_factory=dict, metadata={"internal": True})


def word_of(sources: Iterable[Source], name: str = "") -> str:
    """What the rows of a source are called, or those of all: rows where they are of tables, else lines."""
    words = {source.word for source in sources if not name or source.name == name}
    return "row" if words == {"row"} else "line"


class _Frame:
    """Data descriptor that hands out shallow copies, so that nobody writes into the stored frame.

    pandas 3 copies on write: the copy costs microseconds and still cannot reach the original.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self._key = f"_{name}"

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            raise AttributeError(self._key)  # dataclass reads this as: the field has no default
        return instance.__dict__[self._key].copy(deep=False)

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self._key] = value.copy(deep=False)


@dataclass(frozen=True, eq=False)
class Observations:
    """Observations in the common schema, with their sources and what is worth telling about them.

    Attributes
    ----------
    table : pandas.DataFrame
        Columns `TABLE_COLUMNS`, and those of errors that rows have in common
        (`ifrfit.data.common_errors`); one row is one observation of one observable. Angles in
        degrees from the wall normal, spins as R omega/u in the paper's signs, speed in m/s, values in
        degrees where the name of the observable ends in ``_deg`` and dimensionless otherwise. Missing numbers
        are NaN, missing strings empty. What is handed out is a copy.
    sources : tuple of Source
    notes : tuple of str
        Sentences for the user.
    momentum : tuple of MomentumCheck
        One for each source of raw velocities with spin after; not repeated in the notes.
    calibration : str
        Which calibration of a figure the common errors are of; empty where it is not said, or of several.
    redundant : pandas.DataFrame or None
        Rows that a selection left out because others count their impacts already; read, never written to.

    Examples
    --------
    >>> import ifrfit
    >>> data = ifrfit.load_dataset("kharaz-2001")
    >>> data
    Observations(kharaz-2001: 94 rows of beta_cm, spin_y_after, psi_out_deg, delta_deg; digitised, simulated)
    >>> data.table[["gamma_deg", "observable", "value"]].head(2)
       gamma_deg observable     value
    0    2.23762    beta_cm -0.796540
    1    4.21782    beta_cm -0.746293
    """

    table: pd.DataFrame = _Frame()  # type: ignore[assignment]
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    momentum: tuple[MomentumCheck, ...] = ()
    calibration: str = ""
    redundant: pd.DataFrame | None = None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.__dict__["_table"])

    @property
    def stored(self) -> pd.DataFrame:
        """The table itself, to be read and never written to: a copy for every look takes its time."""
        found: pd.DataFrame = self.__dict__["_table"]
        return found

    @property
    def provenance(self) -> tuple[str, ...]:
        """Return the distinct provenances in order of appearance; empty string where none is stated."""
        return tuple(str(p) for p in self.table["provenance"].unique())

    def with_note(self, *notes: str) -> Observations:
        """Return the same observations with further notes."""
        new = [note for note in notes if note not in self.notes]
        return replace(self, notes=(*self.notes, *new)) if new else self

    def called(self, column: str) -> str:
        """Return what an uncertainty of angle or spin is, with the columns of the files it comes from.

        Parameters
        ----------
        column : str
            ``sigma_gamma_deg``, ``sigma_spin_x`` or ``sigma_spin_y``.
        """
        headers = dict.fromkeys(h for source in self.sources for h in source.headers.get(column, ()))
        what = _UNCERTAINTIES.get(column, column)
        return f"{what} (from {joined(list(headers) or [column])})"

    def __repr__(self) -> str:
        """Return one line: how many rows of what from where."""
        return f"Observations({self._headline()})"

    def _repr_html_(self) -> str:
        """Return the headline, the first rows and the notes for a notebook."""
        from html import escape

        body = self.table.dropna(axis="columns", how="all").head(10).to_html(index=False)
        said = (*self.notes, *(check.says for check in self.momentum))
        notes = "".join(f"<li>{escape(n)}</li>" for n in said)
        return f"<p>{escape(self._headline())}</p>{body}" + (f"<ul>{notes}</ul>" if notes else "")

    def _headline(self) -> str:
        table = self.table
        names = ", ".join(s.name for s in self.sources) or "no source"
        observables = ", ".join(str(o) for o in table["observable"].unique())
        provenance = ", ".join(p or "provenance not stated" for p in self.provenance)
        return f"{names}: {len(table)} rows of {observables or 'nothing'}; {provenance or 'empty'}"


_UNCERTAINTIES = {
    "sigma_gamma_deg": "the uncertainty of the angle",
    "sigma_spin_x": "the uncertainty of the spin about x",
    "sigma_spin_y": "the uncertainty of the spin",
}


def make_table(columns: Mapping[str, Any]) -> pd.DataFrame:
    """Build a table with every column of `TABLE_COLUMNS`, in order, from the ones that are given.

    Parameters
    ----------
    columns : mapping of str to array_like or scalar
        Equal lengths; scalars are repeated. ``value`` must be an array. Columns of common errors stay.

    Returns
    -------
    pandas.DataFrame
        Missing numbers are NaN (spins 0, ``n_repeats`` 1, ``row`` 1, 2, ...), missing strings empty.
    """
    import pandas as pd

    n = len(columns["value"])
    index = pd.RangeIndex(n)
    full: dict[str, Any] = {}
    repeated: dict[str, pd.Series] = {}  # each text made once: strings of a column are never written to
    for name in TABLE_COLUMNS:
        if name in columns:
            full[name] = columns[name]
        elif name in ("spin_x", "spin_y"):
            full[name] = np.zeros(n)
        elif name == "n_repeats":
            full[name] = np.ones(n, dtype=np.int64)
        elif name == "row":
            full[name] = np.arange(1, n + 1)
        else:
            full[name] = "" if name in TEXT_COLUMNS else np.full(n, np.nan)
        text = full[name]
        if name in TEXT_COLUMNS and isinstance(text, str):
            if text not in repeated:
                repeated[text] = pd.Series(text, index=index, dtype="str")
            full[name] = repeated[text]
    shared = common_columns_in(columns)
    full |= {name: np.nan_to_num(np.asarray(columns[name], dtype=float)) for name in shared}
    table = pd.DataFrame(full, index=index)
    wanted: dict[str, Any] = {
        **dict.fromkeys(NUMBER_COLUMNS, np.dtype(float)),
        **dict.fromkeys(TEXT_COLUMNS, pd.StringDtype(na_value=np.nan)),
        **dict.fromkeys(("n_repeats", "row"), np.dtype(np.int64)),
    }
    there = table.dtypes
    for name, kind in wanted.items():
        if there[name] != kind:
            table[name] = table[name].astype(kind)
    return table


def combine(parts: Sequence[Observations]) -> Observations:
    """Put several observations into one; impacts of different sources stay apart, series of one name do not.

    Errors that rows of a source have in common are others than those of another source, but where both are
    of one calibration of a figure.

    Parameters
    ----------
    parts : sequence of Observations

    Returns
    -------
    Observations
        A second source of the same name is called ``NAME (2)``.

    Raises
    ------
    UsageError
        Nothing is given, or the same file is given twice.
    """
    import pandas as pd

    if not parts:
        raise UsageError("No data given: name at least one file or dataset.")
    if len(parts) == 1:
        return parts[0]
    tables: list[pd.DataFrame] = []
    sources: list[Source] = []
    notes: list[str] = []
    momentum: list[MomentumCheck] = []
    known: dict[tuple[str, str, int], int] = {}  # new numbers of common errors
    for place, part in enumerate(parts):
        of = (part.calibration, "" if part.calibration else str(place))
        old = numbers_in(part.table.columns)
        numbers = {number: known.setdefault((*of, number), len(known) + 1) for number in old}
        table, checks = renumbered(part.table, numbers), part.momentum
        for source in part.sources:
            _refuse_duplicate(source, sources)
            name = _free_name(source.name, {s.name for s in sources})
            if name != source.name:
                table["source"] = table["source"].replace(source.name, name)
                checks = tuple(replace(c, source=name) if c.source == source.name else c for c in checks)
            sources.append(replace(source, name=name))
        notes.extend(_of_one_name(table, tables))
        tables.append(table)
        notes.extend(n for n in part.notes if n not in notes)
        momentum.extend(checks)
    table = pd.concat(tables, ignore_index=True)
    shared = common_columns_in(table.columns)
    table[shared] = table[shared].fillna(0.0)
    return Observations(table, tuple(sources), tuple(notes), tuple(momentum))


def _of_one_name(table: pd.DataFrame, before: Sequence[pd.DataFrame]) -> Iterator[str]:
    """Say which series of a table stand with the same observable in one before, and are taken for one."""
    for name in filter(None, dict.fromkeys(table["series"])):
        own = table.loc[table["series"] == name]
        for other in before:
            there = other.loc[(other["series"] == name) & other["observable"].isin(own["observable"])]
            if len(there):
                yield (
                    f"the series {name} is in {there['source'].iloc[0]} and in {own['source'].iloc[0]}, and "
                    "was taken as one. If they are two, give them different names in a column series"
                )
                break


def _refuse_duplicate(source: Source, before: Sequence[Source]) -> None:
    for other in before:
        if source.sha256 and source.sha256 == other.sha256:
            same = source.name if source.name == other.name else f"{other.name} and {source.name}"
            raise UsageError(
                f"{same}: the same data are given twice and would be counted twice. Name them once."
            )


def _free_name(name: str, taken: set[str]) -> str:
    number = 2
    free = name
    while free in taken:
        free = f"{name} ({number})"
        number += 1
    return free
