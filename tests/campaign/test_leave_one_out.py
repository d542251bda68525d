"""Groups that are not of the population of the others: against fits without them, and by false alarms."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy import integrate, stats

from ifrfit.campaign.population.leave_one_out import outlying_groups, predictive_p_values
from ifrfit.campaign.population.normal_hierarchy import FEWEST, NormalHierarchy

# e_n of eleven groups and of one at 0.50, as logits, with their errors
Y = np.array([1.55, 1.82, 1.70, 1.66, 1.78, 1.74, 1.69, 1.81, 1.58, 1.72, 1.76, 0.00])
S = np.full(12, 0.02)


def drawn(rng, n, tau, error=None):
    s = rng.uniform(0.5, 2.0, n) if error is None else np.full(n, error)
    return rng.normal(rng.normal(0.0, 3.0), tau, n) + s * rng.standard_normal(n), s


@pytest.mark.parametrize("tau", [0.0, 1.0, 30.0])
@pytest.mark.parametrize("n", [4, 5, 12, 40])
def test_against_fits_of_the_others(n, tau):
    """The posterior of tau without a group, from the others alone, on a grid of its own."""
    rng = np.random.default_rng(n)
    y, s = drawn(rng, n, tau)
    y[1] += 8.0 * np.hypot(s[1], tau)
    found = predictive_p_values(NormalHierarchy.of(y, s), np.arange(n))
    for place in range(n):
        others = NormalHierarchy.of(np.delete(y, place), np.delete(s, place))
        sd = np.sqrt(s[place] ** 2 + others.tau**2 + others.sd**2)
        upper = float(others.weight @ stats.norm.sf(y[place], others.mean, sd))
        lower = float(others.weight @ stats.norm.cdf(y[place], others.mean, sd))
        # grids of 1201 nodes over other ranges: tails cut at e^14 scales, tau resolved to 2 %
        assert found[place] == pytest.approx(2.0 * min(upper, lower), rel=2e-3, abs=1e-300)


def test_against_quadrature():
    """Student's t, where all errors vanish beside tau: y_i given n - 1 others with p(tau) uniform."""
    y = np.array([0.3, -1.2, 0.8, 2.0, -0.4, 6.0])
    found = predictive_p_values(NormalHierarchy.of(y, np.full(6, 1e-6)), np.arange(6))
    for place in range(6):
        others = np.delete(y, place)
        n, mean, square = others.size, others.mean(), others.var() * others.size

        def density(tau, n=n, square=square):
            return tau ** (1 - n) * np.exp(-0.5 * square / tau**2)

        def beyond(tau, n=n, mean=mean, place=place):
            return 2.0 * stats.norm.sf(abs(y[place] - mean), 0.0, tau * np.sqrt(1.0 + 1.0 / n))

        total = integrate.quad(density, 0.0, np.inf)[0]
        expected = integrate.quad(lambda t: density(t) * beyond(t), 0.0, np.inf)[0] / total
        assert found[place] == pytest.approx(expected, rel=1e-5)


def test_a_group_of_another_kind_is_named():
    found = outlying_groups(NormalHierarchy.of(Y, S))
    assert list(found) == [11]
    assert found[11] < 1e-6
    assert outlying_groups(NormalHierarchy.of(Y[:11], S[:11])) == {}


def test_one_error_may_be_far_below_the_others():
    """Sums over the others are lost in its own."""
    y, s = np.array([0.0, 1.0, -1.0, 0.5, -0.5, 0.2]), np.array([1e-9, 1.0, 1.0, 1.0, 1.0, 1.0])
    found = predictive_p_values(NormalHierarchy.of(y, s), np.arange(6))
    assert ((found > 0.05) & (found <= 1.0)).all()


def test_of_three_groups_nothing_can_be_told():
    assert outlying_groups(NormalHierarchy.of(Y[:FEWEST], S[:FEWEST])) is None
    assert outlying_groups(NormalHierarchy.of(Y[: FEWEST + 1], S[: FEWEST + 1])) == {}


def test_of_many_groups_those_far_off_are_looked_at():
    """The same groups are found as where each is looked at."""
    rng = np.random.default_rng(4)
    for tau in (0.0, 1.0):
        y, s = drawn(rng, 2500, tau)
        y[[7, 800]] += [9.0 * np.hypot(s[7], tau), -12.0 * np.hypot(s[800], tau)]
        hierarchy = NormalHierarchy.of(y, s)
        every = predictive_p_values(hierarchy, np.arange(2500)) * 2500
        found = outlying_groups(hierarchy)
        assert list(found) == [800, 7]
        assert sorted(found) == np.flatnonzero(every < 1e-3).tolist()
        np.testing.assert_allclose([found[7], found[800]], every[[7, 800]], rtol=1e-9)


def test_ten_thousand_groups_take_no_time():
    y, s = drawn(np.random.default_rng(1), 10_000, 0.0)
    hierarchy = NormalHierarchy.of(y, s)
    times = []
    for _ in range(3):
        before = time.process_time()
        outlying_groups(hierarchy)
        times.append(time.process_time() - before)
    assert min(times) < 0.5


def test_false_alarms_are_rare():
    """p is uniform where tau is far above the errors; of 300 campaigns hardly one has an alarm at 0.001."""
    rng = np.random.default_rng(11)
    p, alarms = [], 0
    for number in range(300):
        n = int(rng.integers(4, 60))
        hierarchy = NormalHierarchy.of(*drawn(rng, n, (0.0, 1.0, 100.0)[number % 3]))
        alarms += bool(outlying_groups(hierarchy))
        if number % 3 == 2:
            p += predictive_p_values(hierarchy, np.array([0])).tolist()
    # 0.3 expected at most; four or more have a chance of 3e-4
    assert alarms <= 3
    # an uniform prior of tau makes few groups somewhat cautious
    assert stats.kstest(p, "uniform").pvalue > 1e-3
