"""Groups that leave a constant open on one side: what they say, and what a population is without them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.special import ndtr

from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.limits import Limits
from ifrfit.campaign.population.normal_hierarchy import NormalHierarchy
from ifrfit.campaign.population.partial_pooling import populations
from ifrfit.inference.model.parameters import Parameter

MU = Coordinate(0.0, math.inf)


def row(low95, low68, high=math.inf, value=None, name="mu", status="one_sided"):
    ends = {f"{name}_lo95": low95, f"{name}_lo68": low68, f"{name}_hi68": high, f"{name}_hi95": high}
    return {"failure": "", name: value, f"{name}_status": status} | ends


def test_a_limit_goes_through_both_intervals_of_the_profile():
    """Where chi2 has risen by z^2, of one tail, the likelihood is exp(-z^2/2) of its plateau."""
    (limit,) = [Limits.of("mu", [row(0.2, 0.25)], MU)]
    assert (limit.side.tolist(), limit.groups) == ([1.0], 1)
    z = stats.norm.ppf([0.95, 0.68])
    likelihood = ndtr((np.log([0.2, 0.25]) - limit.place) / limit.width)
    assert likelihood == pytest.approx(np.exp(-0.5 * z**2), rel=1e-9)


def test_a_limit_beside_a_bound_goes_through_the_quantiles_of_a_half_normal_law():
    by = Coordinate(-1.0, -0.4)
    glass = row(-1.0, -1.0, value=-0.99, name="e_t") | {"e_t_hi68": -0.97, "e_t_hi95": -0.94}
    limit = Limits.of("e_t", [glass], by)
    assert limit.side.tolist() == [-1.0]
    z = stats.norm.ppf([0.5 + 0.5 * 0.68, 0.5 + 0.5 * 0.95])
    likelihood = ndtr(-(by.to(np.array([-0.97, -0.94])) - limit.place) / limit.width)
    assert likelihood == pytest.approx(np.exp(-0.5 * z**2), rel=1e-9)


def test_what_is_no_limit():
    determined = row(0.1, 0.15, 0.3, 0.2, status="determined")
    nothing = row(0.0, 0.0, status="not_determined")
    assert Limits.of("mu", [determined, nothing, {"failure": "broken"}], MU).groups == 0


def test_many_limits_are_taken_together():
    rows = [row(low, 1.2 * low) for low in np.linspace(0.1, 0.5, 1500)]
    limits = Limits.of("mu", rows, MU)
    assert limits.groups == 1500
    assert limits.place.size < 300
    mean, variance = np.array([-1.5, -1.0]), np.array([0.2, 0.1])
    alone = [Limits.of("mu", [each], MU).log_likelihood(mean, variance)[0] for each in rows]
    assert limits.log_likelihood(mean, variance)[0] == pytest.approx(np.sum(alone, axis=0), rel=1e-4)


def test_slope_and_bend():
    limits = Limits(np.array([-1.0, 0.3]), np.array([0.2, 0.5]), np.array([1.0, -1.0]), np.array([3.0, 1.0]))
    mean, variance, h = np.array([-0.4]), np.array([0.3]), 1e-4
    low, at, high = (limits.log_likelihood(mean + d, variance) for d in (-h, 0.0, h))
    assert at[1] == pytest.approx((high[0] - low[0]) / (2.0 * h), rel=1e-6)
    assert at[2] == pytest.approx((high[1] - low[1]) / (2.0 * h), rel=1e-6)


def test_the_posterior_by_brute_force():
    """Mean and tau of eight groups, three of which give a limit, over a grid of both."""
    y, s = np.array([-0.6, -0.1, 0.2, 0.4, -0.9]), np.full(5, 0.15)
    limits = Limits(np.array([0.5, 0.7, 0.6]), np.full(3, 0.1), np.ones(3), np.ones(3))
    found = NormalHierarchy.of(y, s, limits)
    tau = np.exp(np.linspace(-6.0, 3.5, 500))[:, None, None]
    mean = np.linspace(-15.0, 25.0, 4001)[None, :, None]
    log_p = stats.norm.logpdf(y, mean, np.sqrt(tau**2 + s**2)).sum(axis=2)
    log_p += stats.norm.logcdf((mean - limits.place) / np.sqrt(tau**2 + limits.width**2)).sum(axis=2)
    p = np.exp(log_p - log_p.max()) * tau[:, :, 0]  # uniform in tau, nodes even in its logarithm
    over_mean = integrate.cumulative_trapezoid(p.sum(axis=0), mean[0, :, 0], initial=0.0)
    exact = np.interp([0.16, 0.5, 0.84], over_mean / over_mean[-1], mean[0, :, 0])
    ours = found.centre_quantiles()[1:4]
    # Laplace's approximation given tau; tenths of the half width
    assert ours == pytest.approx(exact, abs=0.1 * 0.5 * (exact[2] - exact[0]))


def test_the_median_of_censored_populations():
    """A quarter of the groups give a limit: without them the interval of the median hardly ever holds it."""
    rng = np.random.default_rng(4)
    held = np.zeros(2, dtype=int)
    for _ in range(60):
        y = rng.standard_normal(60)
        is_open = y > 0.7 + 0.3 * rng.standard_normal(60)
        seen = y[~is_open] + 0.1 * rng.standard_normal((~is_open).sum())
        n = int(is_open.sum())
        limits = Limits(np.full(n, 0.7), np.full(n, 0.15), np.ones(n), np.ones(n))
        for k, of in enumerate((None, limits)):
            low, *_, high = NormalHierarchy.of(seen, np.full(seen.size, 0.1), of).centre_quantiles().tolist()
            held[k] += low <= 0.0 <= high
    assert held[0] < 20
    assert held[1] >= stats.binom(60, 0.95).ppf(1e-3)


def test_no_population_where_most_groups_give_a_limit():
    determined = [row(x - 0.02, x - 0.01, x + 0.01, x, status="determined") for x in (0.1, 0.12, 0.14)]
    for each, x in zip(determined, (0.12, 0.14, 0.16), strict=True):
        each["mu_hi95"] = x
    limits = [row(0.2 + 0.01 * k, 0.25 + 0.01 * k) for k in range(4)]
    parameters = [Parameter("mu", 0.0, math.inf)]
    (found,), none = populations([*determined, *limits[:3]], parameters)
    assert (found.groups.size, found.limits, found.left_out, none) == (3, 3, 0, [])
    assert float(found.centre.median) > 0.14
    found, (left,) = populations([*determined, *limits], parameters)
    assert (found, left) == ([], ("mu", 3, 4))


def test_a_limit_far_from_the_others_is_named():
    parameters = [Parameter("mu", 0.0, math.inf)]
    rows = [row(0.98 * x, 0.99 * x, 1.01 * x, x, status="determined") for x in np.linspace(0.1, 0.12, 12)]
    for each in rows:
        each["mu_hi95"] = 1.02 * each["mu"]
    (near,), _ = populations([*rows, row(0.11, 0.115)], parameters)
    (far,), _ = populations([*rows, row(0.4, 0.5)], parameters)
    assert near.outlying == {}
    assert list(far.outlying) == [12]
    assert near.limit_p[12] > 0.1
