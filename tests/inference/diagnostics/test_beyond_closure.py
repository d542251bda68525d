"""Readings that no constants of the closure give are told first, with the reason, and are no outliers."""

from __future__ import annotations

import numpy as np
import pytest
from factories import table_file

from ifrfit import fit
from ifrfit.physics import rebound

ANGLES = np.linspace(8.0, 50.0, 12)


def table(path, value, observable="beta", sigma=0.02):
    return table_file(path, {"gamma_deg": ANGLES, observable: value, "sigma": sigma})


def noisy(value, seed=0, sigma=0.02):
    return value + sigma * np.random.default_rng(seed).standard_normal(ANGLES.size)


@pytest.mark.parametrize(("observable", "sign"), [("beta", 1.0), ("beta_cm", 1.0), ("spin_y_after", -1.0)])
def test_a_ball_that_springs_back_is_beyond_closure_f(tmp_path, observable, sign):
    impact = rebound(ANGLES, degrees=True, closure="fr", e_n=0.8, beta0=0.5, mu=0.6)
    value = impact.spin_y if observable == "spin_y_after" else getattr(impact, observable)
    found = fit(
        table(tmp_path / "t.csv", noisy(value), observable), closure="f", method="lsq", fix={"e_n": 0.8}
    )
    fact = found.facts["beyond_closure"]
    assert not fact.ok
    assert fact.figures["observable"] == observable
    assert "as a superball's does: a closure with tangential restitution, --closure fr or ifr" in fact.says
    assert "outliers" not in found.facts
    first = found.summary().split(". Details")[0]  # only a slip of the hand may stand before it
    assert first.removeprefix("LOOK  the table looks as if it had a slip in it; ").startswith(
        (
            "readings lie beyond what the closure can give",
            "LOOK  readings lie beyond what the closure can give",
        )
    )
    assert "beyond_closure" not in fit(tmp_path / "t.csv", closure="fr", method="lsq", fix={"e_n": 0.8}).facts


@pytest.mark.parametrize("closure", ["ifr", "fr", "ifr-contact"])
def test_a_contact_point_faster_than_before_gains_energy(tmp_path, closure):
    found = fit(table(tmp_path / "t.csv", noisy(1.15)), closure=closure, method="lsq", fix={"e_n": 0.8})
    assert "gains energy, which no closure of a rigid sphere gives" in found.facts["beyond_closure"].says


def test_the_wrong_sign_of_beta_may_lie_below_every_closure(tmp_path):
    found = fit(table(tmp_path / "t.csv", noisy(-1.2)), method="lsq", fix={"e_n": 0.8})
    assert "look at signs and at the angle's origin" in found.facts["beyond_closure"].says


def test_a_single_outlier_among_many_is_an_outlier(tmp_path):
    """Control: one of twelve readings far beyond the closure says nothing of the closure."""
    value = noisy(rebound(ANGLES, degrees=True, e_n=0.8, e_t=-0.9, mu=0.15).beta)
    value[3] = 1.8
    found = fit(table(tmp_path / "t.csv", value), method="lsq", fix={"e_n": 0.8})
    assert "beyond_closure" not in found.facts
    assert not found.facts["outliers"].ok


def test_many_rows_of_few_are_no_outliers_to_leave_out(tmp_path):
    """beta of 0.2 in sticking, where IFR has 2/5 at least: so that five of seven rows are far off."""
    value = 0.2 + 0.02 * np.random.default_rng(0).standard_normal(7)
    path = table_file(tmp_path / "t.csv", {"gamma_deg": range(10, 45, 5), "beta": value, "sigma": 0.02})
    found = fit(path, method="lsq", fix={"e_n": 0.8})
    assert found.summary().startswith("LOOK  the data contradict the closure")
    says = found.facts["outliers"].says
    assert "--exclude" not in says
    assert "so many of so few rows are no outliers: the law does not hold for them" in says


@pytest.mark.parametrize("seed", range(8))
def test_data_at_the_end_of_the_domain_are_not_beyond_it(tmp_path, seed):
    """beta of 1 while sticking, the most there is: noise carries half of the readings beyond."""
    value = rebound(ANGLES, degrees=True, e_n=0.8, e_t=-0.4, mu=2.0).beta
    found = fit(table(tmp_path / "t.csv", noisy(value, seed)), method="lsq", fix={"e_n": 0.8})
    assert "beyond_closure" not in found.facts


def unknown_noise(path, gamma, value):
    """The table without sigma, with readings of e_n about 0.9."""
    e_n = 0.9 + 0.02 * np.random.default_rng(99).standard_normal(gamma.size)
    return table_file(path, {"gamma_deg": np.round(gamma, 3), "beta": value, "e_n": e_n}, "%.6f")


@pytest.mark.parametrize("seed", range(3))
def test_an_unknown_noise_does_not_take_the_wrong_sign_of_the_spin_for_scatter(tmp_path, seed):
    """beta formed with the wrong sign of R omega: all readings lie between -1 and -1.7."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(5.0, 80.0, 40)
    impact = rebound(gamma, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True)
    value = -(impact.v_x - impact.spin_y) / np.sin(np.radians(gamma)) + 0.03 * rng.standard_normal(40)
    facts = fit(unknown_noise(tmp_path / "t.csv", gamma, value), method="lsq").facts
    assert facts["beyond_closure"].figures["n_beyond"] >= 30
    assert "look at signs" in facts["beyond_closure"].says
    assert "independence" not in facts
    assert not facts["lack_of_fit"].ok


def test_residuals_of_one_sign_are_a_lack_of_fit(tmp_path):
    """A constant beta beyond 1: nothing smooth departs, and no sign changes."""
    gamma = np.linspace(8.0, 50.0, 20)
    value = 1.15 + 0.02 * np.random.default_rng(0).standard_normal(20)
    facts = fit(unknown_noise(tmp_path / "t.csv", gamma, value), method="lsq").facts
    assert facts["lack_of_fit"].figures["p_runs"] == pytest.approx(2.0**-19)
    assert not facts["lack_of_fit"].ok
    assert not facts["beyond_closure"].ok


@pytest.mark.parametrize("seed", range(8))
def test_readings_at_the_end_of_the_domain_are_not_beyond_it_with_unknown_noise(tmp_path, seed):
    gamma = np.linspace(8.0, 50.0, 20)
    value = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.4, mu=2.0).beta
    value = value + 0.02 * np.random.default_rng(seed).standard_normal(20)
    facts = fit(unknown_noise(tmp_path / "t.csv", gamma, value), method="lsq").facts
    assert "beyond_closure" not in facts
    assert facts["lack_of_fit"].ok
