"""A verdict that a small flaw of the measurement would turn says so."""

from __future__ import annotations

import numpy as np
import pytest
from factories import table_file

from ifrfit.inference.comparison import compare
from ifrfit.inference.comparison.verdict import rivals_with_flaws
from ifrfit.physics import rebound

GAMMA = np.linspace(3.0, 80.0, 40)


def written(tmp_path, closure, own, gain, seed):
    """Readings of beta and e_n, beta by a scale that is too small."""
    rng = np.random.default_rng(seed)
    made = rebound(GAMMA, degrees=True, closure=closure, e_n=0.9, mu=0.14, **own)
    beta = gain * made.beta + 0.02 * rng.standard_normal(GAMMA.size)
    e_n = 0.9 + 0.02 * rng.standard_normal(GAMMA.size)
    return table_file(tmp_path / "a.csv", {"gamma_deg": GAMMA, "beta": beta, "e_n": e_n}, "%.5f")


def test_a_scale_that_lets_fr_look_like_ifr_is_named(tmp_path):
    found = compare(written(tmp_path, "fr", {"beta0": 0.45}, 0.95, 3), ["fr", "ifr"], loo=False)
    assert found.verdict.kind == "preferred"
    assert found.ranked[0] == "ifr", "beta read small feigns IFR"
    words, left = rivals_with_flaws(found.entries, found.ranked)["fr"]
    assert words.startswith("speeds after impact -")
    assert words.endswith(" % off beside those before")
    assert left < 3.0 < found.verdict.log_bayes_factor
    assert "note  the verdict rests on the measurement: by log Bayes factors, FR with" in found.summary()


@pytest.mark.parametrize("seed", [1, 2])
def test_no_flaw_comes_up_to_the_closure_that_made_the_table(tmp_path, seed):
    found = compare(written(tmp_path, "ifr", {"e_t": -0.85}, 1.0, seed), ["fr", "ifr"], loo=False)
    assert found.ranked[0] == "ifr"
    assert rivals_with_flaws(found.entries, found.ranked) == {}
    assert "the verdict rests on" not in found.summary()
