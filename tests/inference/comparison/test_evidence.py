"""Evidence of tiny problems known in closed form, criteria, and evidence without marginals."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from comparison_data import observations
from factories import problem_of
from scipy import special

from ifrfit.inference.comparison import compare
from ifrfit.inference.comparison.compare import probabilities
from ifrfit.inference.posterior import integrate, log_evidence
from ifrfit.physics.closures import CLOSURES

STICKING = np.array([3.0, 5.0, 8.0, 11.0])
FIXED = {"e_n": 0.9, "mu": 0.5}
SIGMA = 0.1
# restitution in sticking = own constant plus this, between these ends (solid sphere)
SHIFT = {"fr": (0.0, -1.0, 1.0), "ifr": (1.4, -1.0, -0.4), "ifr-contact": (1.0, -1.0, 0.0)}


def by_hand(name: str, value: np.ndarray) -> float:
    """Sticking rows with everything known but the closure's constant: a normal law cut off at its domain."""
    n = value.size
    constant = -n * math.log(SIGMA * math.sqrt(2.0 * math.pi))
    if name == "f":
        return constant - 0.5 * float((value**2).sum()) / SIGMA**2
    shift, low, high = SHIFT[name]
    mean, sd = float(value.mean()) - shift, SIGMA / math.sqrt(n)
    inside = float(special.ndtr((high - mean) / sd) - special.ndtr((low - mean) / sd))
    square = float(((value - value.mean()) ** 2).sum())
    return (
        constant - 0.5 * square / SIGMA**2 + math.log(inside * sd * math.sqrt(2.0 * math.pi) / (high - low))
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_evidence_of_sticking_rows_is_the_one_by_hand(seed):
    data = observations("ifr", STICKING, sigma=SIGMA, seed=seed, e_t=-0.9, **FIXED)
    value = data.table["value"].to_numpy()
    found = compare(data, ("f", "fr", "ifr", "ifr-contact"), loo=False, fix=FIXED, noise="known")
    expected = {name: by_hand(name, value) for name in found.entries}
    for name, entry in found.entries.items():
        assert entry.log_evidence == pytest.approx(expected[name], abs=2e-4)
    top = max(expected.values())
    weights = {name: math.exp(x - top) for name, x in expected.items()}
    for name, entry in found.entries.items():
        assert entry.log_bayes_factor == pytest.approx(expected[name] - top, abs=4e-4)
        assert entry.probability == pytest.approx(weights[name] / sum(weights.values()), abs=2e-4)


@pytest.mark.parametrize("name", CLOSURES)
@pytest.mark.parametrize("noise", ["known", "scaled", "unknown"])
def test_evidence_alone_is_that_of_the_posterior(name, noise):
    problem = problem_of(
        observations("ifr", observables=("beta",), sigma=0.1, e_t=-0.8), name, noise=noise, fix={"e_n": 0.9}
    )
    assert log_evidence(problem) == pytest.approx(integrate(problem).log_evidence, abs=2e-4)


def test_evidence_alone_sees_the_wall_of_kappa():
    """Where mu reaches its bound, e_n and kappa are tied: both roads have to leave the short cut."""
    data = observations("ifr", np.linspace(5.0, 40.0, 9), sigma=0.2, e_t=-0.9, mu=1.5)
    extra = observations("ifr", [1.0, 2.0], ("e_n",), sigma=0.1, e_t=-0.9, seed=5)
    both = type(data)(pd.concat([data.table, extra.table], ignore_index=True), data.sources)
    problem = problem_of(both, "ifr")
    assert log_evidence(problem) == pytest.approx(integrate(problem).log_evidence, abs=3e-4)


def test_probabilities_of_huge_differences_stay_finite():
    found = probabilities({"a": -1e5, "b": 0.0, "c": 0.0})
    assert found == {"a": 0.0, "b": 0.5, "c": 0.5}


def test_aicc_only_with_one_unknown_scale():
    data = observations("ifr", sigma=0.03, e_t=-0.9, observables=("beta",))
    assert all(e.aicc is None for e in compare(data, ("f", "ifr"), loo=False, noise="known").entries.values())
    for policy in ("scaled", "unknown"):
        for entry in compare(data, ("f", "ifr"), loo=False, noise=policy).entries.values():
            n, k = entry.fit.fit.n, entry.fit.fit.rank + 1
            assert entry.aicc == pytest.approx(entry.fit.fit.aic + 2 * k * (k + 1) / (n - k - 1))
    two = observations("ifr", sigma=0.03, e_t=-0.9, observables=("beta_cm", "spin_y_after"))
    assert all(
        e.aicc is None for e in compare(two, ("f", "ifr"), loo=False, noise="unknown").entries.values()
    )
