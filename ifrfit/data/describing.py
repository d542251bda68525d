"""What there is to say about a dataset, as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ifrfit.data.observations import Descriptor


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
        """Return the description as lines of text."""
        d = self.descriptor
        mine = " (installed by you)" if self.installed else ""
        series, observables = ", ".join(d.default_series), ", ".join(d.default_observables)
        return [
            f"{d.name}: {d.title}",
            _line("provenance", d.provenance + mine),
            *self.notes,
            *(_line(key, _stated(fact)) for key, fact in d.conditions.items()),
            *(_line("rows", f"{count:>4}  {label} / {what}") for (label, what), count in self.rows.items()),
            _line("default", f"{series or 'every series'}; {observables or 'by rule'}"),
            *(_line("", self.own[key]) for key in ("default_reason",) if key in self.own),
            _line("noise", f"{d.noise or 'by the data'}. {self.own.get('noise_reason', '')}".rstrip()),
            *(
                _line("faces", f"{', '.join(group)}: the same impacts, never counted together")
                for group in d.faces
            ),
            *(
                _line("printed", f"{label}: {_constants(values)}")
                for label, values in self._printed().items()
            ),
            *(_line("assumed", sentence) for sentence in d.assumptions),
            _line("source", d.source),
            _line("licence", d.licence),
            _line("sha256", self.sha256),
        ]

    def _printed(self) -> Mapping[str, Mapping[str, float]]:
        by_series = self.own.get("printed_constants_by_series") or {}
        if by_series:
            return {label: numbers(constants) for label, constants in by_series.items()}
        constants = self.descriptor.printed_constants
        return {"every series": constants} if constants else {}


def _line(key: str, text: str) -> str:
    return f"{key:<13} {text}"


def _constants(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())


def _stated(fact: object) -> str:
    """Return a condition with the place that states it."""
    if not isinstance(fact, Mapping):
        return str(fact)
    where = fact.get("where")
    return f"{fact.get('value')} ({where})" if where else str(fact.get("value"))


def numbers(mapping: Mapping[str, Any]) -> dict[str, float]:
    """Keep the numeric entries of a mapping (the rest says where they are printed)."""
    return {key: float(value) for key, value in mapping.items() if isinstance(value, (int, float))}
