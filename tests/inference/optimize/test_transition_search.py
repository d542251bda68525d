"""The search by intervals of tau finds, proves and counts what the general branch and bound does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from factories import problem_of
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import simulated

import ifrfit
from ifrfit.inference.optimize import impulse_rows, transition_cells, transition_search
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.impulse_rows import ImpulseRows
from ifrfit.inference.optimize.impulse_sums import ImpulseSums
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.parameter_group import ParameterGroup
from ifrfit.inference.optimize.piecewise import PiecewiseBatch
from ifrfit.inference.optimize.piecewise_quadratic import quadratic_of
from ifrfit.inference.optimize.solve import solve, whole_group
from ifrfit.inference.optimize.transition_cells import lowest_anywhere, value_at
from ifrfit.inference.optimize.transition_search import least_chi2, transition_optimum
from ifrfit.physics.closures import get_closure

J = 0.4


def group_of(
    seed: int,
    n: int,
    closure: str = "ifr",
    observable: str = "beta",
    angles: str = "free",
    sigma: float = 0.05,
    misfit: float = 1.0,
    prior: tuple[str, ...] = (),
) -> ParameterGroup:
    """A group whose e_n is known, of random constants."""
    rng = np.random.default_rng(seed)
    low, high = sorted(rng.uniform(1.0, 89.0, 2))
    gamma = rng.uniform(low, high + 0.5, n)
    gamma = {"free": gamma, "rounded": np.ceil(gamma), "repeated": rng.choice(gamma, n)}[angles]
    if observable == "mu_app":  # which has no value at 90 degrees
        gamma = np.minimum(gamma, 89.0)
    own = get_closure(closure)
    e_n, mu, c = rng.uniform(0.3, 1.0), 10.0 ** rng.uniform(-2.0, 0.0), rng.uniform(*own.domain(J))
    constants = {"e_n": e_n, "mu": mu, str(own.constant): c}
    state = ifrfit.rebound(gamma, closure=closure, degrees=True, **constants)
    noise = sigma * 10.0 ** rng.uniform(-0.5, 0.5, n)
    value = getattr(state, observable) + misfit * noise * rng.standard_normal(n)
    data = simulated(np.repeat(observable, n), gamma, value, noise)
    names = {"own": str(own.constant), "mu": "mu"}
    priors = {names[which]: (constants[names[which]], 0.05) for which in prior}
    problem = problem_of(data, closure, fix={"e_n": e_n}, prior=priors)
    return whole_group(problem, problem.noise.sigma)


@st.composite
def groups(draw: st.DrawFn) -> ParameterGroup:
    return group_of(
        draw(st.integers(0, 2**32 - 1)),
        draw(st.integers(1, 150)),
        draw(st.sampled_from(["ifr", "fr"])),
        draw(st.sampled_from(["beta", "v_x", "mu_app"])),
        draw(st.sampled_from(["free", "rounded", "repeated"])),
        10.0 ** draw(st.floats(-5.0, 0.0)),
        10.0 ** draw(st.floats(-1.0, 1.0)),
        tuple(draw(st.sets(st.sampled_from(["own", "mu"])))),
    )


@settings(max_examples=120, deadline=None)
@given(groups(), st.booleans())
def test_the_same_optimum_gap_and_minima_as_branch_and_bound(group: ParameterGroup, by_bins: bool) -> None:
    rows = ImpulseRows.of(group)
    assert rows is not None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(transition_search, "_FEW", 20 if by_bins else 2000)
        found = transition_optimum(rows)
        least = least_chi2(group)
    expected = minimise(kappa_form(group).problem)
    tolerance = 1e-9 * max(1.0, expected.chi2)
    if least is not None:
        assert least == pytest.approx(expected.chi2, abs=tolerance)
    if found is None:  # in doubt: left to branch and bound
        return
    assert found.chi2 == pytest.approx(expected.chi2, abs=tolerance)
    assert found.gap == pytest.approx(expected.gap, abs=tolerance)
    np.testing.assert_allclose(found.t, expected.t, rtol=1e-9, atol=1e-10)
    assert len(found.optima) == len(expected.optima)
    for (value, t), (other, at) in zip(found.optima, expected.optima, strict=True):
        # that of others comes from sums, in the general search less precise ones: the rows themselves judge
        assert value == pytest.approx(rows.chi2(*t.tolist()), abs=1e-7 * max(1.0, value))
        assert value == pytest.approx(other, abs=1e-5 * max(1.0, value))
        np.testing.assert_allclose(t, at, rtol=1e-6, atol=1e-7)
    # several cells may share an end: which of them is named does not matter
    for unknown in (0, 1):
        for end in (unknown, 2 + unknown):
            assert found.extremes[end, unknown] == pytest.approx(expected.extremes[end, unknown], abs=1e-7)
    assert (found.all_slide, found.all_stick) == (expected.all_slide, expected.all_stick)


@pytest.mark.parametrize("closure", ["ifr", "fr"])
def test_many_rows_are_searched_by_intervals_without_a_doubt(closure: str) -> None:
    # FR: the transition lies on a line in (c, kappa), not at one kappa
    group = group_of(5, 6000, closure, sigma=0.3)
    rows = ImpulseRows.of(group)
    assert rows is not None
    found, expected = transition_optimum(rows), minimise(kappa_form(group).problem)
    assert found is not None
    assert found.chi2 == pytest.approx(expected.chi2, rel=1e-12)
    assert found.gap == expected.gap == 0.0
    np.testing.assert_allclose(found.t, expected.t, rtol=1e-9)


@pytest.mark.parametrize("closure", ["ifr", "fr"])
@pytest.mark.parametrize("n", [80, 6000])
def test_noise_far_below_the_values_is_summed_about_the_best_point(closure: str, n: int) -> None:
    # chi2 is some n, its terms are 1e9 times larger about the middle of the domain
    group = group_of(5, n, closure, sigma=2e-5, prior=("own", "mu"))
    rows = ImpulseRows.of(group)
    assert rows is not None
    found, expected = transition_optimum(rows), minimise(kappa_form(group).problem)
    assert found is not None
    assert found.chi2 == pytest.approx(expected.chi2, rel=1e-9)
    assert found.gap <= 1e-9 * expected.chi2
    np.testing.assert_allclose(found.t, expected.t, rtol=1e-11)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["ifr", "fr"]), st.floats(-6.0, 0.0), st.booleans())
def test_rows_that_are_alike_are_searched_as_any(seed: int, closure: str, sigma: float, beside: bool) -> None:
    """Also about the best point, where the noise is small; also with rows of e_n beside them."""
    group = group_of(seed, 150, closure, sigma=10.0**sigma)
    group = replace(group, sigma=np.full(150, 10.0**sigma))
    if beside:
        rng = np.random.default_rng(seed)
        observable, rows = np.where(rng.random(150) < 0.3, "e_n", "beta"), group.rows
        data = simulated(observable, rows.gamma_deg, rows.value, group.sigma)
        problem = problem_of(data, closure)
        group = whole_group(problem, problem.noise.sigma)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(impulse_rows, "_BLOCK", 40)
        patch.setattr(transition_search, "_FEW", 20)
        measured = ImpulseRows.of(group)
        assert measured is not None
        assert measured.alike is not None
        assert measured.alike.sigma == group.sigma[0]
        found, least = [], []
        for each in (measured, replace(measured, alike=None)):
            found.append(transition_optimum(each))
            least.append(each.chi2(0.5 * sum(each.domain), 0.3))
    np.testing.assert_allclose(least[0], least[1], rtol=1e-11)
    alike, other = found
    assert (alike is None) == (other is None)
    if alike is not None and other is not None:
        assert alike.chi2 == pytest.approx(other.chi2, abs=1e-9 * max(1.0, other.chi2))
        np.testing.assert_allclose(alike.t, other.t, rtol=1e-9, atol=1e-10)
        assert len(alike.optima) == len(other.optima)


def test_rows_of_another_slope_or_sigma_are_not_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(impulse_rows, "_BLOCK", 40)
    for observable, one_sigma, alike in (("beta", True, True), ("beta", False, False), ("v_x", True, False)):
        group = group_of(7, 100, observable=observable)
        group = replace(group, sigma=np.full(100, 0.1)) if one_sigma else group
        rows = ImpulseRows.of(group)
        assert rows is not None
        assert (rows.alike is not None) == alike


def test_one_number_in_each_row_is_not_one_number_in_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a single row numpy gives what was broadcast no strides, whether it repeats a number or not."""
    monkeypatch.setattr(impulse_rows, "_BLOCK", 40)
    group = group_of(7, 100)
    rows = ImpulseRows.of(replace(group, sigma=np.full(100, 0.1)))
    assert rows is not None
    beta = rows.parts[0][0]
    for linear, alike in (
        (lambda i, j: (np.broadcast_to(i.sine, i.sine.shape), 2.0), None),
        (lambda i, j: (-1.0, np.broadcast_to(i.sine, i.sine.shape)), None),
        (lambda i, j: (-1.0, 0.0), None),
        (lambda i, j: (-1.0, 2.0), (-1.0, 2.0, 0.1)),
    ):
        own = replace(rows, parts=((replace(beta, linear=linear), 1.0),), alike=None)  # type: ignore[arg-type]
        assert own._find_alike() == alike


