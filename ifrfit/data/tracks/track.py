"""A track: where a ball was, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
NORMAL = "z"
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Track:
    """Positions of one ball around one impact.

    Attributes
    ----------
    name : str
        Of the run, as the file has it.
    place : str
        File and run, for messages.
    lines : (n,) int array
        Line of each frame in the file.
    time : (n,) float array
        Seconds, increasing.
    position : mapping of str to (n,) float array
        Metres, by axis: x along the wall, z normal to it, y perhaps.
    angle : (n,) float array or None
        Of a mark on the ball, radians, from x towards z; nan where it was not seen.
    sigma : mapping of str to (n,) float array
        Standard errors by axis, and of ``angle``, as far as the file gives them.
    series : str
        Empty where the file has none.
    """

    name: str
    place: str
    lines: NDArray[np.int64]
    time: FloatArray
    position: Mapping[str, FloatArray]
    angle: FloatArray | None = None
    sigma: Mapping[str, FloatArray] = field(default_factory=dict)
    series: str = ""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that there are, z last."""
        return tuple(each for each in AXES if each in self.position)
