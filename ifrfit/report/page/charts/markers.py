"""Shapes of marks, as paths of an svg."""

from __future__ import annotations

# within -1 ... 1, named as matplotlib names them; y points down
SHAPES = {
    "o": "M-1 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0z",
    "s": "M-1-1H1V1H-1z",
    "^": "M0-1L1 1H-1z",
    "v": "M0 1L-1-1H1z",
    "<": "M-1 0L1-1V1z",
    ">": "M1 0L-1 1V-1z",
    "D": "M0-1.41L1.41 0 0 1.41-1.41 0z",
    "P": "M-.34-1H.34V-.34H1V.34H.34V1H-.34V.34H-1V-.34H-.34z",
    "X": "M-.5-1L0-.5.5-1 1-.5.5 0 1 .5.5 1 0 .5-.5 1-1 .5-.5 0-1-.5z",
    "h": "M0-1L.87-.5V.5L0 1-.87.5V-.5z",
    "x": "M-1-1L1 1M-1 1L1-1",
}
