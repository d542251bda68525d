"""The quadrature over the transition alone against the general integral, over random plain tables."""

from __future__ import annotations

import math

import numpy as np
import pytest
from posterior_agreement import furthest_from_general

import ifrfit
from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import exact_posterior, integrate
from ifrfit.inference.posterior.transition_quadrature import TransitionPosterior, transition_posterior
from ifrfit.inference.summary.estimates import correlation_of
from ifrfit.physics.closures import get_closure

SEEDS = range(24)
SEEDS_UNKNOWN = range(100, 112)


def table(seed: int) -> tuple[Observations, float]:
    """beta and e_n of 5 to 500 impacts, with constants, angles, spins and errors from all of the space."""
    rng = np.random.default_rng([77, seed])
    n = int(np.exp(rng.uniform(math.log(5.0), math.log(500.0))))
    j = float(rng.uniform(0.35, 0.66)) if rng.random() < 0.3 else 0.4
    high = rng.uniform(30.0, 88.0)
    gamma = rng.uniform(rng.uniform(1.0, 0.7 * high), high, n)
    spin = rng.normal(0.0, rng.choice([0.0, 0.0, 0.3]), n)
    e_n, mu, e_t = rng.uniform(0.3, 0.99), np.exp(rng.uniform(-4.0, -0.2)), rng.uniform(-1.0, -j)
    sigma = np.exp(rng.uniform(math.log(0.003), math.log(0.3)))
    sigma_e_n = np.exp(rng.uniform(math.log(0.002), math.log(0.1)))
    constants = {"e_n": e_n, "e_t": e_t, "mu": mu, "inertia_factor": j}
    beta = ifrfit.rebound(gamma, spin_y=spin, degrees=True, **constants).beta + rng.normal(0.0, sigma, n)
    columns = {
        "series": "run",
        "observable": np.repeat(["beta", "e_n"], n),
        "gamma_deg": np.tile(gamma, 2),
        "spin_y": np.tile(spin, 2),
        "value": np.concatenate((beta, e_n + rng.normal(0.0, sigma_e_n, n))),
        "sigma": np.repeat([sigma, sigma_e_n], n),
    }
    return Observations(make_table(columns)), j


def question(seed: int, noise: str = "known", **options: object) -> Problem:
    """The plain question of a table."""
    observations, j = table(seed)
    closure = get_closure("ifr")
    return make_problem(observations, closure, j, make_parameters(closure, j, **options), noise)  # type: ignore[arg-type]


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6])
def test_it_is_the_general_integral_within_the_tolerance_that_it_states(tolerance):
    found = [furthest_from_general(question(seed), tolerance) for seed in SEEDS]
    settled = [each for each in found if each is not None]
    assert len(settled) >= len(SEEDS) // 2
    assert max(settled) <= tolerance


def test_of_unknown_noise_too():
    found = [furthest_from_general(question(seed, "unknown"), 1e-4) for seed in SEEDS_UNKNOWN]
    settled = [each for each in found if each is not None]
    assert settled
    assert max(settled) <= 1e-4


def test_gaussian_priors_of_e_n_and_of_the_closure_constant_are_in_the_closed_forms():
    found = furthest_from_general(question(3, prior={"e_n": (0.7, 0.05), "e_t": (-0.7, 0.1)}), 1e-5)
    assert found is not None
    assert found <= 1e-5


def test_draws_are_those_of_the_general_integral():
    problem = question(3)
    found = exact_posterior(problem)
    assert isinstance(found, TransitionPosterior)
    ours = found.draws(50, np.random.default_rng(1))
    general = integrate(problem).draws(50, np.random.default_rng(1))
    assert all(np.array_equal(ours[name], general[name]) for name in general)


@pytest.mark.parametrize(
    "options",
    [{"fix": {"e_n": 0.8}}, {"prior": {"mu": (0.2, 0.05)}}, {"fix": {"mu": 0.2}}],
)
def test_what_is_not_plain_is_left_to_the_general_integral(options):
    problem = question(3, **options)
    assert transition_posterior(problem, 1e-4, least_squares(problem)) is None


def test_a_common_factor_of_the_noise_is_left_to_the_general_integral():
    problem = question(3, "scaled")
    assert transition_posterior(problem, 1e-4, least_squares(problem)) is None


@pytest.mark.parametrize("general", [False, True])
@pytest.mark.parametrize("sigma", [1e-7, 1e-8])
def test_correlations_keep_their_digits_however_small_the_noise(sigma, general):
    """They were 23 at 1e-8: the mean of a product less the product of the means."""
    found = []
    for size in (1e-4, sigma):
        rng = np.random.default_rng(7)
        gamma = rng.uniform(3.0, 87.0, 30)
        state = ifrfit.rebound(gamma, e_n=0.7, e_t=-0.7, mu=0.2, degrees=True)
        beta_cm, e_n = state.beta_cm + size * rng.normal(size=30), 0.7 + size * rng.normal(size=30)
        result = ifrfit.fit(gamma_deg=gamma, beta_cm=beta_cm, sigma_beta_cm=size, e_n=e_n, sigma_e_n=size)
        posterior = integrate(*question_of(result)) if general else result.distribution
        found.append(correlation_of(posterior, ("e_n", "e_t", "mu")))
    np.testing.assert_allclose(found[1], found[0], atol=2e-3)


def question_of(result):
    problem, optimum = result.problem_and_optimum()
    return problem, 1e-4, optimum
