"""Conventions that a table may follow: converted when they are named, never guessed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ifrfit.data.columns import COMMON, RAW
from ifrfit.data.schema import OBSERVABLES
from ifrfit.data.units import UNITS, unit_name
from ifrfit.errors import UsageError

ANGLE_FROM = ("from-normal", "from-wall")
ANGLE_UNITS = ("deg", "rad", "tan")
CHOICES: dict[str, tuple[str, ...]] = {
    "angle": (*ANGLE_FROM, "COLUMN[:from-normal|:from-wall][:deg|:rad|:tan]"),
    "beta": ("contact", "opposite-sign", "centre"),
    "e_t": ("centre",),
    "psi": ("over-incoming", "over-outgoing"),
    "column:NAME": ("HEADER",),
    "unit:HEADER": tuple(UNITS),
}
_MEANING = {
    ("beta", "contact"): ("beta", 1.0),
    ("beta", "opposite-sign"): ("beta", -1.0),
    ("beta", "centre"): ("beta_cm", 1.0),
    ("e_t", "centre"): ("beta_cm", -1.0),
    ("psi", "over-incoming"): ("psi_after_deg", 1.0),
    ("psi", "over-outgoing"): ("psi_out_deg", 1.0),
    ("tan_psi", "over-incoming"): ("tan_psi_after", 1.0),
    ("tan_psi", "over-outgoing"): ("tan_psi_out", 1.0),
}
OPEN_QUESTIONS = {
    "e_t": "could be v_t'/v_t of the centre (= -beta_cm) or the closure constant, which is not an "
    "observation. If it is the centre's, say --convention e_t=centre",
    "psi": "could be taken over the incoming or the outgoing normal velocity. "
    "Say which: --convention psi=over-incoming or psi=over-outgoing",
    "magnitude": "a magnitude without its sign fits two mirror-image solutions wherever beta crosses zero. "
    "Give the signed values, beta = -V_t/U_t",
}
OPEN_QUESTIONS["tan_psi"] = OPEN_QUESTIONS["psi"]


@dataclass(frozen=True)
class Conventions:
    """What the user said about a table.

    Attributes
    ----------
    angle_column, angle_from, angle_unit : str or None
        Which column is the incidence angle, from where it is measured, and in what.
    choices : mapping of str to str
        Of ``beta``, ``e_t`` and ``psi``.
    columns : mapping of str to str
        Header in the file to the name of the schema.
    units : mapping of str to str
        Header in the file to its unit.
    """

    angle_column: str | None = None
    angle_from: str | None = None
    angle_unit: str | None = None
    choices: Mapping[str, str] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def headers(self) -> tuple[str, ...]:
        """Return the headers that the user named."""
        angle = (self.angle_column,) if self.angle_column else ()
        return (*angle, *self.columns, *self.units)

    def observable(self, name: str) -> tuple[str, float] | None:
        """Return the observable and the sign that a name stands for, None if it leaves a choice open."""
        choice = self.choices.get("psi" if name == "tan_psi" else name)
        if choice is not None:
            return _MEANING[name, choice]
        return (name, 1.0) if name in OBSERVABLES else None


def parse_conventions(convention: Sequence[str] | Mapping[str, str]) -> Conventions:
    """Read ``NAME=CHOICE`` strings, or the same as a mapping.

    Parameters
    ----------
    convention : sequence of str or mapping of str to str
        ``angle=from-wall``, ``angle=COLUMN:from-wall:rad``, ``beta=opposite-sign``, ``beta=centre``,
        ``e_t=centre``, ``psi=over-outgoing``, ``column:beta=HEADER``, ``unit:HEADER=mm/s``.

    Raises
    ------
    UsageError
        An unknown name or choice, or two choices for one name.
    """
    if isinstance(convention, str):
        convention = (convention,)
    pairs = list(convention.items()) if isinstance(convention, Mapping) else [_split(c) for c in convention]
    angle: dict[str, str] = {}
    choices: dict[str, str] = {}
    columns: dict[str, str] = {}
    units: dict[str, str] = {}
    for name, choice in pairs:
        kind, _, of = name.partition(":")
        if name == "angle":
            _update(angle, _angle(choice), name)
        elif name in ("beta", "e_t", "psi"):
            if choice not in CHOICES[name]:
                raise UsageError(f"--convention {name}={choice}: the choices are {', '.join(CHOICES[name])}.")
            _update(choices, {name: choice}, name)
        elif kind == "column" and of:
            _update(columns, {choice: _column(of, choice)}, name)
        elif kind == "unit" and of:
            _update(units, {of: _unit(of, choice)}, name)
        else:
            raise UsageError(f"--convention {name}={choice}: unknown name. {_list_choices()}.")
    return Conventions(angle.get("column"), angle.get("from"), angle.get("unit"), choices, columns, units)


def _split(text: str) -> tuple[str, str]:
    name, equals, choice = text.partition("=")
    if not equals or not choice.strip():
        raise UsageError(f"--convention {text}: write NAME=CHOICE. {_list_choices()}.")
    return name.strip(), choice.strip()


def _list_choices() -> str:
    return "Known are " + "; ".join(f"{name}={'|'.join(choices)}" for name, choices in CHOICES.items())


def _update(into: dict[str, str], new: Mapping[str, str], name: str) -> None:
    for key, value in new.items():
        if into.get(key, value) != value:
            raise UsageError(f"--convention {name}: both '{into[key]}' and '{value}' are given. Keep one.")
        into[key] = value


def _angle(choice: str) -> dict[str, str]:
    """Take the known words off the end; what remains names a column, which may hold colons itself."""
    found: dict[str, str] = {}
    words = choice.split(":")
    while words and (words[-1] in ANGLE_FROM or words[-1] in ANGLE_UNITS):
        word = words.pop()
        _update(found, {"from" if word in ANGLE_FROM else "unit": word}, "angle")
    column = ":".join(words)
    if column:
        found["column"] = column
    return found


def _column(name: str, header: str) -> str:
    known = [*COMMON, *RAW, *OBSERVABLES, *(f"sigma_{o}" for o in OBSERVABLES)]
    plain = {"gamma_deg": "gamma", "sigma_gamma_deg": "sigma_gamma", "speed_m_s": "speed"}.get(name, name)
    if plain not in known:
        raise UsageError(
            f"--convention column:{name}={header}: '{name}' is no column. Known are {', '.join(known)}."
        )
    return plain


def _unit(header: str, text: str) -> str:
    unit = unit_name(text)
    if unit not in UNITS:
        raise UsageError(f"--convention unit:{header}={text}: unknown unit. Known are {', '.join(UNITS)}.")
    return unit