def test_sums_about_any_point_make_the_same_chi2() -> None:
    group = group_of(3, 60, "fr", sigma=0.2, prior=("own", "mu"))
    rows = ImpulseRows.of(group)
    assert rows is not None
    about_middle = ImpulseSums.of(rows)
    cells = about_middle.all_cells()
    for c, kappa in ((0.1, 0.2), (-0.2, 0.05)):
        moved = about_middle.about(about_middle.c + c, kappa)
        others = moved.all_cells()
        np.testing.assert_array_equal(others.n_stick, cells.n_stick)
        for at_c, at_kappa in ((0.0, 0.1), (0.3, 0.4)):
            there = at_c - moved.c, at_kappa - moved.kappa
            here = at_c - about_middle.c, at_kappa
            np.testing.assert_allclose(value_at(others.form, *there), value_at(cells.form, *here), rtol=1e-10)


def test_two_optima_far_apart_are_runs_of_intervals_of_their_own() -> None:
    # half of the rows slide at one mu, half at another, at angles that do not overlap
    rng = np.random.default_rng(4)
    gamma = np.concatenate((rng.uniform(20.0, 30.0, 300), rng.uniform(60.0, 70.0, 300)))
    mu = np.repeat([0.06, 0.35], 300)
    value = np.concatenate(
        [
            ifrfit.rebound(g, e_n=0.9, e_t=-0.8, mu=m, degrees=True).beta
            for g, m in ((gamma[:300], 0.06), (gamma[300:], 0.35))
        ]
    )
    assert mu.size == value.size
    data = simulated(np.repeat("beta", 600), gamma, value + rng.normal(0.0, 0.3, 600), np.full(600, 6.0))
    problem = problem_of(data, fix={"e_n": 0.9})
    group = whole_group(problem, problem.noise.sigma)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(transition_search, "_FEW", 20)
        found = transition_optimum(ImpulseRows.of(group))  # type: ignore[arg-type]
    expected = minimise(kappa_form(group).problem)
    assert found is not None
    assert len(found.optima) == len(expected.optima)
    assert found.chi2 == pytest.approx(expected.chi2, rel=1e-10)


