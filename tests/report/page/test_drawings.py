"""The pictures by their data."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage, stats

import ifrfit
from ifrfit.inference.appraise import appraise
from ifrfit.inference.result.types import Estimate
from ifrfit.report.credible_regions import Regions, contours, regions, smoothed
from ifrfit.report.page.blocks import Picture, Pictures
from ifrfit.report.page.charts.chart import Band, Box, Line, Points, Words
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.page.sections.constants import Span, draw_forest, draw_intervals
from ifrfit.report.page.sections.identifiability import (
    Directions,
    build,
    directions,
    draw_directions,
    share_text,
)
from ifrfit.report.page.sections.posterior import draw_corner
from ifrfit.report.page.sections.predictive import draw_checks
from ifrfit.report.page.sections.profiles import draw_profile
from ifrfit.report.page.sections.residuals import (
    band_places,
    draw_against,
    draw_quantiles,
    drawn_rows,
    quantile_band,
)
from ifrfit.report.page.svg import inline
from ifrfit.report.style import drawing, new_figure, series_styles, svg_text


def of(chart, kind, panel=0):
    """The marks of one kind in a panel of a chart."""
    return [mark for mark in chart.panels[panel].marks if isinstance(mark, kind)]


def single(chart):
    """Places of all single marks of a chart of one panel."""
    return [(float(p.x[0]), float(p.y[0])) for p in of(chart, Points) if p.x.size == 1]


def test_the_band_of_ordered_residuals_holds_95_per_cent_of_each():
    n, runs = 12, 20_000
    low, high = quantile_band(n)
    drawn = np.sort(np.random.default_rng(0).standard_normal((runs, n)), axis=1)
    inside = ((drawn > low) & (drawn < high)).mean(axis=0)
    # five standard deviations of a share of 0.95 among so many
    assert np.abs(inside - 0.95).max() < 5.0 * math.sqrt(0.95 * 0.05 / runs)
    assert low[0] == pytest.approx(stats.norm.ppf(stats.beta.ppf(0.025, 1, n)))


def test_of_many_residuals_all_that_lie_far_out_are_drawn():
    z = np.random.default_rng(4).standard_normal(60_001)
    z[[7, 11]] = 3.5, np.nan
    drawn = drawn_rows(z)
    assert drawn[[7, 11]].all()
    assert drawn[np.abs(z) > 3.0].all()
    assert 4_000 < drawn.sum() < 5_500
    assert drawn_rows(z[:5000]).all()


def test_the_band_of_many_residuals_has_few_places_and_the_same_limits():
    n = 20_000
    places = band_places(n)
    assert places.size <= 400
    assert {1, 2, n - 1, n} <= set(places.tolist())
    whole = quantile_band(n)
    for few, every in zip(quantile_band(n, places), whole, strict=True):
        np.testing.assert_allclose(few, every[places - 1], rtol=1e-12)
    assert band_places(12).tolist() == list(range(1, 13))


def test_residuals_are_drawn_where_they_are(results):
    result = results("hostile")
    look = series_styles(list(result.points["series"].unique()))
    z = result.points["standardised"].to_numpy()
    for chart in (
        draw_against(result, look, result.points["gamma_deg"].to_numpy(), "γ"),
        draw_quantiles(result, look),
    ):
        drawn = np.concatenate([points.y for points in of(chart, Points) if points.fill != "none"])
        assert sorted(drawn) == pytest.approx(sorted(z))


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.95, -0.995])
def test_the_contours_hold_68_and_95_per_cent(correlation):
    """The area inside each contour of a normal law is known; that of a narrow ridge must not be fat."""
    rng = np.random.default_rng(1)
    turn = np.linalg.cholesky([[1.0, correlation], [correlation, 1.0]])
    x, y = turn @ rng.standard_normal((2, 4000))
    found = regions(x, y, (-4.2, 4.2), (-4.2, 4.2))
    assert found is not None
    cell = abs(
        (found.x[1, 0] - found.x[0, 0]) * (found.y[0, 1] - found.y[0, 0])
        - (found.x[0, 1] - found.x[0, 0]) * (found.y[1, 0] - found.y[0, 0])
    )
    for level, p in zip(found.levels, (0.95, 0.68), strict=True):
        area = float((found.density >= level).sum()) * cell
        exact = math.pi * -2.0 * math.log(1.0 - p) * math.sqrt(1.0 - correlation**2)
        # smoothing widens by the ratio of its own variance, about 10 % here
        assert 0.9 * exact < area < 1.3 * exact, (p, area, exact)


def test_draws_on_a_line_have_no_contour():
    x = np.linspace(0.0, 1.0, 200)
    assert regions(x, 2.0 * x, (0.0, 1.0), (0.0, 2.0)) is None


def test_a_corner_has_a_cell_a_pair():
    rng = np.random.default_rng(2)
    columns = {name: rng.standard_normal(500) for name in ("e_n", "e_t", "mu[a $x_1$ b]")}
    chart = draw_corner(columns, {"e_n": (-2.0, 2.0)})
    assert len(chart.panels) == 6
    assert {float(line.x[0]) for line in of(chart, Line)} >= {-2.0, 2.0}
    histogram = of(chart, Band)[0]
    window = chart.panels[0].x.low, chart.panels[0].x.high
    expected, _ = np.histogram(columns["e_n"], bins=30, range=window, density=True)
    # of all draws, not only of those within the window
    inside = np.mean((columns["e_n"] >= window[0]) & (columns["e_n"] <= window[1]))
    assert histogram.high[1:-1:2] == pytest.approx(inside * expected)


def test_a_corner_holds_the_stated_intervals():
    columns = {"e_n": np.linspace(-1.0, 1.0, 200), "mu": np.linspace(0.0, 1.0, 200)}
    chart = draw_corner(columns, {"e_n": (-3.0, 2.0), "mu": (-math.inf, 0.5)})
    axis = chart.panels[0].x
    assert axis.low < -3.0
    assert axis.high > 2.0
    assert len(of(chart, Line)) == 2 + 2  # outline, median and both ends
    assert math.isfinite(chart.panels[-1].x.low)


def test_smoothing_is_that_of_scipy():
    counts = np.random.default_rng(3).poisson(2.0, (40, 40)).astype(float)
    expected = ndimage.gaussian_filter(counts, 1.6, mode="reflect")
    np.testing.assert_allclose(smoothed(counts, 1.6), expected, rtol=1e-12)
    few = counts[:3, :3]  # mirrored more than once
    np.testing.assert_allclose(smoothed(few, 1.6), ndimage.gaussian_filter(few, 1.6), rtol=1e-12)


def test_a_contour_runs_where_the_density_has_its_level():
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(-1.0, 1.0, 41), indexing="ij")
    (line,) = contours(Regions(x, y, -(x**2 + y**2), (-0.5, -0.25)), -0.25)
    assert np.hypot(*line.T) == pytest.approx(0.5, abs=1e-3)


def test_directions_of_a_known_covariance():
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    covariance = turn.T @ np.diag([0.25, 1e-4]) @ turn
    found = Directions.of(("e_n", "mu"), covariance, np.ones(2))
    assert found.ratio == pytest.approx([0.5, 0.01])
    assert found.parts == pytest.approx(turn[[0, 1]] * [[1.0], [1.0]])
    scaled = Directions.of(("e_n", "mu"), np.diag([1.0, 9.0]), np.array([4.0, 6.0]))
    assert scaled.ratio == pytest.approx([0.5, 0.25])
    chart = draw_directions(found)
    assert chart.panels[1].y.ticks.labels == ("0.5", "0.01")
    assert [words.text for words in of(chart, Words)] == ["+0.80", "+0.60", "−0.60", "+0.80"]
    assert [box.x[1] for box in of(chart, Box, 1) if box.edge] == pytest.approx([0.5, 0.01])
    assert share_text(-0.001) == "0"


def test_where_bounds_narrow_what_the_data_leave_loose_the_caption_says_so(results, appraisals):
    loose = ReportInput(results("loose"), appraisals("loose"))
    bounded = ifrfit.fit("reagle-2013", method="lsq")
    captions = [
        "".join(block.caption for block in build(given) if isinstance(block, Pictures))
        for given in (loose, ReportInput(bounded, appraise(bounded, closures=False)))
    ]
    assert [("owed to bounds" in caption) for caption in captions] == [False, True]


def test_the_loose_direction_of_beta_alone_keeps_kappa(results, appraisals):
    """Theory: beta sees e_n and mu through mu (1 + e_n) only; along the loose direction it stays."""
    result = results("loose")
    found = directions(ReportInput(result, appraisals("loose")))
    assert found is not None
    assert found.names == ("e_n", "e_t", "mu")
    assert found.ratio[0] > 0.9
    prior_sd = np.array([constant.prior_sd for constant in result.asked])
    step = found.parts[0] * prior_sd
    kappa, e_n, mu = 0.2328, 0.5, 0.2328 / 1.5
    # the gradient of kappa along the direction, against that along mu alone
    assert abs(mu * step[0] + (1.0 + e_n) * step[2]) < 0.06 * kappa * abs(step[0]) / mu
    assert directions(ReportInput(results("fixed"), appraisals("fixed"))).ratio.max() < 0.5


def test_intervals_are_where_they_are_and_open_ones_leave_the_picture():
    spans = (
        Span("this fit", 0.5, (0.4, 0.6), (0.3, 0.7)),
        Span("covariance", None, None, (-math.inf, math.inf)),
    )
    chart = draw_intervals("e_n", spans, (0.0, 1.0))
    low, high = chart.panels[0].x.low, chart.panels[0].x.high
    assert low < 0.3
    assert high > 0.7
    assert (0.5, 0.0) in single(chart)
    assert [place for place in single(chart) if place[1] == 1.0] == [(low, 1.0), (high, 1.0)]


def test_a_profile_is_drawn_as_computed(appraisals):
    profile = appraisals("fixed").profiles["e_t"]
    chart = draw_profile(profile)
    curve = max(of(chart, Line), key=lambda line: line.x.size)
    assert np.isin(curve.x, profile.x).all()
    assert (profile.value, 0.0) in single(chart)
    cuts = sorted({round(float(line.y[0]), 5) for line in of(chart, Line) if line.x.size == 2})
    assert cuts == [0.98895, 3.84146] or cuts == [0.98894, 3.84146]


def test_an_interval_without_end_is_shaded_as_far_as_its_profile_is_known(appraisals):
    profile = appraisals("fixed").profiles["e_t"]
    (low, _), *_ = profile.pieces
    chart = draw_profile(replace(profile, pieces=((low, math.inf),)))
    assert of(chart, Box)[0].x == pytest.approx((low, profile.x[np.isfinite(profile.x)].max()))


def test_failing_checks_look_different():
    chart = draw_checks({"chi2": 0.4, "runs of signs": 1e-9})
    assert [points.marker for points in of(chart, Points)] == ["o", "<"]
    assert single(chart) == [(0.4, 0.0), (1e-6, 1.0)]


def test_a_forest_has_a_line_a_result():
    lines = [
        ("a", Estimate(0.12, 0.004, (0.116, 0.124), (0.112, 0.128), "determined")),
        ("b", Estimate(None, None, (0.2, math.inf), (0.15, math.inf), "not_determined")),
        ("c", Estimate(0.13, None, (0.13, 0.13), (0.13, 0.13), "fixed")),
    ]
    chart = draw_forest("mu", lines)
    (panel,) = chart.panels
    assert panel.x.low < 0.112
    assert panel.x.high > 0.13
    assert {(0.12, 0.0), (0.13, 2.0), (panel.x.high, 1.0)} <= set(single(chart))
    assert panel.y.ticks.labels == ("a", "b", "c")


@pytest.mark.parametrize("by_matplotlib", [False, True])
def test_an_inline_svg_has_names_of_its_own_and_no_styles(by_matplotlib):
    picture = figure_of(0.4, "<b>&") if by_matplotlib else draw_checks({"<b>&": 0.4})
    text = inline(Picture("one", "A & B", "what < is seen", picture))
    root = ET.fromstring(text)
    ids = {element.get("id") for element in root.iter() if element.get("id")}
    assert all(name.startswith("one-") for name in ids)
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= ids
    assert "style=" not in text
    assert "metadata" not in text
    assert root.find("title").text == "A & B"
    assert root.find("desc").text == "what < is seen"
    assert "<b>&" in "".join(root.itertext())
    other = ET.fromstring(inline(Picture("two", "", "", picture)))
    assert not ids & {element.get("id") for element in other.iter() if element.get("id")}
    assert inline(Picture("one", "A & B", "what < is seen", picture)) == text


def figure_of(value, label):
    """A figure of matplotlib, as a section of somebody's own may show."""
    with drawing():
        figure = new_figure(60.0, 2.0)
        axes = figure.add_subplot()
        axes.plot([0.0, 1.0], [0.0, value])
        axes.set_xlabel(label)
    return figure


def test_a_figure_and_what_was_written_of_it_are_the_same_picture():
    figure = figure_of(0.4, "x")
    drawn = inline(Picture("one", "", "", figure))
    assert inline(Picture("one", "", "", svg_text(figure))) == drawn
    assert (ET.fromstring(drawn).get("width"), ET.fromstring(drawn).get("height")) == ("250", "212")
