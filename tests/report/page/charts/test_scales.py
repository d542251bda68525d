"""Ticks: few, at round numbers, with labels that tell them from one another."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ifrfit.report.page.charts.scales import (
    Linear,
    Logarithmic,
    SymmetricLogarithmic,
    number_text,
    power_of_ten,
)

LINEAR = Linear()


@pytest.mark.parametrize(
    ("low", "high", "most", "labels", "note"),
    [
        (0.0, 1.0, 6, ("0.0", "0.2", "0.4", "0.6", "0.8", "1.0"), ""),
        (0.0, 1.0, 5, ("0.00", "0.25", "0.50", "0.75", "1.00"), ""),
        (-4.5, 4.5, 5, ("−4", "−2", "0", "2", "4"), ""),
        (-1.03, -0.97, 5, ("−1.02", "−1.00", "−0.98"), ""),
        (0.0, 2.3e-5, 4, ("0", "1", "2"), "×10⁻⁵"),
        (0.94 - 2e-8, 0.94 + 2e-8, 5, ("−2", "−1", "0", "1", "2"), "×10⁻⁸ +0.9400000"),
        (0.0, 40_000.0, 5, ("0", "10\u2009000", "20\u2009000", "30\u2009000", "40\u2009000"), ""),
        (0.0, 3e6, 4, ("0", "1", "2", "3"), "×10⁶"),
    ],
)
def test_ticks_are_round(low, high, most, labels, note):
    found = LINEAR.ticks(low, high, most)
    assert (found.labels, found.note) == (labels, note)


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(3, 8))
def test_any_range_has_ticks_that_can_be_told_apart(low, extent, most):
    high = low + extent
    if not low < high:
        return
    found = LINEAR.ticks(low, high, most)
    assert 1 <= len(found.places) <= most
    assert len(set(found.labels)) == len(found.labels)
    rounding = 1e-6 * extent + 1e-14 * max(abs(low), abs(high))
    assert min(found.places) >= low - rounding
    assert max(found.places) <= high + rounding
    if len(found.places) > 2:
        assert np.ptp(np.diff(found.places)) < rounding


def test_whole_numbers_only_where_asked():
    assert LINEAR.ticks(0.4, 3.6, 7, whole=True).labels == ("1", "2", "3")
    assert "0.5" in LINEAR.ticks(0.4, 3.6, 8).labels


def test_powers_of_ten():
    scale = Logarithmic()
    assert scale.ticks(1e-6, 1.2, 7).labels == ("10⁻⁶", "10⁻⁵", "10⁻⁴", "0.001", "0.01", "0.1", "1")
    assert scale.ticks(1e-6, 1.2, 4).labels == ("10⁻⁶", "10⁻⁴", "0.01", "1")
    assert scale.position(np.array([1e-3, 1.0])) == pytest.approx([-3.0, 0.0])
    assert power_of_ten(12) == "10¹²"


def test_a_symmetric_scale_is_linear_near_zero():
    scale = SymmetricLogarithmic(5.0)
    found = scale.position(np.array([-500.0, -5.0, -2.5, 0.0, 5.0, 50.0]))
    assert found == pytest.approx([-3.0, -1.0, -0.5, 0.0, 1.0, 2.0])
    assert scale.ticks(-800.0, 1.0, 8).labels == ("−100", "−10", "0")
    assert scale.ticks(-80.0, 1.0, 8).labels == ("−10", "−5", "0")
    assert scale.ticks(-4.0, 1.0, 6).labels == ("−4", "−3", "−2", "−1", "0", "1")


def test_room_on_a_symmetric_scale_is_a_share_of_the_axis():
    scale = SymmetricLogarithmic(5.0)
    for value in (-500.0, -5.0, -2.5, 0.0, 3.0, 70.0):
        assert scale.value(float(scale.position(np.array([value]))[0])) == pytest.approx(value)
    low = scale.widened(-500.0, 0.0, 0.25)
    start, inner, end = scale.position(np.array([low, -500.0, 0.0]))
    assert (inner - start) / (end - start) == pytest.approx(0.25)
    moved = scale.position(np.array([scale.shifted(-50.0, -0.1, low, 0.0), -50.0]))
    assert moved[1] - moved[0] == pytest.approx(0.1 * (end - start))


def test_a_number_has_a_true_minus_and_no_negative_zero():
    assert number_text(-0.25, 2) == "−0.25"
    assert number_text(-0.001, 2) == "0.00"
    assert not math.isnan(float(number_text(0.1, 3)))
