"""What a layer above adds to the report of a simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Supplement:
    """Lines, content and files beside those of the simulation itself.

    Attributes
    ----------
    lines : sequence of str
        For the terminal, after the plan of the effects.
    content : mapping
        Further keys of simulation.json.
    write : callable
        Writes its files into a folder and returns their names.
    """

    lines: Sequence[str]
    content: Mapping[str, Any]
    write: Callable[[Path], list[str]]
