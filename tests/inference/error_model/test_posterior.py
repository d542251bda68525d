"""The exact posterior under scatter that is not plain, against the density summed up over a grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from factories import problem_of, rest_long

from ifrfit.data.observations import make_table
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate
from ifrfit.physics import rebound

LAWS = {
    "student": ErrorModel(dof=4.0),
    "set": ErrorModel(angles="set"),
    "measured": ErrorModel(angles="measured", population=(12.0, 78.0)),
    "effective": ErrorModel(angles="effective"),
    "student, set": ErrorModel(dof=4.0, angles="set"),
}


def scattered(error_model, *, closure="ifr", fix=None, noise="known", n=16, **choices):
    rng = np.random.default_rng(11)
    gamma = np.linspace(12.0, 78.0, n)
    true = gamma + 2.0 * rng.standard_normal(n)
    beta = rebound(true, e_n=0.9, e_t=-0.85, mu=0.15, degrees=True).beta + 0.06 * rng.standard_normal(n)
    table = make_table(
        {
            "series": np.tile(["a", "b"], n // 2),
            "observable": "beta",
            "gamma_deg": gamma,
            "value": beta,
            "sigma": 0.06,
            "sigma_gamma_deg": 2.0,
            "provenance": "simulated",
        }
    )
    plain = problem_of(table, closure, noise=noise, fix=fix or {"e_n": 0.9}, **choices)
    return replace(plain, error_model=error_model)


def summed(problem, low, high, n):
    """Mean, sd and log evidence by the midpoint rule on a box that holds all of the mass."""
    density = Density(problem)
    axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b in zip(low, high, strict=True)]
    points = np.stack([x.reshape(-1) for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    log_p = density(points)
    p = np.exp(log_p - log_p.max())
    cell = np.prod((np.asarray(high) - low) / n)
    mean = p @ points / p.sum()
    sd = np.sqrt(p @ (points - mean) ** 2 / p.sum())
    return density.names, mean, sd, float(log_p.max() + np.log(p.sum() * cell))


def check(problem, low, high, n, *, tolerance=1e-3, allowed=0.01):
    found = integrate(problem, tolerance=tolerance)
    names, mean, sd, evidence = summed(problem, low, high, n)
    assert found.converged
    for name, m, s in zip(names, mean, sd, strict=True):
        if name.startswith("noise"):
            continue  # summed up as a logarithm
        assert found.mean(name) == pytest.approx(m, abs=allowed * s)
        assert found.sd(name) == pytest.approx(s, rel=allowed)
    assert found.log_evidence == pytest.approx(evidence, abs=allowed)


@pytest.mark.parametrize("law", LAWS)
def test_posterior_of_two_constants(law):
    # by effective variance sigma jumps where a row changes its regime, which a grid feels
    allowed = 0.03 if law == "effective" else 0.01
    check(scattered(LAWS[law]), (-1.0, 0.08), (-0.7, 0.26), 60, allowed=allowed)


@pytest.mark.parametrize(
    ("closure", "law"),
    [
        ("fr", "set"),
        ("f", "student"),
        ("ifr-contact", "student"),
        pytest.param("fr", "student", marks=pytest.mark.long),
        pytest.param("f", "set", marks=pytest.mark.long),
        pytest.param("ifr-contact", "set", marks=pytest.mark.long),
    ],
)
def test_other_closures(closure, law):
    problem = scattered(LAWS[law], closure=closure)
    lower, upper = problem.parameters.bounds()
    free = problem.parameters.free
    low, high = lower[free].copy(), upper[free].copy()
    low[-1], high[-1] = 0.02, 0.4
    check(problem, low, high, 60 if closure != "f" else 1000, allowed=0.02)


@pytest.mark.parametrize("law", rest_long(("student", "set")))
def test_a_common_factor_on_sigma(law):
    problem = scattered(LAWS[law], fix={"e_n": 0.9, "e_t": -0.85}, noise="scaled")
    check(problem, (0.05, -1.0), (0.3, 1.5), 90, tolerance=1e-2, allowed=0.02)


def test_constants_of_their_own_in_each_series():
    problem = scattered(LAWS["set"], fix={"e_n": 0.9, "e_t": -0.85}, separate=["mu"])
    check(problem, (0.05, 0.05), (0.3, 0.3), 60)


def test_prior_of_mu_and_open_e_n():
    problem = scattered(LAWS["student"], fix={"e_t": -0.85}, prior={"mu": (0.15, 0.01)})
    check(problem, (0.0, 0.1), (1.0, 0.2), 200)


def test_an_outlier_moves_student_little():
    def shift(error_model):
        clean = scattered(error_model)
        value = clean.rows.value.copy()
        value[10] += 0.6
        spoiled = replace(clean, rows=replace(clean.rows, value=value))
        before, after = integrate(clean, tolerance=1e-2), integrate(spoiled, tolerance=1e-2)
        return abs(after.mean("mu") - before.mean("mu")) / before.sd("mu")

    assert shift(ErrorModel(dof=4.0)) < 0.5
    assert shift(ErrorModel()) > 1.0


def test_least_squares_of_student_is_the_maximum_of_its_likelihood():
    problem = scattered(LAWS["student"])
    found = least_squares(problem)
    density = Density(problem)
    at = found.optimum.theta[problem.parameters.free]
    top = density(at[None])[0]
    around = at + 1e-3 * np.random.default_rng(0).standard_normal((200, at.size))
    assert (density(around) <= top + 1e-9).all()
    assert not found.optimum.certified
    # the local picture has the size of the posterior, not of the weights
    post = integrate(problem, tolerance=1e-2)
    local = found.gaussian
    sd = np.sqrt(np.diag(local.to_theta @ local.covariance(capped=True) @ local.to_theta.T))[
        problem.parameters.free
    ]
    assert sd == pytest.approx([post.sd("e_t"), post.sd("mu")], rel=0.3)


def test_no_error_of_angle_is_no_scatter():
    plain = scattered(ErrorModel())
    rows = replace(plain.rows, sigma_gamma_deg=np.zeros(len(plain.rows)))
    exact = replace(plain, rows=rows, error_model=LAWS["set"])
    one, other = integrate(plain, tolerance=1e-3), integrate(exact, tolerance=1e-3)
    for name in ("e_t", "mu"):
        assert other.mean(name) == pytest.approx(one.mean(name), abs=2e-3 * one.sd(name))
    assert other.log_evidence == pytest.approx(one.log_evidence, abs=2e-3)
