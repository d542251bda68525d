"""What an unfinished campaign has found so far: a line a group, from which it can go on."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ifrfit.campaign.group_fit import FAILURE, Row
from ifrfit.campaign.report.contents import unfinished
from ifrfit.errors import UsageError

_FORM = "ifrfit/campaign-journal/3"
_START = b'{"form": "ifrfit/campaign-journal/'  # of every head


@dataclass
class Journal:
    """A file of JSON lines beside the folder of results: what was asked, and rows that say what they answer.

    Two campaigns may write into one file. Each goes on with the lines of its own question alone, and the file
    is of the one whose question stands at its head.

    Attributes
    ----------
    path : Path
    question : str
        What is asked of the groups.
    known : dict
        Rows found earlier, by key and digest of the group.
    unread : str
        A sentence about lines that could not be read; empty where there are none.
    """

    path: Path
    question: str
    known: dict[tuple[tuple[str, ...], str], Row] = field(default_factory=dict)
    unread: str = ""

    @classmethod
    def open(cls, out: Path, question: str, *, resume: bool, force: bool) -> Journal:
        """Begin anew, or go on with what lies there.

        Parameters
        ----------
        out : Path
            Folder of the results to be.
        question : str
            What is asked of the groups; an unfinished campaign that asked something else is not gone on with.
        resume, force : bool
            Whether to go on with what an unfinished campaign has found, or else to throw it away.

        Raises
        ------
        UsageError
            There is an unfinished campaign and neither was said, or it asked something else or cannot be
            read, or nothing can be written.
        """
        journal = cls(unfinished(out), question)
        try:
            if journal._is_begun() and (resume or not force):
                if not resume:
                    raise UsageError(
                        f"{journal.path}: an unfinished campaign. --resume goes on with it, --force begins "
                        "anew."
                    )
                journal._read()
            else:
                journal.path.parent.mkdir(parents=True, exist_ok=True)
                journal.path.write_bytes(journal._head)
        except OSError as error:
            raise UsageError(
                f"{journal.path}: cannot be written ({error.strerror or error}). "
                "Choose another folder with --out."
            ) from None
        return journal

    @property
    def _head(self) -> bytes:
        return f"{json.dumps({'form': _FORM, 'question': self.question})}\n".encode()

    @property
    def _mark(self) -> str:
        """What tells lines of this question from those of others."""
        return hashlib.sha256(self.question.encode()).hexdigest()[:16]

    def _first_line(self) -> bytes | None:
        """As it lies there; None without a file."""
        try:
            with self.path.open("rb") as lines:
                return lines.readline()
        except FileNotFoundError:
            return None

    def _is_begun(self) -> bool:
        """Whether there is more than a head that was cut off, as of a campaign killed in its first moment."""
        first = self._first_line()
        if first is None:
            return False
        return first.endswith(b"\n") or not (first.startswith(_START) or _START.startswith(first))

    def _read(self) -> None:
        kept = [self._head]
        unreadable = 0
        head: dict[str, Any] | None = None
        with self.path.open("rb") as lines:
            for number, line in enumerate(lines):
                entry = _entry(line)
                if entry is not None and "form" in entry:
                    head = entry if number == 0 else head
                elif entry is None:
                    unreadable += line.endswith(b"\n")  # else the end of a campaign that was killed
                elif entry["of"] == self._mark:
                    self.known[tuple(entry["key"]), entry["digest"]] = entry["row"]
                    kept.append(line)
        if head is not None and (head["form"], head.get("question")) != (_FORM, self.question):
            raise UsageError(
                f"{self.path}: this unfinished campaign asked something else of the groups, or is of other "
                "files or another version. Give the files and options of then, or begin anew with --force."
            )
        if head is None and not self.known:
            raise UsageError(
                f"{self.path}: nothing in it can be read as an unfinished campaign. Begin anew with --force, "
                "which replaces it."
            )
        if unreadable:
            lines_of = "a line" if unreadable == 1 else f"{unreadable} lines"
            self.unread = (
                f"{self.path.name}: {lines_of} could not be read; a group whose row stood there was fitted "
                "anew."
            )
        self.path.write_bytes(b"".join(kept))

    def add(self, keys: Sequence[tuple[str, ...]], digests: Sequence[str], rows: Sequence[Row]) -> None:
        """Keep the rows of some groups, on the disk when this returns.

        Raises
        ------
        UsageError
            The disk is full, or gone.
        """
        mark = self._mark
        entries = (
            json.dumps({"of": mark, "key": key, "digest": digest, "row": row})
            for key, digest, row in zip(keys, digests, rows, strict=True)
        )
        try:
            with self.path.open(
                "ab", buffering=0
            ) as lines:  # in one piece, as another campaign may write, too
                whole = memoryview("".join(f"{entry}\n" for entry in entries).encode())
                while whole:
                    whole = whole[lines.write(whole) :]
                os.fsync(lines.fileno())
        except OSError as error:
            raise UsageError(
                f"{self.path}: cannot be written ({error.strerror or error}). What was found before is kept: "
                "make room, and go on with --resume."
            ) from None

    def close(self) -> None:
        """Remove it, as the results are delivered, unless it is another campaign's by now."""
        first = self._first_line()
        if first is None:
            return
        entry = _entry(first)
        if first == self._head or (entry is not None and entry.get("of") == self._mark):
            self.path.unlink(missing_ok=True)


def _entry(line: bytes) -> dict[str, Any] | None:
    """What a line says, a head or a row; None where it cannot be read as one."""
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    if not line.endswith(b"\n") or not isinstance(entry, dict):
        return None
    if "form" in entry:
        return entry
    key = entry.get("key")
    whole = (
        isinstance(key, list)
        and all(isinstance(part, str) for part in key)
        and isinstance(entry.get("digest"), str)
        and isinstance(entry.get("of"), str)
        and isinstance(entry.get("row"), dict)
        and FAILURE in entry["row"]
    )
    return entry if whole else None
