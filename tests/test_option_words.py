"""Messages name options as the surface does on which they are read."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.option_words import in_python


@pytest.mark.parametrize(
    ("shell", "python"),
    [
        ("--fix en: no such constant", 'fix={"en": ...}: no such constant'),
        ("Use --fix e_n=0.94.", 'Use fix={"e_n": 0.94}.'),
        ("(--fix e_n=...)", '(fix={"e_n": ...})'),
        ("--prior mu=0.1,0.02: no", 'prior={"mu": (0.1, 0.02)}: no'),
        ("widen it with --bounds mu=LO,HI.", 'widen it with bounds={"mu": (LO, HI)}.'),
        ("take --noise unknown, or", 'take noise="unknown", or'),
        ("choose --noise.", "choose noise."),
        ("--noise needs a sigma", "noise needs a sigma"),
        ("--gamma-min 12, with which", "gamma_min=12, with which"),
        ("--gamma-min, --gamma-max", "gamma_min, gamma_max"),
        ("--tails student-t --dof 4 takes", 'Noise(tails="student-t", dof=4) takes'),
        ("say --common-errors ignored.", 'say Noise(common_errors="ignored").'),
        ("--angle-offset 0.5", "AngleErrors(offset_sd=0.5)"),
        ("--separate mu --separate e_t", 'separate=["mu", "e_t"]'),
        ("--exclude 3 --exclude 7 --exclude a.csv:9", 'exclude=[3, 7, "a.csv:9"]'),
        ("--exclude 1 --exclude 2 --exclude 3 --exclude 4", "exclude=[1, 2, 3, 4]"),
        ("--convention 'ignore=my column'", 'convention="ignore=my column"'),
        ("ifrfit compare shows", "ifrfit.compare shows"),
        ("ifrfit fit --method exact makes", 'ifrfit.fit(..., method="exact") makes'),
        ("'ifrfit template --raw' prints", "'ifrfit template --raw' prints"),
        ("add --force to replace it", "add force=True to replace it"),
        ("Name a folder with --out.", "Name a folder."),
        ("no option - or -- here", "no option - or -- here"),
    ],
)
def test_options_in_python(shell, python):
    assert in_python(shell) == python
    assert str(UsageError(shell)) == python
    assert UsageError(shell).in_shell == shell


def messages():
    """Each text of the package that names an option, with a number for what is filled in."""
    for path in sorted(Path(ifrfit.__file__).parent.rglob("*.py")):
        if path.parent.name == "cli":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (str(v.value) if isinstance(v, ast.Constant) else "1" for v in node.values)
                yield "".join(parts)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


def test_no_message_keeps_a_dash_in_python():
    texts = [text for text in messages() if re.search(r"--[a-z]{2}", text)]
    assert len(texts) > 100
    # but for the commands that are to be typed as they stand
    left = [re.sub(r"'(ifrfit|dask|pip) [^']*'", "", in_python(text)) for text in texts]
    assert [text for text in left if re.search(r"(?<![\w`])--[a-z][a-z-]+[a-z](?![\w`])", text)] == []


def test_wrong_arguments_are_told_in_python():
    data = {"gamma_deg": [10.0, 40.0, 70.0], "beta": [0.4, 0.1, -0.5]}
    for given, said in (
        ({"fix": {"en": 0.9}}, r'fix=\{"en": \.\.\.\}: closure IFR has no such constant.*Did you mean e_n\?'),
        ({"fix": 0.9}, r"fix: 0\.9 is not a mapping of constants to numbers"),
        ({"fix": {"e_n": "x"}}, r"'x' is not a number"),
        ({"fix": {"e_n": True}}, r"True is not a number"),
        ({"prior": {"mu": 0.1}}, r'prior=\{"mu": \.\.\.\}: 0\.1 is not two numbers'),
        ({"closure": 3}, r"closure: 3 is not a word"),
        ({"separate": 3}, r"separate: 3 is not a name"),
        ({"gamma_min": "a"}, r"gamma_min: 'a' is not a number"),
        ({"observable": 3}, r"observable: 3 is not a name"),
        ({"seed": 1.5}, r"seed: 1\.5 is not a whole number"),
        ({"convention": 3}, r"convention: 3 is neither"),
        ({"params": 3}, r"params: 3 is no lmfit\.Parameters"),
        ({"inertia_factor": "a"}, r"inertia_factor: 'a' is not a number"),
    ):
        with pytest.raises(UsageError, match=said):
            ifrfit.fit(data, **given)


def test_findings_of_a_fit_in_python_name_keywords():
    fit = ifrfit.fit("kharaz-2001")
    assert "--" not in fit.summary()
    assert 'fix={"e_n": ...}' in fit.summary()
    assert "--fix e_n=..." in ifrfit.fit("kharaz-2001", command="ifrfit fit kharaz-2001").summary()
