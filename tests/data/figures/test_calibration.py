"""Pixels to values, and what errors of clicks do to them: against values by hand and a million draws."""

from __future__ import annotations

import numpy as np
import pytest
from factories import each_once, rest_long

from ifrfit.data.figures.calibration import (
    CalibrationError,
    from_axis_clicks,
    from_point_clicks,
)

CLICKS = np.array([[100.0, 500.0], [700.0, 500.0], [100.0, 480.0], [100.0, 80.0]])


def turned(clicks, degrees, skew=0.0):
    a = np.radians(degrees)
    b = np.radians(degrees + skew)
    axes = np.array([[np.cos(a), np.sin(a)], [-np.sin(b), np.cos(b)]])
    return clicks @ axes


def test_upright_axes_by_hand():
    found = from_axis_clicks(CLICKS, (0.0, 90.0), (-1.0, 1.0)).values(np.array([[400.0, 280.0]]))
    np.testing.assert_allclose(found, [[45.0, 0.0]], atol=1e-12)


def test_log_axes_by_hand():
    calibration = from_axis_clicks(CLICKS, (0.1, 10.0), (1.0, 100.0), is_log=(True, True))
    found = calibration.values(np.array([[400.0, 280.0], [100.0, 480.0]]))
    np.testing.assert_allclose(found, [[1.0, 10.0], [0.1, 1.0]], rtol=1e-12)


def test_a_log_axis_of_negative_values():
    calibration = from_axis_clicks(CLICKS, (-10.0, -0.1), (1.0, 2.0), is_log=(True, False))
    np.testing.assert_allclose(calibration.values(np.array([[400.0, 480.0]])), [[-1.0, 1.0]], rtol=1e-12)


@pytest.mark.parametrize(("degrees", "skew"), [(3.0, 0.0), (-90.0, 0.0), (10.0, 4.0), (170.0, -5.0)])
def test_turned_and_skewed_axes_read_the_same_values(degrees, skew):
    points = np.array([[400.0, 280.0], [250.0, 333.0]])
    straight = from_axis_clicks(CLICKS, (0.0, 90.0), (-1.0, 1.0)).values(points)
    found = from_axis_clicks(turned(CLICKS, degrees, skew), (0.0, 90.0), (-1.0, 1.0))
    np.testing.assert_allclose(found.values(turned(points, degrees, skew)), straight, atol=1e-10)
    corners = np.array([[100.0, 480.0], [700.0, 480.0], [700.0, 80.0]])
    values = np.array([[0.0, -1.0], [90.0, -1.0], [90.0, 1.0]])
    by_points = from_point_clicks(turned(corners, degrees, skew), values)
    np.testing.assert_allclose(by_points.values(turned(points, degrees, skew)), straight, atol=1e-10)


@pytest.mark.parametrize("degrees", [0.0, 90.0])
def test_without_rotation_an_oblique_click_tilts_nothing(degrees):
    clicks = CLICKS.copy()
    clicks[1, 1] += 7.0
    points = np.array([[400.0, 280.0]])
    found = from_axis_clicks(turned(clicks, degrees), (0.0, 90.0), (-1.0, 1.0), rotates=False)
    np.testing.assert_allclose(found.values(turned(points, degrees)), [[45.0, 0.0]], atol=1e-10)


@pytest.mark.parametrize(("rotates", "is_log"), each_once([True, False], [(False, False), (True, False)]))
@pytest.mark.parametrize("draws", rest_long((4000, 20_000)))
def test_errors_are_those_of_drawn_clicks(rotates, is_log, draws):
    """First order against recalibrations with clicks off by 0.1 pixel: 4 sd of a sample's sd, and correlation."""
    rng = np.random.default_rng(1)
    clicks = turned(CLICKS, 2.0, 3.0)
    points = turned(np.array([[400.0, 280.0], [680.0, 190.0], [120.0, 470.0]]), 2.0, 3.0)
    given = {"x_values": (1.0, 90.0), "y_values": (-1.0, 1.0), "is_log": is_log, "rotates": rotates}
    calibration = from_axis_clicks(clicks, **given)
    drawn = np.array(
        [
            from_axis_clicks(clicks + rng.normal(0.0, 0.1, (4, 2)), **given).values(points)
            for _ in range(draws)
        ]
    )
    common = calibration.common_errors(points, 0.1).reshape(6, 8)
    covariance = common @ common.T
    sd = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(drawn.std(axis=0).ravel(), sd, rtol=4.0 / np.sqrt(2.0 * draws))
    correlation = covariance / np.outer(sd, sd)
    np.testing.assert_allclose(np.corrcoef(drawn.reshape(-1, 6).T), correlation, atol=4.0 / np.sqrt(draws))
    assert np.linalg.matrix_rank(common, tol=1e-9 * sd.max()) == (6 if rotates else 4)


def test_the_error_of_a_reading_is_that_of_a_drawn_click():
    rng = np.random.default_rng(2)
    calibration = from_axis_clicks(turned(CLICKS, 2.0, 3.0), (1.0, 90.0), (-1.0, 1.0), is_log=(True, False))
    point = turned(np.array([[400.0, 280.0]]), 2.0, 3.0)
    drawn = calibration.values(point + rng.normal(0.0, 0.5, (20_000, 2)))
    np.testing.assert_allclose(calibration.reading_errors(point, 0.5)[0], drawn.std(axis=0), rtol=0.02)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"x_values": (5.0, 5.0)}, "the x axis: all clicks on it are said to be at 5"),
        (
            {"is_log": (True, False), "x_values": (0.0, 10.0)},
            "the x axis: is logarithmic and goes from 0 to 10",
        ),
        ({"is_log": (False, True), "y_values": (-1.0, 10.0)}, "the y axis: is logarithmic .* through zero"),
        ({"clicks": np.repeat(CLICKS[:1], 4, axis=0)}, "one spot or on one line"),
        ({"clicks": np.array([[0.0, 0], [10, 10], [20, 20], [30, 30]])}, "one spot or on one line"),
        ({"clicks": CLICKS[[0, 0, 2, 3]]}, "one spot or on one line"),
        ({"clicks": CLICKS[[0, 0, 2, 3]], "rotates": False}, "one spot or on one line"),
        ({"clicks": CLICKS[[0, 2, 0, 2]] * 1.0, "rotates": False}, "one spot or on one line"),
    ],
)
def test_clicks_that_fix_no_axes(change, words):
    given = {"clicks": CLICKS, "x_values": (0.0, 90.0), "y_values": (-1.0, 1.0)} | change
    with pytest.raises(CalibrationError, match=words):
        from_axis_clicks(given.pop("clicks"), **given)


def test_three_points_on_a_line():
    clicks = np.array([[0.0, 0.0], [10.0, 10.0], [20.0, 20.0]])
    with pytest.raises(CalibrationError, match="one line"):
        from_point_clicks(clicks, np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 3.0]]))
    spread = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 20.0]])
    with pytest.raises(CalibrationError, match="same line"):
        from_point_clicks(spread, np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]))
