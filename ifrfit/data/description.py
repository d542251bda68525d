"""What there is to say about a dataset, as text."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from ifrfit.data.catalogue import Entry, entry, load_dataset, printed_by_series
from ifrfit.data.column_names import parse_header
from ifrfit.data.observations import Observations
from ifrfit.data.schema import STAND_IN

WIDTH = 88
KEY = 13  # columns of a key


def describe(name: str, width: int = WIDTH) -> list[str]:
    """Everything `ifrfit datasets show` tells about a dataset, as lines of so many columns.

    Raises
    ------
    UsageError, DataError
        As `load_dataset`.
    """
    found, data = entry(name), load_dataset(name)
    (source,), own = data.sources, found.package["ifrfit"]
    d = source.descriptor
    assert d is not None  # every dataset has one
    series, observables = ", ".join(d.default_series), ", ".join(d.default_observables)
    chosen = f"{observables or 'by rule'} of {series or 'every series'}"
    every = {"every series": d.printed_constants} if d.printed_constants else {}
    printed = printed_by_series(own) or every
    entries = [
        ("provenance", [d.provenance + (" (installed by you)" if found.installed else "")]),
        ("", data.notes),
        *_conditions(d.conditions),
        ("rows", _rows(data)),
        ("default", [f"{chosen}. {own.get('default_reason', '')}".rstrip(". ") + "."]),
        ("noise", [f"{d.noise or 'by the data'}. {own.get('noise_reason', '')}".rstrip()]),
        ("faces", [f"{', '.join(group)}: the same impacts, never counted together" for group in d.faces]),
        ("printed", [f"{label}: {_constants(values)}" for label, values in printed.items()]),
        ("assumed", d.assumptions),
        ("source", d.source.split("; ")),
        ("licence", [d.licence]),
        ("sha256", [source.sha256]),
    ]
    if d.provenance == STAND_IN:
        remedy = f"ifrfit datasets install {d.name} FILE puts your own digitisation in its place"
        entries.append(("replace it", [remedy]))
    # a word longer than a line (a hash, an address) stays whole
    head = textwrap.wrap(f"{d.name}: {d.title}", width, subsequent_indent="  ", break_long_words=False)
    return head + [line for key, items in entries for line in _entry(key, items, width)]


def _rows(data: Observations) -> list[str]:
    """Say how many rows there are of what, one item a series."""
    counts: dict[str, list[str]] = {}
    pairs = Counter(zip(data.table["series"], data.table["observable"], strict=True))
    for (label, what), count in pairs.items():
        counts.setdefault(label, []).append(f"{count} {what}")
    return [f"{label}: {', '.join(found)}" for label, found in counts.items()]


def listing_lines(entries: Iterable[Entry], width: int = WIDTH) -> list[str]:
    """Return `ifrfit datasets list` as lines: name, provenance and title in columns, then what to do next."""
    rows = []
    for each in entries:
        package = each.package
        kind = package["ifrfit"]["provenance"]
        # the column before says it
        title = str(package["title"]).removesuffix(f": {STAND_IN}")
        rows.append((each.name, kind + (" (yours)" if each.installed else ""), title))
    names, wide = (max((len(row[i]) for row in rows), default=0) for i in range(2))
    lines = []
    for name, kind, title in rows:
        start = f"{name:<{names}}  {kind:<{wide}}  "
        lines += _wrapped(title, start, " " * len(start), width)
    told = ["'ifrfit datasets show NAME' tells more, 'ifrfit fit NAME' fits one."]
    if any(kind == STAND_IN for _, kind, _ in rows):
        told.append(
            "A stand-in is generated from the constants a paper prints: it shows that the tool works and "
            "says nothing about the experiment. 'ifrfit datasets install NAME FILE' puts your own "
            "digitisation in its place."
        )
    return [*lines, "", *(line for sentence in told for line in _wrapped(sentence, "", "", width))]


def _wrapped(text: str, first: str, rest: str, width: int) -> list[str]:
    return textwrap.wrap(
        text,
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _entry(key: str, items: Sequence[str], width: int) -> list[str]:
    """Write the items of an entry under each other; the key stands before the first."""
    lines = []
    for number, item in enumerate(items):
        start = f"{key if number == 0 else '':<{KEY}} "
        # where there are several, the next one is told from the next line of this one
        lines += _wrapped(item, start, " " * (KEY + (3 if len(items) > 1 else 1)), width)
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
