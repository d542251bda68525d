"""What a header can mean: the columns of the schema, the observables, and raw velocities."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ifrfit.data.units import UNITS, Header, parse_header
from ifrfit.physics.observables import OBSERVABLES

# name -> dimension
COMMON = {
    "series": "text",
    "observable": "text",
    "gamma": "angle",
    "tan_gamma": "number",
    "spin_x": "number",
    "spin_y": "number",
    "sigma_spin_x": "number",
    "sigma_spin_y": "number",
    "speed": "speed",
    "value": "number",
    "sigma": "number",
    "sigma_gamma": "angle",
    "impact_id": "text",
    "provenance": "text",
    "n_repeats": "number",
    "sd": "number",
}
RAW = {
    "u_x": "speed",
    "u_y": "speed",
    "u_z": "speed",
    "v_x": "speed",
    "v_y": "speed",
    "v_z": "speed",
    "omega_x": "rate",
    "omega_y": "rate",
    "omega_z": "rate",
    "omega_x_after": "rate",
    "omega_y_after": "rate",
    "omega_z_after": "rate",
    "radius": "length",
    "diameter": "length",
}
_ALIASES = {
    "n": "n_repeats",
    "u": "speed",
    "impact_speed": "speed",
    "id": "impact_id",
    "en": "e_n",
    "std": "sd",
}
_ALIASES |= {f"omega_after_{axis}": f"omega_{axis}_after" for axis in "xyz"}
# Names that could be an incidence angle, but do not say from where it is measured.
_ANGLES = (
    "alpha",
    "theta",
    "angle",
    "impact_angle",
    "incidence_angle",
    "incident_angle",
    "angle_of_incidence",
)
_ANGLE_FROM = re.compile(r"(?P<name>\w+)_from_(the_)?(?P<from>normal|wall|surface)")
WALL_ANGLE = "angle_from_wall"
_MAGNITUDES = ("abs_beta", "beta_abs", "abs(beta)", "|beta|", "beta_magnitude", "mod_beta")
# Observables under names that leave a choice open; conventions.py closes it.
OPEN = {"e_t": "number", "et": "number", "psi": "angle", "tan_psi": "number"}
_IGNORED = ("note", "comment", "remark")
_BOOKKEEPING = ("source", "row")
# Names that often number the impacts: suggested, never assumed.
_NUMBERING = ("shot", "impact", "nr", "no", "no.", "number", "event", "hit", "bounce", "trial", "#")


@dataclass(frozen=True)
class Role:
    """What a column holds.

    Attributes
    ----------
    kind : str
        ``common``, ``observable``, ``open`` (a choice is left open), ``raw``, ``angle`` (perhaps of
        incidence), ``sigma`` or ``sd`` (of the observable `name`), ``sigma_raw``, ``magnitude``, ``ignored``
        or ``unknown``.
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


def _observable_name(base: str) -> str | None:
    return base if base in OBSERVABLES else f"{base}_deg" if f"{base}_deg" in OBSERVABLES else None


def _meanings(header: Header) -> Iterator[Role]:
    """Yield what the name can mean, without looking at units."""
    name, unit = _ALIASES.get(header.name, header.name), header.unit
    if name in RAW and not (name in OBSERVABLES and unit in (None, "1")):
        yield Role("raw", name, RAW[name], unit)
    if name == "v_n" and unit not in (None, "1"):
        yield Role("raw", name, "speed", unit)
    if name in COMMON:
        yield Role("common", name, COMMON[name], unit)
    observable = _observable_name(name)
    if observable:
        dimension = "angle" if OBSERVABLES[observable].unit == "deg" else "number"
        yield Role("observable", observable, dimension, unit)
    if name in OPEN:
        yield Role("open", "e_t" if name == "et" else name, OPEN[name], unit)
    if name in _ANGLES:
        yield Role("angle", name, "angle", unit)
    stated = _ANGLE_FROM.fullmatch(name)
    if stated and stated["name"] in (*_ANGLES, "gamma"):
        yield Role("angle", "gamma" if stated["from"] == "normal" else WALL_ANGLE, "angle", unit)
    if name in _MAGNITUDES:
        yield Role("magnitude", name, "number", unit)
    yield from _uncertainty(name, unit)


