"""The quadrature over the transition where mass reaches the bound of mu: most of what was measured sticks."""

from __future__ import annotations

import copy
import math

import numpy as np
import pandas as pd
import pytest
from factories import rest_long
from hypothesis import given, settings
from hypothesis import strategies as st
from posterior_agreement import furthest_from_general
from posterior_dense import tau_of
from posterior_questions import Question, Row, measured

import ifrfit
from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import exact_posterior, integrate
from ifrfit.inference.posterior.transition_quadrature import TransitionPosterior, transition_posterior
from ifrfit.physics import OBSERVABLES, rebound
from ifrfit.physics.closures import get_closure

J = 0.4
FAR = 9.0  # sd of e_n beyond which there is nothing


def open_above(seed: int, noise: str = "known") -> Problem:
    """5 to 60 impacts that all stick; of which some may slide; or the same with a bound of mu near to it."""
    rng = np.random.default_rng([78, seed])
    n, kind = int(rng.integers(5, 61)), seed % 3
    e_n = float(rng.choice([0.02, 0.5, 0.9, 0.985]) + rng.uniform(-0.012, 0.012))
    e_t = float(rng.choice([-0.99, -0.8, -0.42]))
    sigma, sigma_e_n = np.exp(rng.uniform(np.log([0.005, 0.001]), math.log(0.2)))
    mu = float(np.exp(rng.uniform(math.log(0.1), math.log(1.5))))
    last = math.degrees(math.atan(mu * (1.0 + e_n) / J)) * rng.uniform(
        *[(0.3, 0.95), (0.97, 1.03), (0.8, 1.2)][kind]
    )
    gamma = rng.uniform(min(2.0, 0.5 * last), min(last, 88.0), n)
    beta = ifrfit.rebound(gamma, e_n=e_n, e_t=e_t, mu=mu, degrees=True).beta + rng.normal(0.0, sigma, n)
    columns = {
        "series": "run",
        "observable": np.repeat(["beta", "e_n"], n),
        "gamma_deg": np.tile(gamma, 2),
        "value": np.concatenate((beta, np.maximum(e_n + rng.normal(0.0, sigma_e_n, n), 0.0))),
        "sigma": np.repeat([sigma, sigma_e_n], n),
    }
    bounds = {"mu": (0.0, float(mu * rng.uniform(0.9, 1.8)))} if kind == 2 else {}
    closure = get_closure("ifr")
    return make_problem(
        Observations(make_table(columns)), closure, J, make_parameters(closure, J, bounds=bounds), noise
    )


def worst_of(seeds: range, tolerance: float, least: int, noise: str = "known") -> float:
    """Largest difference from the general integral; at least so many tables are not left to it."""
    found = [furthest_from_general(open_above(seed, noise), tolerance) for seed in seeds]
    own = [each for each in found if each is not None]
    assert len(own) >= least
    return max(own)


def test_thirty_tables_agree_with_the_general_integral():
    assert worst_of(range(30), 1e-4, least=28) <= 1e-4


def test_an_asked_tolerance_of_a_millionth():
    assert worst_of(range(12), 1e-6, least=11) <= 1e-6


def test_of_unknown_noise_too():
    # bounds of e_t, of a noise, or few rows leave the others to the general integral, as elsewhere
    assert worst_of(range(24), 1e-4, least=6, noise="unknown") <= 1e-4


