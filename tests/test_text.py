from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ifrfit.text import (
    as_given,
    decimals,
    duration,
    fixed,
    interval_text,
    joined,
    p_text,
    power_of_ten,
    sd_text,
)

inf = math.inf


@pytest.mark.parametrize(
    ("uncertainty", "places"),
    [(0.0134, 3), (0.0996, 2), (0.00994, 4), (1.0, 1), (0.95, 2), (9.96, 0), (120.0, -1), (-0.02, 3)],
)
def test_two_significant_digits_of_the_uncertainty_decide(uncertainty, places):
    assert decimals(uncertainty) == places


@pytest.mark.parametrize(
    ("value", "places", "text"),
    [
        (0.12345, 3, "0.123"),
        (-0.0001, 3, "0.000"),
        (-0.98, 3, "-0.980"),
        (1234.0, -1, "1230"),
        (-4.0, -2, "0"),
        (0.12, 13, "0.1200000000"),
        (1.5e9, -7, "1.50e+09"),
        (0.0, -7, "0e+00"),
    ],
)
def test_fixed(value, places, text):
    assert fixed(value, places) == text


@pytest.mark.parametrize(
    ("sd", "text"),
    [(0.0134, "0.013"), (0.0996, "0.10"), (3.0, "3.0"), (1.23e-14, "1.2e-14"), (4e9, "4.0e+09"), (0.0, "0")],
)
def test_standard_deviation(sd, text):
    assert sd_text(sd) == text
    assert sd_text(math.nan) == "-"


@pytest.mark.parametrize(
    ("interval", "places", "text"),
    [
        ((0.113, 0.1291), 3, "[0.113, 0.129]"),
        ((0.2134, inf), 2, "> 0.21"),
        ((-inf, 0.31), 1, "< 0.3"),
        ((-inf, inf), 1, "any value"),
        ((0.5, 0.5), None, "[0.5, 0.5]"),
    ],
)
def test_interval_in_words(interval, places, text):
    assert interval_text(interval, places) == text


def test_ends_are_padded_to_line_up():
    assert interval_text((0.113, 0.129), 3, 6) == "[ 0.113,  0.129]"


@given(st.floats(1e-9, 1e4), st.floats(-100.0, 100.0))
def test_rounding_loses_less_than_a_twentieth_of_the_uncertainty(sd, value):
    places = decimals(sd)
    # two digits: a unit in the last place is at most a tenth of the uncertainty (rounded up to 1.0: 0.1005)
    assert 10.0**-places <= sd / 9.9
    assert abs(float(fixed(value, places)) - value) <= 0.5001 * 10.0**-places + 1e-12
    digits = sd_text(sd).lstrip("0.").replace(".", "").partition("e")[0]
    assert float(sd_text(sd)) == pytest.approx(sd, rel=0.051)
    assert len(digits.rstrip("0")) <= 2


@example(-0.0, -6)
@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(-12, 16))
def test_fixed_never_fails_and_never_shows_minus_zero(value, places):
    text = fixed(value, places)
    assert not (text.startswith("-") and float(text) == 0.0)
    assert "nan" not in text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (5.1e-10, "0.51 ns"),
        (3.2e-9, "3.2 ns"),
        (2.5e-7, "250 ns"),
        (9.996e-4, "1.0 ms"),
        (0.0123, "12 ms"),
        (0.4567, "457 ms"),
        (1.04, "1.0 s"),
        (61.0, "61 s"),
        (600.0, "10 min"),
        (math.inf, "-"),
    ],
)
def test_times_in_the_unit_that_people_use(seconds, text):
    assert duration(seconds) == text


def test_as_given():
    assert as_given(0.1 + 0.2) == "0.3"


@pytest.mark.parametrize(
    ("words", "text"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_words_in_a_row(words, text):
    assert joined(words) == text
    assert joined(words, "or") == text.replace("and", "or")


@pytest.mark.parametrize(
    ("p", "text"), [(0.5, "0.5"), (0.0123, "0.012"), (4.4e-4, "4e-04"), (1e-301, "0, below 1e-300")]
)
def test_probabilities(p, text):
    assert p_text(p) == text


@pytest.mark.parametrize(("number", "text"), [(0.0, "0"), (1.2e-3, "1e-3"), (200.0, "2e2")])
def test_powers_of_ten(number, text):
    assert power_of_ten(number) == text
