"""What there is to say about a dataset, as text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ifrfit.data.observations import Descriptor
from ifrfit.data.schema import STAND_IN
from ifrfit.data.units import parse_header

WIDTH = 88
KEY = 13  # columns of a key


@dataclass(frozen=True)
class Listed:
    """A line of `ifrfit datasets list`.

    Attributes
    ----------
    name, title : str
    provenance : str
        Of what loading would give: the user's own data where they are installed.
    installed : bool
        Whether they are.
    """

    name: str
    title: str
    provenance: str
    installed: bool


@dataclass(frozen=True)
class Description:
    """What `ifrfit datasets show` tells.

    Attributes
    ----------
    descriptor : Descriptor
    installed : bool
        Whether the user's own data take the place of the bundled ones.
    rows : mapping of (str, str) to int
        Rows by series and observable.
    sha256 : str
        Of data.csv.
    notes : tuple of str
        What loading tells.
    own : mapping
        The ``ifrfit`` object of datapackage.json, with what the descriptor has no place for: ``materials``,
        ``default_reason``, ``noise_reason``, ``printed_constants_by_series``, ``installed``.
    """

    descriptor: Descriptor
    installed: bool
    rows: Mapping[tuple[str, str], int]
    sha256: str
    notes: tuple[str, ...]
    own: Mapping[str, Any]

    def lines(self) -> list[str]:
        """Return the description as lines of text, wrapped to `WIDTH` columns."""
        d = self.descriptor
        series, observables = ", ".join(d.default_series), ", ".join(d.default_observables)
        chosen = f"{observables or 'by rule'} of {series or 'every series'}"
        entries = [
            ("provenance", [d.provenance + (" (installed by you)" if self.installed else "")]),
            ("", self.notes),
            *_conditions(d.conditions),
            ("rows", self._rows()),
            ("default", [f"{chosen}. {self.own.get('default_reason', '')}".rstrip(". ") + "."]),
            ("noise", [f"{d.noise or 'by the data'}. {self.own.get('noise_reason', '')}".rstrip()]),
            ("faces", [f"{', '.join(group)}: the same impacts, never counted together" for group in d.faces]),
            ("printed", [f"{label}: {_constants(values)}" for label, values in self._printed().items()]),
            ("assumed", d.assumptions),
            ("source", d.source.split("; ")),
            ("licence", [d.licence]),
            ("sha256", [self.sha256]),
        ]
        if d.provenance == STAND_IN:
            own = f"ifrfit datasets install {d.name} FILE puts your own digitisation in its place"
            entries.append(("replace it", [own]))
        # a word longer than a line (a hash, an address) stays whole
        head = textwrap.wrap(f"{d.name}: {d.title}", WIDTH, subsequent_indent="  ", break_long_words=False)
        return head + [line for key, items in entries for line in _entry(key, items)]

    def _rows(self) -> list[str]:
        """Say how many rows there are of what, one item a series."""
        counts: dict[str, list[str]] = {}
        for (label, what), count in self.rows.items():
            counts.setdefault(label, []).append(f"{count} {what}")
        return [f"{label}: {', '.join(found)}" for label, found in counts.items()]

    def _printed(self) -> Mapping[str, Mapping[str, float]]:
        by_series = self.own.get("printed_constants_by_series") or {}
        if by_series:
            return {label: numbers(constants) for label, constants in by_series.items()}
        constants = self.descriptor.printed_constants
        return {"every series": constants} if constants else {}


def listing_lines(entries: Iterable[Listed]) -> list[str]:
    """Return `ifrfit datasets list` as lines: name, provenance and title in columns, then what to do next.

    Parameters
    ----------
    entries : iterable of Listed
        As `catalogue.listing` gives them.
    """
    entries = list(entries)
    kinds = [entry.provenance + (" (yours)" if entry.installed else "") for entry in entries]
    names = max((len(entry.name) for entry in entries), default=0)
    wide = max(map(len, kinds), default=0)
    lines = []
    for entry, kind in zip(entries, kinds, strict=True):
        # the column before says it
        title = entry.title.removesuffix(f": {STAND_IN}")
        start = f"{entry.name:<{names}}  {kind:<{wide}}  "
        lines += _wrapped(title, start, " " * len(start))
    told = ["'ifrfit datasets show NAME' tells more, 'ifrfit fit NAME' fits one."]
    if any(entry.provenance == STAND_IN for entry in entries):
        told.append(
            "A stand-in is generated from the constants a paper prints: it shows that the tool works and "
            "says nothing about the experiment. 'ifrfit datasets install NAME FILE' puts your own "
            "digitisation in its place."
        )
    return [*lines, "", *(line for sentence in told for line in _wrapped(sentence, "", ""))]


def _wrapped(text: str, first: str, rest: str) -> list[str]:
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _entry(key: str, items: Sequence[str]) -> list[str]:
    """Write the items of an entry under each other; the key stands before the first."""
    lines = []
    for number, item in enumerate(items):
        start = f"{key if number == 0 else '':<{KEY}} "
        # where there are several, the next one is told from the next line of this one
        lines += _wrapped(item, start, " " * (KEY + (3 if len(items) > 1 else 1)))
    return lines


def _conditions(conditions: Mapping[str, object]) -> list[tuple[str, list[str]]]:
    """Write the conditions, and where they are stated: once, if all of them are in one place."""
    stated = [
        fact["where"] for fact in conditions.values() if isinstance(fact, Mapping) and fact.get("where")
    ]
    places = list(dict.fromkeys(map(str, stated)))
    one = len(places) == 1 and len(stated) > 1
    entries = [(_label(key), [_fact_text(fact, with_place=not one)]) for key, fact in conditions.items()]
    return [*entries, ("stated in", places)] if one else entries


def _label(key: str) -> str:
    """Turn the key of a condition into words: ``diameter_mm`` is "diameter (mm)"."""
    header = parse_header(key).without_suffix()
    name = header.name if header else key
    return name.replace("_", " ") + (f" ({header.unit})" if header else "")


def _constants(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())


def _fact_text(fact: object, *, with_place: bool) -> str:
    """Return a condition, with the place that states it where asked."""
    if not isinstance(fact, Mapping):
        return str(fact)
    where = fact.get("where")
    return f"{fact.get('value')} ({where})" if where and with_place else str(fact.get("value"))


def numbers(mapping: Mapping[str, Any]) -> dict[str, float]:
    """Keep the numeric entries of a mapping (the rest says where they are printed)."""
    return {key: float(value) for key, value in mapping.items() if isinstance(value, (int, float))}
