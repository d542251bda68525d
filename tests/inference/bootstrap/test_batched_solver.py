"""Replicates that are solved together get the optimum that the certified solver gives each of them."""

from __future__ import annotations

import numpy as np
import pytest
from bootstrap_scenes import fitted, scene
from random_problems import random_problem

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.bootstrap.batched_solver import BatchedSolver
from ifrfit.inference.bootstrap.replicate_fits import NO_E_N, NO_NOISE, NO_SLIDING, NO_STICKING, TOO_FEW
from ifrfit.inference.bootstrap.schemes import ReplicateData, draw_replicates, make_scheme
from ifrfit.inference.bootstrap.sequential_solver import SequentialSolver, replicate
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.optimum import objective_at

QUESTIONS = {
    "beta and e_n, known noise": {},
    "scaled noise": {"noise": "scaled"},
    "unknown noise": {"noise": "unknown"},
    "two noises on the same constants": {
        "observables": ("beta", "tan_psi_after"), "noise": "unknown", "fix": {"e_n": 0.9},
    },
    "priors with a scaled noise": {"noise": "scaled", "prior": {"e_n": (0.88, 0.01), "e_t": (-0.7, 0.02)}},
    "prior of mu": {"observables": ("beta",), "fix": {"e_n": 0.9}, "prior": {"mu": (0.14, 0.002)}},
    "two series that share all": {"series": 2, "n": 12, "noise": "unknown"},
    "two series that share nothing": {"series": 2, "n": 12, "separate": ("e_n", "e_t", "mu")},
    "FR": {"closure": "fr"},
    "F": {"closure": "f"},
    "IFR-contact": {"closure": "ifr-contact", "noise": "unknown"},
    "everything fixed": {"fix": {"e_n": 0.9, "e_t": -0.8, "mu": 0.15}, "noise": "unknown"},
    "mu fixed": {"fix": {"mu": 0.15}},
    "bounds of mu": {"bounds": {"mu": (0.05, 0.149)}},
    "mu_app with e_n held": {"observables": ("beta", "mu_app"), "fix": {"e_n": 0.9}},
    "mu_app alone with mu": {"observables": ("mu_app", "mu")},
    "tan_psi_out with e_n held": {"observables": ("tan_psi_out",), "fix": {"e_n": 0.9}, "noise": "unknown"},
    "rows measured together": {"joint": True},
}  # fmt: skip


@pytest.mark.parametrize("name", QUESTIONS)
def test_every_replicate_has_the_optimum_of_the_certified_solver(name: str) -> None:
    problem, found = fitted(scene(**{"n": 20, **QUESTIONS[name]}))
    together, alone = BatchedSolver.of(problem, found), SequentialSolver.of(problem, found)
    assert together is not None
    for scheme in ("cases", "residual", "wild"):
        try:
            chosen = make_scheme(scheme, problem, found)
        except UsageError:
            assert problem.parameters["e_n"].separate
            continue
        lot = draw_replicates(problem, chosen, np.random.SeedSequence(3).spawn(5))
        ours, theirs = together.solve(lot), alone.solve(lot)
        assert ours.reason == theirs.reason
        assert ours.certified.all()
        assert theirs.certified.all()
        answered = [number for number, reason in enumerate(ours.reason) if not reason]
        assert len(answered) >= 3
        for number in answered:
            if together.noise_matters and on_the_transition(problem, theirs.theta[number]):
                # which regime such a row counts to is a matter of the last digit, and so are the degrees of
                # freedom of its noise
                assert ours.theta[number] == pytest.approx(theirs.theta[number], abs=1e-4)
                continue
            # what the data leave open is compared by its sum of squares, below
            assert ours.theta[number, alone.seen] == pytest.approx(theirs.theta[number, alone.seen], abs=1e-9)
            if not on_the_transition(problem, theirs.theta[number]):
                assert ours.noise[number] == pytest.approx(theirs.noise[number], rel=1e-8)
        one = replicate(problem, lot, answered[0])
        sigma = least_squares(one).sigma
        best = objective_at(one, sigma, theirs.theta[answered[0]])
        assert objective_at(one, sigma, ours.theta[answered[0]]) == pytest.approx(best, rel=1e-9)


