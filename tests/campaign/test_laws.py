"""Quantiles of the laws of many groups: all are found, and each is where its law has the level."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

from ifrfit.campaign.many_groups.friction_law import FrictionOverKappa, FrictionOverRestitution
from ifrfit.campaign.many_groups.laws import ConstantLaw, RestitutionLaw
from ifrfit.campaign.many_groups.panel_law import NODES, WEIGHTS, PanelLaw, panel_nodes
from ifrfit.inference.distributions.protocol import LEVELS

EXACT = 1e-6
DOMAIN = (-1.0, 1.0)


def kappa_law(rng, groups, *, plateau=0.0, panels=60):
    """A peak of any sharpness, and with it some share of all on a plateau that goes on to its end."""
    place, sd = rng.uniform(0.2, 0.8, groups), np.exp(rng.uniform(np.log(2e-3), np.log(0.05), groups))
    peak = place[:, None] + sd[:, None] * np.linspace(-8.0, 8.0, panels)
    edges = np.concatenate((peak, np.linspace(1.5, 3.2, 6) * np.ones((groups, 1))), axis=1)
    half = 0.5 * np.diff(edges, axis=1)[:, :, None]
    nodes = edges[:, :-1, None] + half * (1.0 + NODES)
    z = (nodes - place[:, None, None]) / sd[:, None, None]
    share = plateau * rng.random((groups, 1, 1))
    height = share / (3.2 - place[:, None, None]) * stats.norm.cdf(z)
    density = (1.0 - share) * stats.norm.pdf(z) / sd[:, None, None] + height
    mass = (
        PanelLaw.made(edges, nodes, density).upto[:, -1] + (density[:, -1] * half[:, -1]).mean(axis=1) * 2.0
    )
    return PanelLaw.made(edges, nodes, density / mass[:, None, None])


def restitution_law(rng, groups, sd=2e-3):
    return RestitutionLaw.made(rng.uniform(0.5, 1.0 - 6.0 * sd, groups), np.full(groups, sd), (0.0, 1.0), 40)


def constant_law(rng, groups, nodes=120):
    """Normal laws side by side, of which a bound cuts some."""
    middle = rng.uniform(-1.05, -0.5, (groups, 1)) + np.linspace(0.0, 0.3, nodes)
    width = np.exp(rng.uniform(np.log(0.02), np.log(0.2), (groups, 1))) * np.ones(nodes)
    height = stats.norm.pdf(np.linspace(-5.0, 5.0, nodes)) * np.ones((groups, 1))
    between = stats.norm.cdf(1.0, middle, width) - stats.norm.cdf(-1.0, middle, width)
    height /= (height * between).sum(axis=1, keepdims=True)
    return ConstantLaw.made(middle[:, :, None], width[:, :, None], height[:, :, None], DOMAIN)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["peak", "plateau", "friction", "friction of a plateau", "e_n", "constant"])
def test_each_quantile_is_found(kind, seed):
    rng = np.random.default_rng([seed, 3])
    groups = 400
    law = {
        "peak": lambda: kappa_law(rng, groups),
        "plateau": lambda: kappa_law(rng, groups, plateau=1.0),
        "friction": lambda: FrictionOverRestitution.made(
            kappa_law(rng, groups), restitution_law(rng, groups)
        ),
        "friction of a plateau": lambda: FrictionOverRestitution.made(
            kappa_law(rng, groups, plateau=1.0), restitution_law(rng, groups)
        ),
        "e_n": lambda: restitution_law(rng, groups),
        "constant": lambda: constant_law(rng, groups),
    }[kind]()
    found = law.quantiles(np.array(LEVELS))
    assert np.isfinite(found).all()
    share, density = law.below(found)
    off = np.abs(share - LEVELS) / np.maximum(density * law.sd[:, None], 1e-3)  # in sd, where the law is one
    assert off.max() < 1e-5
    assert np.median(off) < EXACT / 100.0


@pytest.mark.parametrize("beyond", [-30.0, 0.0, 1.0, 4.0])
def test_e_n_that_lies_beyond_its_bound(beyond):
    """What is looked at ended 5.5 sd from the mean, also where the mean lies 4 sd outside."""
    sd = 0.05
    middle = 1.0 + beyond * sd if beyond >= 0.0 else 0.4
    law = RestitutionLaw.made(np.array([middle]), np.array([sd]), (0.0, 1.0), 40)
    x = np.linspace(0.0, 1.0, 2_000_001)
    density = np.exp(-0.5 * ((x - middle) ** 2 - (min(middle, 1.0) - middle) ** 2) / sd**2) / (1.0 + x)
    share = np.cumsum(density)
    expected = np.interp(LEVELS, share / share[-1], x)
    np.testing.assert_allclose(law.quantiles(np.array(LEVELS))[0], expected, atol=2e-5 * law.sd[0])


def corners(rng, groups, panels=40):
    """Densities that fall on either side of a corner, in one as steeply as in the other or not, and edges."""
    place = rng.uniform(0.3, 1.0, (groups, 1))
    length = place * np.exp(rng.uniform(np.log(2e-4), np.log(3e-3), (2, groups, 1)))
    steps = np.linspace(0.0, 1.0, panels // 2 + 1)
    edges = np.concatenate(
        (place - 20.0 * length[0] * steps[::-1], place + 20.0 * length[1] * steps[1:]), axis=1
    )
    nodes = panel_nodes(edges)
    away = nodes - place[:, None]
    density = np.exp(np.where(away < 0.0, away / length[0][:, None], -away / length[1][:, None]))
    return place, length, edges, nodes, density / length.sum(axis=0)[:, None]


def test_friction_where_kappa_has_a_corner():
    rng = np.random.default_rng(12)
    groups, sd = 60, 5e-3
    place, (below, above), edges, nodes, density = corners(rng, groups)
    kappa, e_n = PanelLaw.made(edges, nodes, density), restitution_law(rng, groups, sd)
    weights = density * WEIGHTS * 0.5 * np.diff(edges, axis=1)[:, :, None]
    law = FrictionOverKappa.made(kappa, e_n, weights)
    found = law.quantiles(np.array(LEVELS))
    # the distribution function of kappa in closed form, over very many e_n
    z = np.linspace(-8.0, 8.0, 200_001)
    for group in range(groups):
        scale = 1.0 + e_n.middle[group] + sd * z
        mass = np.where((scale > 1.0) & (scale < 2.0), np.exp(-0.5 * z * z) / scale, 0.0)
        for level, x in zip(LEVELS, found[group], strict=True):
            away = x * scale - place[group]
            low, high = (
                np.exp(np.minimum(each, 0.0)) for each in (away / below[group], -away / above[group])
            )
            share = np.where(away < 0.0, below[group] * low, below[group] + above[group] * (1.0 - high))
            share = (mass * share).sum() / mass.sum() / (below[group] + above[group])
            _, slope = law.below(np.full((groups, 1), x))
            assert share[0] == pytest.approx(level, abs=1e-5 * slope[group, 0] * law.sd[group])


def test_a_level_between_two_modes():
    """A miss that is nothing in probability led 84 sd away; where a law is all but empty none is found."""
    groups = 150
    weight = np.random.default_rng(4).uniform(0.02, 0.98, groups)[:, None, None]
    weight[:40, 0, 0] = LEVELS[0] + np.linspace(-3e-4, 3e-4, 40)  # of the lower mode: a level in the valley
    edges = np.tile(np.linspace(-8.0, 30.0, 96), (groups, 1))
    nodes = panel_nodes(edges)
    law = PanelLaw.made(
        edges, nodes, weight * stats.norm.pdf(nodes) + (1.0 - weight) * stats.norm.pdf(nodes - 20.0)
    )
    found = law.quantiles(np.array(LEVELS))
    assert np.isnan(found[:40, 0]).any()
    assert np.isfinite(found[40:]).mean() > 0.95
    for group, level in zip(*np.nonzero(np.isfinite(found)), strict=True):
        w = weight[group, 0, 0]

        def below(x, w=w):
            return w * stats.norm.cdf(x) + (1.0 - w) * stats.norm.cdf(x - 20.0)

        exact = brentq(lambda x, below=below, level=level: below(x) - LEVELS[level], -8.0, 28.0, xtol=1e-13)
        assert found[group, level] == pytest.approx(exact, abs=1e-4 * law.sd[group])


def test_a_constant_whose_law_lies_far_below_its_bound():
    """What is left of an upper tail has digits: the sd was 1e-4 of itself off at eleven widths."""
    beyond, width = np.array([-1.0, 2.0, 7.0, 11.0, 30.0]), 0.01
    middle = (DOMAIN[0] - beyond * width)[:, None, None]
    z = stats.truncnorm(beyond, np.inf, middle[:, 0, 0], width)
    height = 1.0 / stats.norm.sf(beyond)[:, None, None]
    law = ConstantLaw.made(middle, np.full_like(middle, width), height, DOMAIN)
    np.testing.assert_allclose(law.mean - DOMAIN[0], z.mean() - DOMAIN[0], rtol=1e-9)
    np.testing.assert_allclose(law.sd, z.std(), rtol=1e-7)
    expected = z.ppf(np.array(LEVELS)[:, None]).T
    np.testing.assert_allclose(law.quantiles(np.array(LEVELS)), expected, atol=1e-6 * law.sd.min())


def test_fewer_nodes_stand_for_the_same_law():
    rng = np.random.default_rng(8)
    groups, panels = 60, 30
    edges = np.sort(rng.uniform(-4.0, 4.0, (groups, panels + 1)), axis=1)
    edges = edges * (1.0 / np.diff(edges, axis=1).max(axis=1))[:, None]  # no panel wider than a law
    half = 0.5 * np.diff(edges, axis=1)[:, :, None]
    at = edges[:, :-1, None] + half * (1.0 + NODES)
    width = np.exp(rng.uniform(-4.0, -1.0, (groups, 1, 1)))
    middle = rng.uniform(-1.0, 0.5, (groups, 1, 1)) + width * at
    height = half * WEIGHTS * np.exp(rng.uniform(-0.5, 0.5, (groups, 1, 1)) * at)
    low, high = ((bound - middle) / width for bound in DOMAIN)
    mass = (height * (stats.norm.cdf(high) - stats.norm.cdf(low))).sum(axis=(1, 2), keepdims=True)
    seen = (mass > 0.1 * height.sum(axis=(1, 2), keepdims=True))[:, 0, 0]
    of = [each[seen] for each in (middle, np.broadcast_to(width, middle.shape), height / mass)]
    whole = ConstantLaw.made(*of, DOMAIN)
    few = whole.with_fewer_nodes()
    assert few.middle.shape[1] <= 3 * panels
    there = few.quantiles(np.array(LEVELS))
    np.testing.assert_allclose(
        there / whole.sd[:, None], whole.quantiles(np.array(LEVELS)) / whole.sd[:, None], atol=1e-5
    )


def test_a_constant_against_the_root_of_its_mixture():
    law = constant_law(np.random.default_rng(5), 5)
    found, widths, heights = law.quantiles(np.array(LEVELS)), np.abs(law.width), np.abs(law.height)
    for group in range(5):
        z = stats.norm(law.middle[group], widths[group])

        def share(x, z=z, height=heights[group]):
            return float((height * (z.cdf(x) - z.cdf(DOMAIN[0]))).sum())

        for level, x in zip(LEVELS, found[group], strict=True):
            exact = brentq(lambda x, level=level: share(x) - level, *DOMAIN, xtol=1e-14)
            assert x == pytest.approx(exact, abs=EXACT * law.sd[group])
            assert law.share(np.full((5, 1), x))[group, 0] == pytest.approx(level, abs=1e-7)


def test_a_group_has_the_quantiles_that_it_has_alone():
    law = constant_law(np.random.default_rng(6), 500)
    found = law.quantiles(np.array(LEVELS))
    for group in (0, 17, 499):
        alone = law.of_groups(np.array([group])).quantiles(np.array(LEVELS))
        assert np.array_equal(alone[0], found[group])
