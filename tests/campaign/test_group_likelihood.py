"""What a group says without its prior: against quadrature, and by the mean over many groups."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, stats

from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.group_likelihood import joint_likelihoods, likelihood_moments
from ifrfit.campaign.population.normal_hierarchy import NormalHierarchy
from ifrfit.campaign.population.partial_pooling import populations
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.parameters import Parameter

SHARE, LOG = Coordinate(0.0, 1.0), Coordinate(0.0, math.inf)
PARTS = ("_lo95", "_lo68", "", "_hi68", "_hi95")


def posterior_of(middle, sd, by):
    """Under a uniform prior, of a value that was measured with a normal error."""
    upper = (by.upper - middle) / sd
    return stats.truncnorm((by.lower - middle) / sd, upper, middle, sd)


@pytest.mark.parametrize("by", [SHARE, LOG])
@pytest.mark.parametrize(("middle", "sd"), [(0.5, 0.01), (0.2, 0.01), (0.2, 0.03), (0.2, 0.04), (0.8, 0.05)])
def test_moments_against_quadrature(by, middle, sd):
    """The normal likelihood itself, integrated evenly over the coordinate."""
    y = np.linspace(by.to(np.array(middle)) - 2.5, by.to(np.array(middle)) + 2.5, 200_001)
    density = np.exp(-0.5 * ((by.back(y) - middle) / sd) ** 2)
    density /= density.sum()
    mean = density @ y
    expected = mean, math.sqrt(density @ (y - mean) ** 2)
    five = by.to(posterior_of(middle, sd, by).ppf(LEVELS))[:, None]
    found = likelihood_moments(five, by)
    # five quantiles leave the tails open: they take from the sd a share of the order of its square
    size = expected[1]
    assert found[0][0] == pytest.approx(expected[0], abs=0.15 * size**2 + 0.002 * size)
    assert found[1][0] == pytest.approx(expected[1], rel=0.001 + 0.9 * size**2)
    # the posterior itself is far from it
    middle_of_posterior = 0.5 * (five[1, 0] + five[3, 0])
    if size > 0.05:
        assert abs(middle_of_posterior - expected[0]) > 3 * abs(found[0][0] - expected[0])


def test_an_outer_quantile_at_a_bound_goes_on_as_the_inner_one():
    five = np.array([-1.959964, -0.994458, 0.0, 0.994458, 1.959964])[:, None]
    cut = five.copy()
    cut[0] = -np.inf
    for each in (SHARE, LOG):
        np.testing.assert_allclose(likelihood_moments(cut, each), likelihood_moments(five, each), rtol=1e-6)


def row_of(e_t, mu, sd, rho):
    """What the table holds of a group whose posterior is normal in e_t and mu."""
    row = {"failure": "", "correlation_e_t_mu": rho}
    for name, middle, own in zip(("e_t", "mu"), (e_t, mu), sd, strict=True):
        row |= {
            f"{name}{part}": middle + own * z for part, z in zip(PARTS, stats.norm.ppf(LEVELS), strict=True)
        }
        row[f"{name}_status"] = "determined"
    return row


@pytest.mark.parametrize("rho", [-0.6, 0.0, 0.5])
def test_the_prior_of_mu_in_e_t_against_quadrature(rho):
    """Of a normal likelihood of e_t and mu, integrated evenly over both coordinates."""
    by = {"e_t": Coordinate(-1.0, -0.4), "mu": LOG}
    at, sd = (-0.5, 0.2), (0.02, 0.02)
    found = joint_likelihoods([row_of(*at, sd, rho)], by)
    covariance = np.array([[sd[0] ** 2, rho * sd[0] * sd[1]], [rho * sd[0] * sd[1], sd[1] ** 2]])
    law = stats.multivariate_normal(at, covariance)
    middle = [float(each.to(np.array(x))) for each, x in zip(by.values(), at, strict=True)]

    def density(a, b):
        return law.pdf([float(by["e_t"].back(np.array(a))), float(by["mu"].back(np.array(b)))])

    ends = [(m - 1.2, m + 1.2) for m in middle]
    options = {"epsabs": 1e-4, "epsrel": 1e-6, "limit": 60}
    total = integrate.nquad(density, ends, opts=options)[0]
    mean = integrate.nquad(lambda a, b: a * density(a, b), ends, opts=options)[0] / total
    own = found["e_t"][1][0]
    # to first order in covariances: what is left is of third order in the errors
    assert found["e_t"][0][0] == pytest.approx(mean, abs=0.05 * own)
    alone = joint_likelihoods([row_of(*at, sd, 0.0)], by)
    if rho:
        assert abs(alone["e_t"][0][0] - mean) > 2.0 * abs(found["e_t"][0][0] - mean)
    assert found["mu"][0][0] == alone["mu"][0][0]


def posteriors_of_equal_groups(rng, relative, groups, truth=0.2):
    """Quantiles of the posterior of each group, (5, groups)."""
    sd = relative * truth
    return posterior_of(rng.normal(truth, sd, groups), sd, LOG).ppf(np.asarray(LEVELS)[:, None])


def error_of_the_mean(y, s, truth=0.2):
    """How many of its own sd the mean over groups lies above the truth."""
    found = NormalHierarchy.of(y, s)
    low, middle, high = found.centre_quantiles()[1:4]
    return (middle - math.log(truth)) / (0.5 * (high - low))


@pytest.mark.parametrize("relative", [0.03, 0.08])
def test_a_prior_that_all_groups_hold_counts_no_more(relative):
    """It moved the mean over 200 groups by sqrt(200) of the error of one: by 0.42 and 1.13 of its own sd."""
    rng = np.random.default_rng(8)
    mended, before = [], []
    for _ in range(40):
        five = LOG.to(posteriors_of_equal_groups(rng, relative, 200))
        mended.append(error_of_the_mean(*likelihood_moments(five, LOG)))
        before.append(error_of_the_mean(0.5 * (five[1] + five[3]), 0.5 * (five[3] - five[1])))
    # of 40 campaigns the mean has an error of 0.16; next order: relative^2 sqrt(200), 0.09 at most
    assert abs(np.mean(mended)) < 0.5
    assert 0.7 < np.std(mended) < 1.3
    assert np.mean(before) - np.mean(mended) == pytest.approx(relative * math.sqrt(200), rel=0.2)


def test_the_population_takes_it():
    five = posteriors_of_equal_groups(np.random.default_rng(2), 0.08, 200)
    rows = [
        {f"mu{part}": x for part, x in zip(PARTS, each, strict=True)}
        | {"failure": "", "mu_status": "determined"}
        for each in five.T.tolist()
    ]
    (found,), _ = populations(rows, [Parameter("mu", 0.0, math.inf)])
    hierarchy = NormalHierarchy.of(*likelihood_moments(LOG.to(five), LOG))
    assert float(found.centre.median) == pytest.approx(math.exp(hierarchy.centre_quantiles()[2]), rel=1e-9)
