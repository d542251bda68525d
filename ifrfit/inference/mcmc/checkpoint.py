"""Chains in a file, so that they can be walked on with: plain arrays, nothing that is executed."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.io.json_text import replaced
from ifrfit.inference.mcmc.run import Chains, Rest
from ifrfit.inference.model.digest import digest
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.unfinished_run import writing_to

FILE = "chains.npz"
SCHEMA = "ifrfit/chains/1"
_KEY = 624  # words of the state of MT19937


def save_chains(path: Path, chains: Chains, question: str) -> None:
    """Write chains with the state of their random numbers; the file appears whole or not at all.

    Parameters
    ----------
    path : Path
    chains : Chains
        At least one step of them.
    question : str
        What `question_of` says.
    """
    key, pos, has_gauss, gauss = zip(*(end.random[1:] for end in chains.ends), strict=True)
    with replaced(path) as fresh, fresh.open("wb") as file:
        np.savez(
            file,
            schema=np.array(SCHEMA),
            question=np.array(question),
            at=chains.at,
            log_density=chains.log_density,
            accepted=chains.accepted,
            key=np.array(key, dtype=np.uint32),
            pos=np.array(pos, dtype=np.int64),
            has_gauss=np.array(has_gauss, dtype=np.int64),
            gauss=np.array(gauss, dtype=float),
        )


def load_chains(path: Path, question: str) -> Chains:
    """Read chains.

    Parameters
    ----------
    path : Path
        A file that `save_chains` wrote, or the folder that holds it.
    question : str
        What they must answer.

    Raises
    ------
    UsageError
        If there is no such file, or its chains answer another question.
    DataError
        If the file is damaged.
    """
    place = path / FILE if path.is_dir() else path
    try:
        with place.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise UsageError(
            f"{path}: there are no chains to resume. Name the folder that --method mcmc --out wrote."
        ) from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, AttributeError):
        raise DataError(f"{place}: cannot be read as chains. Run again without --resume.") from None
    if str(content.get("schema", "")) != SCHEMA:
        raise DataError(f"{place}: is no file of chains ('{SCHEMA}'). Run again without --resume.")
    if str(content.get("question", "")) != question:
        raise UsageError(
            f"{place}: these chains are of other data, choices or another seed. "
            "Resume with the same ones, or run again without --resume."
        )
    return _chains(place, content)


def keep_chains(folder: Path, chains: Chains, question: str) -> None:
    """Write chains of an unfinished run into a folder of their own.

    Raises
    ------
    UsageError
        The disk is full, or gone.
    """
    with writing_to(folder):
        save_chains(folder / FILE, chains, question)


def kept_chains(folder: Path, question: str) -> Chains | None:
    """Chains that `keep_chains` wrote for this question; None where there are none, or of another one.

    Raises
    ------
    DataError
        If the file is damaged.
    """
    if not (folder / FILE).is_file():
        return None
    try:
        return load_chains(folder, question)
    except UsageError:
        return None


def _chains(place: Path, content: dict[str, Any]) -> Chains:
    """Chains of arrays that fit together."""
    try:
        at, log_density = content["at"], content["log_density"]
        k, steps, walkers, _ = at.shape
        whole = (
            steps > 0
            and log_density.shape == (k, steps, walkers)
            and content["key"].shape == (k, _KEY)
            and content["key"].dtype == np.uint32
            and all(content[name].shape == (k,) for name in ("accepted", "pos", "has_gauss", "gauss"))
            and bool(((content["pos"] >= 0) & (content["pos"] <= _KEY)).all())
            and bool(np.isfinite(at).all())
            and bool(np.isfinite(log_density).all())
        )
    except (KeyError, ValueError, TypeError, AttributeError):
        whole = False
    if not whole:
        raise DataError(f"{place}: its arrays do not fit together. Run again without --resume.")
    randoms = zip(content["key"], content["pos"], content["has_gauss"], content["gauss"], strict=True)
    ends = [
        Rest(at[i, -1], log_density[i, -1], ("MT19937", key, int(pos), int(has), float(gauss)))
        for i, (key, pos, has, gauss) in enumerate(randoms)
    ]
    return Chains(at, log_density, content["accepted"].astype(np.int64), tuple(ends))


def question_of(problem: Problem, seed: int) -> str:
    """SHA-256 of everything that the chains depend on: the problem and the seed."""
    return digest((problem.digest, seed))
