"""The folder of a run that was interrupted: what it had found, until the results are there."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from ifrfit.errors import UsageError

KEPT = "are kept in {}: the same command goes on with them."
FILES = ("chains.npz", "replicates.npz")


@contextlib.contextmanager
def writing_to(folder: Path) -> Iterator[None]:
    """Write into a folder, which is made if need be.

    Raises
    ------
    UsageError
        The disk is full, or gone.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise UsageError(
            f"{folder}: what was found so far cannot be written ({error.strerror or error})."
        ) from None


def remove_unfinished(folder: Path) -> None:
    """Remove what was kept: the results are there."""
    for name in FILES:
        with contextlib.suppress(OSError):
            (folder / name).unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # not there, or something else lies in it
        folder.rmdir()
