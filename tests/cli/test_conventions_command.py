"""`ifrfit conventions`: all that the parser knows, with choices, and examples that parse."""

from __future__ import annotations

import re

import pytest

from ifrfit.data.column_names import UNITS
from ifrfit.data.convention_meanings import MEANINGS, WORDS
from ifrfit.data.conventions import CHOICES, parse_conventions


def test_every_convention_of_the_parser_is_told() -> None:
    assert list(MEANINGS) == list(CHOICES)


@pytest.mark.parametrize("name", CHOICES)
def test_every_choice_is_told(name: str) -> None:
    told = MEANINGS[name].choices
    if name == "unit:HEADER":
        assert [unit for text in told for unit in text.split(", ")] == list(UNITS)
    else:
        assert tuple(told) == CHOICES[name]
    assert all(told.values())


@pytest.mark.parametrize("name", CHOICES)
def test_every_example_is_read(name: str) -> None:
    example = MEANINGS[name].example
    assert example.partition("=")[0].partition(":")[0] == name.partition(":")[0]
    assert parse_conventions(example) != parse_conventions(())


def test_words_offered_to_shells_are_read() -> None:
    assert "beta=opposite-sign" in WORDS
    for word in WORDS:
        parse_conventions(word)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_list_fits_the_terminal(cli, monkeypatch, width: int) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    found = cli("conventions")
    assert (found.returncode, found.stderr) == (0, "")
    lines = found.stdout.splitlines()
    assert max(map(len, lines)) <= width
    assert [line for line in lines if line != line.rstrip()] == []
    assert [
        name for name in CHOICES if not re.search(rf"^{re.escape(name)}: ", found.stdout, re.MULTILINE)
    ] == []
    assert found.stdout.count("example: --convention ") == len(CHOICES)
