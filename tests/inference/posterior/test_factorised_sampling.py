"""Sampling series by series, given what they share: known answers, quadrature, and a law that is broken."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from factories import rest_long
from posterior_agreement import agree
from posterior_questions import Question, Row, measured

from ifrfit.errors import UsageError
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior import (
    QuadraturePosterior,
    exact_posterior,
    factorised_sampling,
    integrate,
)
from ifrfit.inference.posterior.constants_density import FactorisedDensity, factorises
from ifrfit.inference.posterior.factorised_sampling import sample_by_series
from ifrfit.inference.posterior.importance_posterior import ImportancePosterior
from ifrfit.inference.posterior.integrators import log_evidence
from ifrfit.inference.posterior.mixture_proposal import Beside, Component, MixtureProposal

FEW = (9.0, 22.0, 38.0, 57.0)
SIX = (7.0, 16.0, 27.0, 38.0, 52.0, 70.0)
MUS = (0.1, 0.14, 0.2)


def rows(
    angles: tuple[float, ...],
    observable: str = "beta",
    *,
    sigma: float = 0.02,
    seed: int = 1,
    closure: str = "ifr",
) -> tuple[Row, ...]:
    """Three series that differ in mu."""
    return tuple(
        row
        for number, mu in enumerate(MUS)
        for row in measured(
            observable, angles, seed=seed + number, series=f"s{number}", mu=mu, sigma=sigma, closure=closure
        )
    )


def unknown(question: Question, *, separate: bool = True) -> Problem:
    """With an unknown noise of each series, or of all."""
    problem = replace(question, noise="unknown").problem()
    return problem.with_noise(replace(problem.noise, separate=separate))


MU = {"separate": ("mu",), "fix": {"e_n": 0.9}}
BOTH = {"separate": ("e_t", "mu"), "fix": {"e_n": 0.9}}
PROBLEMS = {
    "known noise": lambda: Question(rows(FEW), **MU).problem(),
    "known noise, e_n free": lambda: Question(
        rows(FEW, "v_x"), separate=("mu",), prior={"e_n": (0.9, 0.02)}
    ).problem(),
    "a noise each": lambda: unknown(Question(rows(SIX, seed=11), **MU)),
    "a noise each, two constants each": lambda: unknown(Question(rows(SIX, seed=21), **BOTH)),
    "one factor of the noise": lambda: Question(
        rows(FEW, seed=31, closure="f"), "f", separate=("mu",), fix={"e_n": 0.9}, noise="scaled"
    ).problem(),
    "two constants each": lambda: Question(rows(FEW, seed=41), **BOTH).problem(),
    "curved": lambda: Question(rows(SIX, "delta_deg", sigma=1.0, seed=51), **MU).problem(),
    "e_t each": lambda: Question(rows(FEW, seed=61), separate=("e_t",), fix={"e_n": 0.9}).problem(),
}  # fmt: skip
OTHERS = {
    "one noise": lambda: unknown(Question(rows(SIX, seed=71), **MU), separate=False),
    "heavy tails": lambda: replace(
        Question(rows(FEW), noise="scaled", **MU).problem(), error_model=ErrorModel(4.0)
    ),
    "angle offset": lambda: replace(Question(rows(FEW), **MU).problem(), error_model=ErrorModel(offset=1.0)),
    "e_n each": lambda: Question(rows(FEW, "v_x"), separate=("e_n", "mu")).problem(),
    "e_n each, one mu": lambda: Question(rows(FEW, "v_x"), separate=("e_n",)).problem(),
}


@pytest.mark.parametrize("name", [*PROBLEMS, *OTHERS])
def test_the_density_is_the_product_of_its_factors(name: str) -> None:
    problem = (PROBLEMS | OTHERS)[name]()
    assert factorises(problem)
    density = FactorisedDensity(problem)
    whole = density.whole
    rng = np.random.default_rng(0)
    at = np.zeros((50, whole.coordinates.dimensions))
    for place in range(whole.coordinates.dimensions):
        low, high = whole.coordinates.ends(place, at)
        at[:, place] = low + (high - low) * rng.random(50)
    found = density.coordinates.log_prior(at[:, density.shared])
    for factor in density.factors:
        found = found + factor(at[:, factor.places])[0]
    np.testing.assert_allclose(found, whole(at)[0], rtol=1e-10)


@cache
def by_quadrature(name: str) -> tuple[Problem, LeastSquaresFit, QuadraturePosterior]:
    problem = PROBLEMS[name]()
    start = least_squares(problem)
    return problem, start, integrate(problem, 1e-3, start)


@cache
def sampled_with(name: str, seed: int) -> ImportancePosterior:
    problem, start, _ = by_quadrature(name)
    return sample_by_series(problem, start, seed)


@pytest.mark.parametrize("name", rest_long(PROBLEMS, 2))
def test_it_agrees_with_quadrature(name: str) -> None:
    _, _, exact = by_quadrature(name)
    assert exact.converged
    sampled = sampled_with(name, 0)
    agree(sampled, exact, by_probability=True)
    assert set(sampled.names) == set(exact.names)
    transition = "transition_tau[s1]"
    assert sampled.quantile(transition, 0.5) == pytest.approx(exact.quantile(transition, 0.5), rel=0.05)
    drawn = sampled.draws(4000, np.random.default_rng(1))
    for each in sampled.parts:
        for quantity in each.values:
            off = abs(np.mean(drawn[quantity]) - sampled.mean(quantity))
            assert off <= 0.3 * sampled.sd(quantity), quantity


# rebound angles of five series, four to six rows each
CROWDED = {
    "s0": {11.08: 8.15066, 31.022: 23.5849, 56.845: 47.7573, 70.727: 68.7173},
    "s1": {21.118: 15.5389, 40.618: 31.6066, 49.461: 40.0269, 62.196: 53.8059},
    "s2": {26.509: 19.5667, 37.11: 28.4925, 39.92: 31.2102, 74.121: 73.4406},
    "s3": {
        8.428: 5.65915,
        14.448: 10.7467,
        29.313: 22.0789,
        29.698: 21.9925,
        43.03: 33.8999,
        69.477: 66.6136,
    },
    "s4": {
        26.754: 19.3793,
        30.476: 23.6429,
        31.18: 24.8509,
        36.776: 29.5717,
        47.214: 34.7075,
        76.136: 76.3596,
    },
}


def crowded() -> Problem:
    """A friction, an e_t and a noise of each series; e_n is tied to all of them."""
    found = tuple(
        Row("delta_deg", gamma, value, None, series=name)
        for name, values in CROWDED.items()
        for gamma, value in values.items()
    )
    return unknown(Question(found, separate=("e_t", "mu"), prior={"e_n": (0.72, 0.02)}))


def test_many_constants_on_few_rows_converge() -> None:
    problem = crowded()
    assert len(problem.free_parameters) == 11
    found = exact_posterior(problem)
    assert isinstance(found, ImportancePosterior)
    assert found.converged


def test_a_noise_that_series_with_own_constants_share_is_sampled() -> None:
    problem = OTHERS["one noise"]()
    found = exact_posterior(problem)
    assert isinstance(found, ImportancePosterior)
    assert found.converged
    assert log_evidence(problem) == pytest.approx(found.log_evidence, abs=0.1)
    with pytest.raises(UsageError, match="the quadrature wants unknown noises of each series"):
        exact_posterior(problem, integrator="quadrature")


@pytest.mark.parametrize("seeds", rest_long((4, 8)))
def test_errors_are_honest_over_seeds(seeds: int) -> None:
    _, _, exact = by_quadrature("known noise")
    found = [sampled_with("known noise", seed) for seed in range(seeds)]
    z = [(each.log_evidence - exact.log_evidence) / each.error_evidence for each in found]
    assert 0.1 < np.mean(np.square(z)) < 4.0
    off = [
        [abs(each.mean(name) - exact.mean(name)) / exact.sd(name) for name in exact.names] for each in found
    ]
    assert np.max(off) <= 4.0 * max(each.error for each in found)


def test_the_seed_decides() -> None:
    problem, start, _ = by_quadrature("known noise")
    first, again = sampled_with("known noise", 3), sample_by_series(problem, start, 3)
    assert first.log_evidence != sampled_with("known noise", 0).log_evidence
    assert first.log_evidence == again.log_evidence
    assert first.quantile("mu[s0]", 0.5) == again.quantile("mu[s0]", 0.5)


def test_laws_that_miss_most_of_the_posterior_do_not_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    # the control: the law of one series far from its posterior, and never fitted
    problem, start, _ = by_quadrature("a noise each")
    known = factorised_sampling.known_modes

    def far(density, start):
        centre, covariance = known(density, start)[0]
        return [(centre + 6.0 * np.sqrt(np.diag(covariance)), 0.05 * covariance)]

    monkeypatch.setattr(factorised_sampling, "known_modes", far)
    monkeypatch.setattr(factorised_sampling, "_TRIED", ())
    monkeypatch.setattr(factorised_sampling, "_OF_A_SERIES", Beside(wide=0.15, uniform=1e-4))
    assert not sample_by_series(problem, start).converged


class Wedge:
    """0 < x < 1, 0 < y < 1 + x, 0 < z < 2."""

    dimensions = 3

    def ends(self, place, at):
        low = np.zeros(at.shape[0])
        return low, (low + 1.0, 1.0 + at[:, 0], low + 2.0)[place]


def test_a_conditional_mixture_is_a_density_and_its_draws_follow_it() -> None:
    near = Component(np.array([0.3, 0.6, 0.5]), np.array([[0.1, 0, 0], [0.2, 0.1, 0], [0.1, 0.1, 0.2]]))
    other = Component(np.array([0.8, 1.5, 1.5]), np.diag([0.1, 0.3, 0.1]))
    beside = Beside(wide=0.15, factor=5.0, long=0.1, uniform=0.25)
    law = MixtureProposal(Wedge(), (near, other), np.array([0.6, 0.4]), beside, 1)
    given = np.array([[0.2], [0.55], [0.9]])
    n = 200
    mean = np.empty((3, 2))
    for row, (x,) in enumerate(given):
        y, z = (np.arange(n) + 0.5) / n * (1.0 + x), (np.arange(n) + 0.5) / n * 2.0
        grid = np.stack(np.meshgrid(y, z, indexing="ij"), axis=-1).reshape(1, -1, 2)
        at = np.concatenate((np.full((1, n * n, 1), x), grid), axis=2)
        density = np.exp(law.log_density(at))[0] * (1.0 + x) * 2.0 / n**2
        assert density.sum() == pytest.approx(1.0, abs=2e-3)
        mean[row] = density @ grid[0]
    drawn = law.draw(np.random.default_rng(0).random((3, 40_000, 3)), given)
    np.testing.assert_array_equal(drawn[:, :, 0], np.repeat(given, 40_000, axis=1))
    np.testing.assert_allclose(drawn[:, :, 1:].mean(axis=1), mean, atol=0.01)
