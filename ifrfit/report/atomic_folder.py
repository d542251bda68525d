"""Folders that appear whole or not at all, and in which what belongs to others stays."""

from __future__ import annotations

import contextlib
import os
import shutil
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ifrfit.errors import UsageError

_OF_JSON = '"ifrfit/'  # every record in JSON says its schema first
_BEGINNING = 4096  # bytes


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
    marks : mapping of str to str
        Files to what stands at the beginning of each where ifrfit wrote it. A folder with none of these is
        somebody else's: nothing in it is replaced, whoever forces it. By default that of a record in JSON;
        where there are none, who calls has looked himself.
    """

    record: str
    others: tuple[str, ...]
    name: str
    marks: Mapping[str, str] | None = None

    @property
    def files(self) -> tuple[str, ...]:
        """All of them."""
        return (self.record, *self.others)

    def there(self, folder: Path) -> list[str]:
        """Which of them lie in a folder."""
        return [name for name in self.files if (folder / name).exists() or (folder / name).is_symlink()]

    def made(self, folder: Path) -> bool:
        """Whether ifrfit made what lies in a folder under these names."""
        marks = {self.record: _OF_JSON} if self.marks is None else self.marks
        return not marks or any(_begins_with(folder / name, mark) for name, mark in marks.items())


def standing(out: Path, of: Contents) -> str:
    """What becomes of what lies in a folder that is written to, in words; empty where nothing lies there."""
    if not out.is_dir():
        return ""
    ours = of.there(out)
    others = [entry.name for entry in out.iterdir() if entry.name not in of.files]
    said = [f"in the place of an earlier {of.name}"] if ours else []
    if others:
        number = f"{len(others)} other file{'s' if len(others) > 1 else ''}"
        said.append(f"{number} there stay{'' if len(others) > 1 else 's'} as before")
    return "; ".join(said)


def _begins_with(path: Path, mark: str) -> bool:
    try:
        with path.open("rb") as file:
            return mark.encode() in file.read(_BEGINNING)
    except OSError:
        return False


def deliver(fill: Callable[[Path], list[str]], target: Path, of: Contents, *, force: bool) -> list[str]:
    """Let `fill` write into a folder beside the target, then put that in place.

    Returns
    -------
    list of str
        Names of the files written, as `fill` returned them.

    Raises
    ------
    UsageError
        If the folder holds an earlier one and `force` is not given, or files of others under these names, or
        nothing can be written there.
    """
    # a link stays a link: what it points to is replaced
    try:
        place = target.resolve()
    except (OSError, RuntimeError):  # links in a circle
        raise UsageError(f"{target}: cannot be followed. Choose another folder with --out.") from None
    check_free(target, force=force, of=of)
    fresh = _beside(place, "new")
    created = [parent for parent in fresh.parents if not parent.exists()]
    try:
        whole = not place.exists() or _is_ours(place, of)
        if not whole:
            fresh = place / fresh.name
        fresh.mkdir(parents=True)
        names = fill(fresh)
        if not place.exists():
            fresh.rename(place)
        elif whole:
            _exchange(fresh, place)
        else:
            _move_in(fresh, place, of)
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


def check_free(out: Path, *, force: bool, of: Contents) -> None:
    """Refuse a folder that may not be written to, so that nothing is computed in vain.

    Raises
    ------
    UsageError
        If `out` is a file; if it holds files that would be replaced and are not of ifrfit, or are and `force`
        is not given.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file. Name a folder with --out.")
    if not out.is_dir():
        return
    there = of.there(out)
    strange = [name for name in there if (out / name).is_dir()] or (
        there if there and not of.made(out) else []
    )
    if strange:
        raise UsageError(
            f"{out} holds a file {strange[0]} that is not of ifrfit: it is not replaced, nor with --force. "
            "Move it away, or choose another folder."
        )
    if there and not force:
        raise UsageError(f"{out} holds an earlier {of.name}; add --force to replace it.")


def _beside(place: Path, what: str) -> Path:
    """A name beside `place` that nobody else has: on the same disk, so that renaming is one step."""
    return place.with_name(f".{place.name}-{uuid.uuid4().hex[:12]}.{what}")


def _is_ours(place: Path, of: Contents) -> bool:
    """Whether a folder may be exchanged as a whole: it holds nothing else, and nobody stands in it."""
    only_ours = all(entry.name in of.files for entry in place.iterdir())
    return only_ours and not Path.cwd().is_relative_to(place)


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
    files = sorted(path.relative_to(fresh) for path in fresh.rglob("*") if path.is_file())
    for name in sorted(files, key=lambda name: name == Path(of.record)):
        (place / name).parent.mkdir(exist_ok=True)
        os.replace(fresh / name, place / name)  # noqa: PTH105
    for name in map(Path, of.files):
        if name not in files:
            (place / name).unlink(missing_ok=True)
