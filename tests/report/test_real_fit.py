"""The report on a result of the estimator itself, not on one built by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from built_results import TRUTH, Run, make_table, points_of

from ifrfit.data import Observations, Source
from ifrfit.inference import load_result
from ifrfit.inference.appraise import appraise
from ifrfit.inference.fit import fit
from ifrfit.report import plot, summary, write_folder


@pytest.fixture(scope="module")
def result():
    points = points_of(
        (Run("a"), Run("b", spin_y=0.2)),
        ("beta",),
        "impacts.csv",
        TRUTH,
    )
    table = points[[*make_table({"value": [0.0]}).columns]]
    source = Source("impacts.csv", "cd" * 32, len(table), len(table), {}, "measured")
    return fit(Observations(table, (source,)), fix={"e_n": 0.94})


def test_a_real_fit_is_shown_saved_and_read_back(result, tmp_path):
    text = summary(result)
    assert text.startswith("impacts.csv   68 impacts, beta, measured, no sigma given\n")
    assert "a: 12 impacts stick, 22 slide; transition at " in text
    names = write_folder(result, appraise(result), tmp_path / "out", force=False)
    assert names == ["result.json", "fit.svg", "fit.png", "report.html"]
    back = load_result(tmp_path / "out" / "result.json")
    assert summary(back) == text
    gamma = np.linspace(1.0, 89.0, 50)
    pd.testing.assert_frame_equal(back.predict(gamma, series="a"), result.predict(gamma, series="a"))


def test_the_drawn_curve_is_the_prediction_and_runs_through_the_fitted_values(result):
    data = next(axes for axes in plot(result).axes if axes.get_ylabel().startswith("restitution"))
    curve = next(line for line in data.lines if len(line.get_xdata()) > 100)
    rows = result.points[result.points["series"] == "a"]
    drawn = np.interp(rows["gamma_deg"], curve.get_xdata(), curve.get_ydata())
    assert drawn == pytest.approx(rows["fitted"].to_numpy(), abs=1e-3)
