"""The folder that holds a result or a comparison: it appears whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ifrfit.errors import UsageError
from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.figures import plot
from ifrfit.report.page.writing import page
from ifrfit.report.style import save_both

FIGURES = ("fit.svg", "fit.png")


@dataclass(frozen=True)
class Contents:
    """What a command leaves in a folder; whatever else lies there belongs to the user.

    Attributes
    ----------
    record : str
        The file that tells that all is there.
    others : tuple of str
        Files that may lie beside it.
    name : str
        What it is, in messages.
    """

    record: str
    others: tuple[str, ...]
    name: str

    @property
    def files(self) -> tuple[str, ...]:
        """All of them."""
        return (self.record, *self.others)


CHAINS = "chains.npz"
REPORT = "report.html"
FIT = Contents("result.json", (*FIGURES, CHAINS, REPORT), "result")
RESULT = FIT.record


def write_folder(result: FitResult, appraisal: Appraisal | None, out: Path, *, force: bool) -> list[str]:
    """Write result.json, figures, report.html and the chains of mcmc into a folder, whole or not at all.

    Parameters
    ----------
    result : FitResult
    appraisal : Appraisal or None
        What was computed for the report; without it neither report nor figures are written.
    out : Path
        Folder; it is made if it is not there. Files in it that are not a fit's own are never touched.
    force : bool
        Replace an earlier result; what it left and this one does not write is removed.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier result and `force` is not given, or nothing can be written there.
    """
    return deliver(lambda folder: _fill(result, appraisal, folder), Path(out), FIT, force=force)


def deliver(fill: Callable[[Path], list[str]], target: Path, of: Contents, *, force: bool) -> list[str]:
    """Let `fill` write into a folder beside the target, then put that in place.

    Returns
    -------
    list of str
        Names of the files written, as `fill` returned them.

    Raises
    ------
    UsageError
        As `write_folder`.
    """
    # a link stays a link: what it points to is replaced
    place = target.resolve()
    check_free(target, force=force, of=of)
    fresh = _beside(place, "new")
    created = [parent for parent in fresh.parents if not parent.exists()]
    try:
        fresh.mkdir(parents=True)
        names = fill(fresh)
        _put_in_place(fresh, place, of)
    except OSError as error:
        raise UsageError(
            f"{target}: cannot be written ({error.strerror or error}). Choose another folder with --out."
        ) from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        for parent in created:  # empty ones only: what holds a result stays
            with contextlib.suppress(OSError):
                parent.rmdir()
    return names


def check_free(out: Path, *, force: bool, of: Contents = FIT) -> None:
    """Refuse a folder that may not be written to, so that nothing is computed in vain.

    Raises
    ------
    UsageError
        If `out` is a file, or holds files that a result would replace and `force` is not given.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file. Name a folder with --out.")
    if force or not out.exists():
        return
    if (out / of.record).exists():
        raise UsageError(f"{out} holds an earlier {of.name}; add --force to replace it.")
    taken = [name for name in of.files if (out / name).exists()]
    if taken:
        raise UsageError(
            f"{out} holds a file {taken[0]} already; add --force to replace it, or choose another folder."
        )


def _beside(place: Path, what: str) -> Path:
    """A name beside `place` that nobody else has: on the same disk, so that renaming is one step."""
    return place.with_name(f".{place.name}-{uuid.uuid4().hex[:12]}.{what}")


def _fill(result: FitResult, appraisal: Appraisal | None, folder: Path) -> list[str]:
    result.save(folder / RESULT)
    names = [RESULT]
    if appraisal is not None and len(result.points):
        figure = plot(result)
        names += save_both(figure, folder, "fit")
        (folder / REPORT).write_text(page(result, appraisal, figure), encoding="utf-8", newline="\n")
        names.append(REPORT)
    for name, own in result.files.items():
        own.save(folder / name)
        names.append(name)
    return names


def _put_in_place(fresh: Path, place: Path, of: Contents) -> None:
    if not place.exists():
        fresh.rename(place)
        return
    only_ours = all(entry.name in of.files for entry in place.iterdir())
    # a folder that someone stands in is filled, not exchanged under their feet
    if only_ours and not Path.cwd().is_relative_to(place):
        _exchange(fresh, place)
    else:
        _move_in(fresh, place, of)


def _exchange(fresh: Path, place: Path) -> None:
    old = _beside(place, "old")
    place.rename(old)
    try:
        fresh.rename(place)
    except OSError:
        old.rename(place)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _move_in(fresh: Path, place: Path, of: Contents) -> None:
    """Replace file by file, the record last: it never describes figures that are not there yet."""
    names = sorted((entry.name for entry in fresh.iterdir()), key=lambda name: name == of.record)
    for name in names:
        os.replace(fresh / name, place / name)  # noqa: PTH105
    for name in of.files:
        if name not in names:
            (place / name).unlink(missing_ok=True)