def test_nothing_lies_below_the_bound_of_an_interval() -> None:
    """The bound of an interval against chi2 at places whose transition lies within it."""
    group = group_of(11, 3000, "fr", sigma=0.2)
    rows = ImpulseRows.of(group)
    assert rows is not None
    sums = ImpulseSums.of(rows)
    assert rows.slip_intervals is not None
    bins = transition_search._Bins.of(sums, rows.slip_intervals)
    m = bins.intervals.count.size
    outside = np.zeros((9, m + 1))
    outside[:3, 1:] = bins.sums[:3].cumsum(axis=1)
    outside[3:, :-1] = bins.sums[:, ::-1].cumsum(axis=1)[:, ::-1]
    bounds = transition_search._lowest_in_bins(sums, bins, outside, float(m))
    rng = np.random.default_rng(0)
    law = rows.law
    for c in np.linspace(*rows.domain, 15):
        for tau in np.concatenate((rng.choice(rows.tau, 20), rng.uniform(0.0, 1.1 * rows.tau.max(), 20))):
            value = rows.chi2(float(c), float(tau * (law.b0 + law.b1 * c)))
            number = min(int(np.searchsorted(bins.intervals.edges, tau, side="right")) - 1, m - 1)
            assert bounds[number] <= value * (1.0 + 1e-12)
    # and it is worth something: few intervals are left for their rows
    assert (bounds <= rows.chi2(*transition_optimum(rows).t.tolist()) + 4.0).sum() < 0.25 * m  # type: ignore[union-attr]


def test_where_the_sums_keep_no_digit_and_no_interval_is_left_the_general_code_answers() -> None:
    """Angles within 1e-8 degrees of 0 and 90, and one sigma far below the others, do so."""
    group = group_of(11, 3000, "fr", sigma=0.2)
    rows = ImpulseRows.of(group)
    assert rows is not None
    assert transition_optimum(rows) is not None
    bounds = transition_search._lowest_in_bins
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(transition_search, "_lowest_in_bins", lambda *given: bounds(*given) + 1e6)
        assert transition_optimum(rows) is None
        assert least_chi2(group) is None


