"""Partial pooling against brute force, in its limits, and by its calibration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from ifrfit.campaign.population import normal_hierarchy
from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.normal_hierarchy import FEWEST, NormalHierarchy
from ifrfit.campaign.population.partial_pooling import populations
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.parameters import Parameter

# the eight schools of Rubin (1981), in Gelman et al., Bayesian Data Analysis, table 5.2
EFFECTS = np.array([28.0, 8.0, -3.0, 7.0, -1.0, 1.0, 18.0, 12.0])
ERRORS = np.array([15.0, 10.0, 16.0, 11.0, 9.0, 11.0, 10.0, 18.0])


def test_against_brute_force():
    found = NormalHierarchy.of(EFFECTS, ERRORS)

    def density(mean, tau):
        return math.exp(stats.norm.logpdf(EFFECTS, mean, np.hypot(ERRORS, tau)).sum())

    ends = (0.0, 400.0, -150.0, 170.0)
    options = {"opts": [{"limit": 400, "points": [5.0, 20.0]}, {"limit": 400, "points": [8.0]}]}

    def integral(of):
        inner = (ends[2], ends[3])
        outer = (ends[0], ends[1])
        return integrate.nquad(lambda m, t: of(m, t) * density(m, t), [inner, outer], **options)[0]

    total = integral(lambda m, t: 1.0)
    mean = integral(lambda m, t: m) / total
    share = ERRORS[0] ** 2
    first = integral(lambda m, t: EFFECTS[0] + share / (share + t * t) * (m - EFFECTS[0])) / total
    inside = found.tau < ends[1]
    weight = found.weight[inside] / found.weight[inside].sum()
    assert weight @ found.mean[inside] == pytest.approx(mean, abs=2e-3)
    few = share / (share + found.tau[inside] ** 2)
    own = EFFECTS[0] + few * (found.mean[inside] - EFFECTS[0])
    assert weight @ own == pytest.approx(first, abs=5e-3)


def test_quantiles_are_those_of_draws():
    found = NormalHierarchy.of(EFFECTS, ERRORS)
    rng = np.random.default_rng(1)
    at = rng.choice(found.tau.size, 400_000, p=found.weight)
    tau, mean = found.tau[at], rng.normal(found.mean[at], found.sd[at])
    share = ERRORS[0] ** 2 / (ERRORS[0] ** 2 + tau**2)
    member = rng.normal(EFFECTS[0] + share * (mean - EFFECTS[0]), ERRORS[0] * np.sqrt(1.0 - share))
    new = rng.normal(mean, tau)
    levels = [0.025, 0.16, 0.5, 0.84, 0.975]
    for ours, draws in (
        (found.centre_quantiles(), mean),
        (found.tau_quantiles(), tau),
        (found.member_quantiles()[:, 0], member),
        (found.new_quantiles(), new),
    ):
        np.testing.assert_allclose(ours, np.quantile(draws, levels), atol=0.03 * np.std(draws))


def test_equal_groups_are_pooled_whole_and_different_ones_not_at_all():
    sure = np.full(12, 0.01)
    apart = NormalHierarchy.of(np.linspace(-5.0, 5.0, 12), sure)
    assert (apart.shrinkage() < 1e-4).all()
    np.testing.assert_allclose(apart.member_quantiles()[2], np.linspace(-5.0, 5.0, 12), atol=1e-3)
    alike = NormalHierarchy.of(np.zeros(12), np.ones(12))
    assert (alike.shrinkage() > 0.8).all()
    np.testing.assert_allclose(alike.member_quantiles()[2], 0.0, atol=1e-9)


def test_a_shift_and_a_scale_go_through():
    one, other = NormalHierarchy.of(EFFECTS, ERRORS), NormalHierarchy.of(3.0 + 0.1 * EFFECTS, 0.1 * ERRORS)
    np.testing.assert_allclose(other.member_quantiles(), 3.0 + 0.1 * one.member_quantiles(), rtol=1e-8)
    np.testing.assert_allclose(other.tau_quantiles(), 0.1 * one.tau_quantiles(), rtol=1e-8)


@pytest.mark.parametrize("bad", [([1.0, 2.0], [1.0, 1.0]), ([1.0, 2.0, 3.0], [1.0, 0.0, 1.0])])
def test_too_little_is_refused(bad):
    with pytest.raises(ValueError, match=str(FEWEST)):
        NormalHierarchy.of(*map(np.array, bad))


def test_calibration():
    """Ranks of the truth among the posterior are uniform where m and tau come from the prior, cut off."""
    rng, n, repeats = np.random.default_rng(7), 8, 400
    ranks = []
    for _ in range(repeats):
        mean, tau = rng.uniform(-20.0, 20.0), rng.uniform(0.0, 3.0)
        truth = rng.normal(mean, tau, n)
        errors = rng.uniform(0.3, 1.5, n)
        found = NormalHierarchy.of(rng.normal(truth, errors), errors)
        inside = found.tau < 3.0  # the prior of this experiment
        weight = found.weight[inside] / found.weight[inside].sum()
        share = errors[0] ** 2 / (errors[0] ** 2 + found.tau[inside] ** 2)
        middle = found.y[0] + share * (found.mean[inside] - found.y[0])
        sd = np.sqrt(errors[0] ** 2 * (1.0 - share) + (share * found.sd[inside]) ** 2)
        ranks.append(
            (
                weight @ stats.norm.cdf(truth[0], middle, sd),
                weight @ stats.norm.cdf(mean, found.mean[inside], found.sd[inside]),
                weight[found.tau[inside] < tau].sum(),
            )
        )
    for column in np.array(ranks).T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3


DOMAINS = [(0.0, 1.0), (-1.0, -0.4), (0.0, math.inf), (-math.inf, math.inf)]


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(DOMAINS), st.floats(0.02, 0.98))
def test_coordinates_go_there_and_back(ends, share):
    low, high = (0.0 if math.isinf(ends[0]) else ends[0]), (1.0 if math.isinf(ends[1]) else ends[1])
    x = np.array([low + share * (high - low)])
    by = Coordinate(*ends)
    np.testing.assert_allclose(by.back(by.to(x)), x, rtol=1e-12, atol=1e-12)


ENDS = (("lo", -1.0), ("hi", 1.0))
WIDTHS = ((68, 1.0), (95, 2.0))


def rows_of(values, sd=0.01, status="determined"):
    return [
        {"failure": "", "mu": v, "mu_status": status}
        | {f"mu_{end}{level}": v + side * by * sd for end, side in ENDS for level, by in WIDTHS}
        for v in values
    ]


def test_groups_that_do_not_determine_a_constant_are_left_out():
    rows = [*rows_of([0.1, 0.12, 0.14]), *rows_of([0.5], status="one_sided"), {"failure": "broken"}]
    (found,), _ = populations(rows, [Parameter("mu", 0.0, math.inf)])
    assert found.groups.tolist() == [0, 1, 2]
    assert found.left_out == 1
    assert 0.1 < float(found.centre.median) < 0.14
    assert populations(rows_of([0.1, 0.2]), [Parameter("mu", 0.0, math.inf)]) == ([], [])


@pytest.mark.parametrize("groups", [3, 10, 100, 1000, 20_000])
def test_the_sd_over_groups_that_are_known_well_has_its_law(groups):
    """Its interval was 1.6 times too wide for 10,000 groups: it lay between two nodes of the grid."""
    y = np.random.default_rng(groups).standard_normal(groups)
    square = ((y - y.mean()) ** 2).sum()
    # p(tau) ~ tau^-(n - 1) exp(-square/2 tau^2) under the uniform prior of tau
    exact = np.sqrt(square / stats.chi2.ppf(1.0 - np.array(LEVELS), groups - 2))
    found = NormalHierarchy.of(y, np.full(groups, 1e-6)).tau_quantiles()
    assert found == pytest.approx(exact, abs=0.01 * (exact[3] - exact[1]))


@pytest.mark.parametrize("groups", [3, 40, 4000])
@pytest.mark.parametrize("spread", [0.0, 0.02, 3.0])
def test_more_nodes_of_tau_change_nothing(monkeypatch, groups, spread):
    rng = np.random.default_rng(groups)
    s = rng.uniform(0.05, 0.2, groups)
    y = spread * rng.standard_normal(groups) + s * rng.standard_normal(groups)
    found = NormalHierarchy.of(y, s)
    monkeypatch.setattr(normal_hierarchy, "_NODES", 20_001 if groups < 100 else 5001)
    monkeypatch.setattr(normal_hierarchy, "_AWAY", math.inf)
    whole = NormalHierarchy.of(y, s)
    for of in ("tau_quantiles", "centre_quantiles", "new_quantiles", "member_quantiles"):
        one, other = getattr(found, of)(), getattr(whole, of)()
        assert np.allclose(one, other, rtol=0.0, atol=0.01 * (other[3] - other[1]).max())
