"""Ratios of velocities scatter more where their denominator is small: those are no outliers."""

from __future__ import annotations

import numpy as np
import pytest
from factories import rest_long, table_file
from scipy import stats

from ifrfit import fit, rebound
from ifrfit.inference.diagnostics.growing_scatter import _tests

GAMMA = np.linspace(3.0, 80.0, 40)


def fitted(folder, power, seed, noise=0.012, **columns):
    rng = np.random.default_rng(seed)
    state = rebound(GAMMA, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True)
    sigma = noise / np.sin(np.radians(GAMMA)) ** power
    table = {
        "gamma_deg": GAMMA,
        "beta": state.beta + sigma * rng.standard_normal(GAMMA.size),
        "e_n": 0.9 + 0.02 * rng.standard_normal(GAMMA.size),
    }
    return fit(table_file(folder / "film.csv", table | columns), method="lsq")


@pytest.mark.parametrize("seeds", rest_long((5, 10)))
def test_errors_of_velocities_are_named_and_nothing_is_excluded(tmp_path, seeds):
    named = 0
    for seed in range(seeds):
        result = fitted(tmp_path, 1.0, seed)
        fact = result.facts.get("growing_scatter")
        if fact is None:
            continue
        named += 1
        assert result.facts["outliers"].ok
        assert "the scatter of beta grows towards normal incidence" in fact.says
        assert "--sigma-velocity and --sigma-spin, together some 0.01" in fact.says
        assert 0.007 < fact.figures["size"] < 0.018
        assert "--exclude" not in result.summary()
    assert named >= 0.6 * seeds


@pytest.mark.parametrize("seeds", rest_long((2, 6)))
def test_an_even_scatter_is_none(tmp_path, seeds):
    for seed in range(seeds):
        result = fitted(tmp_path, 0.0, seed, noise=0.03)
        assert "growing_scatter" not in result.facts
    # nor where the table says how large errors are
    result = fitted(tmp_path, 1.0, 0, sigma_beta=np.full(40, 0.05), sigma_e_n=np.full(40, 0.02))
    assert "growing_scatter" not in result.facts


def test_p_values_of_an_even_scatter_are_uniform_in_their_tail():
    """At most: the worst row is left out, and ranks have a say."""
    rng = np.random.default_rng(5)
    basis = np.linalg.qr(np.column_stack((np.ones(40), GAMMA)))[0]
    errors = rng.standard_normal((4000, 40))
    left = errors - errors @ basis @ basis.T
    amplification = 1.0 / np.sin(np.radians(GAMMA))
    p = np.array([_tests(amplification, basis, z)[0] for z in left])
    assert stats.binomtest(int((p < 0.001).sum()), p.size, 0.001, alternative="greater").pvalue > 1e-3
    # the control: a scatter that grows is seen
    left = errors[:100] * amplification
    left -= left @ basis @ basis.T
    assert np.mean([_tests(amplification, basis, z)[0] < 0.001 for z in left]) > 0.5
