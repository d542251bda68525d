"""Replicates of a run that was interrupted, in a file: plain arrays, nothing that is executed."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.bootstrap.replicate_fits import ReplicateFits
from ifrfit.inference.io.json_text import replaced
from ifrfit.inference.unfinished_run import writing_to

FILE = "replicates.npz"
SCHEMA = "ifrfit/replicates/1"


def keep_replicates(folder: Path, found: ReplicateFits, question: str) -> None:
    """Write replicates into the folder of an unfinished run; the file appears whole or not at all.

    Parameters
    ----------
    folder : Path
    found : ReplicateFits
        At least one.
    question : str
        What they answer.

    Raises
    ------
    UsageError
        The disk is full, or gone.
    """
    with writing_to(folder), replaced(folder / FILE) as fresh, fresh.open("wb") as file:
        np.savez(
            file,
            schema=np.array(SCHEMA),
            question=np.array(question),
            theta=found.theta,
            noise=found.noise,
            reason=np.array(found.reason, dtype=str),
            undetermined=found.undetermined,
            certified=found.certified,
        )


def kept_replicates(folder: Path, question: str, most: int) -> list[ReplicateFits]:
    """The first replicates that were kept for this question; none where there are none.

    Parameters
    ----------
    folder : Path
    question : str
    most : int
        How many are wanted.

    Raises
    ------
    DataError
        If the file is damaged.
    """
    place = folder / FILE
    if not place.is_file():
        return []
    try:
        with place.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
        if str(content["schema"]) != SCHEMA or str(content["question"]) != question:
            return []
        lengths = {len(content[name]) for name in ("theta", "noise", "reason", "undetermined", "certified")}
        if len(lengths) != 1:
            raise ValueError
        return [
            ReplicateFits(
                content["theta"][:most],
                content["noise"][:most],
                tuple(map(str, content["reason"][:most])),
                content["undetermined"][:most],
                content["certified"][:most],
            )
        ]
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
        raise DataError(f"{place}: cannot be read as replicates. Remove it, and run again.") from None
