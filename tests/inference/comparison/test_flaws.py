"""A verdict that a small flaw of the measurement would turn says so."""

from __future__ import annotations

import numpy as np
import pytest

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
    path = tmp_path / "a.csv"
    rows = (f"{g:.3f},{b:.5f},{e:.5f}" for g, b, e in zip(GAMMA, beta, e_n, strict=True))
    path.write_text("\n".join(("gamma_deg,beta,e_n", *rows)), encoding="utf-8")
    return path


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


def test_a_comparison_says_what_it_assumes(tmp_path):
    text = compare(written(tmp_path, "ifr", {"e_t": -0.85}, 1.0, 1), ["fr", "ifr"], loo=False).summary()
    assert "assumed: inertia factor 0.4 (solid sphere), no spin before impact" in text
    assert "angles of incidence without an offset" in " ".join(text.split())
