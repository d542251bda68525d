"""A table that another closure describes is not to be mended as a slip of the hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import ifrfit


def readings(seed, closure, noise=0.01, **turned):
    """Forty impacts of mu 0.15; of closure FR with beta0 0.5."""
    rng = np.random.default_rng(seed)
    gamma = np.round(rng.uniform(6.0, 80.0, 40), 1)
    own = {"beta0": 0.5} if closure == "fr" else {"e_t": -0.75}
    beta = ifrfit.rebound(gamma, closure=closure, e_n=0.85, mu=0.15, degrees=True, **own).beta
    e_n = 0.85 + noise * rng.standard_normal(40)
    table = {"gamma_deg": gamma, "beta": beta + noise * rng.standard_normal(40), "e_n": e_n}
    return pd.DataFrame(table | {name: of(table) for name, of in turned.items()}).round(3)


@pytest.mark.parametrize("seed", [200, 201, 203])
def test_a_closure_that_describes_it_as_well_stands_before_any_remedy(seed):
    table = readings(seed, "fr")
    slips = ifrfit.fit(table).facts["slips"]
    assert not slips.ok
    assert slips.figures["closures"] == ["FR"]
    said = slips.says
    assert said.index("not told apart from closure FR") < said.index("ifrfit compare tells closures")
    assert said.index("ifrfit compare tells closures") < said.index("divide")
    assert all(fact.ok for fact in ifrfit.fit(table, closure="fr").facts.values())


def test_behind_a_slip_that_no_closure_feigns_none_is_named():
    from_the_wall = readings(7, "ifr", gamma_deg=lambda table: 90.0 - table["gamma_deg"])
    slips = ifrfit.fit(from_the_wall).facts["slips"]
    assert "from the wall" in slips.says
    assert slips.figures["closures"] == []
    assert "closure" not in slips.says
