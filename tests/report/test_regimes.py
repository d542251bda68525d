"""Impacts that stick and that slide are those on which something was measured that knows it."""

from __future__ import annotations

import numpy as np
from factories import impacts_file

from ifrfit.inference.fit import fit
from ifrfit.inference.options import AngleErrors, Noise
from ifrfit.report.regimes import regime_counts

ANGLES = np.arange(5.0, 86.0, 5.0)


def test_readings_of_e_n_are_no_impacts_that_stick(tmp_path):
    beta = {"gamma": ANGLES, "noise": 0.01, "sigma": None}
    drops = {"gamma": ANGLES[:5], "observables": ("e_n",), "noise": 0.01, "sigma": None, "seed": 1}
    result = fit(impacts_file(tmp_path / "t.csv", beta, drops), method="lsq")
    assert regime_counts(result, "run") == (6, 11)
    assert "6 impacts stick, 11 slide" in result.summary()
    assert (result.fit.n_sticking, result.fit.n_sliding) == (6, 11)


def test_regimes_are_those_of_the_true_angles(tmp_path):
    """Angles set 4 degrees too small: the impact at 27 degrees came in beyond the transition at 30.2."""
    rows = {"gamma": ANGLES[:-1], "noise": 0.002, "sigma": 0.002}
    path = impacts_file(tmp_path / "t.csv", rows)
    lines = path.read_text(encoding="utf-8").splitlines()
    place = lines[0].split(",").index("gamma_deg")
    moved = [line.split(",") for line in lines[1:]]
    for cells in moved:
        cells[place] = str(float(cells[place]) - 4.0)
    path.write_text("\n".join([lines[0], *(",".join(cells) for cells in moved)]) + "\n", encoding="utf-8")
    noise = Noise(angles=AngleErrors(offset_sd=5.0))
    result = fit(path, method="lsq", fix={"e_n": 0.94}, noise=noise)
    assert regime_counts(result, "run") == (6, 10)


def test_many_series_of_one_transition_have_one_line(tmp_path):
    """Each row a series: their noise is one, too, whatever rounding makes of it in each."""
    parts = [
        {"gamma": [gamma], "noise": 0.01, "sigma": None, "series": f"s{i}", "seed": i}
        for i, gamma in enumerate(ANGLES.tolist())
    ]
    says = fit(impacts_file(tmp_path / "t.csv", *parts), method="lsq", fix={"e_n": 0.94}).summary()
    assert "all 17 series: 6 impacts stick, 11 slide; transition at" in says
    assert "s3:" not in says


def test_one_noise_of_two_series_is_one(tmp_path):
    """Whatever rounding makes of it in a series of one row."""
    for seed in range(4):
        of_a = {
            "gamma": np.linspace(5.0, 80.0, 12),
            "noise": 0.02,
            "sigma": None,
            "series": "a",
            "seed": seed,
        }
        of_b = {"gamma": [85.0], "noise": 0.02, "sigma": None, "series": "b", "seed": 9 + seed}
        result = fit(impacts_file(tmp_path / "t.csv", of_a, of_b), method="lsq", fix={"e_n": 0.94})
        assert "one unknown noise" in result.summary()