def on_the_transition(problem: Problem, theta: np.ndarray) -> bool:
    """Whether a row lies where sticking turns into sliding, but for rounding."""
    e_n, c, mu = problem.per_row(theta)
    linear = problem.closure.coefficients(problem.inertia_factor)
    bound, kappa = problem.rows.tau * (linear.b0 + linear.b1 * c), mu * (1.0 + e_n)
    return bool((np.abs(bound - kappa) <= 1e-9 * (bound + kappa)).any())


def test_no_replicate_of_random_problems_lies_above_the_certified_optimum() -> None:
    n = 0
    for seed in range(25):
        problem = random_problem(np.random.default_rng(seed))
        try:
            found = least_squares(problem)
        except DataError:
            continue
        together = BatchedSolver.of(problem, found)
        if together is None:
            continue
        scheme = make_scheme(("cases", "wild")[seed % 2], problem, found)
        lot = draw_replicates(problem, scheme, np.random.SeedSequence(seed).spawn(2))
        solved = together.solve(lot)
        for number in range(lot.size):
            one = replicate(problem, lot, number)
            best = least_squares(one).optimum
            # both by theta: where sigma is tiny, mu has not the last digits that kappa had
            ours, theirs = (
                objective_at(one, one.noise.sigma, theta) for theta in (solved.theta[number], best.theta)
            )
            assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9)
            n += 1
    assert n > 20


def test_what_is_curved_or_partly_shared_is_fitted_one_by_one() -> None:
    for problem in (
        scene(observables=("delta_deg",), fix={"e_n": 0.9}),
        scene(observables=("mu_app", "e_n"), n=8),
        scene(series=2, n=8, separate=("mu",)),
    ):
        assert BatchedSolver.of(*fitted(problem)) is None
    assert BatchedSolver.of(*fitted(scene(series=1, n=8, separate=("mu",)))) is not None


def _counted(problem, **only: object) -> ReplicateData:
    """One replicate with the given rows only, by a condition on tau and the observable."""
    keep = np.ones(problem.rows.value.size, dtype=bool)
    names = np.array(problem.rows.names)[problem.rows.which]
    tau = problem.rows.tau
    if "below" in only:
        keep &= (tau < only["below"]) | (names == "e_n")
    if "beyond" in only:
        keep &= (tau > only["beyond"]) | (names == "e_n")
    if "without" in only:
        keep &= names != only["without"]
    if "first" in only:
        keep &= (np.arange(keep.size) < only["first"]) | (names == "e_n")
    exact = problem.predict(np.array(only["exact"])) - problem.rows.value if "exact" in only else 0.0 * tau
    return ReplicateData(keep[None].astype(float), exact[None], np.full((1, len(problem.parameters)), np.nan))


@pytest.mark.parametrize(
    ("question", "only", "reason", "left"),
    [
        ({}, {"below": 0.3}, NO_SLIDING, {"mu"}),
        ({"closure": "fr"}, {"beyond": 2.0, "exact": (0.9, 0.4, 0.15)}, NO_STICKING, {"beta0"}),
        ({}, {"without": "e_n"}, NO_E_N, {"e_n", "mu"}),
        ({"gamma": [70.0] * 10 + [20.0, 40.0, 60.0]}, {"first": 10}, TOO_FEW, {"e_t", "mu"}),
        ({"noise": "unknown"}, {"first": 2}, NO_NOISE, {"e_n", "e_t", "mu"}),
    ],
)
def test_a_replicate_that_leaves_something_open_says_what_and_why(question, only, reason, left) -> None:
    problem, found = fitted(scene(**question))
    lot = _counted(problem, **only)
    solved = BatchedSolver.of(problem, found).solve(lot)
    assert solved.reason == (reason,)
    assert {
        name
        for name, is_undetermined in zip(problem.parameters.names, solved.undetermined[0], strict=True)
        if is_undetermined
    } == left
    alone = SequentialSolver.of(problem, found).solve(lot)
    # least squares puts e_n into the middle of its domain, and the transition on the first of exact rows
    if reason not in (NO_E_N, NO_STICKING):
        assert alone.reason == (reason,)
    whole = BatchedSolver.of(problem, found).solve(_counted(problem))
    assert whole.reason == ("",)
    assert whole.theta[0] == pytest.approx(found.optimum.theta, abs=1e-9)
