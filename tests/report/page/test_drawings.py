"""The pictures by their data."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from ifrfit.inference.result.types import Estimate
from ifrfit.report.page.blocks import Picture
from ifrfit.report.page.drawings.checks import draw_checks
from ifrfit.report.page.drawings.corner import draw_corner, regions
from ifrfit.report.page.drawings.directions import Directions, draw_directions, share_text
from ifrfit.report.page.drawings.intervals import Span, draw_forest, draw_intervals
from ifrfit.report.page.drawings.profiles import draw_profile
from ifrfit.report.page.drawings.residuals import draw_against, draw_quantiles, quantile_band
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.page.sections.identifiability import directions
from ifrfit.report.page.svg import inline
from ifrfit.report.style import series_styles


def marks(axes):
    """Places of all single markers."""
    return [
        tuple(float(v) for xy in line.get_data() for v in xy)
        for line in axes.lines
        if len(line.get_xdata()) == 1
    ]


def test_the_band_of_ordered_residuals_holds_95_per_cent_of_each():
    n, runs = 12, 20_000
    low, high = quantile_band(n)
    drawn = np.sort(np.random.default_rng(0).standard_normal((runs, n)), axis=1)
    inside = ((drawn > low) & (drawn < high)).mean(axis=0)
    # five standard deviations of a share of 0.95 among so many
    assert np.abs(inside - 0.95).max() < 5.0 * math.sqrt(0.95 * 0.05 / runs)
    assert low[0] == pytest.approx(stats.norm.ppf(stats.beta.ppf(0.025, 1, n)))


def test_residuals_are_drawn_where_they_are(results):
    result = results("hostile")
    look = series_styles(list(result.points["series"].unique()))
    z = result.points["standardised"].to_numpy()
    for figure in (
        draw_against(result, look, result.points["gamma_deg"].to_numpy(), "γ"),
        draw_quantiles(result, look),
    ):
        (axes,) = figure.axes
        drawn = np.concatenate([line.get_ydata() for line in axes.lines if line.get_linestyle() == "None"])
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
    figure = draw_corner(columns, {"e_n": (-2.0, 2.0)})
    assert len(figure.axes) == 6
    assert {round(float(line.get_xdata()[0]), 9) for line in figure.axes[0].lines} >= {-2.0, 2.0}


def test_directions_of_a_known_covariance():
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    covariance = turn.T @ np.diag([0.25, 1e-4]) @ turn
    found = Directions.of(("e_n", "mu"), covariance, np.ones(2))
    assert found.ratio == pytest.approx([0.5, 0.01])
    assert found.parts == pytest.approx(turn[[0, 1]] * [[1.0], [1.0]])
    scaled = Directions.of(("e_n", "mu"), np.diag([1.0, 9.0]), np.array([4.0, 6.0]))
    assert scaled.ratio == pytest.approx([0.5, 0.25])
    (parts, bars) = draw_directions(found).axes
    assert [label.get_text() for label in bars.get_yticklabels()] == ["0.5", "0.01"]
    assert [text.get_text() for text in parts.texts] == ["+0.80", "+0.60", "−0.60", "+0.80"]
    assert share_text(-0.001) == "0"


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
    (axes,) = draw_intervals("e_n", spans, (0.0, 1.0)).axes
    low, high = axes.get_xlim()
    assert low < 0.3
    assert high > 0.7
    assert (0.5, 0.0) in marks(axes)
    assert [place for place in marks(axes) if place[1] == 1.0] == [(low, 1.0), (high, 1.0)]


def test_a_profile_is_drawn_as_computed(appraisals):
    profile = appraisals("fixed").profiles["e_t"]
    (axes,) = draw_profile(profile).axes
    curve = max(axes.lines, key=lambda line: len(line.get_xdata()))
    assert np.isin(curve.get_xdata(), profile.x).all()
    assert (profile.value, 0.0) in marks(axes)
    cuts = sorted({round(float(line.get_ydata()[0]), 5) for line in axes.lines if len(line.get_xdata()) == 2})
    assert cuts == [0.98895, 3.84146] or cuts == [0.98894, 3.84146]


def test_an_interval_without_end_is_shaded_as_far_as_its_profile_is_known(appraisals):
    profile = appraisals("fixed").profiles["e_t"]
    (low, _), *_ = profile.pieces
    (axes,) = draw_profile(replace(profile, pieces=((low, math.inf),))).axes
    shade = axes.patches[0].get_path().get_extents(axes.patches[0].get_patch_transform())
    assert (shade.x0, shade.x1) == pytest.approx((low, profile.x[np.isfinite(profile.x)].max()))


def test_failing_checks_look_different():
    (axes,) = draw_checks({"chi2": 0.4, "runs of signs": 1e-9}).axes
    found = [line for line in axes.lines if len(line.get_xdata()) == 1]
    assert [line.get_marker() for line in found] == ["o", "<"]
    assert [float(line.get_xdata()[0]) for line in found] == pytest.approx([math.log10(0.4), -6.0])


def test_a_forest_has_a_line_a_result():
    lines = [
        ("a", Estimate(0.12, 0.004, (0.116, 0.124), (0.112, 0.128), "determined")),
        ("b", Estimate(None, None, (0.2, math.inf), (0.15, math.inf), "not_determined")),
        ("c", Estimate(0.13, None, (0.13, 0.13), (0.13, 0.13), "fixed")),
    ]
    (axes,) = draw_forest("mu", lines).axes
    low, high = axes.get_xlim()
    assert low < 0.112
    assert high > 0.13
    assert {(0.12, 0.0), (0.13, 2.0), (high, 1.0)} <= set(marks(axes))
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b", "c"]


def test_an_inline_svg_has_names_of_its_own_and_no_styles():
    figure = draw_checks({"<b>&": 0.4})
    text = inline(Picture("one", "A & B", "what < is seen", figure))
    root = ET.fromstring(text)
    ids = {element.get("id") for element in root.iter() if element.get("id")}
    assert all(name.startswith("one-") for name in ids)
    assert "style" not in text
    assert "metadata" not in text
    assert root.find("title").text == "A & B"
    assert root.find("desc").text == "what < is seen"
    other = ET.fromstring(inline(Picture("two", "", "", figure)))
    assert not ids & {element.get("id") for element in other.iter() if element.get("id")}
    assert inline(Picture("one", "A & B", "what < is seen", figure)) == text
