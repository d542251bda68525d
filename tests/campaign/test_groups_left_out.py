"""Groups that leave a constant open are no random choice: named where that may move a population."""

import math

import numpy as np
import pytest
from scipy import stats

from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.groups_left_out import _truncated, groups_left_out
from ifrfit.campaign.population.normal_hierarchy import NormalHierarchy

LOG, LOGIT = Coordinate(0.0, math.inf), Coordinate(-1.0, -0.4)
ABOVE, BELOW = {"x_lo95": 1.0, "x_hi95": math.inf}, {"x_lo95": 0.0, "x_hi95": 0.1}
TWO_SIDED, UNSAID = {"x_lo95": 0.1, "x_hi95": 3.0}, {"x_lo95": None, "x_hi95": None}


def pooled(n, tau, error, seed=1):
    rng = np.random.default_rng(seed)
    return NormalHierarchy.of(
        tau * rng.standard_normal(n) + error * rng.standard_normal(n), np.full(n, error)
    )


@pytest.mark.parametrize("below", [0.0, 0.01, 0.2])
@pytest.mark.parametrize("above", [0.0, 0.05, 0.3])
def test_the_law_without_its_ends(below, above):
    law = stats.truncnorm(stats.norm.ppf(below), stats.norm.isf(above))
    assert _truncated(below, above) == pytest.approx((law.mean(), law.std()), abs=1e-9)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_it_says_by_how_much_the_median_of_a_cut_population_is_off(side):
    """200 groups of one population, of which the outer eighth is left out: the mean of 60 campaigns."""
    rng, off, expected = np.random.default_rng(3), [], []
    for _ in range(60):
        truth = 2.0 + 0.5 * np.sort(side * rng.standard_normal(200)) * side
        order = np.argsort(side * truth)
        y = truth[order[:175]] + 0.1 * rng.standard_normal(175)
        found = NormalHierarchy.of(y, np.full(175, 0.1))
        _, low, middle, high, _ = found.centre_quantiles()
        off.append((2.0 - middle) / (0.5 * (high - low)))
        (one,) = {groups_left_out("x", LOG, [ABOVE if side > 0.0 else BELOW] * 25, found)}
        expected.append(one.shift)
    assert side * np.mean(off) > 2.0
    # a mean over 60 has an error of some sqrt(1/60) standard errors
    assert np.mean(expected) == pytest.approx(np.mean(off), abs=4.0 / math.sqrt(60))


def test_sides_are_counted():
    found = groups_left_out("x", LOG, [ABOVE, ABOVE, BELOW, TWO_SIDED, UNSAID], pooled(20, 1.0, 0.1))
    assert (found.above, found.below, found.two_sided, found.groups) == (2, 1, 2, 5)
    assert found.shift > 0.0
    at_end = {"x_lo95": -1.0, "x_hi95": -0.9}
    found = groups_left_out("x", LOGIT, [at_end, at_end], pooled(20, 1.0, 0.1))
    assert (found.above, found.below) == (0, 2)
    assert found.shift < 0.0


@pytest.mark.parametrize(
    ("left_out", "hierarchy"),
    [
        ([], pooled(20, 1.0, 0.1)),
        ([ABOVE], pooled(30, 0.0, 0.1)),  # groups that hardly differ, whichever is left out
        ([ABOVE] * 10 + [BELOW] * 10, pooled(80, 1.0, 0.1)),  # from each side as many
    ],
    ids=["none", "alike", "from two sides"],
)
def test_groups_that_move_nothing_are_not_named(left_out, hierarchy):
    assert groups_left_out("x", LOG, left_out, hierarchy) is None
