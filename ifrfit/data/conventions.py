"""Conventions that a table may follow: converted when they are named, never guessed."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from ifrfit.data.column_names import RAW, UNITS, close_names, named_role, unit_name
from ifrfit.data.figures.question import KEYS, FigureQuestion, figure_question
from ifrfit.data.schema import PROVENANCES, provenance_name
from ifrfit.errors import UsageError
from ifrfit.physics.observables import OBSERVABLES

ANGLE_FROM = ("from-normal", "from-wall")
ANGLE_UNITS = ("deg", "rad", "tan")
CHOICES: dict[str, tuple[str, ...]] = {
    "angle": (*ANGLE_FROM, "COLUMN[:from-normal|:from-wall][:deg|:rad|:tan]"),
    "beta": ("contact", "opposite-sign", "centre"),
    "e_t": ("centre",),
    "psi": ("over-incoming", "over-outgoing"),
    "z": ("into-wall", "out-of-wall"),
    "spin": ("topspin", "backspin"),
    "pair": ("equal-spheres",),
    "sports": (),
    "provenance": tuple(p for p in PROVENANCES if p != "stand-in"),
    "column:NAME": ("HEADER",),
    "unit:HEADER": tuple(UNITS),
    "ignore": ("HEADER[,HEADER...]",),
    "sheet": ("NAME",),
    "x": ("HEADER",),
    "y": ("HEADER",),
    "axes": ("NAME",),
    "dataset": ("NAME",),
    "series": ("NAME",),
    "pixels": ("NUMBER",),
    "bars": ("sigma", "2sigma", "95%", "NUMBER"),
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
OPEN_QUESTIONS["spin"] = (
    "is positive for topspin, the way a ball rolls on along its own motion, or for backspin. Say which: "
    "--convention spin=topspin or spin=backspin; or give its component along y as omega_y and omega_y_after"
)
# a word for several conventions that go together
SHORTHANDS: dict[str, dict[str, str]] = {
    "sports": {"angle": "from-wall", "spin": "topspin", "sports": "numbered"},
}
_WHY_PAIR = (
    " Two equal spheres are a wall in the relative frame; of other pairs radii, masses and inertia factors "
    "of both bodies enter, and ifrfit does not read them. For impacts on a wall leave the convention away."
)
OPEN_QUESTIONS["tan_psi"] = OPEN_QUESTIONS["psi"]


@dataclass(frozen=True)
class Conventions:
    """What the user said about a table.

    Attributes
    ----------
    angle_column, angle_from, angle_unit : str or None
        Which column is the incidence angle, from where it is measured, and in what.
    choices : mapping of str to str
        Of ``beta``, ``e_t``, ``psi``, ``z``, ``spin`` and ``pair``; ``sports`` where v1 is before and v2
        after.
    columns : mapping of str to str
        Header in the file to the name of the schema.
    units : mapping of str to str
        Header in the file to its unit.
    ignored : tuple of str
        Headers to pass over, or lists of them separated by commas; the file tells which.
    provenance : str
        Of the rows that do not state theirs; empty if the user said nothing.
    figure : FigureQuestion or None
        What the axes of a digitised figure are.
    sheet : str or None
        Which sheet of a spreadsheet is read.
    """

    angle_column: str | None = None
    angle_from: str | None = None
    angle_unit: str | None = None
    choices: Mapping[str, str] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    provenance: str = ""
    figure: FigureQuestion | None = None
    sheet: str | None = None

    @property
    def headers(self) -> tuple[str, ...]:
        """Return the headers that the user named for what they hold."""
        angle = (self.angle_column,) if self.angle_column else ()
        return (*angle, *self.columns, *self.units)

    @property
    def mentioned(self) -> set[str]:
        """Every text that could be a header which the user named."""
        parts = (part.strip() for text in self.ignored for part in text.split(","))
        return {*self.headers, *self.ignored, *parts}

    @property
    def out_of_wall(self) -> bool:
        """Whether z points out of the wall."""
        return self.choices.get("z") == "out-of-wall"

    @property
    def of_pair(self) -> bool:
        """Whether rows are collisions of two equal spheres, seen from the centre of one of them."""
        return "pair" in self.choices

    def ignores(self, there: Collection[str]) -> set[str]:
        """Return the headers of a file to pass over.

        A text that is a header stands for itself, commas and all; else its parts must be headers.

        Raises
        ------
        UsageError
            One of them is not there, or is also given a meaning.
        """
        found: set[str] = set()
        for text in self.ignored:
            parts = [text] if text in there else [part.strip() for part in text.split(",") if part.strip()]
            missing = [part for part in parts if part not in there]
            if missing:
                raise UsageError(
                    f"--convention ignore={text}: there is no column '{missing[0]}'. The columns are "
                    f"{', '.join(there)}."
                )
            found.update(parts)
        for header in self.headers:
            if header in found:
                raise UsageError(f"--convention: the column '{header}' is both named and ignored. Keep one.")
        return found

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
        ``e_t=centre``, ``psi=over-outgoing``, ``column:beta=HEADER``, ``unit:HEADER=mm/s``,
        ``ignore=HEADER`` or ``ignore=HEADER,HEADER``, ``provenance=measured``, ``spin=topspin``
        (spins without an axis are positive the way a ball rolls on), ``sports`` for both of
        ``angle=from-wall`` and ``spin=topspin``, with 1 before and 2 after, and ``z=out-of-wall``: z points
        out of the wall, in a frame that is right-handed all the same. Such a frame is
        turned half round about x, so y and z components of velocities and of right-handed spins
        change sign; x components stay. ``pair=equal-spheres``: velocities are those of one sphere's centre
        relative to the other's and spins the sum of both spheres', which makes such a pair a wall
        (docs/pairs.md); no number changes. ``sheet=NAME`` of a spreadsheet. Of a digitised figure
        ``x=gamma_deg``, ``y=beta``, ``axes=NAME``, ``dataset=NAME``, ``series=NAME``, ``pixels=1`` and
        ``bars=sigma``; see
        `ifrfit.read_figure`.

    Raises
    ------
    UsageError
        An unknown name or choice, or two choices for one name.
    """
    if isinstance(convention, str):
        convention = (convention,)
    given: object = convention
    if not isinstance(given, Mapping | Sequence) or not all(isinstance(c, str) for c in given):
        raise UsageError(f"--convention: {convention!r:.60} is neither NAME=CHOICE nor several of these.")
    pairs = list(convention.items()) if isinstance(convention, Mapping) else [_split(c) for c in convention]
    pairs = [each for pair in pairs for each in _written_out(*pair)]
    angle: dict[str, str] = {}
    choices: dict[str, str] = {}
    columns: dict[str, str] = {}
    units: dict[str, str] = {}
    ignored: list[str] = []
    figure: dict[str, list[str]] = {}
    sheet: dict[str, str] = {}
    for name, choice in pairs:
        kind, _, of = name.partition(":")
        if name == "angle":
            _update(angle, _angle(choice), name)
        elif name in SHORTHANDS:
            choices[name] = choice
        elif name in ("beta", "e_t", "psi", "z", "spin", "pair", "provenance"):
            _update(choices, {name: _choice(name, choice)}, name)
        elif kind == "column" and of:
            _update(columns, {choice: _column(of, choice)}, name)
        elif kind == "unit" and of:
            _update(units, {of: _unit(of, choice)}, name)
        elif name == "ignore":
            ignored.append(choice)
        elif name == "sheet":
            _update(sheet, {name: choice}, name)
        elif name in KEYS:
            figure.setdefault(name, []).append(choice)
        else:
            raise UsageError(f"--convention {name}={choice}: unknown name. {_list_choices()}.")
    provenance = choices.pop("provenance", "")
    return Conventions(
        angle.get("column"),
        angle.get("from"),
        angle.get("unit"),
        choices,
        columns,
        units,
        tuple(ignored),
        provenance,
        _figure(figure),
        sheet.get("sheet"),
    )