def test_what_e_n_alone_decides_is_added() -> None:
    rng = np.random.default_rng(2)
    gamma = rng.uniform(10.0, 80.0, 60)
    state = ifrfit.rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True)
    value = np.concatenate((state.beta, state.v_n)) + rng.normal(0.0, 0.05, 120)
    data = simulated(np.repeat(["beta", "v_n"], 60), np.tile(gamma, 2), value, np.full(120, 0.05))
    problem = problem_of(data)
    group = whole_group(problem, problem.noise.sigma)
    found = solve(problem, problem.noise.sigma)
    # e_n by hand: a straight line through the origin
    cosine = np.cos(np.radians(gamma))
    assert found.theta[0] == pytest.approx(float(cosine @ value[60:] / (cosine @ cosine)), rel=1e-12)
    held = replace(group, e_n=replace(group.e_n, fixed=float(found.theta[0])))
    assert found.objective == pytest.approx(minimise(kappa_form(held).problem).chi2, rel=1e-10)
    assert found.certified


@settings(max_examples=60, deadline=None)
@given(groups())
def test_every_cell_has_the_minimum_of_the_general_solution(group: ParameterGroup) -> None:
    """Also cells that no search would look at: a free minimum far outside, beyond ends of the domain."""
    rows = ImpulseRows.of(group)
    assert rows is not None
    cells = ImpulseSums.of(rows).all_cells()
    problem = kappa_form(group).problem.sorted_by_tau()
    quadratic = quadratic_of(PiecewiseBatch(problem))
    np.testing.assert_array_equal(cells.n_stick, quadratic.n_stick)
    every = np.arange(cells.n_stick.size)
    found, expected = cells.minima(every), quadratic.minima(problem, every)
    _, doubtful = lowest_anywhere(cells.form, cells.size, cells.rounding)
    assert found.values.shape == expected.values.shape
    off = np.abs(found.values - expected.values)
    allowed = 10.0 * (found.errors + expected.errors) + 1e-9 * (1.0 + np.abs(expected.values))
    assert (off <= allowed)[~doubtful].all()


@settings(max_examples=60, deadline=None)
@given(groups())
def test_few_cells_and_many_are_solved_alike(group: ParameterGroup) -> None:
    rows = ImpulseRows.of(group)
    assert rows is not None
    cells, found = ImpulseSums.of(rows).all_cells(), []
    for few in (0, 1000):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(transition_cells, "_FEW", few)
            found.append(cells.solved((rows.domain[0], 0.25)))
    many, all_solved = found
    np.testing.assert_array_equal(all_solved.cells, np.arange(cells.n_stick.size))
    np.testing.assert_array_equal(many.cells[many.near], all_solved.cells[all_solved.near])
    np.testing.assert_array_equal(many.values, all_solved.values[many.cells])
    np.testing.assert_array_equal(many.points, all_solved.points[many.cells])
    assert (all_solved.bounds <= np.maximum(all_solved.values, 0.0)).all()  # chi2 is no less


@settings(max_examples=60, deadline=None)
@given(groups())
def test_a_value_that_is_met_is_chi2_at_some_place(group: ParameterGroup) -> None:
    """Of every cell, not of the lowest alone: what were no chi2 would exclude the optimum."""
    rows = ImpulseRows.of(group)
    assert rows is not None
    cells = ImpulseSums.of(rows).all_cells()
    every = cells.minima(np.arange(cells.n_stick.size))
    best = every.values.argmin()
    least = every.values[best] - 2.0 * every.errors[best] - 1e-9 * (1.0 + every.values[best])
    met = [cells._met_near(cell) for cell in range(cells.n_stick.size)]
    assert min(met) >= least
    assert cells._met_on_walls() >= least


def test_what_is_left_alone_lies_above_a_value_that_is_met(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transition_cells, "_FEW", 100)
    group = group_of(4, 400, "fr", sigma=0.02)
    rows = ImpulseRows.of(group)
    assert rows is not None
    cells = ImpulseSums.of(rows).all_cells()
    found, every = cells.solved(), cells.minima(np.arange(cells.n_stick.size))
    assert found.cells.size < 0.5 * cells.n_stick.size
    assert found.value == every.values.min()
    alone = np.setdiff1d(np.arange(cells.n_stick.size), found.cells)
    assert (found.bounds[alone] > found.value + 4.0).all()
    assert (found.bounds <= every.values).all()