def gauss(edges: np.ndarray, order: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Composite Gauss-Legendre nodes and weights."""
    x, w = np.polynomial.legendre.leggauss(order)
    edges = np.unique(edges)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()


class Brute:
    """Integrals of likelihood times prior over (e_n, mu, c) below thresholds, with panels between kinks."""

    def __init__(self, question: Question) -> None:
        self.rows = [row for row in question.rows if row.observable == "beta"]
        self.normal = [row for row in question.rows if row.observable == "e_n"]
        self.ends = {name: question.domain(name) for name in ("e_n", "e_t", "mu")}
        self.log_scale = -sum(math.log(row.sigma * math.sqrt(2.0 * math.pi)) for row in question.rows)  # type: ignore[operator]
        self.log_scale -= sum(math.log(high - low) for low, high in self.ends.values())

    def mass(self, **below: float) -> dict[str, float]:
        """Integrals of 1, of each quantity and of their products, where all are below what is given."""
        weight = sum(row.sigma**-2 for row in self.normal)  # type: ignore[operator]
        mean = sum(row.value * row.sigma**-2 for row in self.normal) / weight  # type: ignore[operator]
        low, high = (min(max(mean + side * FAR / math.sqrt(weight), 0.0), 1.0) for side in (-1, 1))
        high = min(high, below.get("e_n", 1.0))
        m = self.ends["mu"][1]
        steps = np.array([below.get("kappa", math.inf), *(J * tau_of(row) for row in self.rows)]) / m - 1.0
        e_nodes, e_weights = gauss(
            np.append(np.linspace(low, high, 5), steps[(steps > low) & (steps < high)])
        )
        c_low, c_high = self.ends["e_t"]
        c, c_weight = gauss(np.linspace(c_low, min(c_high, below.get("e_t", c_high)), 11))
        found = dict.fromkeys(("1", "e_n", "e_t", "mu", "kappa"), 0.0)
        found |= {
            f"{a} {b}": 0.0 for a in ("e_n", "e_t", "mu", "kappa") for b in ("e_n", "e_t", "mu", "kappa")
        }
        for e_n, e_weight in zip(e_nodes, e_weights, strict=True):
            top = min(
                self.ends["mu"][1], below.get("mu", math.inf), below.get("kappa", math.inf) / (1.0 + e_n)
            )
            kinks = np.array([J * tau_of(row) / (1.0 + e_n) for row in self.rows])
            edges = np.concatenate(([0.0], kinks[kinks < top], [top]))
            fine = np.concatenate(
                [np.linspace(a, b, 7) for a, b in zip(np.sort(edges), np.sort(edges)[1:], strict=False)]
            )
            mu, mu_weight = gauss(fine)
            kappa = mu * (1.0 + e_n)
            chi2 = sum(((row.value - e_n) / row.sigma) ** 2 for row in self.normal)  # type: ignore[operator]
            for row in self.rows:
                k = J / (1.0 + J) * (1.0 + c) + np.minimum(J, kappa / tau_of(row))[:, None]
                chi2 = chi2 + ((row.value - (k * (1.0 + J) / J - 1.0)) / row.sigma) ** 2  # type: ignore[operator]
            f = np.exp(self.log_scale - 0.5 * chi2) * (e_weight * mu_weight[:, None] * c_weight)
            values = {"e_n": e_n, "e_t": c, "mu": mu[:, None], "kappa": kappa[:, None]}
            found["1"] += f.sum()
            for a, one in values.items():
                found[a] += (f * one).sum()
                for b, other in values.items():
                    found[f"{a} {b}"] += (f * one * other).sum()
        return found


NORMAL = tuple(Row("e_n", 5.0, value, 0.08) for value in (0.93, 1.04, 0.88))
QUESTIONS = {
    "all stick, e_n near 1": Question(
        measured("beta", (4.0, 9.0, 14.0, 21.0), seed=1, sigma=0.08, mu=0.6, c=-0.7) + NORMAL
    ),
    "the last ones may slide, e_t near -1": Question(
        (
            *measured("beta", (12.0, 22.0, 31.0, 38.0), seed=2, sigma=0.1, mu=0.16, c=-0.95),
            Row("e_n", 5.0, 0.6, 0.02),
        )
    ),
    "mu has a bound, e_n is wide": Question(
        (
            *measured("beta", (15.0, 30.0, 40.0, 62.0), seed=3, sigma=0.1, mu=0.3, e_n=0.4),
            Row("e_n", 5.0, 0.4, 0.2),
        ),
        bounds={"mu": (0.0, 0.33)},
    ),
}


@pytest.mark.parametrize("name", QUESTIONS)
def test_against_brute_force(name: str) -> None:
    question = QUESTIONS[name]
    problem = question.problem()
    post = transition_posterior(problem, 1e-4, least_squares(problem))
    assert post is not None
    brute = Brute(question)
    whole = brute.mass()
    z = whole["1"]
    assert abs(post.log_evidence - math.log(z)) < 1e-4
    names = ("e_n", "e_t", "mu", "kappa")
    means = np.array([whole[one] / z for one in names])
    products = np.array([[whole[f"{one} {other}"] / z for other in names] for one in names])
    between = products - np.outer(means, means)
    sd = np.sqrt(np.diag(between))
    assert np.abs(np.array([post.mean(one) for one in names]) - means).max() < 1e-4 * sd.min()
    assert np.abs(np.array([post.sd(one) for one in names]) / sd - 1.0).max() < 1e-4
    assert np.abs(post.covariance(names) - between).max() < 1e-4 * np.outer(sd, sd).min()
    for one in names:
        for level in (LEVELS[0], LEVELS[2], LEVELS[4]):
            below = brute.mass(**{one: float(post.quantile(one, level))})["1"] / z
            assert abs(below - level) < 4e-5, (one, level)  # 1e-4 sd at the height of a normal law


@settings(max_examples=12, deadline=None)
@given(st.integers(1000, 2000), st.lists(st.floats(0.0, 1.0), min_size=2, max_size=20))
def test_distribution_functions_rise_from_0_to_1(seed: int, places: list[float]) -> None:
    problem = open_above(seed)
    post = transition_posterior(problem, 1e-4, least_squares(problem))
    if post is None:
        return
    for name, own in post.marginals.items():
        at = own.low + (own.high - own.low) * np.sort(places)
        found = post.cdf(name, np.concatenate(([own.low], at, [own.high])))
        assert np.diff(found).min() >= -1e-6  # a hundredth of the tolerance: polynomials may ripple
        assert found[0] == 0.0
        assert found[-1] == 1.0
        quantiles = np.asarray(post.quantile(name, np.linspace(0.01, 0.99, 15)))
        assert (np.diff(quantiles) > 0.0).all()


def test_a_copy_of_the_posterior_is_the_same():
    post = exact_posterior(open_above(1))
    assert isinstance(post, TransitionPosterior)
    other = copy.deepcopy(post)
    for name in post.names:
        assert other.quantile(name, 0.3) == post.quantile(name, 0.3)


def test_draws_are_those_of_the_general_integral_and_within_the_bound():
    problem = open_above(1)
    post = exact_posterior(problem)
    assert isinstance(post, TransitionPosterior)
    drawn = post.draws(4000, np.random.default_rng(1))
    general = integrate(problem).draws(4000, np.random.default_rng(1))
    assert all(np.array_equal(drawn[name], general[name]) for name in general)
    assert drawn["mu"].max() <= 2.0
    np.testing.assert_allclose(drawn["kappa"], drawn["mu"] * (1.0 + drawn["e_n"]), rtol=1e-12)
    names = ("e_n", "e_t", "mu", "kappa")
    sd = np.array([post.sd(one) for one in names])
    between = np.cov([drawn[one] for one in names]) - post.covariance(names)
    assert np.abs(between / np.outer(sd, sd)).max() < 5.0 * math.sqrt(2.0 / 4000.0)  # standard errors
    for one in names:
        ranks = np.asarray(post.cdf(one, drawn[one]))
        assert abs(ranks.mean() - 0.5) < 5.0 / math.sqrt(12.0 * 4000.0)


def test_a_bound_far_below_what_the_data_say_is_left_to_the_general_integral():
    rows = measured("beta", (20.0, 40.0, 60.0, 75.0), seed=4, sigma=0.01, mu=0.3)
    problem = Question((*rows, Row("e_n", 5.0, 0.9, 0.01)), bounds={"mu": (0.0, 0.2)}).problem()
    assert transition_posterior(problem, 1e-4, least_squares(problem)) is None


@pytest.mark.parametrize("seed", rest_long(range(12), 5))
def test_a_best_friction_beyond_the_end_of_its_prior(seed):
    """There the region of kappa may be empty: it was a number of panels below zero."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(40.0, 87.0, 15)
    state = rebound(gamma, 0.0, 0.0, degrees=True, e_n=0.5, e_t=-0.6, mu=rng.uniform(2.5, 6.0))
    table = pd.DataFrame({"gamma_deg": gamma})
    table["beta"] = OBSERVABLES["beta"].value(state, np.full(15, 0.3)) + 0.03 * rng.standard_normal(15)
    table = table.assign(e_n=0.5 + 0.02 * rng.standard_normal(15), sigma_beta=0.03, sigma_e_n=0.02)
    found, other = ifrfit.fit(table), ifrfit.fit(table, method=ifrfit.Exact(integrator="quadrature"))
    for name, one in found.constants.items():
        expected = other.constants[name]
        assert one.status == expected.status
        assert one.mean == pytest.approx(expected.mean, abs=1e-3 * (expected.stderr or 1.0))
