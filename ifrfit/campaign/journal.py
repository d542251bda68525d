"""What an unfinished campaign has found so far: a line a group, from which it can go on."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ifrfit.campaign.group_fit import Row
from ifrfit.errors import UsageError

_FORM = "ifrfit/campaign-journal/1"


@dataclass
class Journal:
    """A file of JSON lines beside the folder of results; the first says what was asked.

    Attributes
    ----------
    path : Path
    known : dict
        Rows found earlier, by key and digest of the group.
    """

    path: Path
    known: dict[tuple[tuple[str, ...], str], Row] = field(default_factory=dict)

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
            There is an unfinished campaign and neither was said, or it asked something else, or nothing can
            be written.
        """
        place = out.resolve()
        journal = cls(place.with_name(f"{place.name}.unfinished.jsonl"))
        try:
            if journal.path.exists() and (resume or not force):
                if not resume:
                    raise UsageError(
                        f"{journal.path}: an unfinished campaign. --resume goes on with it, --force begins "
                        "anew."
                    )
                journal._read(question)
            else:
                journal.path.parent.mkdir(parents=True, exist_ok=True)
                head = json.dumps({"form": _FORM, "question": question})
                journal.path.write_text(f"{head}\n", encoding="utf-8")
        except OSError as error:
            raise UsageError(
                f"{journal.path}: cannot be written ({error.strerror or error}). "
                "Choose another folder with --out."
            ) from None
        return journal

    def _read(self, question: str) -> None:
        whole = bytearray()
        with self.path.open("rb") as lines:
            for number, line in enumerate(lines):
                if not line.endswith(b"\n"):
                    break  # the end of a campaign that was killed
                entry = json.loads(line)
                if number == 0 and (entry.get("form"), entry.get("question")) != (_FORM, question):
                    raise UsageError(
                        f"{self.path}: this unfinished campaign asked something else of the groups. Give the "
                        "options of then, or begin anew with --force."
                    )
                if number:
                    self.known[tuple(entry["key"]), entry["digest"]] = entry["row"]
                whole += line
        self.path.write_bytes(whole)

    def add(self, keys: Sequence[tuple[str, ...]], digests: Sequence[str], rows: Sequence[Row]) -> None:
        """Keep the rows of some groups, on the disk when this returns.

        Raises
        ------
        UsageError
            The disk is full, or gone.
        """
        entries = (
            json.dumps({"key": key, "digest": digest, "row": row})
            for key, digest, row in zip(keys, digests, rows, strict=True)
        )
        try:
            with self.path.open("a", encoding="utf-8") as lines:
                lines.write("".join(f"{entry}\n" for entry in entries))
                lines.flush()
                os.fsync(lines.fileno())
        except OSError as error:
            raise UsageError(
                f"{self.path}: cannot be written ({error.strerror or error}). What was found before is kept: "
                "make room, and go on with --resume."
            ) from None

    def close(self) -> None:
        """Remove it: the results are delivered."""
        self.path.unlink(missing_ok=True)
