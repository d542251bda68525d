"""The batched search finds what independent methods find, on kinks and at bounds too, or says it failed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from factories import impacts_file, own_constant, problem_of
from scipy.optimize import least_squares as scipy_least_squares
from scipy.optimize import minimize
from strangers import draw

from ifrfit.data import read
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.aitken import StepsBefore
from ifrfit.inference.optimize.batched_search import BatchedSearch
from ifrfit.inference.optimize.kinked_quadratic import KinkedQuadratic
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.multistart import multistart, starts
from ifrfit.inference.optimize.search_objective import FollowingMu
from ifrfit.inference.optimize.solve import solve
from ifrfit.physics import CLOSURES

NO_NOISE = np.empty(0)
CURVED = ("beta", "delta_deg", "beta_tot")


def problem_at_random(
    folder: Path,
    seed: int,
    closure: str,
    observables: tuple[str, ...] = CURVED,
    *,
    noise: str | None = None,
    **choices: object,
) -> Problem:
    """A table of one series with errors of 0.05 (beta) and 1.5 degrees or so."""
    rng = np.random.default_rng([seed, 7])
    own = own_constant(closure, rng.uniform(0.2, 0.8))
    path = impacts_file(
        folder / f"{seed}.csv",
        *(
            {
                "gamma": np.sort(rng.uniform(3.0, 80.0, 9)),
                "observables": (name,),
                "e_n": 0.85,
                "c": next(iter(own.values()), 0.0),
                "mu": rng.uniform(0.05, 0.4),
                "closure": closure,
                "noise": 1.5 if name.endswith("deg") else 0.05,
                "sigma": None if noise == "unknown" else (1.5 if name.endswith("deg") else 0.05),
                "seed": seed,
            }
            for name in observables
        ),
    )
    return problem_of(read(path), closure, noise=noise, **choices)


def by_scipy(problem: Problem, sigma: np.ndarray, start: np.ndarray) -> float:
    free = problem.parameters.free
    lower, upper = (end[free] for end in problem.parameters.bounds())

    def residuals(x: np.ndarray) -> np.ndarray:
        theta = start.copy()
        theta[free] = x
        data = (problem.rows.value - problem.predict(theta)) / sigma
        return np.concatenate((data, problem.parameters.prior_residuals(theta)))

    x0 = np.clip(start[free], lower + 1e-9, np.minimum(upper, 1e9) - 1e-9)
    return float(2.0 * scipy_least_squares(residuals, x0, bounds=(lower, upper), xtol=1e-12).cost)


@pytest.mark.parametrize("closure", CLOSURES)
def test_it_goes_as_low_as_scipy_from_the_same_places(tmp_path, closure) -> None:
    for seed in range(3):
        problem = problem_at_random(tmp_path, seed, closure)
        sigma = problem.noise.sigma
        search = BatchedSearch.of(problem, sigma)
        places = search.lowest(starts(problem), NO_NOISE, 4)
        found = search.run(places, NO_NOISE)
        assert found.converged[found.value.argmin()]
        theirs = min(by_scipy(problem, sigma, place) for place in places)
        assert found.value.min() <= theirs + 1e-6 * max(1.0, theirs)
        # the value is that of the place
        z = (problem.rows.value - problem.predict(found.theta[0])) / sigma
        assert found.value[0] == pytest.approx(z @ z, rel=1e-12)


def on_kinks(problem: Problem) -> tuple[float, float, bool]:
    """chi2 of the certified optimum, that of the search, and whether the optimum lies on a kink."""
    certified = solve(problem, problem.noise.sigma)
    assert certified.certified
    found = multistart(problem, problem.noise.sigma)
    e_n, *_, mu = certified.theta
    law = problem.closure.law(problem.inertia_factor)
    bound = float(law.bound(certified.theta[1]))
    distance = np.abs(mu * (1.0 + e_n) - problem.rows.tau * bound).min()
    return certified.objective, found.objective, bool(distance < 1e-9)


def test_optima_on_kinks_are_those_of_the_certified_method(tmp_path, monkeypatch) -> None:
    problems = [problem_at_random(tmp_path, seed, "fr", ("beta", "e_n")) for seed in range(40)]
    pairs = [on_kinks(problem) for problem in problems]
    kinks = np.array([on_kink for _, _, on_kink in pairs])
    assert kinks.sum() >= 5
    missed = np.array([search - certified for certified, search, _ in pairs])
    assert (missed > -1e-8).all()
    assert missed[kinks].max() < 1e-7
    assert (missed < 1e-7).mean() >= 0.95  # several minima: eight places do not find every best one
    # the control: without steps along kinks it stops short of them
    monkeypatch.setattr(KinkedQuadratic, "kinks_ahead", property(lambda _: []))
    stopped = np.array([on_kinks(problem)[1] - certified for problem, (certified, *_) in
                        zip(problems, pairs, strict=True)])  # fmt: skip
    assert stopped[kinks].max() > 1e-4


def test_it_ends_at_bounds(tmp_path) -> None:
    free = problem_at_random(tmp_path, 1, "ifr")
    best = multistart(free, free.noise.sigma).theta
    bounds = {"mu": (0.0, 0.8 * best[2]), "e_n": (best[0] + 0.02, 1.0)}
    problem = problem_at_random(tmp_path, 1, "ifr", bounds=bounds)
    found = multistart(problem, problem.noise.sigma)
    assert found.theta[2] == 0.8 * best[2]
    assert found.theta[0] == pytest.approx(best[0] + 0.02, abs=1e-12)
    # what is left is at its best there
    fixed = problem.with_fixed({"mu": 0.8 * best[2], "e_n": best[0] + 0.02})
    assert found.theta[1] == pytest.approx(multistart(fixed, problem.noise.sigma).theta[1], abs=1e-7)


def test_a_search_that_is_cut_short_says_so(tmp_path) -> None:
    problem = problem_at_random(tmp_path, 2, "maw")
    search = BatchedSearch.of(problem, problem.noise.sigma)
    places = np.array(starts(problem))[:6]
    assert not search.run(places, NO_NOISE, steps=1).converged.any()
    whole = search.run(places, NO_NOISE)
    assert whole.converged.all()
    # converged is what it says: no place nearby is lower
    rng = np.random.default_rng(0)
    best = whole.theta[whole.value.argmin()]
    nearby = search.at(best + 1e-3 * rng.standard_normal((200, best.size)), np.zeros(200))
    value, _ = search.objective(nearby, NO_NOISE)
    assert value.min() > whole.value.min() - 1e-9


def test_slopes_without_an_end_leave_numbers(tmp_path, monkeypatch) -> None:
    """The tangent of a rebound grows beyond all bounds where e_n is next to nothing: squares overflow."""
    problem = problem_at_random(tmp_path, 5, "ifr-contact", ("tan_psi_out",))
    slopes = Problem.jacobian
    monkeypatch.setattr(Problem, "jacobian", lambda self, theta: slopes(self, theta) * [1.0, 1e299, 1.0])
    search = BatchedSearch.of(problem, problem.noise.sigma)
    found = search.run(np.array([[0.8, -0.6, 0.2]]), NO_NOISE, steps=3)
    assert np.isfinite(found.value).all()


@pytest.mark.parametrize("closure", ["fr", "maw"])
def test_unknown_noises_are_at_their_best(tmp_path, closure) -> None:
    problem = problem_at_random(tmp_path, 3, closure, noise="unknown", prior={"e_n": (0.85, 0.02)})
    groups = list(problem.noise_groups().values())
    sizes = np.array([float(rows.size) for rows in groups])
    search = BatchedSearch.of(problem, problem.noise.base, groups)
    found = search.run(search.lowest(starts(problem), sizes, 8), sizes)
    best = int(found.value.argmin())
    assert found.converged[best]

    def objective(theta: np.ndarray) -> float:
        inside = np.clip(theta, search.lower, np.minimum(search.upper, 5.0))
        z = problem.rows.value - problem.predict(inside)
        prior = problem.parameters.prior_residuals(inside)
        return float(sum(n * np.log(z[rows] @ z[rows]) for n, rows in zip(sizes, groups, strict=True))
                     + prior @ prior)  # fmt: skip

    assert found.value[best] == pytest.approx(objective(found.theta[best]), abs=1e-9)
    simplex = minimize(objective, found.theta[best], method="Nelder-Mead",
                       options={"xatol": 1e-9, "fatol": 1e-9, "maxiter": 2000})  # fmt: skip
    assert found.value[best] <= simplex.fun + 1e-7


@pytest.mark.parametrize("closure", CLOSURES)
def test_derivatives_of_many_are_those_of_one(tmp_path, closure) -> None:
    problem = problem_at_random(tmp_path, 4, closure)
    thetas = np.array(starts(problem))[:5]
    together = problem.jacobian(thetas)
    for theta, jacobian in zip(thetas, together, strict=True):
        assert np.array_equal(problem.jacobian(theta), jacobian)


def test_a_mu_that_follows_keeps_its_quantity(tmp_path) -> None:
    problem = problem_at_random(tmp_path, 5, "fr")
    law = problem.closure.law(problem.inertia_factor)
    theta = np.array([[0.8, 0.3, 0.1], [0.9, -0.2, 0.3]])
    x = np.array([0.2, 0.5])
    for i_c in (None, 1):
        mu = FollowingMu(2, 0, i_c, law)
        for place, slope in mu.slopes(theta, x):
            shift = np.zeros(3)
            shift[place] = 1e-6
            numeric = (mu.value(theta + shift, x) - mu.value(theta - shift, x)) / 2e-6
            assert slope == pytest.approx(numeric, rel=1e-7)
    lower, upper = problem.parameters.bounds()
    free = np.array([True, True, False])
    search = BatchedSearch(problem, problem.noise.sigma, (), free, lower, upper, FollowingMu(2, 0, None, law))
    found = search.run(theta, NO_NOISE, x)
    assert found.theta[:, 2] * (1.0 + found.theta[:, 0]) == pytest.approx(x, rel=1e-12)
    limited = BatchedSearch(problem, problem.noise.sigma, (), free, lower, upper,
                            FollowingMu(2, 0, None, law, (0.0, 0.27)))  # fmt: skip
    found = limited.run(theta, NO_NOISE, x)
    assert found.theta[:, 2].max() <= 0.27 + 1e-12


def test_a_narrow_valley_is_followed_to_its_end(tmp_path):
    # of five series under one friction each e_n falls along a valley, as narrow as 1e-5 of its length
    path = tmp_path / "valley.csv"
    path.write_text(draw(0, 100).text, encoding="utf-8")
    shared = problem_of(read(path), noise="unknown")
    sigma = least_squares(replace(shared, noise=replace(shared.noise, separate=True))).sigma
    search = BatchedSearch.of(problem_of(read(path), separate=("e_n",)), sigma)
    found = search.run(search.lowest(starts(search.problem), NO_NOISE, 32), NO_NOISE)
    assert found.converged.mean() > 0.75


def test_steps_that_shrink_by_one_ratio_are_summed(tmp_path, monkeypatch):
    # residuals as large as here leave Gauss and Newton's steps two thirds of the last one each
    path = tmp_path / "misfit.csv"
    path.write_text(draw(0, 39).text, encoding="utf-8")
    problem = problem_of(read(path), "maw", noise="known")
    number = []
    model = KinkedQuadratic.of.__func__
    monkeypatch.setattr(KinkedQuadratic, "of", classmethod(lambda *own: number.append(0) or model(*own)))
    found, steps = multistart(problem, problem.noise.sigma), len(number)
    search = BatchedSearch.of(problem, problem.noise.sigma)
    z = search.objective(found.theta[None], NO_NOISE)[1]
    rest = KinkedQuadratic.of(search, found.theta[None], z, np.empty((1, 0)), np.zeros(1)).promised
    assert rest < 1e-15
    monkeypatch.setattr(StepsBefore, "factor", lambda self, which, step, unit: np.ones(len(step)))
    number.clear()
    plain = multistart(problem, problem.noise.sigma)
    assert steps < 0.5 * len(number)
    assert found.theta == pytest.approx(plain.theta, rel=1e-6)
    assert found.objective == pytest.approx(plain.objective, abs=1e-9)
