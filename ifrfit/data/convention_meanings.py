"""What each convention means, in words, with an example of each."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ifrfit.data.column_names import UNITS
from ifrfit.data.conventions import CHOICES, SHORTHANDS, suggest


@dataclass(frozen=True)
class Meaning:
    """One convention in words.

    Attributes
    ----------
    about : str
        What it says of a table.
    example : str
        A convention as it is given.
    unset : str
        What holds without it.
    choices : mapping of str to str
        What each choice means; choices that are no fixed words are written as in `CHOICES`.
    """

    about: str
    example: str
    unset: str
    choices: Mapping[str, str] = field(default_factory=dict)


_DIMENSIONS = {
    "angle": "angles",
    "length": "lengths",
    "speed": "speeds",
    "rate": "spins",
    "number": "ratios",
}

MEANINGS: Mapping[str, Meaning] = {
    "angle": Meaning(
        "the column of the angle of incidence, from where it is measured, and in what",
        "angle=alpha:from-wall:deg",
        "the column whose header says so, from the wall's normal, in the unit of its header",
        {
            "from-normal": "0 is head-on, 90 degrees grazes the wall",
            "from-wall": "0 grazes the wall, 90 degrees is head-on",
            "COLUMN[:from-normal|:from-wall][:deg|:rad|:tan]": "the header of the column, and what is known "
            "of it; tan: the column holds the tangent of the angle from the normal",
        },
    ),
    "beta": Meaning(
        "what a column 'beta' holds",
        "beta=opposite-sign",
        "contact",
        {
            "contact": "-V_t/U_t of the point of contact: -1 where it slides on as before, 1 where it "
            "is reversed",
            "opposite-sign": "V_t/U_t of the point of contact: the other sign",
            "centre": "-v_t/u_t of the sphere's centre (beta_cm)",
        },
    ),
    "e_t": Meaning(
        "what a column 'e_t' holds, which is refused unless it is said",
        "e_t=centre",
        "refused: it could be the constant of a closure, which is no observation",
        {"centre": "v_t'/v_t of the sphere's centre (-beta_cm)"},
    ),
    "psi": Meaning(
        "over which normal velocity psi and tan psi after impact are taken",
        "psi=over-outgoing",
        "refused: both are in use",
        {
            "over-incoming": "tan psi = V_t/u_n, with the normal velocity before impact",
            "over-outgoing": "tan psi = V_t/v_n, with the normal velocity after impact",
        },
    ),
    "z": Meaning(
        "where z points in a table of velocities",
        "z=out-of-wall",
        "into-wall",
        {
            "into-wall": "z points into the wall: u_z is positive before impact",
            "out-of-wall": "z points out of the wall, in a right-handed frame all the same: y and z of "
            "velocities and spins change sign",
        },
    ),
    "spin": Meaning(
        "what a positive spin is in a column that names no axis, as spin_in_rpm and spin_out_rpm",
        "spin=topspin",
        "refused: both are in use; omega_y is right-handed about y",
        {
            "topspin": "the way a ball rolls on along its own motion",
            "backspin": "the other way",
        },
    ),
    "pair": Meaning(
        "who hit whom in a table of velocities",
        "pair=equal-spheres",
        "a sphere and a wall",
        {"equal-spheres": "two equal spheres: relative velocities and the sum of both spins (docs/pairs.md)"},
    ),
    "sports": Meaning(
        "tables of balls on courts: all angles from the surface, topspin positive, 1 before and 2 after; "
        "that is "
        "angle=from-wall, spin=topspin and columns such as v1, theta1, v2, theta2, omega2 read as v_in, "
        "angle_in, "
        "v_out, angle_out, spin_out",
        "sports",
        "both are asked for, each by itself",
    ),
    "provenance": Meaning(
        "where rows come from that do not say it themselves",
        "provenance=published",
        "not stated",
        {
            "measured": "by the user",
            "published": "printed in a paper, as a table or as data of its figures",
            "digitised": "read off a figure",
            "simulated": "made by a computation",
        },
    ),
    "column:NAME": Meaning(
        "which column holds a quantity; NAME is as in 'ifrfit template' or 'ifrfit template --raw'",
        "column:beta=reversal",
        "the column whose header is that name, or one that is known to mean it",
        {"HEADER": "as it stands in the file"},
    ),
    "unit:HEADER": Meaning(
        "the unit of a column whose header states none",
        "unit:speed=mm/s",
        "the unit in the header",
        {
            ", ".join(unit for unit, (dimension, _) in UNITS.items() if dimension == name): plural
            for name, plural in _DIMENSIONS.items()
        },
    ),
    "ignore": Meaning(
        "columns to pass over",
        "ignore=remark,operator",
        "every column must be understood",
        {"HEADER[,HEADER...]": "as they stand in the file"},
    ),
    "sheet": Meaning(
        "which sheet of a spreadsheet is read",
        "sheet=impacts",
        "the only one that holds anything",
        {"NAME": "as its tab has it"},
    ),
    "x": Meaning(
        "of a digitised figure (docs/how-to/digitise.md), what its x axis is",
        "x=gamma_deg",
        "the file is a table of impacts; the project of a digitiser is refused",
        {"HEADER": "an angle of incidence as a table would call it, with its unit"},
    ),
    "y": Meaning(
        "of a digitised figure, what its y axis is",
        "y=beta",
        "as for x: both are said, or none",
        {"HEADER": "an observable as a table would call it, with its unit"},
    ),
    "axes": Meaning(
        "of a digitised figure with several axes, which are meant",
        "axes=XY",
        "those that have points",
        {"NAME": "as in the digitiser"},
    ),
    "dataset": Meaning(
        "of a digitised figure, which points are meant; repeatable",
        "dataset=glass",
        "all on the axes",
        {"NAME": "of the dataset or the curve, as in the digitiser"},
    ),
    "series": Meaning(
        "of a digitised figure, the series that each dataset is, in their order; repeatable",
        "series=glass",
        "the names of the datasets",
        {"NAME": "one for each dataset, or one for all"},
    ),
    "pixels": Meaning(
        "of a digitised figure, by how many pixels a click is wrong: one standard error in each direction",
        "pixels=0.5",
        "1",
        {"NUMBER": "of the picture that was clicked in"},
    ),
    "bars": Meaning(
        "of a digitised figure, what half an error bar is, where ends of bars were read off",
        "bars=2sigma",
        "bars are left out, with a note",
        {
            "sigma": "one standard error",
            "2sigma": "two standard errors",
            "95%": "half of an interval that holds the value with this probability, of normal errors",
            "NUMBER": "so many standard errors",
        },
    ),
}

# conventions with a choice that is a word, for shells that complete what is typed
WORDS: tuple[str, ...] = tuple(
    f"{name}={choice}"
    for name, choices in CHOICES.items()
    if ":" not in name
    for choice in choices
    if choice == choice.lower()
) + tuple(SHORTHANDS)


def convention_lines(width: int) -> Iterator[str]:
    """All conventions, each with its choices and an example, as lines.

    Parameters
    ----------
    width : int
        Longest line, where words allow.
    """
    yield from textwrap.wrap(
        "A table that was written in another way is converted once it is said how: --convention NAME=CHOICE, "
        "as often as it takes. Nothing is guessed.",
        width,
    )
    for name, meaning in MEANINGS.items():
        yield ""
        yield from textwrap.wrap(f"{name}: {meaning.about}", width, subsequent_indent="    ")
        column = max((len(choice) for choice in meaning.choices if len(choice) <= _COLUMN), default=0)
        for choice, says in meaning.choices.items():
            start = f"    {choice:{column}}  "
            if len(choice) > _COLUMN:
                yield f"    {choice}"
                start = " " * (6 + column)
            yield from textwrap.wrap(says, width, initial_indent=start, subsequent_indent=" " * (6 + column))
        yield from textwrap.wrap(
            f"without it: {meaning.unset}", width, initial_indent="    ", subsequent_indent="      "
        )
        yield f"    example: {suggest(meaning.example)}"


_COLUMN = 24  # choices longer than this have a line of their own
