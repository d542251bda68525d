"""Every road to an optimum finds what went in, proves what it claims to prove, and beats a grid."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from factories import BILINEAR, own_constant, problem_of
from simulated import simulated

import ifrfit
from ifrfit.data import read
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.optimum import objective_at
from ifrfit.inference.optimize.restitution_and_friction import ManyRestitutions, at_restitution
from ifrfit.inference.optimize.solve import solve, whole_group
from ifrfit.physics import CLOSURES, OBSERVABLES

GAMMA = np.linspace(4.0, 86.0, 25)
# linear in the impulse whatever e_n is, and not zero without lateral spin
ONE_SCALE = [
    name
    for name, each in OBSERVABLES.items()
    if each.kind == "tangential" and each.scale == "one" and each.takes & {"Tx", "Sy"}
]


ROADS = {
    "kappa": (("beta", "e_n"), {}, "all partitions"),
    "known e_n": (("mu_app", "beta"), {"fix": {"e_n": 0.94}}, "all partitions"),
    "friction": (("beta", "mu"), {}, "all partitions"),
    "impulse": (("mu_app",), {}, "all partitions"),
    "rebound": (("tan_psi_out",), {}, "all partitions"),
    "coupled through kappa": (("beta", "e_n", "mu"), {}, "all partitions at each e_n"),
    "coupled through w": (("mu_app", "e_n"), {}, "all partitions at each e_n"),
    "two priors": (
        ("beta",),
        {"prior": {"e_n": (0.94, 0.01), "mu": (0.12, 0.01)}},
        "all partitions at each e_n",
    ),
}


@pytest.mark.parametrize("name", ROADS)
def test_a_noisy_problem_is_certified_and_no_grid_point_lies_lower(name, impacts):
    observables, choices, road = ROADS[name]
    path = impacts(gamma=GAMMA, observables=observables, noise=0.03, sigma=0.03, seed=4)
    problem = problem_of(read(path), **choices)
    found = solve(problem, problem.noise.sigma)
    assert found.method == road
    assert found.certified
    assert found.objective == pytest.approx(objective_at(problem, problem.noise.sigma, found.theta), rel=1e-9)
    e_n = [0.94] if "fix" in choices else np.linspace(0.5, 1.0, 13)
    grid = itertools.product(e_n, np.linspace(-1.0, -0.4, 13), np.linspace(0.0, 0.3, 31))
    lowest = min(objective_at(problem, problem.noise.sigma, np.array(theta)) for theta in grid)
    assert found.objective <= lowest


@pytest.mark.parametrize("name", ROADS)
def test_noise_free_constants_come_back(name, impacts):
    observables, choices, _ = ROADS[name]
    problem = problem_of(read(impacts(gamma=GAMMA, observables=observables, sigma=0.05)), **choices)
    found = solve(problem, problem.noise.sigma)
    # where e_n is searched for, its place is known to the square root of rounding
    places = 1e-10 if found.method == "all partitions" else 1e-6
    np.testing.assert_allclose(found.theta, [0.94, -0.9, 0.12], rtol=0, atol=places)


@pytest.mark.parametrize("closure", BILINEAR)
@pytest.mark.parametrize("observable", ONE_SCALE)
def test_every_tangential_observable_recovers_every_closure(closure, observable, impacts):
    own = own_constant(closure, 0.65)
    path = impacts(
        gamma=GAMMA, observables=(observable,), closure=closure, c=next(iter(own.values()), 0.0), spin_y=0.1
    )
    found = ifrfit.fit(path, closure=closure, fix={"e_n": 0.94}, method="lsq")
    assert found.constants["mu"].value == pytest.approx(0.12, abs=1e-9)
    for name, value in own.items():
        assert found.constants[name].value == pytest.approx(value, abs=1e-9)
    assert found.facts["global_optimum"].ok


@pytest.mark.parametrize(
    "observable", ["delta_deg", "beta_tot", "psi_after_deg", "psi_out_deg", "lambda_deg"]
)
def test_curved_observables_are_searched_and_not_called_certified(observable, impacts):
    path = impacts(gamma=GAMMA, observables=(observable,), spin_x=0.2, spin_y=0.1, sigma=0.002)
    found = ifrfit.fit(path, fix={"e_n": 0.94}, method="lsq")
    assert found.constants["e_t"].value == pytest.approx(-0.9, abs=1e-6)
    assert found.constants["mu"].value == pytest.approx(0.12, abs=1e-6)
    fact = found.facts["global_optimum"]
    assert not fact.ok
    assert fact.figures["gap"] is None
    assert "not proven" in fact.says


def test_separate_friction_is_certified_through_the_dual(impacts):
    parts = [
        {"gamma": GAMMA, "mu": mu, "series": f"run {mu}", "noise": 0.03, "sigma": 0.03, "seed": i}
        for i, mu in enumerate((0.08, 0.12, 0.3))
    ]
    path = impacts(*parts)
    problem = problem_of(read(path), fix={"e_n": 0.94}, separate=("mu",))
    found = solve(problem, problem.noise.sigma)
    assert found.certified
    assert found.method.startswith("all partitions of each series")
    rng = np.random.default_rng(0)
    for _ in range(300):
        theta = found.theta * (1.0 + 0.05 * rng.standard_normal(found.theta.size))
        theta[0] = 0.94
        assert objective_at(problem, problem.noise.sigma, theta) >= found.objective
    result = ifrfit.fit(path, fix={"e_n": 0.94}, separate="mu", method="lsq")
    each = result.constants["mu"]
    for mu in (0.08, 0.12, 0.3):
        estimate = each[f"run {mu}"]
        assert abs(estimate.value - mu) < 4.0 * estimate.stderr
        assert estimate.status == "determined"


def test_a_prior_on_the_shared_constant_takes_part_in_the_proof(impacts):
    parts = [
        {"gamma": GAMMA, "mu": mu, "series": f"run {mu}", "noise": 0.05, "sigma": 0.05, "seed": i}
        for i, mu in enumerate((0.08, 0.15, 0.3))
    ]
    prior = {"e_t": (-0.7, 0.02)}
    problem = problem_of(read(impacts(*parts)), fix={"e_n": 0.94}, separate=("mu",), prior=prior)
    found = solve(problem, problem.noise.sigma)
    assert found.certified
    assert found.objective == pytest.approx(objective_at(problem, problem.noise.sigma, found.theta), rel=1e-9)
    for shift in (-0.01, -0.001, 0.001, 0.01):
        moved = found.theta + np.where(np.arange(found.theta.size) == 1, shift, 0.0)
        assert objective_at(problem, problem.noise.sigma, moved) > found.objective


def test_all_constants_separate_equals_fits_one_by_one(impacts):
    one = {"gamma": GAMMA, "mu": 0.1, "series": "a", "noise": 0.03, "seed": 1}
    two = {"gamma": GAMMA, "mu": 0.2, "series": "b", "noise": 0.03, "seed": 2, "c": -0.7}
    both = ifrfit.fit(impacts(one, two), fix={"e_n": 0.94}, separate=("e_t", "mu"), method="lsq")
    for series, part in (("a", one), ("b", two)):
        alone = ifrfit.fit(impacts(part, name=f"{series}.csv"), fix={"e_n": 0.94}, method="lsq")
        assert both.constants["e_t"][series].value == pytest.approx(alone.constants["e_t"].value, abs=1e-12)
        assert both.constants["mu"][series].stderr == pytest.approx(alone.constants["mu"].stderr, rel=1e-9)
    assert both.facts["global_optimum"].ok


@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize(
    "choices", [{}, {"prior": {"mu": (0.2, 0.05), "e_n": (0.9, 0.02)}}, {"fix": {"mu": 0.1}}]
)
def test_without_oblique_rows_every_closure_has_the_means_as_its_proven_optimum(closure, choices):
    rng = np.random.default_rng(5)
    e_n, mu = rng.normal(0.94, 0.02, 30), rng.normal(0.15, 0.05, 20)
    gamma, sigma = np.repeat([0.0, 60.0], [30, 20]), np.repeat([0.02, 0.05], [30, 20])
    data = simulated(np.repeat(["e_n", "mu"], [30, 20]), gamma, np.concatenate([e_n, mu]), sigma)
    problem = problem_of(data, closure, **choices)
    found = solve(problem, problem.noise.sigma)
    assert found.certified
    assert (found.gap, found.n_near) == (0.0, 1)

    def best(name, values, sigma):
        if name in choices.get("fix", {}):
            return choices["fix"][name]
        values, weight = list(values), [sigma**-2] * len(values)
        if "prior" in choices:
            mean, sd = choices["prior"][name]
            values, weight = [*values, mean], [*weight, sd**-2]
        return np.average(values, weights=weight)

    expected = [best("e_n", e_n, 0.02), best("mu", mu, 0.05)]
    np.testing.assert_allclose(found.theta[[0, -1]], expected, rtol=1e-12)
    assert np.isfinite(found.extremes).all()


@pytest.mark.parametrize(
    "observables", [("beta", "e_n", "mu"), ("mu_app", "e_n"), ("beta", "tan_psi_out", "e_n")]
)
def test_many_restitutions_at_once_are_each_alone(observables, impacts):
    path = impacts(gamma=GAMMA, observables=observables, noise=0.03, sigma=0.03, seed=11)
    problem = problem_of(read(path), prior={"e_n": (0.9, 0.05), "mu": (0.2, 0.1)})
    group = whole_group(problem, problem.noise.sigma)
    many = ManyRestitutions.of(group, 1.0)
    assert many is not None
    e_n = np.linspace(0.05, 1.0, 9)
    alone = [at_restitution(group, each) for each in e_n.tolist()]
    expected = [minimise(form.problem).chi2 for form in alone] + ((e_n - 0.9) / 0.05) ** 2
    np.testing.assert_allclose(many.objective(e_n), expected, rtol=1e-9)
