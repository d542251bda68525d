"""chi2 is looked at from below, too, and a row that is fitted exactly is no outlier."""

from __future__ import annotations

import numpy as np
import pytest
from factories import impacts_file

from ifrfit import fit

ANGLES = np.linspace(5.0, 80.0, 17)


@pytest.mark.parametrize(("noise", "alarm"), [(0.002, True), (0.02, False)])
def test_a_sigma_that_is_too_large_is_a_finding(tmp_path, noise, alarm):
    path = impacts_file(tmp_path / "t.csv", {"gamma": ANGLES, "noise": noise, "sigma": 0.02})
    result = fit(path, method="lsq", fix={"e_n": 0.94})
    assert ("scatter_too_small" in result.facts) == alarm
    if alarm:
        assert "sigma is too large" in result.facts["scatter_too_small"].says
        assert result.summary().startswith("LOOK  the data scatter less than their sigma")


def test_a_row_that_is_fitted_exactly_is_no_outlier(tmp_path):
    """One row alone slides, so mu runs through it: whatever rounding leaves of it is no residual."""
    parts = [
        {"gamma": np.linspace(5.0, 18.0, 9), "noise": 0.02, "sigma": None},
        {"gamma": [80.0], "sigma": None},
    ]
    result = fit(impacts_file(tmp_path / "t.csv", *parts), method="lsq", fix={"e_n": 0.94})
    last = result.points[result.points["gamma_deg"] == 80.0]
    assert abs(last["standardised"].iloc[0]) < 1e-6
    assert result.facts["outliers"].ok
