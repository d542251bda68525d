"""A series along a shared value in closed form: the same minima as the certified solver's, value by value."""

from dataclasses import replace

import numpy as np
import pytest

from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.parameters import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.optimize.lagrangian_bound import KAPPA, C, constants_at
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.parameter_group import Block
from ifrfit.inference.optimize.piecewise import minimise
from ifrfit.inference.optimize.series_profile import Along
from ifrfit.inference.optimize.solve import whole_block
from ifrfit.physics.closures import get_closure
from ifrfit.physics.rebound import rebound

SHARED = {"c": (C, np.linspace(-1.0, -0.4, 25)), "kappa": (KAPPA, np.linspace(0.0, 1.2, 25))}


def block_of(closure: str = "ifr", n: int = 30, sigma: float = 0.05, **choices) -> Block:
    """Values of beta at as many angles, with e_n held."""
    rng = np.random.default_rng(7)
    gamma = np.linspace(4.0, 86.0, n)
    own = {"ifr": {"e_t": -0.8}, "fr": {"beta0": 0.4}}[closure]
    value = rebound(gamma, e_n=0.9, mu=0.2, closure=closure, degrees=True, **own).beta
    value = value + rng.normal(0.0, sigma, n)
    columns = {"series": "a", "observable": "beta", "gamma_deg": gamma, "value": value}
    table = make_table({**columns, "sigma": np.full(n, sigma)})
    chosen = get_closure(closure)
    constants = make_parameters(chosen, 0.4, fix={"e_n": 0.9, **choices.pop("fix", {})}, **choices)
    problem = make_problem(Observations(table), chosen, 0.4, constants, "known")
    return whole_block(problem, problem.noise.sigma)


def without_prior(block: Block, place: int) -> Block:
    """The prior of a shared constant is in no series."""
    if place == C:
        return replace(block, c=replace(block.c, prior=None))
    return replace(block, mu=replace(block.mu, prior=None))


def held(block: Block, place: int, x: float) -> Block:
    if place == C:
        return replace(block, c=replace(block.c, fixed=x))
    return replace(block, mu=replace(block.mu, fixed=x / (1.0 + block.e_n.fixed)))


@pytest.mark.parametrize("shared", SHARED)
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
def test_values_are_those_of_the_certified_solver(closure, choices, shared):
    place, x = SHARED[shared]
    block = without_prior(block_of(closure, **choices), place)
    if place == C and closure == "fr":
        x = x + 1.2
    if "bounds" in choices and place == KAPPA:
        x = np.linspace(0.15, 0.19, 25) * 1.9
    value, _ = Along(block, 0 if place == C else 1)(x)
    expected = [minimise(kappa_form(held(block, place, float(each))).problem).chi2 for each in x]
    np.testing.assert_allclose(value, expected, rtol=1e-8)


@pytest.mark.parametrize(("place", "fixed"), [(C, {"mu": 0.2}), (KAPPA, {"e_t": -0.8})])
def test_nothing_else_to_choose(place, fixed):
    block = block_of(fix=fixed)
    x = SHARED["c" if place == C else "kappa"][1]
    value, _ = Along(block, 0)(x)
    expected = [minimise(kappa_form(held(block, place, float(each))).problem).chi2 for each in x]
    np.testing.assert_allclose(value, expected, rtol=1e-8)


@pytest.mark.parametrize("shared", SHARED)
def test_slope_is_the_derivative_between_kinks(shared):
    block = block_of()
    place, x = SHARED[shared]
    along = Along(block, 0 if place == C else 1)
    step = 1e-6
    numeric = (along(x[1:-1] + step)[0] - along(x[1:-1] - step)[0]) / (2.0 * step)
    close = np.isclose(along(x[1:-1])[1], numeric, rtol=1e-4, atol=1e-2)
    # where the other unknown stands on a kink that moves with the shared value, the slope is one side's
    on_kink = [constants_at(block, place, float(each)) for each in x[1:-1]]
    linear = block.coefficients
    tau = np.array([mu * (1.0 + e) / (linear.b0 + linear.b1 * c) for e, c, mu in on_kink])
    free = np.abs(tau[:, None] - block.rows.tau).min(axis=1) > 1e-6
    assert free.sum() > 5
    assert close[free].all()


def test_many_rows_take_no_more_memory_at_once(monkeypatch):
    block = block_of()
    x = SHARED["c"][1]
    whole = Along(block, 0)(x)
    monkeypatch.setattr("ifrfit.inference.optimize.series_profile._AT_ONCE", 1)
    parts = Along(block, 0)(x)
    np.testing.assert_array_equal(whole, parts)
