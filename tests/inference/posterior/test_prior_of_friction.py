"""A prior of mu that the data contradict, where the bound of sticking depends on the closure constant."""

from __future__ import annotations

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.posterior import integrate

E_N = 0.9


def grid_of(gamma, beta, sigma, prior):
    """Log evidence, and (mean, sd) of beta0 and mu, in closure FR, from sums over a plane."""
    beta0 = np.concatenate((np.linspace(-0.4, 0.0, 401), np.linspace(0.0, 1.0, 401)[1:]))
    mu = np.linspace(0.1, 0.32, 2201)
    slide = -1.0 + 3.5 * mu[:, None] * (1.0 + E_N) / np.tan(np.radians(gamma))
    log_p = np.array([-0.5 * (((beta - np.minimum(own, slide)) / sigma) ** 2).sum(axis=1) for own in beta0])
    log_p -= 0.5 * ((mu - prior[0]) / prior[1]) ** 2
    p = np.exp(log_p - log_p.max())
    found = []
    weights = np.gradient(beta0)[:, None] * np.gradient(mu)
    share = p * weights / (p * weights).sum()
    for value, own in ((beta0, share.sum(axis=1)), (mu, share.sum(axis=0))):
        mean = float(value @ own)
        found.append((mean, float(np.sqrt((value - mean) ** 2 @ own))))
    constants = -np.log(sigma * np.sqrt(2.0 * np.pi)).sum() - np.log(prior[1] * np.sqrt(2.0 * np.pi))
    log_z = float(np.log((p * weights).sum()) + log_p.max() + constants - np.log(2.0))
    return log_z, found


@pytest.mark.parametrize("seed", range(4))
def test_the_closure_constant_is_followed_to_where_the_prior_of_mu_has_it(seed):
    """Given a transition, beta0 was followed from the mode of the rows alone: sds off, and called ok."""
    rng = np.random.default_rng(seed)
    gamma = np.sort(rng.uniform(50.0, 88.0, 30))
    sigma = rng.uniform(0.02, 0.04, 30)
    truth = np.minimum(-0.15, -1.0 + 3.5 * 0.21 * (1.0 + E_N) / np.tan(np.radians(gamma)))
    beta = truth + sigma * rng.standard_normal(30)
    prior = (0.14, 0.003)
    data = {"gamma_deg": gamma, "beta": beta, "sigma": sigma}
    problem, _ = ifrfit.fit(
        data, closure="fr", fix={"e_n": E_N}, prior={"mu": prior}, method="lsq"
    ).problem_and_optimum()
    post = integrate(problem)
    log_z, ((mean, sd), (mean_mu, sd_mu)) = grid_of(gamma, beta, sigma, prior)
    assert post.log_evidence == pytest.approx(log_z, abs=0.02)
    assert post.mean("beta0") == pytest.approx(mean, abs=0.03 * sd)
    assert post.mean("mu") == pytest.approx(mean_mu, abs=0.03 * sd_mu)
    assert post.sd("beta0") == pytest.approx(sd, rel=0.03)
    assert post.sd("mu") == pytest.approx(sd_mu, rel=0.03)
