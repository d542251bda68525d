"""One constant for all series, or one each? One noise? Asked of every fit of several series."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, impacts_file, rest_long

from ifrfit import fit

ANGLES = np.linspace(4.0, 84.0, 17)


def pair(path, first, second, *, noise=(0.02, 0.02), sigma=None, seed=0):
    parts = [
        {"gamma": ANGLES, "e_n": 0.9, "noise": scatter, "sigma": sigma, "seed": 2 * seed + i, "series": name}
        | own
        for i, (name, own, scatter) in enumerate(zip("AB", (first, second), noise, strict=True))
    ]
    return impacts_file(path / "pair.csv", *parts)


def asked(path, **choices):
    return fit(path, fix={"e_n": 0.9}, method="lsq", **choices)


@pytest.mark.parametrize("sigma", [None, 0.02])
@pytest.mark.parametrize("seeds", rest_long((3, 8)))
def test_series_of_different_friction_are_told_apart(tmp_path, sigma, seeds):
    """Pairs with mu 0.14 and 0.16 at a noise of 0.02: all are found, and nothing else is blamed."""
    for seed in range(seeds):
        path = pair(tmp_path, {"mu": 0.14, "c": -0.85}, {"mu": 0.16, "c": -0.85}, seed=seed, sigma=sigma)
        result = asked(path)
        found = result.facts["pooling"]
        assert not found.ok
        assert found.figures["separate"] == ["mu"]
        assert "--separate mu" in found.says
        assert "effects" not in result.facts
        first = result.summary().partition(".")[0]
        assert first.startswith("LOOK  the series do not share their constants")
        assert "contradict" not in first


def test_two_constants_that_differ_are_both_named_with_their_values(tmp_path):
    path = pair(tmp_path, {"mu": 0.14, "c": -0.85}, {"mu": 0.25, "c": -0.70})
    found = asked(path).facts["pooling"]
    assert set(found.figures["separate"]) == {"mu", "e_t"}
    after = asked(path, separate=["mu", "e_t"])
    assert "pooling" not in after.facts
    assert after.constants["mu"]["A"].value == pytest.approx(0.14, abs=0.005)
    assert after.constants["mu"]["B"].value == pytest.approx(0.25, abs=0.01)


def test_constants_known_by_their_product_alone_get_no_values(tmp_path):
    """beta knows mu (1 + e_n): which of them differs is not to be told, and no value of either is."""
    path = pair(tmp_path, {"mu": 0.14, "c": -0.85}, {"mu": 0.25, "c": -0.85})
    says = fit(path, method="lsq").facts["pooling"].says
    assert "--separate mu" in says
    assert "values not determined one by one" in says
    assert "+-" not in says
    assert "+-" in asked(path).facts["pooling"].says


@pytest.mark.parametrize(
    ("pairs", "most"), [(15, at_most(15, 0.2)), pytest.param(60, 17, marks=pytest.mark.long)]
)
def test_series_that_are_alike_are_rarely_parted(tmp_path, pairs, most):
    """The smallest p of clean pairs: of 60 below 0.001 at most once (probability of more below 0.0018)."""
    same = {"mu": 0.14, "c": -0.85}
    smallest = [
        min(asked(pair(tmp_path, same, same, seed=seed)).facts["pooling"].figures["p"].values())
        for seed in range(pairs)
    ]
    assert sum(p < 0.001 for p in smallest) <= 1
    assert sum(p < 0.2 for p in smallest) <= most


def test_unknown_noise_is_shared_unless_it_is_separate(tmp_path):
    same = {"mu": 0.14, "c": -0.85}
    path = pair(tmp_path, same, same)
    shared = asked(path)
    assert shared.noise.sigma["A/beta"] == shared.noise.sigma["B/beta"]
    assert "one unknown noise" in shared.summary()
    apart = asked(path, separate="noise")
    assert apart.noise.sigma["A/beta"] != apart.noise.sigma["B/beta"]
    assert "two unknown noises" in apart.summary()
    exact = fit(path, fix={"e_n": 0.9})
    assert list(exact.noise.estimates) == ["beta"]


def test_unequal_noise_is_a_finding(tmp_path):
    same = {"mu": 0.14, "c": -0.85}
    found = asked(pair(tmp_path, same, same, noise=(0.01, 0.05)))
    assert not found.facts["unequal_noise"].ok
    assert "--separate noise" in found.facts["unequal_noise"].says
    assert "unequal_noise" not in asked(pair(tmp_path, same, same)).facts
    apart = asked(pair(tmp_path, same, same, noise=(0.01, 0.05)), separate="noise")
    assert "unequal_noise" not in apart.facts
