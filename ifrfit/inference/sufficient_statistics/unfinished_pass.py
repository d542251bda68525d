"""What an unfinished pass over a stream has found so far: a file a portion, from which it can go on."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ifrfit._version import __version__
from ifrfit.data.stream.portions import Portion
from ifrfit.errors import UsageError


class Part(Protocol):
    """What a pass finds of a portion."""

    def question(self) -> bytes:
        """All that decides what is found of a portion, but for its rows."""

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What was found, as JSON takes it and as arrays."""

    def with_arrays(self, found: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """What `to_arrays` gave, as a part of the same pass as this one, which is of nothing."""


P = TypeVar("P", bound=Part)


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

    def of(self, nothing: P) -> KeptParts[P]:
        """The parts that begin as `nothing`: found by the same question of the same files."""
        question = hashlib.sha256(__version__.encode())
        question.update(nothing.question())
        return KeptParts(self.folder, question.hexdigest(), nothing)

    def close(self) -> None:
        """Remove the parts: the results are there."""
        for path in self.folder.glob("part-*") if self.folder.is_dir() else ():
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # not there, or something else lies in it
            self.folder.rmdir()


@dataclass(frozen=True)
class KeptParts(Generic[P]):
    """Parts of one question.

    Attributes
    ----------
    folder : Path
    question : str
        Its digest.
    nothing : Part
        What each part begins as.
    """

    folder: Path
    question: str
    nothing: P

    def _path(self, portion: Portion) -> Path:
        """A name that tells the question, the files, their sizes and when they were written."""
        digest = hashlib.sha256(f"{self.question} {portion!r}".encode()).hexdigest()
        return self.folder / f"part-{digest[:32]}.npz"

    def has(self, portion: Portion) -> bool:
        """Whether a portion is there."""
        return self._path(portion).is_file()

    def load(self, portion: Portion) -> P:
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

    def keep(self, portion: Portion, part: P) -> None:
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
