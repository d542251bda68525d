"""beta_tot knows e_n: alone it determines all constants, and is not left out beside beta without a word."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.physics import rebound

TRUE = {"e_n": 0.8, "e_t": -0.7, "mu": 0.12}
GAMMA = np.linspace(8.0, 82.0, 30)
NOISE = 0.01


def table(*names, seed=1):
    """Values with independent noise, by the closed form of the rebound."""
    rng = np.random.default_rng(seed)
    state = rebound(GAMMA, **TRUE, degrees=True)
    values = {name: getattr(state, name) + NOISE * rng.standard_normal(GAMMA.size) for name in names}
    return pd.DataFrame({"gamma": GAMMA, **values})


def test_it_determines_all_constants_alone():
    """Pulls of 20 tables are of unit size: their sum of squares is of chi2 with 60 degrees of freedom.

    A band of 1e-4 at either end, widened by a tenth for the curvature of the law.
    """
    squares = 0.0
    for seed in range(20):
        found = ifrfit.fit(table("beta_tot", seed=seed), method="lsq")
        for name, true in TRUE.items():
            estimate = found.constants[name]
            assert estimate.status == "determined"
            squares += ((estimate.value - true) / estimate.stderr) ** 2 / 3.0
    # constants of one table go together: 20 independent means of three squares at the least
    assert 0.2 < squares / 20.0 < 2.4


@pytest.mark.parametrize("beside", ["beta", "beta_cm"])
def test_where_it_is_left_out_the_words_say_what_it_tells(beside):
    data = table(beside, "beta_tot")
    found = ifrfit.fit(data, method="lsq")
    assert found.constants["e_n"].status == "not_determined"
    fact = found.facts["identifiable"]
    assert not fact.ok
    assert "beta_tot of the same impacts, left out so that none counts twice, tells e_n, too" in fact.says
    assert "(--observable beta_tot)" in fact.says
    assert f"(--observable {beside} --observable beta_tot --independent)" in fact.says
    words = " ".join(found.summary().split())
    assert f'observable=["{beside}", "beta_tot"] independent=True' in words
    # what it says works, and gives what was put in
    with pytest.raises(UsageError, match="independent"):
        ifrfit.fit(data, method="lsq", observable=[beside, "beta_tot"])
    for more in ({"observable": ["beta_tot"]}, {"observable": [beside, "beta_tot"], "independent": True}):
        again = ifrfit.fit(data, method="lsq", **more)
        for name, true in TRUE.items():
            estimate = again.constants[name]
            assert estimate.status == "determined"
            assert abs(estimate.value - true) < 4.0 * estimate.stderr


def test_nothing_is_said_where_e_n_is_known_or_nothing_tells_it():
    known = ifrfit.fit(table("beta", "beta_tot"), method="lsq", fix={"e_n": 0.8})
    assert all("left out" not in fact.says for fact in known.facts.values())
    fact = ifrfit.fit(table("beta"), method="lsq").facts["identifiable"]
    assert "left out" not in fact.says
