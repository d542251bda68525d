"""Slips where sigma is given of one observable and not of another, however large the misfit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.diagnostics.slips.compared_fit import ComparedFit
from ifrfit.inference.diagnostics.slips.refit import Misfit


def table(sigma, *, from_wall):
    """40 impacts of IFR at e_n 0.85, e_t -0.5 and mu 0.15, sigma of beta given, e_n without."""
    rng = np.random.default_rng(3)
    gamma = np.round(rng.uniform(6.0, 80.0, 40), 1)
    true = ifrfit.rebound(gamma, e_n=0.85, e_t=-0.5, mu=0.15, degrees=True).beta
    return {
        "gamma_deg": 90.0 - gamma if from_wall else gamma,
        "beta": true + sigma * rng.standard_normal(40),
        "e_n": 0.85 + 0.02 * rng.standard_normal(40),
        "sigma_beta": sigma,
    }


@pytest.mark.parametrize("sigma", [0.02, 0.005, 0.0005])
def test_a_large_misfit_of_known_sigma_is_no_overflow(sigma):
    found = ifrfit.fit(table(sigma, from_wall=True))
    assert not found.facts["slips"].ok
    assert "angle-from-wall" in str(found.facts["slips"].figures["called"])


@pytest.mark.parametrize("size", [1e-3, 1.0, 30.0])
def test_the_sd_of_a_size_is_that_of_weighted_least_squares(size):
    """A size along rows of known sigma alone has sd sigma over their length, whatever the others scatter."""
    n, sigma = 25, 1e-3
    rng = np.random.default_rng(0)
    after = rng.standard_normal(2 * n) * np.repeat([sigma, 0.3], n)
    after[:n] -= after[:n].mean()
    before = after + size * np.repeat([1.0, 0.0], n)
    misfit = Misfit(np.repeat([sigma, 1.0], n), (np.arange(n, 2 * n),))
    drop = float(misfit.likelihood(before) - misfit.likelihood(after))
    problem = SimpleNamespace(rows=SimpleNamespace(value=before))
    whole = SimpleNamespace(problem=problem, misfit=misfit, before=before, dof=2 * n - 2)
    # the fall is a difference of sums of squares, which lose 2e-16 of the larger
    assert ComparedFit.sd_of(whole, size, drop, after) == pytest.approx(sigma / np.sqrt(n), rel=1e-9)
