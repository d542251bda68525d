"""What a header can mean: the columns of the schema, the observables, and raw velocities.

The names are in headers.toml beside this file.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from ifrfit.data.common_errors import dimension_of
from ifrfit.physics.observables import OBSERVABLES

# unit -> dimension, factor to the unit of the schema (deg, m, m/s, rad/s)
UNITS: dict[str, tuple[str, float]] = {
    "deg": ("angle", 1.0),
    "rad": ("angle", 180.0 / math.pi),
    "m": ("length", 1.0),
    "mm": ("length", 1e-3),
    "cm": ("length", 1e-2),
    "m/s": ("speed", 1.0),
    "mm/s": ("speed", 1e-3),
    "cm/s": ("speed", 1e-2),
    "km/h": ("speed", 1.0 / 3.6),
    "mph": ("speed", 0.44704),
    "rad/s": ("rate", 1.0),
    "rpm": ("rate", math.pi / 30.0),
    "rps": ("rate", 2.0 * math.pi),
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


# name to dimension: columns of the schema, raw velocities, and names that a convention must make clear
COMMON: dict[str, str] = HEADERS["columns"]["common"]
RAW: dict[str, str] = HEADERS["columns"]["raw"]
OPEN: dict[str, str] = HEADERS["columns"]["open"]
_ALIASES: dict[str, str] = HEADERS["columns"]["aliases"]
_NAMES: dict[str, list[str]] = HEADERS["names"]
_ANGLE_FROM = re.compile(r"(?P<name>\w+)_from_(the_)?(?P<from>normal|wall|surface)")
WALL_ANGLE = "angle_from_wall"


@dataclass(frozen=True)
class Role:
    """What a column holds.

    Attributes
    ----------
    kind : str
        ``common``, ``common_error`` (of rows, see `ifrfit.data.common_errors`), ``observable``, ``open`` (a
        choice is left open), ``raw``, ``angle`` (perhaps of incidence), ``sigma`` or ``sd`` (of the
        observable `name`), ``sigma_raw``, ``magnitude``, ``ignored`` or ``unknown``.
    name : str
        Name without unit: a key of `COMMON` or `RAW`, an observable (``delta_deg``, ``beta``) or an open
        name.
    dimension : str
        ``text``, ``number``, ``angle``, ``length``, ``speed`` or ``rate``.
    unit : str or None
        The unit that the header states.
    """

    kind: str
    name: str
    dimension: str = "text"
    unit: str | None = None


def _is_ignored(name: str) -> bool:
    return name.startswith(tuple(_NAMES["ignored"])) or name in _NAMES["bookkeeping"]


def _observable_name(base: str) -> str | None:
    return base if base in OBSERVABLES else f"{base}_deg" if f"{base}_deg" in OBSERVABLES else None


def _meanings(header: Header) -> Iterator[Role]:
    """Yield what the name can mean, without looking at units."""
    name, unit = _ALIASES.get(header.name, header.name), header.unit
    found = False
    for role in _untimed(name, unit):
        found = True
        yield role
    if not found:
        yield from _timed(name, unit)


def _timed(name: str, unit: str | None) -> Iterator[Role]:
    """Yield what a name means that says before or after: ``v_in``, ``angle_out``, ``rebound_speed``."""
    sigma = name.startswith("sigma_")
    name = name.removeprefix("sigma_")
    name, _, place = name.partition("_from_")
    place = place.removeprefix("the_")
    for number, time in enumerate(("before", "after")):
        for word in HEADERS["times"][time]:
            rest = (
                name.removesuffix(f"_{word}") if name.endswith(f"_{word}") else name.removeprefix(f"{word}_")
            )
            meant = HEADERS["timed"].get(rest) if rest != name else None
            if meant is None:
                continue
            key = str(meant[number])
            if key.startswith("angle"):
                yield from _timed_angle(key, place, unit, sigma=sigma)
            elif not place:
                dimension = RAW.get(key, "speed")
                kind = "sigma_raw" if sigma else "common" if key in COMMON else "raw"
                yield Role(kind, key, dimension, unit)


def _timed_angle(key: str, place: str, unit: str | None, *, sigma: bool) -> Iterator[Role]:
    """Yield the angle of what comes or of what leaves, which may say from where it is measured."""
    if place not in ("", "normal", "wall", "surface"):
        return
    wall = place in ("wall", "surface")
    if key == "angle_after":
        name = key if sigma or not place else f"{key}_from_{'wall' if wall else 'normal'}"
        yield Role("sigma_raw" if sigma else "raw", name, "angle", unit)
    elif sigma:
        yield Role("common", "sigma_gamma", "angle", unit)
    else:
        yield Role("angle", "angle" if not place else WALL_ANGLE if wall else "gamma", "angle", unit)


def _untimed(name: str, unit: str | None) -> Iterator[Role]:
    """Yield what a name means that says nothing of before or after."""
    if name in RAW and not (name in OBSERVABLES and unit in (None, "1")):
        yield Role("raw", name, RAW[name], unit)
    if name in ("v_n", "v_t") and unit not in (None, "1"):
        yield Role("raw", "v_n" if name == "v_n" else "v_x", "speed", unit)
    if name in COMMON:
        yield Role("common", name, COMMON[name], unit)
    shared = dimension_of(name)
    if shared is not None:
        yield Role("common_error", name, shared, unit)
    observable = _observable_name(name)
    if observable:
        dimension = "angle" if OBSERVABLES[observable].unit == "deg" else "number"
        yield Role("observable", observable, dimension, unit)
    if name in OPEN:
        yield Role("open", "e_t" if name == "et" else name, OPEN[name], unit)
    if name in _NAMES["angles"]:
        yield Role("angle", name, "angle", unit)
    stated = _ANGLE_FROM.fullmatch(name)
    if stated and stated["name"] in (*_NAMES["angles"], "gamma"):
        yield Role("angle", "gamma" if stated["from"] == "normal" else WALL_ANGLE, "angle", unit)
    if name in _NAMES["magnitudes"]:
        yield Role("magnitude", name, "number", unit)
    yield from _uncertainty(name, unit)


def _uncertainty(name: str, unit: str | None) -> Iterator[Role]:
    of = name.removeprefix("sigma_") if name.startswith("sigma_") else name.removesuffix("_sigma")
    if of != name:
        for role in _meanings(Header(of, unit)):
            if role.kind in ("observable", "open", "raw"):
                kind = "sigma_raw" if role.kind == "raw" else "sigma"
                yield Role(kind, role.name, role.dimension, unit)
            elif role.name == "gamma" or role.kind == "angle":
                yield Role("common", "sigma_gamma", "angle", unit)
            elif role.name == "speed":
                yield Role("sigma_raw", "speed", "speed", unit)
            elif role.name in ("spin_x", "spin_y"):
                yield Role("common", f"sigma_{role.name}", "number", unit)
    if name.startswith("sd_"):
        for role in _meanings(Header(name.removeprefix("sd_"), unit)):
            if role.kind in ("observable", "open"):
                yield Role("sd", role.name, role.dimension, unit)


def role_of(text: str) -> Role:
    """Return what the header cell `text` holds; kind ``unknown`` if nothing known.

    A unit that is no unit, or one that does not fit the column, is kept in ``unit`` for the caller to refuse.
    """
    header = parse_header(text)
    if _is_ignored(header.name):
        return Role("ignored", header.name)
    short = header.without_suffix()
    if short is not None:
        for role in _meanings(short):
            if UNITS[str(short.unit)][0] == role.dimension:
                return role
    for role in _meanings(header):
        return role
    return Role("unknown", header.name, unit=header.unit)


_NUMBERED = re.compile(
    r"^(?P<sigma>sigma_)?(?P<of>v|angle|theta|omega|spin)_?(?P<time>[12])(?=$|[_\s\[(])", re.IGNORECASE
)


def numbered_role(text: str) -> Role:
    """Return what a header holds that calls before 1 and after 2, as ``v1`` and ``theta2_deg``."""
    match = _NUMBERED.match(text.strip())
    if match is None:
        return Role("unknown", parse_header(text).name)
    time = "in" if match["time"] == "1" else "out"
    return role_of(f"{match['sigma'] or ''}{match['of']}_{time}{text.strip()[match.end() :]}")


def named_role(name: str, header: str, given_unit: str | None) -> Role:
    """Return what a column holds that the user named, or whose unit the user stated.

    Parameters
    ----------
    name : str
        Name of the schema, of an observable or of a raw velocity, with or without a unit (``v_x``,
        ``v_x_m_s``).
    header : str
        As it stands in the file; the unit in its brackets or at its end holds unless one is stated.
    given_unit : str or None
        Unit that the user stated.
    """
    target, own = parse_header(name), parse_header(header)
    if _is_ignored(target.name):
        return Role("ignored", target.name)
    short, suffix = target.without_suffix(), own.without_suffix()
    names = [h.name for h in (target, short) if h is not None]
    # A unit at the end of a name may be no unit at all (sigma_m): it counts where it fits.
    sure = given_unit or own.unit or target.unit
    perhaps = [sure] if sure else [h.unit for h in (suffix, short) if h is not None]
    for unit in perhaps:
        for role in (r for n in names for r in _meanings(Header(n, unit))):
            if unit in UNITS and UNITS[unit][0] == role.dimension:
                return role
    for role in (r for n in names for r in _meanings(Header(n, sure))):
        return role
    return Role("unknown", target.name, unit=sure)


def uncertainty_of(name: str) -> str | None:
    """Return the sigma column that an uncertainty means ("beta_err": sigma_beta), None for other names.

    Only what is left of the name without its "err", "u_", "std" and so on counts, and it must be known.
    """
    plain = parse_header(name).name
    stems = [plain.removeprefix(x) for x in _NAMES["uncertain_prefixes"] if plain.startswith(x)]
    stems += [plain.removesuffix(x) for x in _NAMES["uncertain_suffixes"] if plain.endswith(x)]
    for stem in stems:
        for role in _uncertainty(f"sigma_{stem}", None):
            named = role.name if role.kind == "common" else f"sigma_{role.name}"
            return "sigma_gamma_deg" if named == "sigma_gamma" else named
    return None


_SHORTEST = 2  # letters: a single one resembles too much
_SEVERAL = re.compile(r"[,;:/|]")  # between a name and what is said of it, which decides


def closest(name: str) -> str | None:
    """Return the known column name that `name` resembles most, None if it resembles none.

    An uncertainty is never taken for a value.
    """
    plain = parse_header(name).name
    sigma = uncertainty_of(name)
    if sigma is not None:
        return sigma
    if plain == "e":  # too short to resemble anything: the restitution of most tables
        return "e_n"
    return "impact_id" if plain in _NAMES["numbering"] else next(iter(close_names(plain)), None)


def close_names(name: str, most: int = 1, also: Iterable[str] = ()) -> list[str]:
    """Return up to `most` of the known column names and `also` that resemble `name`, the closest first."""
    # with their units, which other names have not
    schema = {"gamma": "gamma_deg", "sigma_gamma": "sigma_gamma_deg", "speed": "speed_m_s"}
    si = {"speed": "m_s", "rate": "rad_s", "length": "m", "angle": "deg"}
    names = [
        *(schema.get(each, each) for each in COMMON),
        *OBSERVABLES,
        *(f"sigma_{o}" for o in OBSERVABLES),
        *(f"{each}_{si[dimension]}" for each, dimension in RAW.items()),
        *OPEN,
        *_NAMES["angles"],
    ]
    plain = parse_header(name).name
    if len(plain) < _SHORTEST or _SEVERAL.search(plain):
        return []
    return difflib.get_close_matches(plain, dict.fromkeys([*names, *also]), n=most, cutoff=0.6)
