"""Draws as a distribution: known answers, and the estimates of the distribution that they were drawn from."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import ifrfit
from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.distributions.protocol import LEVELS, Distribution
from ifrfit.inference.posterior import QuadraturePosterior
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.prediction import draw_kept
from ifrfit.inference.result.types import Estimate, Fact

ANGLES = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0]
M = 20_000


@pytest.fixture
def problem(impacts):
    return ifrfit.fit(impacts(gamma=ANGLES, noise=0.05), fix={"e_n": 0.94}, method="lsq").problem


def normal(m: int = M) -> dict[str, np.ndarray]:
    at = stats.norm.ppf((np.arange(m) + 0.5) / m)  # the normal law without chance
    rng = np.random.default_rng(1)
    return {"e_t": -0.8 + 0.02 * at, "mu": 0.1 + 0.01 * rng.permutation(at)}


def test_moments_and_quantiles_of_a_normal_law(problem) -> None:
    law: Distribution = Draws.of(problem, normal())
    assert law.names == ("e_t", "mu", "kappa")
    assert law.mean("e_t") == pytest.approx(-0.8, abs=1e-12)
    assert law.sd("e_t") == pytest.approx(0.02, rel=1e-3)
    expected = -0.8 + 0.02 * stats.norm.ppf(LEVELS)
    assert law.quantile("e_t", LEVELS) == pytest.approx(expected, abs=1e-5)
    assert law.cdf("e_t", expected) == pytest.approx(LEVELS, abs=1e-4)
    assert law.quantile("e_t", 0.5) == pytest.approx(-0.8, abs=1e-6)
    covariance = law.covariance(("e_t", "mu", "kappa"))
    assert np.sqrt(np.diag(covariance)) == pytest.approx([0.02, 0.01, 0.0194], rel=1e-3)
    assert covariance[1, 2] == pytest.approx(1.94 * 1e-4, rel=1e-3)
    assert covariance[0, 1] == pytest.approx(0.0, abs=5.0 * 2e-4 / math.sqrt(M))


def test_kappa_and_the_transition_follow_from_the_constants(problem) -> None:
    law = Draws.of(problem, normal())
    assert law.values["kappa"] == pytest.approx(1.94 * law.values["mu"])
    # IFR sticks up to tau = 5/2 kappa
    assert law.quantile("transition_tau[run]", LEVELS) == pytest.approx(2.5 * law.quantile("kappa", LEVELS))


def test_draws_on_a_bound_count_towards_its_density(problem) -> None:
    draws = normal(1000) | {"e_t": np.concatenate((np.full(300, -1.0), np.linspace(-0.99, -0.6, 700)))}
    law = Draws.of(problem, draws)
    assert law.cdf("e_t", [-1.1, -1.0, -0.9999, -0.6, 0.0]) == pytest.approx([0.0, 0.0, 0.3, 1.0, 1.0])
    upper = Draws.of(problem, draws | {"e_t": np.where(np.arange(1000) < 300, -0.4, -0.7)})
    assert upper.cdf("e_t", [-0.5, -0.4]) == pytest.approx([0.7, 1.0])


def test_draws_are_taken_once_as_long_as_there_are_enough(problem) -> None:
    law = Draws.of(problem, normal(1000))
    assert law.n_draws == 1000
    drawn = law.draws(1000, np.random.default_rng(3))
    assert np.array_equal(np.sort(drawn["mu"]), np.sort(law.values["mu"]))
    assert drawn["kappa"] == pytest.approx(1.94 * drawn["mu"])
    assert law.draws(3000, np.random.default_rng(3))["mu"].shape == (3000,)
    with pytest.raises(ValueError, match="read-only"):
        law.values["mu"][0] = 1.0


def test_a_constant_without_draws_is_named(problem) -> None:
    with pytest.raises(KeyError, match="mu"):
        Draws.of(problem, {"e_t": np.zeros(10)})


@pytest.mark.parametrize(
    "choice",
    [
        {"fix": {"e_n": 0.94}},
        {"fix": {"e_n": 0.94}, "noise": "unknown"},
        {"fix": {"e_n": 0.94}, "noise": "scaled"},
        {},
    ],
)
def test_read_like_the_posterior_that_it_was_drawn_from(impacts, choice) -> None:
    path: Path = impacts(
        {"gamma": ANGLES, "noise": 0.05, "series": "a"},
        {"gamma": ANGLES, "noise": 0.05, "series": "b", "mu": 0.16, "seed": 1},
    )
    exact = ifrfit.fit(path, **choice)
    assert isinstance(exact.distribution, QuadraturePosterior)
    law = Draws.of(exact.problem, exact.distribution.draws(M, np.random.default_rng(5)))
    assert law.names == exact.distribution.names
    estimation = Estimation("exact", law, {"converged": Fact(True, "", {}, "")}, is_posterior=True)
    told = build_result(*exact.problem_and_optimum(), estimation)
    pairs = [(told.flat_constants(), exact.flat_constants()), (told.noise.estimates, exact.noise.estimates)]
    for ours, theirs in pairs:
        assert ours.keys() == theirs.keys()
        for name, one in ours.items():
            assert_alike(one, theirs[name])
    kappas = told.derived["kappa"], exact.derived["kappa"]
    if isinstance(kappas[0], Estimate):
        assert_alike(*kappas)
    angles = told.derived["transition_angle_deg"]
    for series, one in angles.items():
        assert_alike(one, exact.derived["transition_angle_deg"][series])
    assert told.correlation.matrix == pytest.approx(exact.correlation.matrix, abs=6.0 / math.sqrt(M))
    assert told.state.names == exact.state.names


def assert_alike(one: Estimate, other: Estimate) -> None:
    """Within 6 standard errors: of a median 1.25 sd, of an end some 3 sd over the root of the number."""
    assert one.status == other.status
    if other.stderr is None:
        assert one.value == other.value
        return
    unit = other.stderr / math.sqrt(M)
    assert one.stderr == pytest.approx(other.stderr, rel=8.0 / math.sqrt(M))
    assert one.value == pytest.approx(other.value, abs=6.0 * 1.25 * unit)
    for ours, theirs in zip(one.interval95, other.interval95, strict=True):
        assert ours == pytest.approx(theirs, abs=6.0 * 4.0 * unit)


def test_a_law_without_noise_leaves_the_noise_as_it_was(impacts) -> None:
    local = ifrfit.fit(impacts(gamma=ANGLES, noise=0.05), fix={"e_n": 0.94}, method="lsq", noise="scaled")
    estimation = Estimation(
        "bootstrap", Draws.of(local.problem, normal()), {"converged": Fact(True, "", {}, "")}
    )
    told = build_result(*local.problem_and_optimum(), estimation)
    assert told.noise == local.noise
    assert "predictive" not in told.facts
    assert told.constants["mu"].mean == pytest.approx(0.1, abs=1e-9)
    assert told.state.sample is not None
    assert told.state.sample.shape == (2000, 3)


@pytest.mark.parametrize(("closure", "name"), [("ifr", "e_t"), ("fr", "beta0")])
def test_a_constant_that_no_row_sees_is_drawn_over_its_domain(closure, name):
    """Readings of e_n and mu say nothing of the closure constant: no end of its domain is the best value."""
    found = ifrfit.fit("netl-glass-acrylic", closure=closure, method="lsq")
    low, high = found.constants[name].interval95
    drawn = draw_kept(found, 4000, np.random.default_rng(1))[name]
    assert abs(np.median(drawn) - 0.5 * (low + high)) < 0.05 * (high - low)
