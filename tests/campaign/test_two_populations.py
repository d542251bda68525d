"""Two populations in place of one: their likelihood by another optimizer, what is named and what is not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, special, stats

from ifrfit.campaign.population.leave_one_out import FEWEST_OF_SEVERAL, groups_that_hide, outlying_groups
from ifrfit.campaign.population.normal_hierarchy import NormalHierarchy
from ifrfit.campaign.population.two_populations import (
    _one_law,
    _one_peak,
    _two_laws,
    two_populations,
)


def halves(rng, n, distance, share=0.5, error=1 / 3):
    """Groups of which a share lies so many tau above the others."""
    truth = rng.standard_normal(n) + distance * (np.arange(n) < round(share * n))
    s = error * np.exp(rng.uniform(-0.3, 0.3, n))
    return rng.normal(truth, s), s


@pytest.mark.parametrize(("n", "distance", "share"), [(20, 8.0, 0.5), (60, 5.0, 0.3), (200, 0.0, 0.5)])
def test_likelihoods_against_a_simplex_search(n, distance, share):
    y, s = halves(np.random.default_rng(n), n, distance, share)

    def one(at):
        return -stats.norm.logpdf(y, at[0], np.hypot(s, at[1])).sum()

    def two(at):
        parts = [
            np.log(p) + stats.norm.logpdf(y, m, np.hypot(s, at[3]))
            for p, m in ((special.expit(-at[0]), at[1]), (special.expit(at[0]), at[2]))
        ]
        return -np.logaddexp(*parts).sum()

    options = {"method": "Nelder-Mead", "options": {"maxiter": 20000, "maxfev": 20000, "fatol": 1e-9}}
    constant = 0.5 * n * np.log(2.0 * np.pi)
    best = -optimize.minimize(one, [y.mean(), y.std()], **options).fun
    # the last grid of tau is so fine that the parabola between its nodes loses less than this
    assert _one_law(y, s) - constant == pytest.approx(best, abs=1e-3)
    ends = np.quantile(y, [0.2, 0.8])
    starts = [[x, *ends, scale] for x in (-1.0, 0.0, 1.0) for scale in (0.5, 1.0)]
    best = max(-optimize.minimize(two, start, **options).fun for start in starts)
    found, _ = _two_laws(y, s)
    # rounds end where they add less than 1e-3 each: some hundredths are left where the peaks overlap
    assert best - 0.2 < found - constant < best + 1e-6


def test_one_peak_is_never_worse_than_its_uniform_law():
    rng = np.random.default_rng(5)
    y, s = rng.uniform(-3.0, 3.0, 100), np.full(100, 0.2)
    y = rng.normal(y, s)

    def box(at):
        z = (np.array(at)[:, None] - y) / s
        return -np.log((special.ndtr(z[1]) - special.ndtr(z[0])) / (at[1] - at[0])).sum()

    best = -optimize.minimize(box, [-3.1, 3.1], method="Nelder-Mead").fun + 50.0 * np.log(2.0 * np.pi)
    # widths are those of a grid
    assert _one_peak(y, s, (0.5, -1.5, 1.5, 1.0)) > best - 2.0


@pytest.mark.parametrize(("n", "share"), [(20, 0.5), (40, 0.25), (1000, 0.5)])
def test_two_populations_are_named(n, share):
    y, s = halves(np.random.default_rng(4), n, 10.0, share)
    found = two_populations(y, s)
    assert found is not None
    assert found.p_value < 1e-4
    assert found.sizes == (n - round(share * n), round(share * n))
    assert (found.is_upper > 0.5).tolist() == (np.arange(n) < round(share * n)).tolist()
    assert found.lower == pytest.approx(0.0, abs=4.0 / np.sqrt(0.5 * n))
    assert found.upper - found.lower == pytest.approx(10.0, abs=5.0 / np.sqrt(share * n))
    assert found.tau == pytest.approx(1.0, abs=3.0 / np.sqrt(n))
    shifted = two_populations(3.0 - 2.0 * y, 2.0 * s)
    assert shifted is not None
    assert shifted.sizes == found.sizes[::-1]
    assert shifted.p_value == pytest.approx(found.p_value, rel=0.2)


KINDS = {
    "normal": lambda rng, n: rng.standard_normal(n),
    "uniform": lambda rng, n: rng.uniform(-2.0, 2.0, n),
    "exponential": lambda rng, n: rng.exponential(1.0, n),
    "equal": lambda rng, n: np.zeros(n),
}


@pytest.mark.parametrize("kind", KINDS)
def test_one_population_that_is_not_normal_is_none_of_two(kind):
    rng = np.random.default_rng(1)
    named = 0
    for n in [100] * 20 + [600] * 6:
        s = np.full(n, 0.2)
        named += two_populations(KINDS[kind](rng, n) + s * rng.standard_normal(n), s) is not None
    # of 100 groups that are even some look like two now and then
    assert named <= (1 if kind == "uniform" else 0)


def test_two_ends_among_few_are_not_told():
    with pytest.raises(ValueError, match=str(FEWEST_OF_SEVERAL)):
        two_populations(np.zeros(FEWEST_OF_SEVERAL - 1), np.ones(FEWEST_OF_SEVERAL - 1))


@pytest.mark.parametrize("offsets", [[10.0, 10.0], [10.0, -10.0], [10.0, 12.0, -9.0, 11.0]])
def test_odd_groups_that_hide_one_another_are_named(offsets):
    """Two of twenty made the standard deviation so large that neither was named."""
    rng = np.random.default_rng(6)
    named = others = 0
    for _ in range(20):
        truth = rng.standard_normal(20)
        truth[: len(offsets)] = offsets
        hierarchy = NormalHierarchy.of(rng.normal(truth, 1 / 3), np.full(20, 1 / 3))
        found = outlying_groups(hierarchy)
        named += set(range(len(offsets))) <= set(found)
        others += any(place >= len(offsets) for place in found)
    assert named >= 18
    assert others <= 1


def test_p_values_of_several_are_given_the_others():
    rng = np.random.default_rng(6)
    y, s = rng.standard_normal(20), np.full(20, 0.3)
    y[[3, 8]] = 11.0, -12.0
    hierarchy = NormalHierarchy.of(y, s)
    assert sorted(groups_that_hide(hierarchy)) == [3, 8]
    found = outlying_groups(hierarchy)
    rest = np.delete(np.arange(20), [3, 8])
    for place in (3, 8):
        kept = np.append(rest, place)
        alone = outlying_groups(NormalHierarchy.of(y[kept], s[kept]))[18]
        # that one is times 19 groups
        assert found[place] == pytest.approx(alone * 20 / 19, rel=2e-3)


def test_false_alarms_are_rare():
    """Of 120 populations of one kind hardly one is called two, or has groups that are named."""
    rng = np.random.default_rng(2)
    two = odd = 0
    for number in range(120):
        n = int(rng.integers(FEWEST_OF_SEVERAL, 60))
        s = rng.uniform(0.5, 2.0, n)
        y = rng.normal((0.0, 0.5, 2.0, 20.0)[number % 4] * rng.standard_normal(n), s)
        two += two_populations(y, s) is not None
        odd += bool(outlying_groups(NormalHierarchy.of(y, s)))
    # 0.12 expected at most of each
    assert two <= 2
    assert odd <= 2
