from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ifrfit.inference.result.types import Estimate
from ifrfit.report.rounding import (
    alone,
    decimals,
    fixed,
    interval_text,
    places_of,
    spread,
    value_text,
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
def test_spread(sd, text):
    assert spread(sd) == text
    assert spread(math.nan) == "-"


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


@pytest.mark.parametrize(
    ("interval", "places"), [((0.2134, inf), 2), ((0.1, 0.3), 2), ((0.2, 0.2), None), ((-inf, inf), None)]
)
def test_without_a_standard_deviation_the_interval_decides(interval, places):
    assert places_of(Estimate(None, None, interval, interval, "not_determined")) == places


def test_value_of_each_kind():
    assert value_text(Estimate(0.94, None, (0.94, 0.94), (0.94, 0.94), "fixed")) == "0.94"
    assert value_text(Estimate(None, None, (0.1, 0.2), (0.1, 0.2), "not_determined")) == "-"
    assert value_text(Estimate(0.12345, 0.0041, (0.1, 0.2), (0.1, 0.2), "determined")) == "0.1235"
    assert alone(0.1 + 0.2) == "0.3"


@given(st.floats(1e-9, 1e4), st.floats(-100.0, 100.0))
def test_rounding_loses_less_than_a_twentieth_of_the_uncertainty(sd, value):
    places = decimals(sd)
    # two digits: a unit in the last place is at most a tenth of the uncertainty (rounded up to 1.0: 0.1005)
    assert 10.0**-places <= sd / 9.9
    assert abs(float(fixed(value, places)) - value) <= 0.5001 * 10.0**-places + 1e-12
    digits = spread(sd).lstrip("0.").replace(".", "").partition("e")[0]
    assert float(spread(sd)) == pytest.approx(sd, rel=0.051)
    assert len(digits.rstrip("0")) <= 2


@example(-0.0, -6)
@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(-12, 16))
def test_fixed_never_fails_and_never_shows_minus_zero(value, places):
    text = fixed(value, places)
    assert not (text.startswith("-") and float(text) == 0.0)
    assert "nan" not in text
