"""Densities of priors against closed forms and draws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, stats

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.prior_density import kappa_prior_density, prior_density

E_N, MU = Parameter("e_n", 0.0, 1.0), Parameter("mu", 0.0, math.inf)


def test_the_default_prior_is_uniform_as_far_as_it_reaches():
    assert prior_density(MU, np.array([-0.1, 0.0, 1.0, 2.0, 2.1])) == pytest.approx([0, 0.5, 0.5, 0.5, 0])
    assert prior_density(Parameter("e_t", -1.0, -0.4), np.array([-0.7])) == pytest.approx([1.0 / 0.6])


def test_a_prior_of_the_user_is_cut_to_the_domain():
    prior = Parameter("e_n", 0.0, 1.0, prior=(0.98, 0.03))
    at = np.array([-0.1, 0.9, 0.97, 0.999, 1.01])
    expected = stats.truncnorm(-0.98 / 0.03, 0.02 / 0.03, 0.98, 0.03).pdf(at)
    assert prior_density(prior, at) == pytest.approx(expected, rel=1e-12)


def test_kappa_of_uniform_priors_is_known():
    """mu uniform to 2 and 1 + e_n from 1 to 2: the density is half the logarithm of 2 over max(1, k/2)."""
    at = np.array([0.3, 1.0, 1.9, 2.5, 3.5, 3.99])
    # beyond 2 only those e_n count for which mu = k/(1 + e_n) stays below 2
    expected = 0.5 * (math.log(2.0) - np.log(np.maximum(1.0, at / 2.0)))
    # a step of one node in 1,024 where the uniform prior of mu ends
    assert kappa_prior_density(E_N, MU, at) == pytest.approx(expected, abs=0.5 / 1024)


@pytest.mark.parametrize(
    ("e_n", "mu"),
    [
        (Parameter("e_n", 0.0, 1.0, prior=(0.9, 0.05)), Parameter("mu", 0.0, math.inf, prior=(0.2, 0.05))),
        (Parameter("e_n", 0.0, 1.0, fixed=0.94), MU),
        (E_N, Parameter("mu", 0.0, math.inf, fixed=0.3)),
    ],
)
def test_kappa_has_the_mean_of_the_product_and_a_mass_of_one(e_n, mu):
    def mean(parameter):
        if parameter.fixed is not None:
            return parameter.fixed
        x = np.linspace(parameter.lower, parameter.prior_upper, 20_001)
        return float(integrate.trapezoid(x * prior_density(parameter, x), x))

    at = np.linspace(0.0, 4.0, 8001)
    density = kappa_prior_density(e_n, mu, at)
    assert integrate.trapezoid(density, at) == pytest.approx(1.0, abs=2e-3)
    assert integrate.trapezoid(at * density, at) == pytest.approx(mean(mu) * (1.0 + mean(e_n)), rel=3e-3)
