"""Tables without what an impact had before: speeds that e_n falls with, spins of later bounces."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import table_file

from ifrfit import fit, rebound

TRUTH = {"e_t": -0.7, "mu": 0.15}
FALLS = "e_n falls with the normal speed"


def fitted(folder, seed, noise, *, known, speeds=False, upright=False, most=3.0):
    """Readings of beta and e_n whose e_n falls with the normal speed, from 0.5 m/s on."""
    rng = np.random.default_rng([seed, 17])
    gamma = rng.uniform(10.0, 80.0, 60)
    speed = np.exp(rng.uniform(np.log(0.5), np.log(most), 60))
    normal = speed if upright else speed * np.cos(np.radians(gamma))
    e_n = 0.9 - 0.12 * (normal / 1.3) ** 0.6
    beta = [rebound(g, e_n=e, degrees=True, **TRUTH).beta for g, e in zip(gamma, e_n, strict=True)]
    table = {"gamma_deg": gamma, "beta": np.array(beta) + noise * rng.standard_normal(60)}
    table["e_n"] = e_n + noise * rng.standard_normal(60)
    if known:
        table |= {"sigma_beta": noise, "sigma_e_n": noise}
    if speeds:
        table["speed_m_s"] = speed
    return fit(table_file(folder / "impacts.csv", pd.DataFrame(table)), method="lsq").facts


@pytest.mark.parametrize("known", [True, False])
def test_a_rise_with_the_angle_may_be_that_of_a_speed(tmp_path, known):
    for seed in range(3):
        fact = fitted(tmp_path, seed, 0.01, known=known, most=1.0)["normal_restitution"]
        assert not fact.ok
        assert FALLS in fact.says
        beside = fitted(tmp_path, seed, 0.01, known=known, most=1.0, speeds=True)
        assert FALLS not in beside["normal_restitution"].says


def test_scatter_of_e_n_may_be_that_of_a_speed(tmp_path):
    said = [
        fact.says
        for seed in range(6)
        for name, fact in fitted(tmp_path, seed, 0.02, known=True, upright=True).items()
        if name in ("scatter_too_large", "angle_scatter") and not fact.ok
    ]
    assert len(said) > 3
    assert all(FALLS in one for one in said)


def test_e_n_that_trends_is_told_before_the_lack_of_fit_that_it_makes(tmp_path):
    for seed in range(3):
        failing = [name for name, fact in fitted(tmp_path, seed, 0.005, known=True).items() if not fact.ok]
        assert failing.index("normal_restitution") < failing.index("lack_of_fit")


def test_later_bounces_are_named_beside_signs(tmp_path):
    rng = np.random.default_rng(5)
    gamma, spin = rng.uniform(15.0, 70.0, 40), np.zeros(40)
    first = rebound(np.full(40, 55.0), e_n=0.9, degrees=True, **TRUTH)
    later = rng.random(40) < 0.3
    spin[later] = (first.spin_y / np.hypot(first.v_x, first.v_n))[later]
    state = rebound(gamma, 0.0, spin, e_n=0.9, degrees=True, **TRUTH)
    # the slip before impact without the spin that nobody saw
    beta = -(state.v_x + state.spin_y) / np.sin(np.radians(gamma))
    table = {"gamma_deg": gamma, "beta": beta + 0.01 * rng.standard_normal(40), "e_n": 0.9}
    table["e_n"] = 0.9 + 0.01 * rng.standard_normal(40)
    fact = fit(table_file(tmp_path / "impacts.csv", pd.DataFrame(table)), method="lsq").facts["slips"]
    assert fact.figures["called"][0] == "mixed-sign beta"
    assert "later bounces" in fact.says
