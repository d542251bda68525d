"""Several modes: the figure draws the one whose residuals it shows, and says where the others are."""

from __future__ import annotations

import numpy as np
import pytest
from factories import impacts_file, texts_of

import ifrfit
from ifrfit.inference.appraise import appraise
from ifrfit.physics import get_closure, transition_angles, transition_tau
from ifrfit.report import plot
from ifrfit.report.modes import at_shown_mode, modes_of, other_modes
from ifrfit.report.page.charts.chart import Points
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.page.sections.posterior import build
from ifrfit.report.regimes import regime_key


@pytest.fixture(scope="module")
def two_modes(tmp_path_factory):
    """Four impacts: either two of them stick, or one does."""
    path = tmp_path_factory.mktemp("modes") / "few.csv"
    gamma = np.array([20.0, 35.0, 50.0, 60.0])
    few = {"gamma": gamma, "noise": 0.15, "sigma": 0.15, "c": -0.8, "mu": 0.2, "seed": 13}
    return ifrfit.fit(impacts_file(path, few), fix={"e_n": 0.94})


def test_the_curve_is_that_of_the_fitted_values(two_modes):
    assert len(modes_of(two_modes)) == 2
    shown = at_shown_mode(two_modes)
    curve = shown.predict(two_modes.points["gamma_deg"], bands=False)["value"]
    assert curve.to_numpy() == pytest.approx(two_modes.points["fitted"].to_numpy(), abs=1e-6)
    # a control: medians of the posterior lie at no mode here
    between = two_modes.predict(two_modes.points["gamma_deg"], bands=False)["value"]
    assert np.abs(between.to_numpy() - two_modes.points["fitted"].to_numpy()).max() > 0.1


def test_regimes_are_those_of_the_curve_and_of_the_points(two_modes):
    theta = two_modes.least_squares.optimum.theta
    tau = transition_tau(get_closure("ifr"), theta[1], theta[2] * (1.0 + theta[0]))
    (angle,) = transition_angles(tau)
    ((value, low, high),) = regime_key(two_modes, "few" if "few" in two_modes.transitions else "run")
    assert (value, low, high) == pytest.approx((angle, angle, angle), abs=1e-6)
    assert (two_modes.points["gamma_deg"] < value).tolist() == two_modes.points["sticking"].tolist()


def test_the_others_are_dotted_and_named_with_their_weight(two_modes):
    ((weight, other),) = other_modes(two_modes)
    figure = plot(two_modes)
    written = texts_of(figure)
    assert f"another mode, weight {weight:.2g}" in written
    assert "transition of the mode shown" in written
    dotted = next(line for line in figure.axes[0].lines if line.get_linestyle() == ":" or line.is_dashed())
    expected = other.predict(dotted.get_xdata(), bands=False)["value"]
    assert dotted.get_ydata() == pytest.approx(expected.to_numpy(), nan_ok=True)


def test_marginals_mark_each_mode(two_modes):
    blocks = build(ReportInput(two_modes, appraise(two_modes, closures=False)))
    chart = blocks[0].items[0].figure
    marks = [m for m in chart.panels[0].marks if isinstance(m, Points)]
    expected = sorted(mode["constants"]["e_t"] for mode in modes_of(two_modes))
    assert sorted(marks[0].x.tolist()) == pytest.approx(expected)
    assert "triangles: the modes" in blocks[0].caption


def test_one_mode_is_as_it_was(made):
    result = made.fine()
    assert modes_of(result) == []
    assert at_shown_mode(result) is result
    assert other_modes(result) == []
