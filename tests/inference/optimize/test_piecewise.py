"""The certified solver against brute force on the same sums of squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ifrfit.inference.optimize.branch_and_bound import branch, minimise, minimise_batch
from ifrfit.inference.optimize.piecewise import LinearRows, PiecewiseBatch, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_quadratic import quadratic_of
from ifrfit.inference.optimize.solved_cells import SolvedCells, refine


def sphere(tau, y, sigma, closure="ifr", linear=None):
    """Beta of a solid sphere in (c, kappa), written out by hand."""
    n = tau.size
    stick, slide = np.zeros((n, 2)), np.zeros((n, 2))
    if closure == "ifr":  # sticking: c + 7/5; sliding: c + 7/2 kappa/tau
        stick[:, 0] = slide[:, 0] = 1.0
        stick0, slide0, bound, bound0, low, high = 1.4, 0.0, [0.0, 0.0], 0.4, -1.0, -0.4
    else:  # fr: c; 7/2 kappa/tau - 1
        stick[:, 0] = 1.0
        stick0, slide0, bound, bound0, low, high = 0.0, -1.0, [2 / 7, 0.0], 2 / 7, -1.0, 1.0
    slide[:, 1] = 3.5 / tau
    return PiecewiseProblem(
        tau,
        LinearRows.of(stick / sigma[:, None], (y - stick0) / sigma),
        LinearRows.of(slide / sigma[:, None], (y - slide0) / sigma),
        LinearRows.of(np.zeros((0, 2)), np.zeros(0)),
        np.array([0.0, 1.0]),
        0.0,
        np.array(bound),
        bound0,
        np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]),
        np.array([high, -low, 0.0]),
        linear,
    )


def chi2(problem, c, kappa):
    """The sum of squares on a grid, by its definition."""
    total = np.zeros(np.broadcast(c, kappa).shape)
    for i, tau in enumerate(problem.tau):
        sticks = tau * (problem.bound[0] * c + problem.bound0) <= kappa
        a, b = problem.stick, problem.slide
        stick = a.target[i] - a.design[i, 0] * c - a.design[i, 1] * kappa
        slide = b.target[i] - b.design[i, 0] * c - b.design[i, 1] * kappa
        total += np.where(sticks, stick, slide) ** 2
    return total


@st.composite
def problems(draw):
    n = draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    gamma = rng.uniform(1.0, 88.0, n)
    if draw(st.booleans()) and n > 2:
        gamma[1] = gamma[0]
    y = rng.uniform(-1.2, 1.2, n)
    sigma = 10.0 ** rng.uniform(-3, 0, n)
    return sphere(np.tan(np.radians(gamma)), y, sigma, draw(st.sampled_from(["ifr", "fr"])))


@settings(max_examples=150, deadline=None)
@given(problems())
def test_no_point_of_a_fine_grid_lies_below_the_certified_minimum(problem):
    found = minimise(problem)
    low, high = -problem.limits[1], problem.limits[0]
    top = 1.05 * problem.tau.max() * (problem.bound0 + problem.bound[0] * high) + 0.1
    c, kappa = np.meshgrid(np.linspace(low, high, 201), np.linspace(0.0, top, 401))
    assert found.chi2 <= chi2(problem, c, kappa).min() * (1 + 1e-9) + 1e-12
    assert found.gap <= 1e-12 * max(1.0, found.chi2)
    # and it is the value at the point that it names, inside the domain
    assert found.chi2 == pytest.approx(float(chi2(problem, found.t[0], found.t[1])), rel=1e-9, abs=1e-12)
    assert low - 1e-9 <= found.t[0] <= high + 1e-9
    assert found.t[1] >= -1e-12


def test_the_order_of_rows_does_not_matter():
    rng = np.random.default_rng(5)
    tau, y = rng.uniform(0.05, 5.0, 30), rng.uniform(-1, 1, 30)
    problem = sphere(tau, y, np.full(30, 0.1))
    order = rng.permutation(30)
    shuffled = sphere(tau[order], y[order], np.full(30, 0.1))
    np.testing.assert_allclose(minimise(problem).t, minimise(shuffled).t, rtol=1e-9)


def test_two_far_optima_of_equal_depth_are_both_found():
    # two impacts: the first sticks, or both slide; either way both are hit exactly
    tau = np.tan(np.radians([20.0, 60.0]))
    c, kappa = -0.98, 0.12 * 1.94
    y = np.array([c + 1.4, c + 3.5 * kappa / tau[1]])
    found = minimise(sphere(tau, y, np.array([0.01, 0.01])))
    assert [value for value, _ in found.optima] == pytest.approx([0.0, 0.0], abs=1e-9)
    first, second = sorted(t[0] for _, t in found.optima)
    assert first == pytest.approx(-0.98, abs=1e-9)
    assert second == pytest.approx(-0.7567, abs=1e-3)


def test_a_single_valley_counts_once():
    rng = np.random.default_rng(2)
    tau = np.tan(np.radians(np.linspace(5, 85, 60)))
    y = -0.9 + np.minimum(1.4, 3.5 * 0.23 / tau) + rng.normal(0, 0.02, 60)
    found = minimise(sphere(tau, y, np.full(60, 0.02)))
    assert len(found.optima) == 1


def test_a_linear_term_moves_the_minimum():
    rng = np.random.default_rng(3)
    tau = np.tan(np.radians(np.linspace(5, 85, 40)))
    y = -0.8 + np.minimum(1.4, 3.5 * 0.23 / tau) + rng.normal(0, 0.02, 40)
    linear = np.array([30.0, -10.0])
    problem = sphere(tau, y, np.full(40, 0.02), linear=linear)
    found = minimise(problem)
    c, kappa = np.meshgrid(np.linspace(-1.0, -0.4, 601), np.linspace(0.0, 0.6, 1201))
    grid = chi2(problem, c, kappa) + linear[0] * c + linear[1] * kappa
    assert found.chi2 <= grid.min() + 1e-9
    assert found.chi2 == pytest.approx(grid.min(), rel=1e-3)


def test_noise_free_rows_are_met_to_the_last_digits():
    tau = np.tan(np.radians(np.linspace(3, 87, 40)))
    y = -0.9 + np.minimum(1.4, 3.5 * 0.2328 / tau)
    found = minimise(sphere(tau, y, np.full(40, 0.05)))
    np.testing.assert_allclose(found.t, [-0.9, 0.2328], rtol=0, atol=1e-13)
    assert found.chi2 < 1e-24


def test_a_cell_that_was_never_solved_is_refined_all_the_same():
    rng = np.random.default_rng(7)
    tau = np.sort(np.tan(np.radians(rng.uniform(3, 87, 20))))
    problem = sphere(tau, rng.uniform(-1, 1, 20), np.full(20, 0.1))
    quadratic = quadratic_of(PiecewiseBatch(problem))
    whole = branch(problem, quadratic, 8, count_minima=True).member(0)
    worst = np.array([int(np.argmax(whole.values))])
    bounds = np.zeros(whole.bounds.size)  # nothing is known of the other cells
    crippled = SolvedCells(
        whole.values[worst], whole.errors[worst], whole.points[worst], whole.cells[worst], bounds, True
    )
    found = refine(problem, quadratic, crippled)
    assert found.value == pytest.approx(minimise(problem).chi2, rel=1e-9)
    assert found.lowest_bound_elsewhere() >= found.value * (1 - 1e-9)


@pytest.mark.parametrize("closure", ["ifr", "fr"])
@pytest.mark.parametrize("shifted", [False, True])
def test_each_member_of_a_batch_has_the_minimum_it_has_alone(closure, shifted):
    rng = np.random.default_rng(11)
    tau = np.sort(np.tan(np.radians(rng.uniform(3, 87, 30))))
    tau[7] = tau[6]
    problem = sphere(tau, rng.uniform(-1, 1, 30), np.ones(30), closure)
    always = LinearRows.of(rng.normal(size=(2, 2)), rng.normal(size=2))
    batch = PiecewiseBatch(
        replace(problem, always=always),
        rng.integers(0, 4, (40, 30)) * 10.0 ** rng.uniform(0, 4, (40, 30)),
        rng.uniform(0.0, 2.0, (40, 2)),
        rng.normal(0.0, 0.1, (40, 30)) if shifted else None,
        rng.normal(0.0, 0.1, (40, 2)) if shifted else None,
    )
    found = minimise_batch(batch)
    assert found.certified.all()
    for i in range(batch.size):
        alone = minimise(batch.member(i))
        assert found.values[i] == pytest.approx(alone.chi2, rel=1e-9)
        assert batch.member(i).value(found.points[i]) == pytest.approx(alone.chi2, rel=1e-9)
