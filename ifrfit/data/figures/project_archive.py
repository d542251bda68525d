"""The project of a tar archive, read in memory: nothing is ever extracted."""

from __future__ import annotations

import io
import tarfile
from pathlib import PurePosixPath, PureWindowsPath

from ifrfit.data.figures.located_json import LARGEST_JSON
from ifrfit.errors import DataError

MAGIC_AT, MAGIC = 257, b"ustar"
_MOST_MEMBERS = 1000
_REMEDY = "Save the project anew, or give its wpd.json."


def is_tar(head: bytes) -> bool:
    """Whether a file that begins so is a tar archive."""
    return head[MAGIC_AT : MAGIC_AT + len(MAGIC)] == MAGIC


def project_of_tar(raw: bytes, file: str) -> tuple[bytes, str]:
    """The JSON of the project in an archive, and what to call it in messages.

    Parameters
    ----------
    raw : bytes
    file : str

    Raises
    ------
    DataError
        The archive is damaged, has members that no project has (links, devices, paths that lead out of it,
        sizes beyond the file), too many, or not one project.
    """
    found: list[tuple[bytes, str]] = []
    try:
        with tarfile.open(fileobj=io.BytesIO(raw), mode="r:") as archive:
            for number, member in enumerate(archive):
                if number >= _MOST_MEMBERS:
                    raise DataError(
                        f"{file}: holds more than {_MOST_MEMBERS} files, a project a handful. {_REMEDY}"
                    )
                _refuse_member(member, len(raw), file)
                if member.isfile() and PurePosixPath(member.name).name == "wpd.json":
                    opened = archive.extractfile(member)
                    content = opened.read(LARGEST_JSON + 1) if opened is not None else b""
                    found.append((content, f"{file}, {member.name}"))
    except (tarfile.TarError, EOFError, OSError, ValueError, OverflowError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{file}: a damaged tar archive ({str(error)[:80]}). {_REMEDY}") from None
    if len(found) != 1:
        there = "no" if not found else f"{len(found)} files called"
        raise DataError(f"{file}: has {there} wpd.json, a project has one. {_REMEDY}")
    return found[0]


def _refuse_member(member: tarfile.TarInfo, size: int, file: str) -> None:
    name = member.name if len(member.name) <= 60 else f"{member.name[:60]}..."
    name = "".join(letter if letter.isprintable() else "?" for letter in name)
    # of Windows, too, whose paths part at either slash
    if any(path.anchor or ".." in path.parts for path in (PurePosixPath(member.name), PureWindowsPath(member.name))):
        raise DataError(f"{file}, {name}: leads out of the archive, which no project does. {_REMEDY}")
    if not (member.isfile() or member.isdir()):
        raise DataError(f"{file}, {name}: is a link or a device, which no project has. {_REMEDY}")
    if member.size > size or member.issparse():
        raise DataError(
            f"{file}, {name}: is said to be {member.size:,} bytes long, the archive has {size:,}. {_REMEDY}"
        )
