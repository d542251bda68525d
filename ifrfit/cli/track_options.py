"""Options about tracks, which `import` and `check` share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from ifrfit.errors import UsageError

_TRACKS = "Tracks"


def _option(metavar: str, says: str) -> Any:
    return typer.Option(metavar=metavar, help=says, rich_help_panel=_TRACKS)


IsTracks = Annotated[
    bool, typer.Option("--tracks", help="Positions frame by frame: t or frame, x, z, perhaps run and angle.")
]
Fps = Annotated[float | None, _option("N", "Of tracks: frames in a second.")]
PixelSize = Annotated[str | None, _option("LENGTH", "Of tracks: size of a pixel, as 0.1mm.")]
Radius = Annotated[str | None, _option("LENGTH", "Of tracks: radius of the ball, as 20mm.")]
Contact = Annotated[str | None, _option("TIME", "Of tracks: how long a contact lasts, as 2ms.")]
Frames = Annotated[int | None, _option("N", "Of tracks: at most so many on a side, by default 20.")]
Acceleration = Annotated[
    float | None, _option("M_S2", "Of tracks: into the wall, as 9.81 for a floor; by default found.")
]


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
