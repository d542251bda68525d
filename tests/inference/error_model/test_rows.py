"""Likelihood of rows with scattered angles, spins and heavy tails, against adaptive quadrature row by row."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from factories import each_once
from scipy import integrate, stats

from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.model.row_likelihood import RowLaw, at_theta
from ifrfit.inference.posterior import exact_posterior
from ifrfit.physics import rebound
from ifrfit.physics.closures import get_closure

THETA = {"e_n": 0.9, "e_t": -0.8, "mu": 0.15}
TRANSITION = math.degrees(math.atan(2.5 * 0.15 * 1.9))
LAWS = {
    "set": ErrorModel(angles="set"),
    "measured": ErrorModel(angles="measured", population=(12.0, 70.0)),
    "set, student": ErrorModel(angles="set", dof=3.0),
}


def value_of(observable, gamma, spin_x=0.0, spin_y=0.0):
    r = rebound(gamma, spin_x, spin_y, **THETA, degrees=True)
    return {
        "beta": r.beta,
        "beta_cm": r.beta_cm,
        "v_x": r.v_x,
        "spin_y_after": r.spin_y,
        "mu_app": r.mu_app,
        "delta_deg": np.degrees(r.delta),
        "v_n": r.v_n,
        "e_n": 0.9 + 0.0 * np.asarray(gamma),
    }[observable]


def problem_of(
    observable, error_model, *, sigma=0.1, sigma_gamma=3.0, sigma_spin=0.0, spin_y=0.0, ids="", gamma=None
):
    gamma = np.array([13.0, 20.0, 30.0, TRANSITION, 40.0, 55.0, 69.0]) if gamma is None else np.asarray(gamma)
    observables = np.broadcast_to(np.asarray(observable), gamma.shape)
    value = [float(value_of(str(o), g, 0.0, spin_y)) for o, g in zip(observables, gamma, strict=True)]
    rng = np.random.default_rng(3)
    table = make_table(
        {
            "series": "a",
            "observable": observables,
            "gamma_deg": gamma,
            "value": np.array(value) + sigma * rng.standard_normal(gamma.size),
            "sigma": sigma,
            "spin_y": spin_y,
            "sigma_gamma_deg": sigma_gamma,
            "sigma_spin_y": sigma_spin,
            "impact_id": ids,
            "provenance": "simulated",
        }
    )
    closure = get_closure("ifr")
    made = make_problem(Observations(table), closure, 0.4, make_parameters(closure, 0.4), "known")
    return replace(made, error_model=error_model)


def law_of(error_model):
    return stats.norm() if error_model.dof is None else stats.t(error_model.dof)


def by_quadrature(error_model, center, sd, ends, kinks, density):
    """Integral of a density over a normal law of the true value, cut off at the ends."""
    low, high = max(ends[0], center - 9.0 * sd), min(ends[1], center + 9.0 * sd)
    points = [q for q in (*kinks, center) if low < q < high]
    found = integrate.quad(
        lambda q: density(q) * stats.norm.pdf(q, center, sd),
        low,
        high,
        points=points,
        epsabs=0.0,
        epsrel=1e-9,
        limit=200,
    )[0]
    return found / (stats.norm.cdf(ends[1], center, sd) - stats.norm.cdf(ends[0], center, sd))


def theta_of(problem):
    return np.array([[THETA[name] for name in problem.parameters.names]])


def angles_integrated_out(problem, error_model, observable, sigma):
    """Log likelihood of each row, averaged over the true angles behind the one that it states."""
    table, own = problem.observations.table, law_of(error_model)
    return [
        math.log(
            by_quadrature(
                error_model, g, 3.0, error_model.population or (0.0, 90.0), [TRANSITION],
                lambda q, y=y: own.pdf((y - float(value_of(observable, q))) / sigma) / sigma,
            )
        )
        for g, y in zip(table["gamma_deg"], table["value"], strict=True)
    ]  # fmt: skip


@pytest.mark.parametrize(("law", "observable"), each_once(LAWS, ["beta", "v_x", "spin_y_after", "mu_app"]))
def test_true_angles_are_integrated_out(law, observable):
    problem = problem_of(observable, LAWS[law])
    found = Density(problem).impacts(theta_of(problem))[0]
    assert found == pytest.approx(angles_integrated_out(problem, LAWS[law], observable, 0.1), abs=3e-6)


@pytest.mark.parametrize(
    ("observable", "sigma", "gamma"),
    [
        # not defined at normal, and at grazing incidence: pieces of no width have their nodes there
        ("beta_cm", 0.1, (0.5, 3.0, 8.0)),
        pytest.param("mu_app", 0.1, (82.0, 88.0), marks=pytest.mark.long),
        # moves by ten of its sigma within one sd of the angle: more nodes
        ("delta_deg", 0.5, None),
    ],
)
def test_angles_that_scatter_where_the_value_is_steep_or_not_defined(observable, sigma, gamma):
    problem = problem_of(observable, LAWS["set"], sigma=sigma, gamma=gamma)
    expected = angles_integrated_out(problem, LAWS["set"], observable, sigma)
    assert Density(problem).impacts(theta_of(problem))[0] == pytest.approx(expected, abs=1e-3)
    if gamma is not None:
        assert all(math.isfinite(exact_posterior(problem, 1e-2).sd(name)) for name in ("e_t", "mu"))


def test_true_spins_are_integrated_out():
    error_model = LAWS["set"]
    problem = problem_of("beta", error_model, sigma_gamma=0.0, sigma_spin=0.08, spin_y=0.1)
    found = Density(problem).impacts(theta_of(problem))[0]
    table = problem.observations.table
    tau = 2.5 * 0.15 * 1.9
    expected = []
    for g, y in zip(table["gamma_deg"], table["value"], strict=True):
        sine, cosine = math.sin(math.radians(g)), math.cos(math.radians(g))
        kinks = [tau * cosine - sine, -tau * cosine - sine]
        density = lambda q, g=g, y=y: stats.norm.pdf(y, float(value_of("beta", g, 0.0, q)), 0.1)  # noqa: E731
        expected.append(math.log(by_quadrature(error_model, 0.1, 0.08, (-9.0, 9.0), kinks, density)))
    assert found == pytest.approx(expected, abs=3e-6)


def test_angle_and_spin_together():
    """Both true values scatter: against a plain average over many of them."""
    error_model = LAWS["set"]
    problem = problem_of("beta", error_model, sigma_spin=0.08, spin_y=0.1)
    found = Density(problem).impacts(theta_of(problem))[0]
    table = problem.observations.table
    rng = np.random.default_rng(1)
    n = 400_000
    for number in (2, 5):
        g, y = table["gamma_deg"].iloc[number], table["value"].iloc[number]
        true = np.abs(g + 3.0 * rng.standard_normal(n)), 0.1 + 0.08 * rng.standard_normal(n)
        p = stats.norm.pdf(y, value_of("beta", true[0], 0.0, true[1]), 0.1)
        assert math.exp(found[number]) == pytest.approx(p.mean(), abs=5.0 * p.std() / math.sqrt(n))


def test_rows_of_one_impact_share_their_true_angle():
    error_model = LAWS["set"]
    gamma = [20.0, 20.0, 20.0, 50.0]
    ids = ["one", "one", "one", ""]
    problem = problem_of(
        ["v_x", "spin_y_after", "v_n", "beta"], error_model, sigma=0.02, ids=ids, gamma=gamma
    )
    density = Density(problem)
    found = density.impacts(theta_of(problem))[0]
    values = problem.observations.table["value"].to_numpy()
    joint = by_quadrature(
        error_model, 20.0, 3.0, (0.0, 90.0), [TRANSITION],
        lambda q: math.prod(
            stats.norm.pdf(y, float(value_of(o, q)), 0.02)
            for o, y in zip(("v_x", "spin_y_after", "v_n"), values, strict=False)
        ),
    )  # fmt: skip
    assert found.size == 2
    assert found[0] == pytest.approx(math.log(joint), abs=1e-5)
    # the same rows as impacts of their own are another thing
    apart = Density(problem_of(["v_x", "spin_y_after", "v_n", "beta"], error_model, sigma=0.02, gamma=gamma))
    assert abs(apart.impacts(theta_of(problem))[0, :3].sum() - found[0]) > 0.1


@pytest.mark.parametrize("observable", ["beta", "e_n"])
def test_student_alone_is_scipys(observable):
    problem = problem_of(observable, ErrorModel(dof=4.0))
    table = problem.observations.table
    expected = stats.t.logpdf(
        (table["value"] - value_of(observable, table["gamma_deg"])) / 0.1, 4.0
    ) - math.log(0.1)
    assert Density(problem).impacts(theta_of(problem))[0] == pytest.approx(expected, abs=1e-12)


def test_effective_variance_adds_the_slope():
    problem = problem_of("beta", ErrorModel(angles="effective"), gamma=[20.0, 50.0, 65.0])
    g = problem.observations.table["gamma_deg"].to_numpy()
    slope = np.where(g < TRANSITION, 0.0, -3.5 * 0.15 * 1.9 / np.sin(np.radians(g)) ** 2) * math.radians(3.0)
    sigma = np.hypot(0.1, slope)
    expected = stats.norm.logpdf(problem.rows.value, value_of("beta", g), sigma)
    assert Density(problem).impacts(theta_of(problem))[0] == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("law", [*LAWS, "student", "effective"])
def test_probability_below_the_value_is_uniform(law):
    """Values drawn from the law itself: their probabilities are uniform, which is what residuals rest on."""
    error_model = {**LAWS, "student": ErrorModel(dof=3.0), "effective": ErrorModel(angles="effective")}[law]
    rng = np.random.default_rng(8)
    n = 1500
    shown = rng.uniform(15.0, 68.0, n)
    sigma_gamma = 0.0 if law in ("student", "effective") else 2.0
    true = shown + sigma_gamma * rng.standard_normal(n)
    if error_model.population:  # measured angles scatter about true ones
        true = rng.uniform(*error_model.population, n)
        shown = true + sigma_gamma * rng.standard_normal(n)
    noise = 0.05 * (rng.standard_normal(n) if error_model.dof is None else rng.standard_t(error_model.dof, n))
    problem = problem_of("beta", error_model, sigma=0.05, sigma_gamma=sigma_gamma, gamma=shown)
    rows = replace(problem.rows, value=value_of("beta", true) + noise)
    own = RowLaw.of(replace(problem, rows=rows), np.arange(n), theta_of(problem)[0])
    p = own.below(at_theta(problem, theta_of(problem)))[0, 0]
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    # and not if the angles are taken as exact
    if error_model.integrates:
        blind = RowLaw.of(
            replace(problem, rows=rows, error_model=ErrorModel(dof=error_model.dof or 1e6)), np.arange(n)
        )
        assert stats.kstest(blind.below(at_theta(problem, theta_of(problem)))[0, 0], "uniform").pvalue < 1e-3
