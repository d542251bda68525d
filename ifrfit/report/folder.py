"""The folder that holds a result: it appears whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import uuid
from pathlib import Path

from ifrfit.errors import UsageError
from ifrfit.inference.result import FitResult
from ifrfit.report.figures import plot
from ifrfit.report.page.writing import page
from ifrfit.report.style import save_figure

RESULT = "result.json"
FIGURES = ("fit.svg", "fit.png")
REPORT = "report.html"
# everything that a fit may have left in a folder; whatever else lies there belongs to the user
OWN_FILES = (RESULT, *FIGURES, REPORT)


def write_folder(result: FitResult, out: Path, *, force: bool, figures: bool = True) -> list[str]:
    """Write result.json, fit.svg, fit.png and report.html into a folder, whole or not at all.

    Parameters
    ----------
    result : FitResult
    out : Path
        Folder; it is made if it is not there. Files in it that are not a fit's own are never touched.
    force : bool
        Replace an earlier result; what it left and this one does not write is removed.
    figures : bool
        Whether to draw, and to write the report.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier result and `force` is not given, or nothing can be written there.
    """
    target = Path(out)
    # a link stays a link: what it points to is replaced
    place = target.resolve()
    check_free(target, force=force)
    fresh = _beside(place, "new")
    made = [parent for parent in fresh.parents if not parent.exists()]
    try:
        fresh.mkdir(parents=True)
        names = _fill(result, fresh, figures=figures)
        _put_in_place(fresh, place)
    except OSError as error:
        raise UsageError(
            f"{target}: cannot be written ({error.strerror or error}). Choose another folder with --out."
        ) from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        for parent in made:  # empty ones only: what holds a result stays
            with contextlib.suppress(OSError):
                parent.rmdir()
    return names


def check_free(out: Path, *, force: bool) -> None:
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
    if (out / RESULT).exists():
        raise UsageError(f"{out} holds an earlier result; add --force to replace it.")
    taken = [name for name in OWN_FILES if (out / name).exists()]
    if taken:
        raise UsageError(
            f"{out} holds a file {taken[0]} already; add --force to replace it, or choose another folder."
        )


def _beside(place: Path, what: str) -> Path:
    """A name beside `place` that nobody else has: on the same disk, so that renaming is one step."""
    return place.with_name(f".{place.name}-{uuid.uuid4().hex[:12]}.{what}")


def _fill(result: FitResult, folder: Path, *, figures: bool) -> list[str]:
    result.save(folder / RESULT)
    names = [RESULT]
    if figures and len(result.points):
        figure = plot(result)
        for name in FIGURES:
            save_figure(figure, folder / name)
            names.append(name)
        (folder / REPORT).write_text(page(result, figure=figure), encoding="utf-8", newline="\n")
        names.append(REPORT)
    return names


def _put_in_place(fresh: Path, place: Path) -> None:
    if not place.exists():
        fresh.rename(place)
        return
    only_ours = all(entry.name in OWN_FILES for entry in place.iterdir())
    # a folder that someone stands in is filled, not exchanged under their feet
    if only_ours and not Path.cwd().is_relative_to(place):
        _exchange(fresh, place)
    else:
        _move_in(fresh, place)


def _exchange(fresh: Path, place: Path) -> None:
    old = _beside(place, "old")
    place.rename(old)
    try:
        fresh.rename(place)
    except OSError:
        old.rename(place)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _move_in(fresh: Path, place: Path) -> None:
    """Replace file by file, result.json last: it never describes figures that are not there yet."""
    names = sorted((entry.name for entry in fresh.iterdir()), key=lambda name: name == RESULT)
    for name in names:
        os.replace(fresh / name, place / name)  # noqa: PTH105
    for name in OWN_FILES:
        if name not in names:
            (place / name).unlink(missing_ok=True)
