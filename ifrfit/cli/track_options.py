"""Options about tracks, which `import` and `check` share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ifrfit.cli.parameters import flag, option
from ifrfit.errors import UsageError

_ABOUT_TRACKS = (
    flag("--tracks", help="Positions frame by frame: t or frame, x, z, perhaps run and angle."),
    option("--fps", type=float, metavar="N", help="Of tracks: frames in a second."),
    option("--pixel", metavar="LENGTH", help="Of tracks: size of a pixel, as 0.1mm."),
    option("--radius", metavar="LENGTH", help="Of tracks: radius of the ball, as 20mm."),
    option("--contact", metavar="TIME", help="Of tracks: how long a contact lasts, as 2ms."),
    option("--frames", type=int, metavar="N", help="Of tracks: at most so many on a side, by default 20."),
    option(
        "--acceleration",
        type=float,
        metavar="M_S2",
        help="Of tracks: into the wall, as 9.81 for a floor; by default found.",
    ),
)


def track_options(run: Callable[..., None]) -> Callable[..., None]:
    """Decorate a command with ``--tracks`` and what is said of tracks."""
    for add in reversed(_ABOUT_TRACKS):
        run = add(run)
    return run


def given_of_tracks(is_tracks: bool, **options: Any) -> dict[str, Any] | None:
    """The options that were given, as `ifrfit.read_tracks` takes them; None where it is not about tracks.

    Raises
    ------
    UsageError
        There are some, and it is not.
    """
    if not is_tracks:
        refuse_given(options, "is about tracks. Say --tracks, too, or leave it away")
        return None
    return {key: value for key, value in options.items() if value is not None}


def refuse_given(options: Mapping[str, Any], why: str) -> None:
    """Refuse options that were given and are about something else."""
    for key, value in options.items():
        if value is not None and value != []:
            raise UsageError(f"--{key}: {why}.")
