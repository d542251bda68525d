"""A noise that changes with the angle is called so, and nothing else is called that."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import rest_long
from scipy import stats

from ifrfit import fit, rebound
from ifrfit.inference.diagnostics.scatter_by_angle import _tested
from ifrfit.inference.model.problem import Problem

TRUTH = {"e_n": 0.9, "e_t": -0.8, "mu": 0.2}
ALONG = np.linspace(0.0, 1.0, 60)
SHAPES = {"grazing": ALONG, "normal": 1.0 - ALONG, "both ends": np.abs(2.0 * ALONG - 1.0)}


def readings(seed, factor=1.0, shape="grazing", noise=0.01, draw=None, **columns):
    """60 impacts of beta and e_n; the noise of beta grows by a factor."""
    rng = np.random.default_rng([seed, 3])
    gamma = np.linspace(5.0, 82.0, ALONG.size)
    errors = rng.standard_normal((2, gamma.size)) if draw is None else draw(rng, (2, gamma.size))
    beta = rebound(gamma, degrees=True, **TRUTH).beta + noise * factor ** SHAPES[shape] * errors[0]
    return pd.DataFrame({"gamma_deg": gamma, "beta": beta, "e_n": 0.9 + noise * errors[1]} | columns)


def fitted(folder, table, **options):
    path = folder / "impacts.csv"
    table.to_csv(path, index=False)
    return fit(path, method="lsq", **options)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seeds", rest_long((6, 20)))
def test_it_is_named(tmp_path, shape, seeds):
    named = 0
    for seed in range(seeds):
        facts = fitted(tmp_path, readings(seed, 8.0, shape)).facts
        assert "truncation" not in facts or "scatter_by_angle" in facts  # both, where they explain as much
        assert "mixture" not in facts
        if "growing_scatter" in facts and shape == "normal":  # so do errors of velocities scatter
            named += 1
            continue
        if "scatter_by_angle" not in facts:
            continue
        named += 1
        assert facts["outliers"].ok
        assert "the scatter of beta changes with the angle of incidence: " in facts["scatter_by_angle"].says
    assert named >= 0.6 * seeds


def test_the_sizes_it_tells_are_those_of_the_errors_and_settle_it(tmp_path):
    table = readings(4, 8.0)
    fact = fitted(tmp_path, table).facts["scatter_by_angle"]
    true = 0.01 * 8.0 ** np.interp(fact.figures["angles"], table["gamma_deg"], ALONG)
    np.testing.assert_allclose(fact.figures["sizes"], true, rtol=0.4)
    sigma = np.interp(table["gamma_deg"], fact.figures["angles"], fact.figures["sizes"])
    again = fitted(tmp_path, table.assign(sigma_beta=sigma, sigma_e_n=0.01))
    assert "scatter_by_angle" not in again.facts
    for name, estimate in again.constants.items():
        assert abs(estimate.value - TRUTH[name]) < 3.0 * estimate.stderr, name


@pytest.mark.parametrize("seeds", rest_long((6, 30)))
def test_an_even_scatter_is_none_whatever_its_tails(tmp_path, seeds):
    def heavy(rng, shape):
        return rng.standard_t(3, shape)

    for seed in range(seeds):
        for draw in (None, heavy):
            assert "scatter_by_angle" not in fitted(tmp_path, readings(seed, draw=draw)).facts


def test_one_sigma_for_all_angles_is_held_against_them(tmp_path):
    """Right in the mean, too small at grazing incidence and too large at the other end."""
    table = readings(4, 8.0, sigma_beta=0.03, sigma_e_n=0.01)
    assert "scatter_by_angle" in fitted(tmp_path, table).facts
    said = fitted(tmp_path, table.assign(sigma_beta=0.01 * 8.0**ALONG)).facts
    assert "scatter_by_angle" not in said


def test_p_values_of_an_even_scatter_are_no_smaller_than_they_say(tmp_path):
    rng = np.random.default_rng(7)
    result = fitted(tmp_path, readings(0))
    problem: Problem = result.problem
    rows = problem.rows.rows_of("beta")
    own = 1.0 - result.least_squares.gaussian.leverage
    basis = np.linalg.qr(problem.jacobian(result.least_squares.optimum.theta)[rows][:, :3])[0]
    errors = rng.standard_normal((1500, rows.size))

    def p_of(left):
        z = np.zeros(own.size)
        z[rows] = left - basis @ (basis.T @ left)
        return _tested(problem, "beta", rows, z, own).p

    p = np.array([p_of(one) for one in errors])
    assert stats.binomtest(int((p < 0.001).sum()), p.size, 0.001, alternative="greater").pvalue > 1e-3
    # the control: a noise that grows is seen
    grown = np.array([p_of(one * 8.0**ALONG) for one in errors[:100]])
    assert np.mean(grown < 0.001) > 0.8
