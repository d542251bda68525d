"""Names and units in the headers of tables: ``gamma_deg``, ``gamma [deg]``, ``gamma (rad)``."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

# unit -> dimension, factor to the unit of the schema (deg, m, m/s, rad/s)
UNITS: dict[str, tuple[str, float]] = {
    "deg": ("angle", 1.0),
    "rad": ("angle", 180.0 / math.pi),
    "m": ("length", 1.0),
    "mm": ("length", 1e-3),
    "m/s": ("speed", 1.0),
    "mm/s": ("speed", 1e-3),
    "rad/s": ("rate", 1.0),
    "rpm": ("rate", math.pi / 30.0),
    "1": ("number", 1.0),
    "%": ("number", 0.01),
}
# names of columns, spellings of units and of Greek letters
HEADERS: dict[str, Any] = tomllib.loads(
    files("ifrfit.data").joinpath("headers.toml").read_text(encoding="utf-8")
)
_SUFFIXES: dict[str, str] = HEADERS["units"]["suffixes"]
_BRACKETS = re.compile(r"^(?P<name>.*?)[\s_]*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))\s*$")
# Only this letter tells before from after by its case.
_OMEGA_AFTER = re.compile(r"^(sigma_)?Omega(?=_|$)")


@dataclass(frozen=True)
class Header:
    """A header cell taken apart.

    Attributes
    ----------
    name : str
        Lower case, spaces as underscores, Greek letters spelt out, unit in brackets removed. ``Omega`` with a
        capital, the paper's letter for the spin after, becomes ``omega_after``.
    unit : str or None
        Key of `UNITS`; what stands in the brackets if it is not one; None without brackets.
    """

    name: str
    unit: str | None

    def without_suffix(self) -> Header | None:
        """Return the header without a unit at the end of its name (``_deg``, ``_m_s``), None without one."""
        if self.unit is None:
            for suffix, unit in _SUFFIXES.items():
                if self.name.endswith(suffix) and len(self.name) > len(suffix):
                    return Header(self.name[: -len(suffix)], unit)
        return None


def parse_header(text: str) -> Header:
    """Take a header cell apart into a name and a unit in brackets."""
    name, unit = text.strip(), None
    match = _BRACKETS.match(name)
    if match and match["name"].strip():
        inside = match["square"] if match["square"] is not None else match["round"]
        name, unit = match["name"], unit_name(inside)
    for letter, spelt in HEADERS["greek"].items():
        name = name.replace(letter, spelt)
    name = re.sub(r"[\s\-]+", "_", name.strip())
    name = _OMEGA_AFTER.sub(lambda m: f"{m[1] or ''}omega_after", name)
    return Header(name.lower(), unit)


def unit_name(text: str) -> str:
    """Return the key of `UNITS` that `text` means, or `text` itself if it means none."""
    unit = " ".join(text.strip().lower().split())
    return str(HEADERS["units"]["spellings"].get(unit, unit))


def units_of(dimension: str) -> tuple[str, ...]:
    """Return the known units of a dimension (``angle``, ``length``, ``speed``, ``rate``, ``number``)."""
    return tuple(unit for unit, (of, _) in UNITS.items() if of == dimension)
