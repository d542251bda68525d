"""What a table carries in its comments, for whoever fits it: ``# note: ...``, ``# calibration: ...``."""

from __future__ import annotations

from collections.abc import Iterable

_MARK = "# note:"
_CALIBRATION = "# calibration:"
_WITHIN = 50  # lines at the beginning of a file
_LONGEST = 500
_MOST = 20


def calibration_line(digest: str) -> str:
    """The comment line that says which calibration of a figure the common errors of a table are of."""
    return f"{_CALIBRATION} {digest}"


def calibration_in(text: str) -> str:
    """The calibration that the first lines of a text name; empty without one, or with several."""
    found = {line.removeprefix(_CALIBRATION).strip() for line in _first_lines(text, _CALIBRATION)}
    return found.pop()[:_LONGEST] if len(found) == 1 else ""


def note_lines(notes: Iterable[str]) -> list[str]:
    """The comment lines that carry notes."""
    return [f"{_MARK} {' '.join(note.split())}" for note in notes]


def notes_in(text: str) -> tuple[str, ...]:
    """The notes that the first lines of a text carry."""
    found = (line.removeprefix(_MARK).strip()[:_LONGEST] for line in _first_lines(text, _MARK))
    return tuple(note for note in found if note)[:_MOST]


def _first_lines(text: str, mark: str) -> list[str]:
    """Those lines at the beginning that begin with a mark."""
    if mark not in text[:100_000]:
        return []
    return [line for line in text[:100_000].splitlines()[:_WITHIN] if line.startswith(mark)]
