"""Profiles by the batched search are those of the certified methods, and of a dense grid."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from factories import impacts_file, problem_of, rest_long

from ifrfit.data import read
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.profile.curve import ProfileCurve
from ifrfit.inference.profile.objective import Misfit, limit
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.inference.profile.quantities import entry, kappa, transition_tau
from ifrfit.inference.profile.searched_profile import SearchedProfile

GAMMA = np.linspace(5.0, 75.0, 14)


def fitted(folder, closure, observables=("beta", "e_n"), noise=None, **choices):
    sigma = None if noise == "unknown" else 0.03
    c = {"fr": 0.3, "ifr": -0.8}[closure]
    path = impacts_file(folder / "t.csv", {"gamma": GAMMA, "observables": observables, "closure": closure,
                                           "c": c, "noise": 0.03, "sigma": sigma, "seed": 3})  # fmt: skip
    problem = problem_of(read(path), closure, noise=noise, **choices)
    fit = least_squares(problem)
    return problem, fit, Misfit.of(problem, fit)


@pytest.mark.parametrize("closure", ["ifr", "fr"])
@pytest.mark.parametrize("noise", rest_long(("unknown", None)))
def test_entries_are_those_of_the_certified_method(tmp_path, closure, noise) -> None:
    problem, fit, misfit = fitted(tmp_path, closure, noise=noise)
    for place, theta in enumerate(fit.optimum.theta.tolist()):
        quantity = entry(problem, fit, place)
        sd = np.sqrt(fit.gaussian.variance(quantity.functional, quantity.domain.prior_sd))
        values = theta + sd * np.array([-2.0, -1.0, 0.5, 1.5])
        searched = SearchedProfile(misfit, quantity.constraint, theta)
        found = searched(np.array(values))
        assert not searched.unconverged
        for value, rise in zip(values.tolist(), found.tolist(), strict=True):
            assert rise == pytest.approx(in_turn(misfit, {quantity.name: value}), abs=2e-6)


def in_turn(misfit: Misfit, held) -> float:
    """Rise where certified fits with constants held and the noises that they leave come to rest."""
    theta, problem = misfit.fit.optimum.theta, misfit.problem.with_fixed(held)
    for _ in range(60):
        sigma = misfit.search.base.copy()
        residual = (misfit.problem.rows.value - misfit.problem.predict(theta)) / misfit.search.base
        for number, rows in enumerate(misfit.search.groups):
            sigma[rows] *= np.sqrt(residual[rows] @ residual[rows] / misfit.modes[0].dof[number])
        theta = solve(problem, sigma).theta
    return misfit.rise(theta)


def test_kappa_is_that_of_the_certified_method(tmp_path) -> None:
    problem, fit, misfit = fitted(tmp_path, "fr")
    quantity = kappa(problem, fit, 0)
    at = quantity.of(fit.optimum.theta)
    searched = SearchedProfile(misfit, quantity.constraint, at)
    values = at * np.array([0.9, 0.97, 1.05, 1.1])
    for value, rise in zip(values.tolist(), searched(values).tolist(), strict=True):
        # rows of e_n alone know e_n
        held = {"e_n": fit.optimum.theta[0], "mu": value / (1.0 + fit.optimum.theta[0])}
        theta = solve(problem.with_fixed(held), fit.sigma).theta
        assert rise == pytest.approx(misfit.rise(theta), abs=1e-7)


def test_the_transition_is_that_of_a_dense_grid(tmp_path) -> None:
    problem, fit, misfit = fitted(tmp_path, "fr", fix={"e_n": 0.94}, observables=("beta", "delta_deg"))
    quantity = transition_tau(problem, fit, 0)
    at = quantity.of(fit.optimum.theta)
    searched = SearchedProfile(misfit, quantity.constraint, at)
    values = at * np.array([0.85, 0.95, 1.1, 1.3])
    c = np.linspace(-1.0, 1.0, 4001)
    law = problem.closure.law(problem.inertia_factor)
    for value, rise in zip(values.tolist(), searched(values).tolist(), strict=True):
        theta = np.column_stack((np.full(c.size, 0.94), c, value * law.bound(c) / 1.94))
        grid = float(misfit.rises(theta).min())
        assert rise <= grid + 1e-9
        assert rise == pytest.approx(grid, rel=1e-4, abs=1e-3)


def test_rises_of_many_are_those_of_one(tmp_path) -> None:
    for noise in (None, "unknown"):
        _, fit, misfit = fitted(tmp_path, "ifr", noise=noise)
        thetas = fit.optimum.theta * np.linspace(0.9, 1.0, 5)[:, None]
        assert misfit.rises(thetas) == pytest.approx([misfit.rise(theta) for theta in thetas], rel=1e-12)


def test_series_that_share_all_constants_have_one_transition(tmp_path) -> None:
    parts = [{"gamma": GAMMA, "closure": "fr", "c": 0.3, "noise": 0.03, "sigma": 0.03, "series": name,
              "seed": seed} for seed, name in enumerate("ab")]  # fmt: skip
    problem = problem_of(read(impacts_file(tmp_path / "t.csv", *parts)), "fr", fix={"e_n": 0.94})
    found = profile_all(problem, least_squares(problem), curves=False)
    first, second = (found[f"transition_angle_deg[{name}]"] for name in "ab")
    assert (first.value, first.interval95) == (second.value, second.interval95)


def test_places_are_looked_at_together() -> None:
    calls = []

    def rise(x):
        calls.append(x.size)
        return np.minimum((x - 0.3) ** 2 / 0.02**2, 1.5 + (x - 0.7) ** 2 / 0.01**2)

    limits = [limit(0.68), limit(0.95), limit(0.997)]
    curve = ProfileCurve(rise, 0.0, 1.0)
    curve.explore([0.3, 0.7], 0.015, limit(0.997))
    curve.cross(limits)
    for each in limits:
        expected = [(0.3, 0.02 * np.sqrt(each))]
        expected += [(0.7, 0.01 * np.sqrt(each - 1.5))] if each > 1.5 else []
        assert np.array(curve.pieces(each)) == pytest.approx(
            np.array([(at - half, at + half) for at, half in expected]), abs=1e-9
        )
    # far fewer calls than places
    assert len(calls) < 0.3 * sum(calls)


def test_many_places_take_no_array_of_places_by_rows(tmp_path) -> None:
    gamma = np.linspace(5.0, 75.0, 2000)
    path = impacts_file(tmp_path / "t.csv", {"gamma": gamma, "observables": ("beta",), "closure": "ifr",
                                             "c": -1.0, "mu": 2.0, "noise": 0.02, "seed": 1})  # fmt: skip
    problem = problem_of(read(path), "ifr", noise="unknown")
    misfit = Misfit.of(problem, least_squares(problem))
    thetas = np.linspace(1.0, 0.9, 4000)[:, None] * misfit.fit.optimum.theta
    one = 8 * len(thetas) * len(problem.rows)  # bytes
    for looked_at in (
        misfit.rises,
        misfit.dof_at,
        lambda places: misfit.search.lowest(places, misfit.modes[0].dof, 8),
    ):
        tracemalloc.start()
        looked_at(thetas)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < one
