"""What an unfinished pass over a stream has found so far: a file a portion, from which it can go on."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit._version import __version__
from ifrfit.data.stream.portions import Portion
from ifrfit.errors import UsageError
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated


@dataclass(frozen=True)
class UnfinishedPass:
    """A folder beside that of the results to be.

    Attributes
    ----------
    folder : Path
    """

    folder: Path

    @classmethod
    def beside(cls, out: Path) -> UnfinishedPass:
        """Of the results that are to stand in a folder."""
        place = out.resolve()
        return cls(place.with_name(f"{place.name}.unfinished"))

    def of(self, nothing: Accumulated) -> KeptParts:
        """The parts that begin as `nothing`: found by the same question of the same files."""
        asked = nothing.stream, nothing.weighted, nothing.intervals, nothing.sample.below
        question = hashlib.sha256(repr((__version__, *asked)).encode())
        question.update(np.packbits(nothing.window.inside).tobytes())
        return KeptParts(self.folder, question.hexdigest(), nothing)

    def close(self) -> None:
        """Remove the parts: the results are there."""
        for path in self.folder.glob("part-*") if self.folder.is_dir() else ():
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # not there, or something else lies in it
            self.folder.rmdir()


@dataclass(frozen=True)
class KeptParts:
    """Parts of one question.

    Attributes
    ----------
    folder : Path
    question : str
        Its digest.
    nothing : Accumulated
        What each part begins as.
    """

    folder: Path
    question: str
    nothing: Accumulated

    def _path(self, portion: Portion) -> Path:
        """A name that tells the question, the files, their sizes and when they were written."""
        digest = hashlib.sha256(f"{self.question} {portion!r}".encode()).hexdigest()
        return self.folder / f"part-{digest[:32]}.npz"

    def has(self, portion: Portion) -> bool:
        """Whether a portion is there."""
        return self._path(portion).is_file()

    def load(self, portion: Portion) -> Accumulated:
        """What was found of a portion.

        Raises
        ------
        UsageError
            The file is damaged.
        """
        path = self._path(portion)
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                found = {name: arrays[name] for name in arrays.files}
            about = json.loads(found.pop("about").tobytes())
            return self.nothing.with_arrays(about, found)
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
            raise UsageError(f"{path}: damaged. Remove it, and run again.") from None

    def keep(self, portion: Portion, part: Accumulated) -> None:
        """Put a part on the disk.

        Raises
        ------
        UsageError
            The disk is full, or gone.
        """
        about, arrays = part.to_arrays()
        named: dict[str, Any] = {**arrays, "about": np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)}
        path = self._path(portion)
        fresh = path.with_suffix(".new")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with fresh.open("wb") as file:
                np.savez(file, **named)
                file.flush()
                os.fsync(file.fileno())
            fresh.replace(path)
        except OSError as error:
            with contextlib.suppress(OSError):
                fresh.unlink(missing_ok=True)
            raise UsageError(
                f"{path}: cannot be written ({error.strerror or error}). What was found before is kept: make "
                "room, and run again."
            ) from None
