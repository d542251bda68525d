"""What the headers of a table of tracks say: names of columns, and units of lengths, times and angles."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ifrfit.data.tracks.track import AXES, NORMAL

_NAMES: dict[str, tuple[str, ...]] = {
    "time": ("t", "time", "seconds"),
    "frame": ("frame", "frames", "frame_number", "frame_no", "image"),
    "run": ("run", "track", "trajectory", "particle", "ball", "shot", "impact", "impact_id", "id"),
    "angle": ("angle", "phi", "theta", "mark", "mark_angle", "rotation"),
    "series": ("series",),
    **{axis: (axis,) for axis in AXES},
}
_OF = {name: key for key, names in _NAMES.items() for name in names}
_HEADER = re.compile(
    r"^(?P<name>.*?)[\s_]*(?:\[(?P<a>[^\[\]]*)\]|\((?P<b>[^()]*)\)|_(?P<c>m|cm|mm|um|px|s|ms|us|deg|rad))?$"
)


def looks_like_tracks(headers: Sequence[str]) -> bool:
    """Whether the columns of a table are times and places, frame by frame."""
    keys = {header_key(header) for header in headers}
    return {"x", NORMAL} <= keys and not keys.isdisjoint({"time", "frame"})


def header_key(header: str) -> str:
    """What a header holds, empty if nothing known."""
    match = _HEADER.match(header.strip())
    name = match["name"].strip().lower().replace(" ", "_") if match else ""
    of = name.removeprefix("sigma_")
    key = _OF.get(of, "")
    return f"sigma:{key}" if key and of != name else key


def header_unit(header: str) -> str:
    """The unit in the brackets of a header or at its end, as it is written; empty without one."""
    match = _HEADER.match(header.strip())
    return next((each.strip() for each in match.groups()[1:] if each), "") if match else ""
