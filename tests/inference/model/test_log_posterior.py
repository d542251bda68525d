"""The density at points against the exact posterior: the same evidence by integration, the same rows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from factories import problem_of
from scipy import stats

from ifrfit.data.observations import make_table
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.posterior import integrate
from ifrfit.physics import rebound


def beta_of(*, noise="known", ids=None, **choices):
    rng = np.random.default_rng(3)
    gamma = np.linspace(10.0, 80.0, 12)
    beta = rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta + 0.1 * rng.standard_normal(12)
    table = make_table(
        {
            "series": np.repeat(["a", "b"], 6),
            "observable": "beta",
            "gamma_deg": gamma,
            "value": beta,
            "sigma": 0.1,
            "impact_id": ids if ids is not None else "",
            "provenance": "simulated",
        }
    )
    return problem_of(table, noise=noise, **choices)


def grid_of(density, n=400):
    """Midpoint rule over the whole domain."""
    ends = zip(density.lower, density.upper, strict=True)
    axes = [low + (high - low) * (np.arange(n) + 0.5) / n for low, high in ends]
    points = np.stack([x.reshape(-1) for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    return points, float(np.prod((density.upper - density.lower) / n))


@pytest.mark.parametrize(
    "choice",
    [
        {"fix": {"e_n": 0.9}},
        {"fix": {"e_n": 0.9}, "prior": {"mu": (0.2, 0.05)}},
        {"fix": {"e_n": 0.9, "mu": 0.15}, "noise": "scaled"},
        {"fix": {"e_n": 0.9, "e_t": -0.8}, "separate": ["mu"]},
    ],
)
def test_integral_of_the_density_is_the_exact_evidence(choice):
    problem = beta_of(**choice)
    density = Density(problem)
    points, cell = grid_of(density, 400)
    found = np.log(np.exp(density(points)).sum() * cell)
    assert found == pytest.approx(integrate(problem).log_evidence, abs=2e-3)


def test_each_noise_of_its_own_is_in_the_exact_evidence():
    problem = beta_of(fix={"e_n": 0.9, "e_t": -0.8, "mu": 0.15}, noise="unknown", separate_noise=True)
    density = Density(problem)
    assert density.names == ("noise[a/beta]", "noise[b/beta]")
    points, cell = grid_of(density, 500)
    found = np.log(np.exp(density(points)).sum() * cell)
    # with all constants fixed the posterior is that of the two noises alone
    rows = problem.rows.value - problem.predict(np.array([0.9, -0.8, 0.15]))
    expected = 0.0
    for group, (low, high) in density.problem.noise_bounds().items():
        at = np.exp(np.linspace(math.log(low), math.log(high), 20001))
        own = rows[problem.groups()[group]]
        like = stats.norm.logpdf(own[:, None], 0.0, at).sum(axis=0)
        expected += math.log(np.trapezoid(np.exp(like) / at, at) / math.log(high / low))
    assert found == pytest.approx(expected, abs=1e-3)


def test_outside_the_domain_there_is_nothing():
    density = Density(beta_of())
    points = np.array([[0.9, -0.8, 0.15], [1.1, -0.8, 0.15], [0.9, -0.2, 0.15], [0.9, -0.8, -0.1]])
    assert np.isfinite(density(points)).tolist() == [True, False, False, False]


def test_rows_of_an_impact_are_added():
    ids = ["i1", "i1", "", "", "i2", "i2", "i2", "", "", "", "", "i1"]
    density = Density(beta_of(ids=ids))
    point = np.array([[0.9, -0.8, 0.15]])
    rows = density.rows(point)[0]
    impacts = density.impacts(point)[0]
    assert impacts.size == 8
    assert impacts[0] == pytest.approx(rows[0] + rows[1] + rows[11])
    assert impacts[3] == pytest.approx(rows[4] + rows[5] + rows[6])
    assert impacts.sum() == pytest.approx(rows.sum())
    by_hand = stats.norm.logpdf(
        density.problem.rows.value, density.problem.predict(point[0]), density.problem.noise.sigma
    )
    assert rows == pytest.approx(by_hand)


def test_draws_are_in_natural_units():
    density = Density(beta_of(noise="scaled"))
    draws = density.draws(np.array([[0.9, -0.8, 0.15, math.log(1.3)]]))
    assert {name: float(x[0]) for name, x in draws.items()} == pytest.approx(
        {"e_n": 0.9, "e_t": -0.8, "mu": 0.15, "noise": 1.3}
    )
