"""The stand-in datasets: made the same every time, from what the paper prints, with honest uncertainties."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from make_stand_ins import Measured, make, rows_of

from ifrfit.physics.rebound import rebound

ROOT = Path(__file__).resolve().parents[2]
STAND_INS = ("buck-2017", "cross-2019", "hashemnia-2019", "reagle-2013", "wang-2020")


@pytest.fixture(scope="module")
def specs():
    with (ROOT / "scripts" / "stand_ins.toml").open("rb") as file:
        return {name: spec for name, spec in tomllib.load(file).items() if name != "paper"}


def rows(name, folder=ROOT / "datasets"):
    with (folder / name / "data.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def column(chosen, name):
    return np.array([float(row[name]) for row in chosen])


def test_the_bundled_files_are_what_the_script_makes(tmp_path):
    made = make(tmp_path)
    assert sorted(folder.name for folder in made) == sorted(STAND_INS)
    for folder in made:
        for file in folder.iterdir():
            assert file.read_bytes() == (ROOT / "datasets" / folder.name / file.name).read_bytes(), file


@pytest.mark.parametrize("name", STAND_INS)
def test_each_assumption_is_listed(name, specs):
    own = json.loads((ROOT / "datasets" / name / "datapackage.json").read_text(encoding="utf-8"))["ifrfit"]
    text = " ".join(own["assumptions"])
    for series in specs[name]["series"]:
        assert f"Series '{series['label']}'" in text
    assert "% of the incoming speed" in text
    assert "first order" in text
    assert ("uniform" in text) == any(
        "spin_rad_s" in s or s.get("speed_m_s", {}).get("individual") for s in specs[name]["series"]
    )


def test_faces_of_an_impact_agree_with_one_another():
    # the three observables of an impact come from the same v_x, v_n and spin; without spin before,
    # psi_after and beta hold the same V_x
    by_impact = {}
    for row in rows("cross-2019"):
        if row["series"] == "no spin":
            by_impact.setdefault(row["impact_id"], {})[row["observable"]] = row
    assert len(by_impact) == 17
    for faces in by_impact.values():
        assert set(faces) == {"beta", "psi_after_deg", "mu_app"}
        gamma = np.radians(float(faces["beta"]["gamma_deg"]))
        contact = -float(faces["beta"]["value"]) * np.sin(gamma)
        psi = np.degrees(np.arctan2(contact, np.cos(gamma)))
        assert float(faces["psi_after_deg"]["value"]) == pytest.approx(psi, abs=1e-3)


def test_impact_ids_are_unique_to_an_impact():
    seen = {}
    for name in STAND_INS:
        for row in rows(name):
            impact = (name, row["series"], row["gamma_deg"])
            assert seen.setdefault(row["impact_id"], impact) == impact


def test_spin_series_state_the_nominal_spin_and_its_deviation():
    # R omega/u from the caption: 0.01 m 45 1/s / 2.0 m/s and 0.01 m 125 1/s / 1.5 m/s; uniform spreads
    for series, spin, rate, speed in (
        ("spin 0.225", 0.225, 15 / 45, 0.5 / 2.0),
        ("spin 0.833", 0.01 * 125 / 1.5, 25 / 125, 0.6 / 1.5),
    ):
        chosen = [row for row in rows("cross-2019") if row["series"] == series]
        assert len(chosen) == 17
        assert column(chosen, "spin_y") == pytest.approx(spin, abs=1e-6)
        assert column(chosen, "sigma_spin_y") == pytest.approx(
            spin * np.sqrt((rate**2 + speed**2) / 3), abs=1e-6
        )


def test_speed_is_stated_only_where_the_paper_prints_one():
    assert {row["speed_m_s"] for row in rows("cross-2019") if row["series"] == "no spin"} == {""}
    assert {row["speed_m_s"] for row in rows("buck-2017") + rows("hashemnia-2019")} == {""}
    assert set(column(rows("reagle-2013"), "speed_m_s")) == {27.0}
    wang = column(rows("wang-2020"), "speed_m_s")
    assert wang.min() >= 5.9
    assert wang.max() <= 6.1


EXPECTED = {
    "beta": lambda r: r.beta,
    "psi_after_deg": lambda r: np.degrees(r.psi_after),
    "mu_app": lambda r: r.mu_app,
    "beta_tot": lambda r: r.beta_tot,
    "delta_deg": lambda r: np.degrees(r.delta),
}


def chi2_of(made, constants, observable):
    chosen = [row for row in made if row["observable"] == observable]
    exact = EXPECTED[observable](rebound(column(chosen, "gamma_deg"), degrees=True, **constants))
    return float(np.sum(((column(chosen, "value") - exact) / column(chosen, "sigma")) ** 2)), len(chosen)


@pytest.mark.parametrize("name", STAND_INS)
def test_sigma_is_honest(name, specs):
    # over many other seeds chi2 at the true constants averages to the number of points; the mean of 200
    # has a standard error of sqrt(2 n/200), and first-order sigmas are good to a few per cent
    series = specs[name]["series"][0]
    for observable in series["observables"]:
        drawn = [
            chi2_of(
                rows_of(name, series, specs[name]["noise_level"], np.random.default_rng([1, k])),
                series["constants"],
                observable,
            )
            for k in range(200)
        ]
        n = drawn[0][1]
        assert np.mean([chi2 for chi2, _ in drawn]) == pytest.approx(
            n, abs=4 * np.sqrt(2 * n / 200) + 0.06 * n
        )


def test_spin_scatter_is_beyond_sigma(specs):
    # control: with the nominal spin the residuals exceed sigma, which is why the policy is not 'known'
    spec = specs["cross-2019"]
    series = spec["series"][2]
    made = rows_of("cross-2019", series, spec["noise_level"], np.random.default_rng(5))
    spin = column(made, "spin_y")
    exact = rebound(column(made, "gamma_deg"), spin_y=spin, degrees=True, **series["constants"])
    chi2 = np.sum(((column(made, "value") - exact.beta) / column(made, "sigma")) ** 2)
    assert chi2 > 5 * len(made)
    assert spec["noise"] == "scaled"


def test_an_observable_without_a_rule_is_refused():
    one = np.ones(1)
    with pytest.raises(ValueError, match="no rule for lambda_deg"):
        Measured(45 * one, 0 * one, one, one, one).observe("lambda_deg")