def _uncertainty(name: str, unit: str | None) -> Iterator[Role]:
    of = name.removeprefix("sigma_") if name.startswith("sigma_") else name.removesuffix("_sigma")
    if of != name:
        for role in _meanings(Header(name, of, unit)):
            if role.kind in ("observable", "open", "raw"):
                kind = "sigma_raw" if role.kind == "raw" else "sigma"
                yield Role(kind, role.name, role.dimension, unit)
            elif role.name == "gamma" or role.kind == "angle":
                yield Role("common", "sigma_gamma", "angle", unit)
            elif role.name in ("spin_x", "spin_y"):
                yield Role("common", f"sigma_{role.name}", "number", unit)
    if name.startswith("sd_"):
        for role in _meanings(Header(name, name.removeprefix("sd_"), unit)):
            if role.kind in ("observable", "open"):
                yield Role("sd", role.name, role.dimension, unit)


def role_of(text: str) -> Role:
    """Return what the header cell `text` holds; kind ``unknown`` if nothing known.

    A unit that is no unit, or one that does not fit the column, is kept in ``unit`` for the caller to refuse.
    """
    header = parse_header(text)
    if header.name.startswith(_IGNORED) or header.name in _BOOKKEEPING:
        return Role("ignored", header.name)
    short = header.without_suffix()
    if short is not None:
        for role in _meanings(short):
            if UNITS[str(short.unit)][0] == role.dimension:
                return role
    for role in _meanings(header):
        return role
    return Role("unknown", header.name, unit=header.unit)


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
    if target.name.startswith(_IGNORED) or target.name in _BOOKKEEPING:
        return Role("ignored", target.name)
    short, suffix = target.without_suffix(), own.without_suffix()
    names = [h.name for h in (target, short) if h is not None]
    # A unit at the end of a name may be no unit at all (sigma_m): it counts where it fits.
    sure = given_unit or own.unit or target.unit
    perhaps = [sure] if sure else [h.unit for h in (suffix, short) if h is not None]
    for unit in perhaps:
        for role in (r for n in names for r in _meanings(Header(header, n, unit))):
            if unit in UNITS and UNITS[unit][0] == role.dimension:
                return role
    for role in (r for n in names for r in _meanings(Header(header, n, sure))):
        return role
    return Role("unknown", target.name, unit=sure)


def is_known(text: str) -> bool:
    """Tell whether a cell reads like a header."""
    return role_of(text).kind != "unknown"


def closest(name: str) -> str | None:
    """Return the known column name that `name` resembles most, None if it resembles none."""
    plain = parse_header(name).name
    return "impact_id" if plain in _NUMBERING else next(iter(close_names(plain)), None)


def close_names(name: str, most: int = 1, also: Iterable[str] = ()) -> list[str]:
    """Return up to `most` of the known column names and `also` that resemble `name`, the closest first."""
    names = [
        *schema_names(),
        *OBSERVABLES,
        *(f"sigma_{o}" for o in OBSERVABLES),
        *raw_names(),
        *OPEN,
        *_ANGLES,
    ]
    plain = parse_header(name).name
    return difflib.get_close_matches(plain, dict.fromkeys([*names, *also]), n=most, cutoff=0.6)


def schema_names() -> list[str]:
    """Return the column names of the schema with their units."""
    unit = {"gamma": "gamma_deg", "sigma_gamma": "sigma_gamma_deg", "speed": "speed_m_s"}
    return [unit.get(name, name) for name in COMMON]


def raw_names() -> list[str]:
    """Return the column names of raw velocities with SI units."""
    unit = {"speed": "m_s", "rate": "rad_s", "length": "m"}
    return [f"{name}_{unit[dimension]}" for name, dimension in RAW.items()]
