"""Wrong signs in some readings of v_n: named where they describe the table better than noise does."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import ifrfit

E_N, NOISE = 0.5, 0.1


def grazing(seed, n=400, *, errors=None, stated=False):
    """Impacts so flat that noise carries readings of v_n below zero."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(60.0, 87.0, n)
    state = ifrfit.rebound(gamma, degrees=True, e_n=E_N, e_t=-0.6, mu=0.15)
    e = rng.standard_normal(n) if errors is None else errors(rng, n)
    beta = state.beta + 0.03 * rng.standard_normal(n)
    table = pd.DataFrame({"gamma_deg": gamma, "v_n": state.v_n + NOISE * e, "beta": beta})
    return table.assign(sigma_v_n=NOISE, sigma_beta=0.03) if stated else table


def long_tails(rng, n):
    """Errors of Student's t, no further out than readings may lie below zero."""
    return np.clip(rng.standard_t(3, n), -4.0, 4.0)


def every_tenth_turned(table):
    turned = np.arange(len(table)) % 10 == 0
    return table.assign(v_n=np.where(turned, -table["v_n"], table["v_n"])), np.flatnonzero(turned)


@pytest.mark.parametrize("seed", range(1, 4))
@pytest.mark.parametrize("stated", [True, False])
def test_some_wrong_signs_are_named_with_their_rows(seed, stated):
    # e_n would be 3.6 to 5.9 sd below 0.5 without a word
    table, _ = every_tenth_turned(grazing(seed))
    if stated:  # beyond 5 sigma a reading is refused
        table = table.assign(sigma_v_n=NOISE, sigma_beta=0.03)
    fit = ifrfit.fit(table, method="lsq")
    fact = fit.facts["slips"]
    assert not fact.ok
    assert fact.figures["called"] == ["mixed-sign-below-zero v_n"]
    assert "v_n of the opposite sign in some of its lines" in fact.says
    assert "look at the signs of these lines" in fact.says
    mended = ifrfit.fit(grazing(seed), method="lsq")
    assert mended.facts["slips"].ok
    assert abs(mended.constants.e_n.value - E_N) < 3.5 * mended.constants.e_n.stderr


def test_rows_that_are_named_are_turned_ones():
    table, turned = every_tenth_turned(grazing(1))
    says = ifrfit.fit(table, method="lsq").facts["slips"].says
    listed = says.partition("lines (")[2].partition(" and ")[0]
    named = [int(row) for row in listed.split(",")]
    # at 60 degrees a turned reading lies 5 sd from a right one, at 87 none: some rows of noise are among them
    assert np.isin(named, turned).mean() > 0.75


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("errors", [None, long_tails], ids=["normal", "long tails"])
def test_readings_of_noise_are_none(seed, errors):
    table = grazing(seed, errors=errors)
    assert (table["v_n"] < 0.0).sum() > 20
    called = ifrfit.fit(table, method="lsq").facts["slips"].figures["called"]
    assert "mixed-sign-below-zero v_n" not in called
