"""Decomposition over a linking parameter: members against the certified solver, bounds against samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from factories import problem_of
from random_problems import random_problem
from simulated import simulated

from ifrfit.inference.diagnostics.thresholds import GAP
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.decomposition import Decomposition, PiecewiseMember
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.parameter_group import ParameterGroup
from ifrfit.inference.optimize.piecewise import PiecewiseProblem
from ifrfit.inference.optimize.scalar_search import minimum_near, scalar_minima
from ifrfit.inference.optimize.shared_parameter import LinkedGroups, fix_restitution
from ifrfit.inference.optimize.solve import series_groups, whole_group
from ifrfit.physics.rebound import rebound

C, KAPPA = 0, 1
LINKS = {"c": (C, np.linspace(-1.0, -0.4, 25)), "kappa": (KAPPA, np.linspace(0.0, 1.2, 25))}


def group_of(closure: str = "ifr", n: int = 30, sigma: float = 0.05, **choices) -> ParameterGroup:
    """Values of beta at as many angles, with e_n fixed."""
    rng = np.random.default_rng(7)
    gamma = np.linspace(4.0, 86.0, n)
    own = {"ifr": {"e_t": -0.8}, "fr": {"beta0": 0.4}}[closure]
    value = rebound(gamma, e_n=0.9, mu=0.2, closure=closure, degrees=True, **own).beta
    value = value + rng.normal(0.0, sigma, n)
    fix = {"e_n": 0.9, **choices.pop("fix", {})}
    problem = problem_of(simulated("beta", gamma, value, sigma), closure, noise="known", fix=fix, **choices)
    return whole_group(problem, problem.noise.sigma)


def without_prior(group: ParameterGroup, unknown: int) -> ParameterGroup:
    """Priors of the linking parameter are counted once, in the first member."""
    if unknown == C:
        return replace(group, c=replace(group.c, prior=None))
    return replace(group, mu=replace(group.mu, prior=None))


def with_fixed(group: ParameterGroup, unknown: int, x: float) -> ParameterGroup:
    if unknown == C:
        return replace(group, c=replace(group.c, fixed=x))
    return replace(group, mu=replace(group.mu, fixed=x / (1.0 + group.e_n.fixed)))


def members_of_random_problems(number: int) -> list[tuple[PiecewiseMember, float, float]]:
    """Members along c or kappa of random groups, and a range of the linking parameter."""
    found = []
    for child in np.random.SeedSequence(20230107).spawn(20 * number):
        rng = np.random.default_rng(child)
        problem = random_problem(rng)
        if problem.closure.constant is None or problem.parameters["e_n"].fixed is None:
            continue
        groups = series_groups(problem, problem.noise.sigma)
        name = str(rng.choice([problem.closure.constant, "mu"]))
        linked = LinkedGroups.of(groups, name, None)
        found += [
            (m, linked.decomposition.low, linked.decomposition.high) for m in linked.decomposition.members
        ]
        if len(found) >= number:
            break
    return found[:number]


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize(
    ("closure", "choices"),
    [
        ("ifr", {}),
        ("fr", {}),
        ("ifr", {"prior": {"mu": (0.25, 0.02)}}),
        ("ifr", {"prior": {"e_t": (-0.7, 0.02)}}),
        ("ifr", {"bounds": {"mu": (0.15, 0.19)}}),
        ("ifr", {"sigma": 1e-7}),
    ],
)
def test_a_member_has_the_values_of_the_certified_solver(closure, choices, link):
    unknown, x = LINKS[link]
    group = without_prior(group_of(closure, **choices), unknown)
    if unknown == C and closure == "fr":
        x = x + 1.2
    if "bounds" in choices and unknown == KAPPA:
        x = np.linspace(0.15, 0.19, 25) * 1.9
    member = PiecewiseMember(kappa_form(group).problem, unknown)
    expected = [minimise(kappa_form(with_fixed(group, unknown, each)).problem).chi2 for each in x.tolist()]
    np.testing.assert_allclose(member.profile(x)[0], expected, rtol=1e-8)
    np.testing.assert_allclose([member.value(each) for each in x.tolist()], expected, rtol=1e-9)


@pytest.mark.parametrize(("link", "fixed"), [("c", {"mu": 0.2}), ("kappa", {"e_t": -0.8})])
def test_a_member_with_one_unknown(link, fixed):
    unknown, x = LINKS[link]
    group = group_of(fix=fixed)
    member = PiecewiseMember(kappa_form(group).problem, 0)
    expected = [minimise(kappa_form(with_fixed(group, unknown, each)).problem).chi2 for each in x.tolist()]
    np.testing.assert_allclose(member.profile(x)[0], expected, rtol=1e-8)
    np.testing.assert_allclose([member.value(each) for each in x.tolist()], expected, rtol=1e-9)
    assert member.minimiser(0.5).tolist() == [0.5]


@pytest.mark.parametrize("link", LINKS)
def test_the_slope_is_the_derivative_between_kinks(link):
    unknown, x = LINKS[link]
    group = group_of()
    member = PiecewiseMember(kappa_form(group).problem, unknown)
    step = 1e-6
    numeric = (member.profile(x[1:-1] + step)[0] - member.profile(x[1:-1] - step)[0]) / (2.0 * step)
    close = np.isclose(member.profile(x[1:-1])[1], numeric, rtol=1e-4, atol=1e-2)
    # where the other unknown lies on a kink that moves with the linking one, the slope is one side's
    c, kappa = np.array([member.minimiser(each) for each in x[1:-1].tolist()]).T
    linear = group.coefficients
    tau = kappa / (linear.b0 + linear.b1 * c)
    free = np.abs(tau[:, None] - group.rows.tau).min(axis=1) > 1e-6
    assert free.sum() > 5
    assert close[free].all()


def test_many_rows_take_no_more_memory_at_once(monkeypatch):
    unknown, x = LINKS["c"]
    member = PiecewiseMember(kappa_form(group_of()).problem, unknown)
    whole = member.profile(x)
    monkeypatch.setattr("ifrfit.inference.optimize.piecewise_profile._AT_ONCE", 1)
    np.testing.assert_array_equal(whole, member.profile(x))


def test_no_value_of_a_random_member_lies_below_its_bound_with_any_multiplier():
    rng = np.random.default_rng(3)
    members = members_of_random_problems(40)
    assert len(members) == 40
    for member, low, high in members:
        first, last = np.sort(rng.uniform(low, high, 2))
        x = np.linspace(first, last, 9)
        value, slope = member.profile(x)
        for multiplier in (0.0, -float(slope[4]), float(rng.normal(0.0, 1.0 + abs(slope[4])))):
            bound = member.lower_bound(float(first), float(last), multiplier)
            total = value + multiplier * x
            size = 1e-9 * (1.0 + np.abs(value).max() + np.abs(multiplier * x).max())
            assert total.min() >= bound - size
            # over a point there is nothing to lose
            middle = float(x[4])
            at_point = member.lower_bound(middle, middle, multiplier)
            assert at_point == pytest.approx(total[4], rel=1e-6, abs=1e-6 * (1.0 + abs(value[4])))


def linked_random_problems(number: int) -> list[Decomposition]:
    """Random fits of two or three series that share one parameter, with a prior on it or none."""
    found = []
    for child in np.random.SeedSequence(20230109).spawn(20 * number):
        rng = np.random.default_rng(child)
        problem = random_problem(rng)
        closure = problem.closure
        fixed = problem.parameters["e_n"].fixed
        if closure.constant is None or fixed is None or len(problem.observations.table) < 6:
            continue
        table = problem.observations.table.copy()
        table["series"] = [f"s{i % int(rng.integers(2, 4))}" for i in range(len(table))]
        separate, shared = (("mu",), closure.constant) if rng.random() < 0.5 else ((closure.constant,), "mu")
        problem = problem_of(
            table, closure.name, noise="known", inertia_factor=problem.inertia_factor, fix={"e_n": fixed},
            separate=separate,
        )  # fmt: skip
        groups, _ = fix_restitution(
            series_groups(problem, problem.noise.sigma), whole_group(problem, problem.noise.sigma)
        )
        prior = (float(rng.uniform(0.0, 0.5)), 0.1) if rng.random() < 0.3 else None
        found.append(LinkedGroups.of(groups, shared, prior).decomposition)
        if len(found) == number:
            break
    return found


@pytest.mark.parametrize(("number", "samples"), [(6, 80), pytest.param(25, 400, marks=pytest.mark.long)])
def test_random_decompositions_are_certified_and_no_sample_lies_lower(number, samples):
    linked = linked_random_problems(number)
    assert len(linked) == number
    certified = 0
    for total in linked:
        found = total.minimise()
        least = found.minima[0][0]
        assert found.gap >= 0.0
        certified += found.gap <= GAP * max(1.0, least)
        sample = total.profile(np.linspace(total.low, total.high, samples))
        assert least <= sample.min() + 1e-7 * (1.0 + abs(least))
        assert found.bound <= least + 1e-9 * (1.0 + abs(least))
    assert certified >= 0.92 * number


def test_a_bound_over_the_wrong_interval_is_caught():
    """Negative control: bounds of half the domain do not hold for the whole."""
    broken = 0
    for total in linked_random_problems(18):
        middle = 0.5 * (total.low + total.high)
        bound = total.lower_bound(middle, total.high, middle)
        broken += total.profile(np.linspace(total.low, middle, 200)).min() < bound - 1e-6
    assert broken >= 3


def test_an_interval_narrows_the_domain_and_never_widens_it():
    problem: PiecewiseProblem = kappa_form(group_of(bounds={"mu": (0.15, 0.19)})).problem
    assert problem.interval(KAPPA) == pytest.approx((0.15 * 1.9, 0.19 * 1.9))
    member = PiecewiseMember(problem, KAPPA)
    assert member.lower_bound(-5.0, 5.0, 0.0) == pytest.approx(minimise(problem).chi2, rel=1e-12)
    inside = minimise(problem.within(KAPPA, 0.30, 0.31))
    assert 0.30 - 1e-12 <= inside.t[KAPPA] <= 0.31 + 1e-12


def test_all_dips_of_a_function_are_found_best_first():
    found = scalar_minima(lambda x: np.cos(4.0 * x) + 0.1 * x, 0.0, 6.0)
    exact = [(np.pi + np.arcsin(0.025) + 2.0 * np.pi * k) / 4.0 - np.arcsin(0.025) / 2.0 for k in range(4)]
    np.testing.assert_allclose([x for _, x in found], exact, atol=1e-6)
    assert [value for value, _ in found] == sorted(value for value, _ in found)


def test_a_minimum_far_from_the_start_is_found_on_the_grid():
    value, x = minimum_near(lambda x: (x - 0.9) ** 2, 0.1, 0.0, 1.0)
    assert (value, x) == pytest.approx((0.0, 0.9), abs=1e-8)
    assert minimum_near(lambda x: x, 0.5, 0.5, 0.5) == (0.5, 0.5)
