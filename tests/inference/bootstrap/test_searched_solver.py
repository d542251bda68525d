"""Replicates that are searched together get the optimum that each of them gets alone."""

from __future__ import annotations

import numpy as np
import pytest
from bootstrap_scenes import fitted, scene
from factories import each_once

from ifrfit.inference.bootstrap.estimator import solver_of
from ifrfit.inference.bootstrap.replicate_fits import NO_NOISE
from ifrfit.inference.bootstrap.schemes import draw_replicates, make_scheme
from ifrfit.inference.bootstrap.searched_solver import SearchedSolver
from ifrfit.inference.bootstrap.sequential_solver import SequentialSolver

PRIOR = {"e_n": (0.9, 0.01)}
QUESTIONS = {
    "angles with a prior": {"observables": ("delta_deg",), "prior": PRIOR, "noise": "unknown"},
    "angles and e_n, known noise": {"observables": ("delta_deg", "e_n")},
    "angles and e_n, two noises": {"observables": ("delta_deg", "e_n"), "noise": "unknown"},
    "a closure that bends": {"noise": "scaled", "closure": "maw", "only": ("beta",), "fix": {"e_n": 0.9}},
    "few rows": {"observables": ("delta_deg", "e_n"), "noise": "unknown", "n": 5},
}


def asked(name):
    choices = {"n": 20, **QUESTIONS[name]}
    closure, only = choices.pop("closure", ""), choices.pop("only", ("delta_deg",))
    if not closure:
        return fitted(scene(**choices))
    from factories import problem_of

    plain = scene(observables=only, **choices)
    return fitted(problem_of(plain.observations.table, closure, noise="scaled", fix={"e_n": 0.9}))


@pytest.mark.parametrize(("name", "scheme"), each_once(QUESTIONS, ["cases", "residual", "wild"]))
def test_every_replicate_has_the_optimum_that_it_has_alone(name: str, scheme: str) -> None:
    problem, found = asked(name)
    together, alone = solver_of(problem, found), SequentialSolver.of(problem, found)
    assert isinstance(together, SearchedSolver)
    lot = draw_replicates(problem, make_scheme(scheme, problem, found), np.random.SeedSequence(3).spawn(4))
    ours, theirs = together.solve(lot), alone.solve(lot)
    assert ours.reason == theirs.reason
    assert (ours.undetermined == theirs.undetermined).all()
    assert not ours.certified.any()
    for number, reason in enumerate(ours.reason):
        if reason != NO_NOISE:
            assert ours.theta[number] == pytest.approx(theirs.theta[number], abs=1e-6)
            assert ours.noise[number] == pytest.approx(theirs.noise[number], rel=1e-6)


def test_a_replicate_does_not_depend_on_those_beside_it() -> None:
    problem, found = asked("angles and e_n, two noises")
    solver = solver_of(problem, found)
    lot = draw_replicates(problem, make_scheme("cases", problem, found), np.random.SeedSequence(3).spawn(40))
    every, part = solver.solve(lot), solver.solve(lot.take(np.arange(30, 40)))
    assert every.theta[30:] == pytest.approx(part.theta, abs=1e-9)
    assert every.noise[30:] == pytest.approx(part.noise, rel=1e-9)


def test_what_has_a_proof_is_not_searched() -> None:
    problem, found = fitted(scene(10))
    assert SearchedSolver.of(problem, found) is None
