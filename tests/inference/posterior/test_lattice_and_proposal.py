"""Lattices and the laws that importance sampling draws from: known answers."""

from __future__ import annotations

import numpy as np
from scipy import stats

from ifrfit.inference.posterior.mixture_proposal import (
    Beside,
    Component,
    MixtureProposal,
    _at_share,
    _below,
    cut_quantile,
    lattice,
)


class Wedge:
    """0 < x < 1, 0 < y < 1 + x: the domain of (e_n, kappa) with mu below 1."""

    dimensions = 2

    def ends(self, place, at):
        low = np.zeros(at.shape[0])
        return (low, low + 1.0) if place == 0 else (low, 1.0 + at[:, 0])


CORNER = Component(np.array([0.95, 2.2]), np.array([[0.2, 0.0], [0.3, 0.4]]))


def midpoints(n=500):
    x = (np.arange(n) + 0.5) / n
    y = (np.arange(2 * n) + 0.5) / n
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid[grid[:, 1] < 1.0 + grid[:, 0]], 1.0 / n**2


def test_a_finer_lattice_holds_the_coarser_one():
    shift = np.array([0.3, 0.77, 0.05])
    both = np.concatenate((lattice(64, shift), lattice(64, shift, finer=True)))
    np.testing.assert_allclose(np.sort(both, axis=0), np.sort(lattice(128, shift), axis=0), atol=1e-12)


def test_averages_over_shifted_lattices_are_unbiased_and_far_better_than_random_ones():
    rng = np.random.default_rng(5)

    def average(u):
        return np.mean(np.prod(1.0 + 0.5 * np.sin(2.0 * np.pi * u) + (u - 0.5) ** 2, axis=1))

    exact = (1.0 + 1.0 / 12.0) ** 5
    found = np.array([average(lattice(1024, rng.random(5))) for _ in range(32)])
    random = np.array([average(rng.random((1024, 5))) for _ in range(32)])
    assert abs(found.mean() - exact) < 4.0 * found.std(ddof=1) / np.sqrt(32)
    assert found.std() < 0.1 * random.std()


def test_the_law_of_a_coordinate_is_students_t_with_four_degrees_of_freedom():
    x = np.array([-1e5, -40.0, -2.0, -1e-3, 0.0, 0.7, 5.0])
    np.testing.assert_allclose(_below(x), stats.t.cdf(x, 4), rtol=1e-12)
    np.testing.assert_allclose(_at_share(_below(x[:5])), x[:5], rtol=1e-9, atol=1e-12)
    # cut off far out in either tail, where differences of probabilities have no digits left
    for low, high in ((30.0, 31.0), (-31.0, -30.0)):
        found = cut_quantile(np.array([low]), np.array([high]), np.array([0.5]))
        between = stats.t.sf(30.0, 4), stats.t.sf(31.0, 4)
        middle = stats.t.isf(0.5 * sum(between), 4)
        np.testing.assert_allclose(abs(found), middle, rtol=1e-9)


def test_a_component_is_a_density_inside_its_domain_and_draws_follow_it():
    at, area = midpoints()
    density = np.exp(CORNER.log_density(Wedge(), at))
    assert abs(density.sum() * area - 1.0) < 3e-3  # cells that the slanted end cuts
    drawn = CORNER.draw(Wedge(), np.random.default_rng(0).random((100_000, 2)))
    assert (drawn[:, 1] <= 1.0 + drawn[:, 0]).all()
    mean = density @ at / density.sum()
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=4e-3)
    spread = np.sqrt(density @ (at - mean) ** 2 / density.sum())
    np.testing.assert_allclose(drawn.std(axis=0), spread, rtol=0.01)


def test_a_mixture_weighs_its_components():
    mixture = MixtureProposal(Wedge(), (CORNER,), np.ones(1), Beside(uniform=0.3))
    at, area = midpoints()
    density = np.exp(mixture.log_density(at[None])[0])
    assert abs(density.sum() * area - 1.0) < 3e-3
    drawn = mixture.draw(np.random.default_rng(1).random((1, 100_000, 3)))[0]
    low = at[:, 0] < 0.4
    assert abs(np.mean(drawn[:, 0] < 0.4) - density[low].sum() * area) < 6e-3
