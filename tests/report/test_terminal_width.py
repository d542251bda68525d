"""Texts for a terminal take its width: nothing beyond 80 columns at 80, and at 100 what they always took."""

from __future__ import annotations

import pytest

import ifrfit
from ifrfit.report.terminal import aligned, as_wide_as, text_width


@pytest.mark.parametrize("columns", [72, 80, 90])
def test_a_fit_and_a_comparison_fit_in(columns: int) -> None:
    fit = ifrfit.fit("kharaz-2001", prior={"e_n": (0.98, 0.01)})
    comparison = ifrfit.compare("kharaz-2001", prior={"e_n": (0.98, 0.01)}, loo=False)
    with as_wide_as(columns):
        narrow = [fit.summary(), comparison.summary()]
    wide = [fit.summary(), comparison.summary()]
    for text in narrow:
        assert [line for line in text.splitlines() if len(line) > columns] == []
    for one, other in zip(narrow, wide, strict=True):
        assert set(other.split()) == set(one.split())
        assert max(map(len, other.splitlines())) > 90


def test_the_width_is_that_of_before_afterwards() -> None:
    with as_wide_as(80):
        assert text_width() == 80
        with as_wide_as(1000):
            assert text_width() == 100
    assert text_width() == 100


def test_columns_that_do_not_fit_follow_below() -> None:
    rows = [["name", *(f"column {i}" for i in range(12))], ["one", *map(str, range(12))]]
    with as_wide_as(60):
        lines = aligned(rows, "<" + 12 * ">")
    assert max(map(len, lines)) <= 60
    assert [line.split()[0] for line in lines if line] == 3 * ["name", "one"]
    assert [int(cell) for line in lines if line.startswith("  one") for cell in line.split()[1:]] == list(
        range(12)
    )
