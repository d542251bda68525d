"""Readings that noise carries below zero are fitted; others are refused, with what to do."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import table_file

import ifrfit
from ifrfit.data import readings_below_zero
from ifrfit.data.readings_below_zero import made_by_noise
from ifrfit.errors import DataError
from ifrfit.physics.observables import OBSERVABLES

V_N, E_N = OBSERVABLES["v_n"], OBSERVABLES["e_n"]


def grazing(n=300, e_n=0.5, sigma=0.1, seed=1, least=60.0):
    """Angles in degrees and readings of v_n, of which noise makes some negative."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(least, 86.0, n)
    return gamma, e_n * np.cos(np.radians(gamma)) + sigma * rng.standard_normal(n)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("n", [20, 300])
def test_readings_of_noise_are_fitted_with_the_others(tmp_path, n, stated):
    gamma, v_n = grazing(n)
    assert (v_n < 0.0).any()
    table = pd.DataFrame({"gamma_deg": gamma, "v_n": v_n})
    if stated:
        table["sigma_v_n"] = 0.1
    fit = ifrfit.fit(table_file(tmp_path / "t.csv", table), method="lsq")
    assert fit.fit.n == n
    slope = np.cos(np.radians(gamma))
    np.testing.assert_allclose(fit.constants.e_n.value, slope @ v_n / (slope @ slope), rtol=1e-6)
    assert abs(fit.constants.e_n.value - 0.5) < 3.5 * fit.constants.e_n.stderr


def test_so_are_raw_velocities_and_the_rule_is_that_of_observables(tmp_path):
    gamma, v_n = grazing()
    angle = np.radians(gamma)
    raw = pd.DataFrame(
        {
            "u_x_m_s": 2.0 * np.sin(angle),
            "u_z_m_s": 2.0 * np.cos(angle),
            "v_x_m_s": 1.2 * np.sin(angle),
            "v_z_m_s": -2.0 * v_n,
            "sigma_v_z_m_s": 0.2,
            "sigma_v_x_m_s": 0.2,
        }
    )
    fit = ifrfit.fit(table_file(tmp_path / "raw.csv", raw), method="lsq")
    slope = np.cos(angle)
    np.testing.assert_allclose(fit.constants.e_n.value, slope @ v_n / (slope @ slope), rtol=1e-5)
    raw["v_z_m_s"] *= -1.0
    with pytest.raises(DataError, match="z=out-of-wall"):
        ifrfit.fit(table_file(tmp_path / "raw.csv", raw), method="lsq")


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("case", ["all negative", "one far", "few of a wrong sign"])
def test_wrong_signs_are_refused(tmp_path, case, stated):
    gamma, v_n = grazing(sigma=0.01, least=30.0, e_n=0.8)
    if case == "all negative":
        v_n = -v_n
    elif case == "one far":
        v_n[7] = -0.3
    else:
        v_n[::4] *= -1.0
    table = pd.DataFrame({"gamma_deg": gamma, "v_n": v_n})
    if stated:
        table["sigma_v_n"] = 0.01
    with pytest.raises(DataError, match=r"impossible for v_n \(0 to 10\), and no noise: .* 5 sigma below 0"):
        ifrfit.fit(table_file(tmp_path / "t.csv", table))


@pytest.mark.parametrize("stated", [True, False])
def test_negative_on_the_whole_is_no_noise_however_near(stated):
    """Each within 3 sigma, all of a wrong sign: the constant would be -0.5, 20 standard errors below 0."""
    gamma, v_n = grazing()
    sigma = np.full(v_n.size, 0.1 if stated else np.nan)
    assert made_by_noise(V_N, v_n, gamma, sigma)[v_n < 0.0].all()
    assert not made_by_noise(V_N, -v_n, gamma, sigma).any()


@pytest.mark.parametrize("stated", [True, False])
def test_of_no_rebound_half_of_the_readings_are_negative(stated):
    """Of 200 tables with e_n = 0 one is refused with a chance of 200 times Phi(-4), 0.6 %, or 5 sigma's."""
    rng = np.random.default_rng(5)
    sigma = np.full(60, 0.02 if stated else np.nan)
    refused = 0
    for _ in range(200):
        e_n = 0.02 * rng.standard_normal(60)
        refused += not made_by_noise(E_N, e_n, np.full(60, np.nan), sigma)[e_n < 0.0].all()
    assert refused <= 1


def test_each_series_has_its_own_law():
    """At e_n = 0.8 nothing of noise 0.01 lies below 0; together with e_n = 0.02 the scatter would be 0.4."""
    rng = np.random.default_rng(2)
    e_n = np.concatenate([0.8 + 0.01 * rng.standard_normal(40), 0.01 + 0.01 * rng.standard_normal(40)])
    e_n[3] = -0.1
    series = np.repeat(["a", "b"], 40)
    nothing = np.full(80, np.nan)
    found = made_by_noise(E_N, e_n, nothing, nothing, series)
    assert not found[:40].any()
    np.testing.assert_array_equal(found[40:], e_n[40:] < 0.0)


def test_few_without_sigma_show_no_noise_and_sizes_have_no_sign():
    nothing = np.full(4, np.nan)
    assert not made_by_noise(E_N, np.array([0.05, -0.01, 0.02, 0.03]), nothing, nothing).any()
    of_size = OBSERVABLES["beta_tot"]
    assert not readings_below_zero.within_errors(of_size, np.array([-0.01]), np.array([0.1])).any()
