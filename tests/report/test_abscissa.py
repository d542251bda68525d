"""Over what the panel of a fit draws its rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import table_file

import ifrfit
from ifrfit.inference.result.types import Estimate
from ifrfit.physics import rebound
from ifrfit.report import plot
from ifrfit.report.page.explorer import payload
from ifrfit.report.panels import ANGLE, NUMBER, SPEED, abscissa

OFFSET = ifrfit.Noise(angles=ifrfit.AngleErrors(offset_sd=1.0))
GAMMA = np.linspace(10.0, 80.0, 15)


def fitted(tmp_path, **columns):
    beta = rebound(GAMMA, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta
    table = {"gamma_deg": GAMMA, "beta": beta + 0.01 * np.sin(7.0 * GAMMA), "sigma_beta": 0.02}
    return table_file(tmp_path / "a.csv", table | columns)


def readings(gamma, speed):
    return pd.DataFrame({"gamma_deg": gamma, "speed_m_s": speed})


@pytest.mark.parametrize(
    ("rows", "label"),
    [
        (readings([10.0, 40.0, 70.0], [1.0, 2.0, 3.0]), ANGLE),
        (readings([10.0, 10.0, 10.0], [1.0, 2.0, 3.0]), SPEED),
        (readings([np.nan, np.nan, np.nan], [1.0, 2.0, 3.0]), SPEED),
        (readings([np.nan, 10.0, 70.0], [np.nan, 2.0, 3.0]), NUMBER),
        (readings([10.0, 10.0, 10.0], [2.0, 2.0, 2.0]), NUMBER),
    ],
)
def test_readings_of_e_n_are_drawn_over_what_differs(rows, label):
    x, found = abscissa(rows, "e_n")
    assert found == label
    expected = {ANGLE: "gamma_deg", SPEED: "speed_m_s"}.get(label)
    np.testing.assert_array_equal(x, [1.0, 2.0, 3.0] if expected is None else rows[expected])
    assert abscissa(rows, "beta")[1] == ANGLE


def test_a_panel_of_e_n_shows_its_trend_over_the_angle(tmp_path):
    falling = 0.95 - 0.005 * GAMMA
    fit = ifrfit.fit(fitted(tmp_path, e_n=falling, sigma_e_n=0.1), method="lsq")
    labels = [axes.get_xlabel() for axes in plot(fit).axes if axes.get_xlabel()]
    assert labels == [ANGLE, ANGLE]
    drawn = [
        line for axes in plot(fit).axes for line in axes.lines if np.array_equal(line.get_ydata(), falling)
    ]
    assert len(drawn) == 1
    np.testing.assert_array_equal(drawn[0].get_xdata(), GAMMA)


def test_readings_of_one_angle_are_drawn_over_the_speed(tmp_path):
    speed = np.linspace(0.5, 5.0, 12)
    columns = {"speed_m_s": speed, "e_n": 0.95 - 0.01 * speed, "sigma_e_n": 0.02}
    path = table_file(tmp_path / "drops.csv", columns)
    (data, residuals) = plot(ifrfit.fit(path, method="lsq")).axes
    assert residuals.get_xlabel() == SPEED
    low, high = data.get_xlim()
    assert low < 0.5
    assert high > 5.0


def test_points_lie_on_the_curve_where_an_offset_is_fitted(tmp_path):
    fit = ifrfit.fit(fitted(tmp_path), method="lsq", fix={"e_n": 0.9}, noise=OFFSET)
    offset = fit.noise.angle_offset
    assert isinstance(offset, Estimate)
    figure = plot(fit)
    assert [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()] == [
        f"{ANGLE}, fitted offset added"
    ]
    drawn = np.sort(np.concatenate([x.get_xdata() for x in figure.axes[0].lines if x.get_marker() == "o"]))
    assert np.isin(np.round(GAMMA + offset.value, 9), np.round(drawn, 9)).all()
    assert payload(fit)["rows"]["gamma"] == pytest.approx(GAMMA + offset.value)
    np.testing.assert_array_equal(fit.points["gamma_deg"], GAMMA)
