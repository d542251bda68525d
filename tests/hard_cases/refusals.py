"""Hard cases of data: what is refused, in which words, and what is skipped."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from hard_cases.case import FILE, OUT, HardCase, Told, command, in_a_process, put, refused
from hard_cases.synthetic import FAN, HEADER, values

_GOOD = "gamma_deg,beta,sigma\n10,0.42,0.05\n20,0.43,0.05\n50,-0.3,0.05\n"


def _fit(content: str | bytes | None) -> Callable[[Path], Told]:
    def run(folder: Path) -> Told:
        if content is not None:
            put(folder, content)
        return command(folder, ["fit", FILE, "--fix", "e_n=0.94", "--out", OUT])

    return run


def _case(name: str, what: str, content: str | bytes | None, *words: str, remedy: str) -> HardCase:
    answer = f"Refused with exit status 3, nothing written: {remedy}."
    return HardCase(name, "data refused", what, answer, _fit(content), refused(*words))


def _skipping(folder: Path) -> Told:
    lines = [f"{g!r},{float(b)!r},0.05" for g, b in zip(FAN, values(FAN, "beta"), strict=True)]
    lines[2:2] = ["12.5,,0.05", "13.5,NaN,0.05", "14.5,n/a,0.05", ",0.4,0.05"]
    put(folder, "gamma_deg,beta,sigma\n" + "\n".join(lines) + "\n")
    return command(folder, ["fit", FILE, "--fix", "e_n=0.94", "--json"])


def _counted(told: Told) -> None:
    assert told.status == 0, told.err
    result = json.loads(told.out)
    (source,) = result["input"]
    assert source["rows_skipped"] == {"not measured": 3, "angle not measured": 1}
    assert (source["rows"], source["rows_used"]) == (len(FAN) + 4, len(FAN))
    assert result["fit"]["n"] == len(FAN)


_UNDEFINED = (
    _case(
        "beta without slip",
        "A row of beta at normal incidence without spin.",
        "gamma_deg,beta\n10,0.4\n20,0.4\n0,0.42\n",
        "line 4, column beta",
        "the contact point does not move",
        "Empty the cell or remove the row.",
        remedy="the row is named, with the reason that U_t = 0 leaves beta without a value",
    ),
    _case(
        "beta of a rolling sphere",
        "A row of beta where the spin makes the contact point stand still.",
        "gamma_deg,spin_y,beta\n30,-0.5,0.42\n40,0,0.3\n",
        "line 2, column beta",
        "the contact point does not move",
        remedy="the row is named",
    ),
    _case(
        "mu_app at 90 degrees",
        "A row of the apparent friction at grazing incidence.",
        HEADER + "run,mu_app,60,0.12,0.01\nrun,mu_app,90,0.12,0.01\n",
        "line 3, column value",
        "mu_app: at gamma = 90 degrees there is no normal velocity",
        remedy="the row is named, with the reason that there is no normal impulse",
    ),
)

_IMPOSSIBLE = tuple(
    _case(
        f"{column} of {number}",
        f"A {column} of {number}.",
        _GOOD + f"60,{number if column == 'value' else -0.4},{number if column == 'sigma' else 0.05}\n",
        f"line 5, column {'beta' if column == 'value' else column}",
        f"{float(number):g} is impossible for {'beta' if column == 'value' else 'a standard uncertainty'}",
        remedy="impossible for the observable, with its range",
    )
    for column in ("value", "sigma")
    for number in ("1e-300", "1e300")
)

_FORM = (
    _case(
        "binary file",
        "A file of bytes.",
        bytes(range(256)) * 4,
        "binary",
        "Export it as CSV.",
        remedy="export it as CSV",
    ),
    _case(
        "header only",
        "A header and no row.",
        "gamma_deg,beta\n",
        "there is a header, but no row under it. Add one impact a line.",
        remedy="add one impact a line",
    ),
    _case(
        "text in a number",
        "The word abc in the column beta.",
        _GOOD + "60,abc,0.05\n",
        "line 5, column beta: 'abc' is not a number",
        'leave the cell empty for "not measured"',
        remedy="line, column and text are named; correct it or leave the cell empty",
    ),
    _case(
        "infinity",
        "The value inf.",
        _GOOD + "60,inf,0.05\n",
        "line 5, column beta: 'inf' is infinite",
        remedy="correct it or leave the cell empty",
    ),
    _case(
        "infinity by overflow",
        "The value 1e999, which is infinite as a number.",
        _GOOD + "60,1e999,0.05\n",
        "line 5, column beta: '1e999' is infinite",
        remedy="correct it or leave the cell empty",
    ),
    _case(
        "missing column",
        "Values of beta without an incidence angle.",
        "beta,sigma\n0.42,0.05\n",
        "there is no incidence angle, which beta needs",
        "Add a column gamma_deg",
        remedy="add a column gamma_deg",
    ),
    _case(
        "missing observable",
        "Angles without anything measured.",
        "gamma_deg,sigma\n10,0.05\n",
        "no column of an observable. Add one, such as beta",
        remedy="add a column such as beta",
    ),
    _case(
        "unknown column",
        "A column called betta.",
        "gamma_deg,betta\n10,0.42\n",
        "line 1, column betta: unknown name, the closest known one is beta",
        remedy="rename it (the closest known name is given) or remove it",
    ),
    _case(
        "duplicate header",
        "Two columns of one name.",
        "gamma_deg,beta,beta\n10,0.42,0.42\n",
        "line 1: columns 2 and 3 are both called 'beta'",
        remedy="both columns are named",
    ),
    _case(
        "long row",
        "A row with more cells than the header.",
        _GOOD + "60,-0.4,0.05,7\n",
        "line 5, column 4: the line goes on, 4 cells under a header of 3",
        remedy="line and cell are named",
    ),
    _case(
        "short row",
        "A row with fewer cells than the header.",
        _GOOD + "60,-0.4\n",
        "line 5, column sigma: the line ends before it, 2 cells under a header of 3. Complete the line",
        remedy="line and missing column are named",
    ),
    _case(
        "cell of 200,000 digits",
        "A number with 200,000 digits.",
        "gamma_deg,beta\n10,0." + "1" * 200_000 + "\n",
        "line 2, column beta",
        "'0.111111111111111111...' (200002 characters) is longer than any number",
        remedy="line and column are named, the cell is shown shortened",
    ),
)

_MEANING = (
    _case(
        "sigma of 0",
        "A standard uncertainty of 0.",
        _GOOD + "60,-0.4,0\n",
        "line 5, column sigma: 0 cannot be a standard uncertainty",
        remedy="give a positive one, or leave the cell empty if it is not known",
    ),
    _case(
        "negative sigma",
        "A standard uncertainty of -0.05.",
        _GOOD + "60,-0.4,-0.05\n",
        "line 5, column sigma: -0.05 cannot be a standard uncertainty",
        remedy="give a positive one, or leave the cell empty if it is not known",
    ),
    _case(
        "gamma above 90",
        "An incidence angle of 91 degrees.",
        _GOOD + "91,-0.4,0.05\n",
        "line 5, column gamma_deg",
        "91 degrees from the normal, outside 0 to 90",
        remedy="the angle is outside 0 to 90 degrees",
    ),
    _case(
        "gamma below 0",
        "An incidence angle of -1 degrees.",
        _GOOD + "-1,-0.4,0.05\n",
        "line 5, column gamma_deg",
        "outside 0 to 90",
        remedy="the angle is outside 0 to 90 degrees",
    ),
    _case(
        "unknown unit",
        "An angle in grad.",
        "gamma [grad],beta\n10,0.42\n",
        "line 1, column gamma [grad]: the unit 'grad' does not fit",
        "deg, rad",
        remedy="the units that fit are listed",
    ),
    _case(
        "mixed conventions of the angle",
        "One angle from the normal and one that may be from the wall.",
        "gamma_deg,alpha_deg,beta\n10,80,0.42\n",
        "two columns could be the incidence angle, 'gamma_deg' and 'alpha_deg'",
        "--convention angle=",
        remedy="both are named, with the option that chooses",
    ),
    _case(
        "mixed conventions of psi",
        "Rows of tan_psi_after beside rows of a tan_psi that does not say over which velocity.",
        HEADER + "run,tan_psi_after,20,-0.1,0.01\nrun,tan_psi,30,-0.2,0.01\n",
        "line 3, column observable: 'tan_psi'",
        "--convention psi=over-incoming",
        remedy="the row is named, with the option that chooses",
    ),
    _case(
        "mixed decimal signs",
        "Decimal commas and decimal points in one file.",
        "gamma_deg;beta\n10,5;0,42\n20;0.43\n",
        "line 3, column beta: '0.43' has a decimal point",
        "a decimal comma",
        remedy="both places are named; write all numbers the same way",
    ),
)

CASES = (
    *_UNDEFINED,
    HardCase(
        "empty file",
        "data refused",
        "A file of no bytes.",
        "Refused with exit status 3, nothing written: ifrfit template prints a table to fill in.",
        in_a_process,
        refused("the file is empty", "ifrfit template"),
    ),
    _case(
        "missing file",
        "A file that is not there.",
        None,
        FILE,
        "dataset",
        remedy="neither a file nor a dataset has that name",
    ),
    *_FORM,
    *_MEANING,
    *_IMPOSSIBLE,
    HardCase(
        "empty and NaN cells",
        "data refused",
        "Three values and one angle that were not measured: empty, NaN, n/a.",
        "The rows are skipped, counted by reason in result.json and reported; the rest is fitted.",
        _skipping,
        _counted,
    ),
)
