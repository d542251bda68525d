"""The marginals of a report are the posterior's own densities: against posteriors that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

import ifrfit
from ifrfit.inference.appraise import appraise
from ifrfit.inference.distributions.marginal_density import CELLS, has_density, marginal_window


def test_of_readings_of_e_n_it_is_the_normal_law_cut_at_one(impacts):
    path = impacts(gamma=np.full(6, 30.0), observables=("e_n",), e_n=0.985, noise=0.03, sigma=0.03, seed=2)
    result = ifrfit.fit(path)
    found = appraise(result, closures=False).densities["e_n"]
    mean, sd = result.points["value"].mean(), 0.03 / math.sqrt(6.0)
    law = stats.truncnorm(-mean / sd, (1.0 - mean) / sd, mean, sd)
    expected = np.diff(law.cdf(found.edges)) / np.diff(found.edges)
    assert found.edges[-1] == 1.0
    assert found.density.size == CELLS
    # the quadrature is right to 1e-4 of an sd: of a cell of 1/20 sd that is 0.2 % of the largest density
    assert found.density == pytest.approx(expected, abs=2e-3 * expected.max())
    assert found.median == pytest.approx(law.median(), abs=1e-3 * sd)


def test_of_the_friction_alone_it_is_the_likelihood(impacts):
    path = impacts(gamma=np.linspace(10.0, 70.0, 7), noise=0.1, sigma=0.1, c=-0.8, seed=3)
    result = ifrfit.fit(path, fix={"e_n": 0.94, "e_t": -0.8})
    found = appraise(result, closures=False).densities["mu"]
    grid = np.linspace(0.0, 2.0, 40_001)
    rows = result.problem.rows.value
    inside = grid[(grid > found.edges[0] - 0.02) & (grid < found.edges[-1] + 0.02)]
    misfit = [
        np.sum(((rows - result.problem.predict(np.array([0.94, -0.8, mu]))) / 0.1) ** 2) for mu in inside
    ]
    weight = np.exp(-0.5 * (np.array(misfit) - min(misfit)))
    below = np.concatenate(([0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]) * np.diff(inside))))
    expected = np.diff(np.interp(found.edges, inside, below / below[-1])) / np.diff(found.edges)
    assert found.density == pytest.approx(expected, abs=5e-3 * expected.max())


def test_methods_that_draw_have_a_histogram_instead(impacts):
    path = impacts(gamma=np.linspace(10.0, 70.0, 12), noise=0.05)
    for method in ("lsq", ifrfit.Exact(integrator="sampling")):
        result = ifrfit.fit(path, fix={"e_n": 0.94}, method=method)
        assert result.method != "exact" or not has_density(result.distribution)
        assert appraise(result, closures=False).densities == {}


def test_a_window_holds_the_draws_and_the_finite_ends():
    low, high = marginal_window(np.linspace(0.0, 1.0, 1001), (-math.inf, 3.0))
    assert -0.2 < low < 0.002
    assert 3.0 < high < 3.2
    low, high = marginal_window(np.ones(5))
    assert low < 1.0 < high
