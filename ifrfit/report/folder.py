"""The folder that holds a result: it appears whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path

from ifrfit.errors import UsageError
from ifrfit.inference.result import FitResult
from ifrfit.report.figures import plot
from ifrfit.report.style import save_figure

RESULT = "result.json"
FIGURES = ("fit.svg", "fit.png")
CHAINS = "chains.npz"
# everything that a fit may have left in a folder; whatever else lies there belongs to the user
OWN_FILES = (RESULT, *FIGURES, CHAINS, "report.html")


def write_folder(result: FitResult, out: Path, *, force: bool, figures: bool = True) -> list[str]:
    """Write result.json, fit.svg, fit.png and the chains of mcmc into a folder, whole or not at all.

    Parameters
    ----------
    result : FitResult
    out : Path
        Folder; it is made if it is not there. Files in it that are not a fit's own are never touched.
    force : bool
        Replace an earlier result; what it left and this one does not write (report.html) is removed.
    figures : bool
        Whether to draw.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier result and `force` is not given, or nothing can be written there.
    """
    return write_whole(
        Path(out),
        lambda folder: _fill(result, folder, figures=figures),
        own=OWN_FILES,
        main=RESULT,
        force=force,
    )


def write_whole(
    target: Path, fill: Callable[[Path], list[str]], *, own: Sequence[str], main: str, force: bool
) -> list[str]:
    """Let `fill` write files into a folder that then appears whole, or not at all.

    Parameters
    ----------
    target : Path
    fill : callable
        Writes into the folder it is given and returns the names.
    own : sequence of str
        Every name it may ever have written: these files are replaced or removed, no others.
    main : str
        The one that tells that a result is there, put in place last.
    force : bool
        Replace an earlier result.

    Returns
    -------
    list of str
        What `fill` returned.

    Raises
    ------
    UsageError
        As `write_folder`.
    """
    # a link stays a link: what it points to is replaced
    place = target.resolve()
    check_free(target, force=force, own=own, main=main)
    fresh = _beside(place, "new")
    made = [parent for parent in fresh.parents if not parent.exists()]
    try:
        fresh.mkdir(parents=True)
        names = fill(fresh)
        _put_in_place(fresh, place, own, main)
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


def check_free(out: Path, *, force: bool, own: Sequence[str] = OWN_FILES, main: str = RESULT) -> None:
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
    if (out / main).exists():
        raise UsageError(f"{out} holds an earlier result; add --force to replace it.")
    taken = [name for name in own if (out / name).exists()]
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
    if result.sample is not None:
        result.sample.save(folder / CHAINS)
        names.append(CHAINS)
    return names


def _put_in_place(fresh: Path, place: Path, own: Sequence[str], main: str) -> None:
    if not place.exists():
        fresh.rename(place)
        return
    only_ours = all(entry.name in own for entry in place.iterdir())
    # a folder that someone stands in is filled, not exchanged under their feet
    if only_ours and not Path.cwd().is_relative_to(place):
        _exchange(fresh, place)
    else:
        _move_in(fresh, place, own, main)


def _exchange(fresh: Path, place: Path) -> None:
    old = _beside(place, "old")
    place.rename(old)
    try:
        fresh.rename(place)
    except OSError:
        old.rename(place)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _move_in(fresh: Path, place: Path, own: Sequence[str], main: str) -> None:
    """Replace file by file, the main one last: it never describes figures that are not there yet."""
    names = sorted((entry.name for entry in fresh.iterdir()), key=lambda name: name == main)
    for name in names:
        os.replace(fresh / name, place / name)  # noqa: PTH105
    for name in own:
        if name not in names:
            (place / name).unlink(missing_ok=True)
