"""A closure's own constant that changes with the angle is named, be the change even or at one angle."""

from __future__ import annotations

import numpy as np
import pytest
from factories import rest_long, table_file

from ifrfit.inference.fit import fit
from ifrfit.physics import rebound

N = 40


def table(path, seed, change, mu=0.15, sigma=None, noise=0.01):
    """Readings of beta and e_n, with e_t larger by a change of the share of the range of angles."""
    rng = np.random.default_rng([seed, 91])
    gamma = rng.uniform(10.0, 80.0, N)
    e_t = -0.7 + change((gamma - 10.0) / 70.0)
    pairs = zip(gamma.tolist(), e_t.tolist(), strict=True)
    beta = [float(rebound(g, e_n=0.9, e_t=e, mu=mu, degrees=True).beta) for g, e in pairs]
    columns = {
        name: x + noise * rng.standard_normal(N) for name, x in (("beta", np.array(beta)), ("e_n", 0.9))
    }
    columns |= {f"{name}_sigma": np.full(N, noise) for name in columns} if sigma else {}
    return table_file(path / "t.csv", {"gamma_deg": gamma, **columns}, "%.6f")


def called(path):
    facts = fit(path, method="lsq").facts
    assert facts["slips"].ok, facts["slips"].says
    return facts["effects"]


@pytest.mark.parametrize("sigma", [False, True])
@pytest.mark.parametrize("mu", [0.15, 0.3])
@pytest.mark.parametrize("size", [0.2, -0.2])
@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_a_trend_of_e_t_is_named(tmp_path, seed, size, mu, sigma):
    fact = called(table(tmp_path, seed, lambda u: size * (u - 0.5), mu, sigma))
    assert fact.figures["called"] == ["sticking-by-angle"]
    assert f"e_t {'rises' if size > 0.0 else 'falls'} by 0." in fact.says
    assert "--gamma-min, --gamma-max" in fact.says


@pytest.mark.parametrize("sigma", [False, True])
@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_another_e_t_beyond_some_angle_is_named(tmp_path, seed, sigma):
    fact = called(table(tmp_path, seed, lambda u: 0.2 * (u > 0.4) - 0.1, 0.3, sigma))
    assert fact.figures["called"][0] == "sticking-by-angle"


@pytest.mark.parametrize("seeds", rest_long((10, 100)))
def test_one_e_t_is_no_trend(tmp_path, seeds):
    """Control."""
    for seed in range(seeds):
        facts = fit(table(tmp_path, seed, lambda u: 0.0 * u), method="lsq").facts
        assert facts["slips"].ok
        assert facts["effects"].ok
