"""Sentences that a table carries in its comments, for whoever fits it: ``# note: ...``."""

from __future__ import annotations

from collections.abc import Iterable

_MARK = "# note:"
_WITHIN = 50  # lines at the beginning of a file
_LONGEST = 500
_MOST = 20


def note_lines(notes: Iterable[str]) -> list[str]:
    """The comment lines that carry notes."""
    return [f"{_MARK} {' '.join(note.split())}" for note in notes]


def notes_in(text: str) -> tuple[str, ...]:
    """The notes that the first lines of a text carry."""
    if _MARK not in text[:100_000]:
        return ()
    lines = text[:100_000].splitlines()[:_WITHIN]
    found = (line.removeprefix(_MARK).strip()[:_LONGEST] for line in lines if line.startswith(_MARK))
    return tuple(note for note in found if note)[:_MOST]
