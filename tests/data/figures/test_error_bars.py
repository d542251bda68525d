"""Ends of error bars become standard errors once it is said of what, and are never measurements by themselves."""

from __future__ import annotations

import numpy as np
import pytest
from project_files import (
    POINTS,
    VALUES,
    as_json,
    coordinate_system,
    curve,
    dataset,
    engauge,
    engauge_whole,
    pixel,
    version_4,
)
from refusals import refused

from ifrfit.data.figures.error_bars import standard_errors
from ifrfit.errors import DataError, UsageError

HALF = np.array([0.05, 0.02, 0.1])  # of each bar, in y
READ_Y = 2.0 / 400.0  # of one pixel
READ_X = 90.0 / 600.0
ENDS = {
    sign: tuple(pixel(gamma, value + sign * half) for (gamma, value), half in zip(VALUES, HALF, strict=True))
    for sign in (1, -1)
}


def grouped(*ends, names=("Upper", "Lower"), without=()):
    """A dataset as WebPlotDigitizer keeps bars: a tuple for each point, in any order."""
    made = dataset(groupNames=["Primary Group", *names])
    for number, point in enumerate(made["data"]):
        point.update(tuple=number, group=0)
    for group, points in enumerate(ends, start=1):
        for number, (x, y) in reversed(list(enumerate(points))):
            if (group, number) not in without:
                made["data"].insert(0, {"x": x, "y": y, "tuple": number, "group": group})
    return as_json(version_4(dataset_coll=[made]))


WPD = grouped(ENDS[1], ENDS[-1])
CURVES = engauge_whole({"glass": POINTS, "glass upper": ENDS[1], "glass lower": ENDS[-1]})


@pytest.mark.parametrize("raw", [WPD, CURVES], ids=["groups", "curves"])
@pytest.mark.parametrize(("bars", "of"), [("sigma", 1.0), ("2sigma", 2.0), ("95%", 1.959964), (3, 3.0)])
def test_half_a_bar_is_what_is_said(figure, raw, bars, of):
    found = figure(raw, bars=bars).table
    np.testing.assert_allclose(found[["gamma_deg", "value"]], VALUES, rtol=1e-12)
    np.testing.assert_allclose(found["sigma"], np.hypot(HALF / of, READ_Y), rtol=1e-6)
    np.testing.assert_allclose(found["sigma_gamma_deg"], READ_X, rtol=1e-12)


def test_one_end_is_enough_and_some_points_have_none(figure):
    found = figure(grouped(ENDS[1], names=("Upper",), without={(1, 1)}), bars="sigma")
    np.testing.assert_allclose(found.table["sigma"], np.hypot([HALF[0], 0.0, HALF[2]], READ_Y))
    assert any("1 point has no bar; sigma there is the error of reading alone" in note for note in found.notes)
    assert any("sigma is of bars (2 along beta; half a bar is 1 standard error)" in note for note in found.notes)


def test_bars_along_x(figure):
    ends = [tuple(pixel(gamma + sign * 2.0, value) for gamma, value in VALUES) for sign in (1, -1)]
    found = figure(grouped(ENDS[1], ENDS[-1], *ends, names=("a", "b", "c", "d")), bars="sigma")
    np.testing.assert_allclose(found.table["sigma"], np.hypot(HALF, READ_Y))
    np.testing.assert_allclose(found.table["sigma_gamma_deg"], np.hypot(2.0, READ_X))


def test_unsaid_bars_are_left_out_or_refused(figure):
    found = figure(WPD)
    np.testing.assert_allclose(found.table["sigma"], READ_Y)
    said = "6 points of the groups Upper, Lower of dataset 'glass' were left out: they mark bars"
    assert any(said in note and "say --bars sigma" in note for note in found.notes)
    with refused(DataError, "'glass upper' is by its name the end of error bars of 'glass', .* --dataset glass"):
        figure(CURVES)
    assert len(figure(CURVES, dataset="glass").table) == 3


def test_lopsided_bars_are_said(figure):
    longer = tuple(pixel(gamma, value + 0.3) for gamma, value in VALUES)
    found = figure(grouped(longer, ENDS[-1]), bars="sigma")
    np.testing.assert_allclose(found.table["sigma"], np.hypot((0.3 + HALF) / 2.0, READ_Y))
    assert any("3 bars are more than 1.5 times as long on one side" in note for note in found.notes)


@pytest.mark.parametrize("bars", ["", "about 1", "-1", "0", "100%", "0%", "sigma2"])
def test_what_bars_may_be(bars):
    with refused(UsageError, "say what half a bar is, in standard errors or as an interval: sigma, 2sigma, 95%"):
        standard_errors(bars)


def test_what_is_broken_is_refused(figure):
    with refused(UsageError, "--bars: .* has no ends of bars, .* called 'glass upper' and 'glass lower'"):
        figure(as_json(version_4()), bars="sigma")
    far = engauge(coordinate_system(curves=curve("glass") + curve("glass upper", [pixel(25.0, 0.5)])))
    with refused(DataError, "curve 'glass upper': the end at pixel .* stands over no point of 'glass'"):
        figure(far, bars="sigma")
    double = engauge(coordinate_system(curves=curve("glass") + curve("glass upper", [ENDS[1][0], ENDS[-1][0]])))
    with refused(DataError, "two ends stand over one point of 'glass'"):
        figure(double, bars="sigma")
    with refused(DataError, "dataset 'glass': 3 groups of points are ends of the same bars, which have two"):
        figure(grouped(ENDS[1], ENDS[-1], ENDS[1], names=("a", "b", "c")), bars="sigma")
    repeated = grouped(ENDS[1], ENDS[-1]).replace(b'"tuple": 1, "group": 1', b'"tuple": 0, "group": 1')
    with refused(DataError, r"datasetColl.0..data.\d+.: group 1 has two points of tuple 0. Remove one."):
        figure(repeated, bars="sigma")
    with refused(DataError, r"data.0..tuple: is 'one', not a number"):
        figure(grouped(ENDS[1]).replace(b'"tuple": 0', b'"tuple": "one"', 1))