def _figure(given: Mapping[str, list[str]]) -> FigureQuestion | None:
    once: dict[str, str | None] = {}
    for key in ("x", "y", "axes", "pixels", "bars"):
        texts = given.get(key, [])
        if len(set(texts)) > 1:
            raise UsageError(f"--convention {key}: both '{texts[0]}' and '{texts[1]}' are given. Keep one.")
        once[key] = texts[0] if texts else None
    return figure_question(
        once["x"],
        once["y"],
        once["axes"],
        given.get("dataset", ()),
        given.get("series", ()),
        once["pixels"],
        once["bars"],
    )


def _choice(name: str, choice: str) -> str:
    meant = (provenance_name(choice) or choice) if name == "provenance" else choice
    if meant not in CHOICES[name]:
        why = _WHY_PAIR if name == "pair" else ""
        if meant == "stand-in":
            why = " A stand-in says so in the file itself."
        raise UsageError(f"--convention {name}={choice}: the choices are {', '.join(CHOICES[name])}.{why}")
    return meant


def suggest(convention: str) -> str:
    """Return the option as it can be pasted into a shell."""
    return f"--convention {shlex.quote(convention)}"


def _split(text: str) -> tuple[str, str]:
    name, equals, choice = text.partition("=")
    if name.strip() in SHORTHANDS and not equals:
        return name.strip(), ""
    if not equals or not choice.strip():
        raise UsageError(f"--convention {text}: write NAME=CHOICE. {_list_choices()}.")
    return name.strip(), choice.strip()


def _written_out(name: str, choice: str) -> list[tuple[str, str]]:
    """The conventions that a word stands for; any other stands for itself."""
    if name not in SHORTHANDS:
        return [(name, choice)]
    if choice:
        raise UsageError(f"--convention {name}={choice}: takes no choice. Write --convention {name}.")
    return list(SHORTHANDS[name].items())


def _list_choices() -> str:
    return "Known are " + "; ".join(
        name if name in SHORTHANDS else f"{name}={'|'.join(choices)}" for name, choices in CHOICES.items()
    )


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
    if named_role(name, name, None).kind == "unknown":
        close = close_names(name, 3, RAW)
        near = f"; close are {', '.join(close)}" if close else ""
        if named_role(header, header, None).kind != "unknown":
            raise UsageError(
                f"{suggest(f'column:{name}={header}')}: the name of the schema stands first, the header of "
                f"your table behind it: {suggest(f'column:{header}={name}')}."
            )
        raise UsageError(
            f"--convention column:{name}={header}: '{name}' is no column{near}. A column is one of the "
            "common schema, an observable or a raw velocity; see 'ifrfit template' and 'ifrfit template "
            "--raw'."
        )
    return name


def _unit(header: str, text: str) -> str:
    unit = unit_name(text)
    if unit not in UNITS:
        raise UsageError(f"--convention unit:{header}={text}: unknown unit. Known are {', '.join(UNITS)}.")
    return unit
