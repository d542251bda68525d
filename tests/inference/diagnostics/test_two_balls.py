"""Tables that are partly of another ball, and each part of the search against an answer of its own."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from factories import rest_long
from scipy.integrate import quad
from scipy.optimize import minimize
from scipy.stats import norm
from two_balls import ERRORS, two_balls

from ifrfit.inference.diagnostics import mixture
from ifrfit.inference.diagnostics.change_points import best_runs, run_of_largest_sum
from ifrfit.inference.diagnostics.linear_mixture import Linearised, linear_kinds
from ifrfit.inference.diagnostics.unimodal_errors import _log_density
from ifrfit.inference.fit import fit
from ifrfit.physics.rebound import rebound

# tables in which a constant was more than 3 sd off, and every fact ok, before these were looked for
SILENT = rest_long((19, 732, 282, 118, 239, 668, 917, 929, 13), 3)
CHANCE = 9  # a seed with which chance makes two kinds of a thousand impacts of one
VELOCITIES = ("v_x", "v_n", "spin_y_after")


def facts_of(table):
    return fit(table.frames, **table.options).facts


@pytest.mark.parametrize("number", SILENT)
def test_another_ball_is_told(number):
    table = two_balls(5, number)
    fact = facts_of(table)["mixture"]
    first, second = table.scene["first"], table.scene["second"]
    name = fact.figures["constant"]
    assert first[name] != second[name]
    # the constants of the larger kind may be those of either ball, where nearly half of the impacts are
    assert sorted(fact.figures["values"]) == pytest.approx(sorted((first[name], second[name])), rel=0.2)
    assert len(fact.figures["rows"]) == fact.figures["of_second"]
    proven = "runs and constants" if fact.figures["run"] else "more than for errors of one hump"
    assert proven in fact.says


def of_another_mu(seed, many, mu):
    """Thirty impacts, of which so many in the middle of the table have another mu: found by a stranger."""
    rng, n = np.random.default_rng(seed), 30
    gamma = rng.uniform(8.0, 78.0, n)

    def read(mu, rng):
        rng.normal(size=n)
        state = rebound(gamma, e_n=0.9, e_t=-0.9, mu=mu, closure="ifr", degrees=True)
        return {name: getattr(state, name[:6]) + 0.02 * rng.normal(size=n) for name in VELOCITIES}

    values = read(0.12, rng)
    others = read(mu, np.random.default_rng(rng.integers(1e9)))
    start = (n - many) // 2
    for name in VELOCITIES:
        values[name][start : start + many] = others[name][start : start + many]
    return pd.DataFrame({"gamma_deg": gamma, **values})


@pytest.mark.parametrize(("many", "mu"), [(9, 0.18), (12, 0.16)])
def test_a_run_of_another_mu_is_told_with_its_lines(many, mu):
    table = of_another_mu(1008, many, mu)
    fact = fit(table, method="lsq").facts["mixture"]
    assert fact.figures["run"]
    assert fact.figures["constant"] == "mu"
    assert fact.figures["values"] == pytest.approx([0.12, mu], abs=0.01)
    assert f"from {fact.figures['rows'][0]} to {fact.figures['rows'][-1]}" in fact.says
    start = (30 - many) // 2
    own = set(range(start + 1, start + many + 1))
    # an impact that sticks tells no mu, so that the run may end before it or behind
    slides = ~rebound(table["gamma_deg"].to_numpy(), e_n=0.9, e_t=-0.9, mu=mu, degrees=True).sticking
    differ = {line for line in own ^ set(map(int, fact.figures["rows"])) if slides[line - 1]}
    assert len(differ) <= 1


@pytest.mark.parametrize("errors", ERRORS)
@pytest.mark.parametrize("numbers", rest_long((range(3), range(3, 30))), ids=len)
def test_one_ball_is_one_whatever_its_errors(errors, numbers):
    for number in numbers:
        assert "mixture" not in facts_of(two_balls(41, number, errors, clean=True))


def of_many(share, seed=10, count=6000):
    """Beta and e_n, of a share with an e_n two sigma lower."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(3.0, 80.0, count)
    e_n = np.where(rng.random(count) < share, 0.84, 0.9)
    state = rebound(gamma, e_n=e_n, e_t=-0.7, mu=0.15, degrees=True)
    errors = rng.standard_normal((2, count))
    table = {"gamma_deg": gamma, "beta": state.beta + 0.05 * errors[0], "e_n": e_n + 0.03 * errors[1]}
    return pd.DataFrame(table | {"sigma_beta": 0.05, "sigma_e_n": 0.03})


