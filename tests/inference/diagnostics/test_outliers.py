"""A row is an outlier only if the fit of the other rows does not predict it."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, rest_long, table_file

from ifrfit import fit
from ifrfit.inference.diagnostics.residuals import residuals_of
from ifrfit.physics import rebound

# clean tables whose optimum lies on a bound or where a row begins to slide: the leverage does not hold there
SIX = ("gamma_deg,delta_deg", "12,8.3681 25,18.193 38,28.907 52,47.112 66,64.919 75,75.708", {})
TEN = (
    "gamma_deg,delta_deg",
    "13.3,9.1189 16.5,10.882 23.7,15.923 28.5,18.5 29.1,19.086 30.8,21.393 34.5,24.74 37.3,24.697 "
    "53.9,50.426 72.4,73.597",
    {"fix": {"e_n": 0.9}},
)
SEVEN = (
    "gamma_deg,beta_tot",
    "23.5,0.85874 27.2,0.84358 32.5,0.76898 39.6,0.80159 56.1,0.82796 63.6,0.85433 66.2,0.86423",
    {"fix": {"e_n": 0.9}},
)
# the one impact that sticks holds its constant alone: its leverage is 0.9, and without it another fit is best
STICKS_ALONE = (
    "gamma_deg,spin_y,beta_cm",
    "81.2,-0.244,-0.93055 60.5,-0.232,-0.85773 34.2,0.171,-0.65473 76.3,0.474,-0.95381 49.8,-0.27,-0.83054 "
    "67.9,0.047,-0.89778 58.4,0.57,-0.82621 49.9,0.658,-0.7956 55.2,0.077,-0.8491 17.2,0.499,-0.14613 "
    "58,0.692,-0.81019 38.5,0.682,-0.68161 82.9,0.504,-0.94868 35.3,0.251,-0.62432 73.1,0.357,-0.93015 "
    "58.7,-0.211,-0.81662 27.7,-0.159,-0.80665 29.2,0.402,-0.55023",
    {"closure": "fr"},
)
CLEAN = {"six": SIX, "seven": SEVEN, "ten": TEN, "sticks alone": STICKS_ALONE}


@pytest.mark.parametrize(("header", "rows", "options"), CLEAN.values(), ids=CLEAN.keys())
def test_clean_rows_at_a_kink_are_no_outliers(tmp_path, header, rows, options):
    path = tmp_path / "clean.csv"
    path.write_text("\n".join((header, *rows.split())) + "\n", encoding="utf-8")
    found = fit(path, method="lsq", **options)
    assert found.facts["outliers"].ok, found.facts["outliers"].says
    assert np.abs(residuals_of(found.problem, found.least_squares).studentised).max() < 10.0


def beta_of(seed, shift, n=12):
    rng = np.random.default_rng(seed)
    gamma = np.sort(rng.uniform(8.0, 76.0, n)).round(1)
    beta = rebound(gamma, e_n=0.9, e_t=-0.9, mu=0.15, degrees=True).beta + 0.02 * rng.standard_normal(n)
    far = int(rng.integers(n))
    beta[far] += 0.02 * shift
    return {"gamma_deg": gamma, "beta": beta}, far + 2


@pytest.mark.parametrize("seeds", rest_long((20, 200)))
def test_small_tables_have_outliers_where_there_are_some(tmp_path, seeds):
    false = named = 0
    for seed in range(seeds):
        clean, _ = beta_of(seed, 0.0)
        false += (
            not fit(table_file(tmp_path / "t.csv", clean), method="lsq", fix={"e_n": 0.9})
            .facts["outliers"]
            .ok
        )
        wrong, line = beta_of(seed, 15.0)
        fact = fit(table_file(tmp_path / "t.csv", wrong), method="lsq", fix={"e_n": 0.9}).facts["outliers"]
        named += fact.figures["rows"] == [f"t.csv line {line} (beta)"]
    assert false <= at_most(seeds, 0.001)
    assert named >= 0.8 * seeds


def test_a_line_with_two_outliers_is_left_out_once(tmp_path):
    table, _ = beta_of(1, 0.0, n=30)
    table["e_n"] = 0.9 + 0.02 * np.random.default_rng(2).standard_normal(30)
    for column in ("beta", "e_n"):
        table[column][4] += 0.8
    says = fit(table_file(tmp_path / "t.csv", table), method="lsq").facts["outliers"].says
    assert says.startswith("2 outliers: ")
    assert says.count("--exclude 6") == 1
