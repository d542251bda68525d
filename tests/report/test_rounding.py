from __future__ import annotations

import math

import pytest

from ifrfit.inference.result.types import Estimate
from ifrfit.report.sentences import places_of, value_text

inf = math.inf


@pytest.mark.parametrize(
    ("interval", "places"), [((0.2134, inf), 2), ((0.1, 0.3), 2), ((0.2, 0.2), None), ((-inf, inf), None)]
)
def test_without_a_standard_deviation_the_interval_decides(interval, places):
    assert places_of(Estimate(None, None, interval, interval, "not_determined")) == places


def test_value_of_each_kind():
    assert value_text(Estimate(0.94, None, (0.94, 0.94), (0.94, 0.94), "fixed")) == "0.94"
    assert value_text(Estimate(None, None, (0.1, 0.2), (0.1, 0.2), "not_determined")) == "-"
    assert value_text(Estimate(0.12345, 0.0041, (0.1, 0.2), (0.1, 0.2), "determined")) == "0.1235"