def test_of_very_many_impacts_some_are_searched_and_more_confirm(monkeypatch):
    searched = []
    grown = mixture._grown
    monkeypatch.setattr(mixture, "_grown", lambda *given: searched.append(1) or grown(*given))
    fact = fit(of_many(0.3), method="lsq").facts["mixture"]
    assert sorted(fact.figures["values"]) == pytest.approx([0.84, 0.9], abs=0.02)
    assert searched
    searched.clear()
    found = []
    monkeypatch.setattr(mixture, "linear_kinds", lambda *given: found.extend(linear_kinds(*given)) or found)
    assert "mixture" not in fit(of_many(0.0, CHANCE), method="lsq").facts
    assert max(one.drop for one in found) > mixture._HINT  # chance, of a thousand impacts
    assert not searched  # of which the two laws are not computed


def test_skewed_errors_are_no_second_ball():
    """180 readings of e_n with errors of skewness 1, which two normal humps describe better than one."""
    assert "mixture" not in facts_of(two_balls(77, 49, "skewed", clean=True))


def test_no_run_is_looked_for_where_rows_are_sorted():
    table = of_another_mu(1008, 12, 0.16).sort_values("gamma_deg")
    fact = fit(table, method="lsq").facts.get("mixture")
    assert fact is None or not fact.figures["run"]


def linear_law(z, slopes):
    """Independent rows in units of an unknown noise; their residuals are those of least squares."""
    left = z - slopes @ np.linalg.lstsq(slopes, z)[0]
    rows = np.arange(z.size)
    theta = np.zeros(slopes.shape[1])
    return Linearised(
        left / np.sqrt((left**2).mean()), slopes, rows, rows, (rows,), theta, np.arange(theta.size)
    )


@pytest.mark.parametrize(("many", "distance"), [(6, 5.0), (15, 4.0), (4, 7.0)])
def test_the_linear_mixture_is_that_of_two_normal_laws(many, distance):
    rng = np.random.default_rng(many)
    linear = linear_law(rng.standard_normal(30) + distance * (np.arange(30) < many), np.ones((30, 1)))
    (found,) = linear_kinds(linear, np.array([0]))

    def logs(p):
        share = 1.0 / (1.0 + np.exp(-p[3]))
        one, other = (norm.logpdf(linear.residual, mean, np.exp(p[2])) for mean in p[:2])
        return np.logaddexp(np.log1p(-share) + one, np.log(share) + other)

    starts = itertools.product((-1.5, -0.5), (0.5, 1.5), (-1.0,), (-1.0, 1.0))
    fits = [minimize(lambda p: -logs(p).sum(), start, method="BFGS") for start in starts]
    gain = 2.0 * (logs(min(fits, key=lambda one: one.fun).x) - norm.logpdf(linear.residual))
    # expectation and maximisation ends after some steps, below the best likelihood by less than this
    assert found.drop == pytest.approx(gain.sum() - gain.max(), abs=0.05)


def test_the_best_run_is_that_of_all_least_squares():
    rng, n = np.random.default_rng(3), 25
    slopes = np.column_stack((np.ones(n), rng.standard_normal(n)))
    linear = linear_law(rng.standard_normal(n) + 2.0 * slopes[:, 1] * (abs(np.arange(n) - 12) < 4), slopes)
    found = best_runs(linear, np.array([0, 1]))[0]

    def chi2(column, first, last):
        own = np.zeros(n)
        own[first:last] = slopes[first:last, column]
        rest = np.linalg.lstsq(np.column_stack((slopes, own)), linear.residual)[1]
        return float((linear.residual**2).sum() - rest.sum())

    runs = [(i, j) for i in range(n + 1) for j in range(i + 3, n + 1) if n - (j - i) >= 3]
    best = max(itertools.product((0, 1), runs), key=lambda one: chi2(one[0], *one[1]))
    assert (found.column, (found.first, found.last)) == best
    assert found.chi2 == pytest.approx(chi2(best[0], *best[1]), rel=1e-9)
    assert found.looks == 2 * len(runs)


def test_the_run_of_the_largest_sum():
    rng = np.random.default_rng(8)
    for n in (7, 12, 30):
        gain = rng.standard_normal(n)
        runs = [(i, j) for i in range(n + 1) for j in range(i + 3, n + 1) if n - (j - i) >= 3]
        assert run_of_largest_sum(gain) == max(runs, key=lambda ends: gain[slice(*ends)].sum())


@pytest.mark.parametrize("parameters", [(0.0, 0.0, 0.0, 0.0), (0.3, -0.4, 0.6, -0.5), (-1.0, 0.2, -0.8, 0.4)])
def test_the_density_of_errors_of_one_hump(parameters):
    parameters = np.array(parameters)

    def density(z):
        return float(np.exp(_log_density(parameters, np.array([z]))[0])) / np.sqrt(2.0 * np.pi)

    assert quad(density, -np.inf, np.inf)[0] == pytest.approx(1.0, rel=1e-6)
    if not parameters.any():
        assert density(0.7) == pytest.approx(norm.pdf(0.7), rel=1e-12)
