"""Starts: inside the domain, wider than the posterior, at every optimum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from posterior_questions import Question, Row, measured

from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.mcmc import Coordinates, starts
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
DROPS = (Row("e_n", 5.0, 0.97, 0.03),)
PAIR = (Row("beta", 20.0, 0.42, 0.01), Row("beta", 60.0, -0.5, 0.01))

QUESTIONS = {
    "beta and e_n": Question(measured("beta", FAN, seed=1) + DROPS),
    "e_t on its bound": Question(measured("beta", FAN, seed=2, c=-1.0), fix={"e_n": 0.9}),
    "sticking only": Question(measured("beta", (5.0, 10.0, 15.0), seed=3)),
    "noise unknown": Question(measured("beta", FAN, seed=5, known=False), fix={"e_n": 0.9}, noise="unknown"),
    "a common factor": Question(measured("beta", FAN, seed=6) + DROPS, noise="scaled"),
    "mu separate": Question(
        measured("beta", FAN, seed=9, series="a") + measured("beta", FAN, seed=10, series="b", mu=0.25),
        separate=("mu",),
    ),
    "all separate": Question(
        measured("beta", FAN, seed=9, series="a") + measured("beta", FAN, seed=10, series="b", mu=0.25),
        separate=("e_n", "e_t", "mu"),
    ),
    "mu fixed": Question(measured("beta", FAN, seed=1) + DROPS, fix={"mu": 0.15}),
    "two optima": Question(PAIR, fix={"e_n": 0.9}),
}


def coordinates_of(question: Question) -> Coordinates:
    return Coordinates(Density(question.problem()))


@pytest.mark.parametrize("name", QUESTIONS)
def test_every_walker_starts_where_there_is_density(name: str) -> None:
    coordinates = coordinates_of(QUESTIONS[name])
    made = starts(coordinates, least_squares(coordinates.problem), np.random.default_rng(1))
    assert made.shape[0] == 4
    assert made.shape[1] >= 64
    assert made.shape[1] % 2 == 0
    assert np.isfinite(coordinates(made.reshape(-1, made.shape[2]))).all()
    for ensemble in made:  # no two walkers on top of each other, no coordinate without spread
        assert len(np.unique(ensemble, axis=0)) == len(ensemble)
        assert (np.ptp(ensemble, axis=0) > 0.0).all()


@pytest.mark.parametrize("seed", [5, 11])
def test_the_last_bit_of_the_data_does_not_move_the_starts(seed: int) -> None:
    problem = Question(measured("beta", FAN, seed=seed, closure="fr", c=0.4) + DROPS, "fr").problem()
    rng = np.random.default_rng(3)
    found = []
    for up in (np.zeros(len(problem.rows)), *rng.choice([-1.0, 1.0], (12, len(problem.rows)))):
        value = np.nextafter(problem.rows.value, problem.rows.value + up)
        moved = replace(problem, rows=replace(problem.rows, value=value))
        found.append(starts(Coordinates(Density(moved)), least_squares(moved), np.random.default_rng(1)))
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", QUESTIONS)
def test_coordinates_there_and_back(name: str) -> None:
    coordinates = coordinates_of(QUESTIONS[name])
    density = coordinates.density
    rng = np.random.default_rng(2)
    points = density.lower + (density.upper - density.lower) * rng.random((50, coordinates.dimensions))
    at = coordinates.at(points)
    assert coordinates.points(at) == pytest.approx(points, rel=1e-12)
    # the density of coordinates is that of points times |d point/d at|, by differences
    step = 1e-6
    jacobians = []
    for place in at:
        moved = coordinates.points(place + step * np.eye(place.size)) - coordinates.points(place)
        jacobians.append(np.linalg.slogdet(moved / step)[1])
    expected = density(points) + np.array(jacobians)
    off = np.array(coordinates(at)) - expected
    assert np.ptp(off) < 1e-4  # up to a constant where e_n is fixed


@pytest.mark.parametrize("name", QUESTIONS)
def test_quantities_are_named_like_the_exact_ones(name: str) -> None:
    coordinates = coordinates_of(QUESTIONS[name])
    posterior = integrate(coordinates.problem, 1e-2)
    drawn = posterior.draws(20, np.random.default_rng(3))
    columns = [drawn[x] if "noise" not in x else np.log(drawn[x]) for x in coordinates.density.names]
    found = coordinates.quantities(coordinates.at(np.stack(columns, axis=-1)).reshape(4, 5, -1))
    assert tuple(found) == posterior.names
    for quantity, values in found.items():
        assert values.shape == (4, 5)
        assert values.reshape(-1) == pytest.approx(drawn[quantity], rel=1e-9)
    assert Draws.of(coordinates.problem, drawn).names == posterior.names


def test_starts_are_wider_than_the_posterior() -> None:
    question = QUESTIONS["beta and e_n"]
    coordinates = coordinates_of(question)
    posterior = integrate(coordinates.problem)
    found = least_squares(coordinates.problem)
    made = starts(coordinates, found, np.random.default_rng(4), ensembles=40)
    kappa = coordinates.quantities(made)["kappa"]
    assert kappa.std() > 1.2 * posterior.sd("kappa")
    # ensembles as such start further apart than their means would be in the posterior
    assert kappa.mean(axis=1).std() > 3.0 * posterior.sd("kappa") / np.sqrt(made.shape[1])


def test_every_ensemble_has_both_optima_in_shares_of_its_own() -> None:
    coordinates = coordinates_of(QUESTIONS["two optima"])
    found = least_squares(coordinates.problem)
    assert len(found.optimum.minima) == 2
    kappas = sorted(float(theta[2]) * 1.9 for _, theta in found.optimum.minima)
    made = starts(coordinates, found, np.random.default_rng(5))
    lower = (coordinates.quantities(made)["kappa"] < np.mean(kappas)).mean(axis=1)
    assert ((lower > 0.1) & (lower < 0.9)).all()
    assert np.ptp(lower) > 0.3  # R-hat has to see it if they stay as they are
    five = starts(coordinates, found, np.random.default_rng(5), ensembles=5)
    assert five.shape[0] == 5


def test_the_seed_decides() -> None:
    coordinates = coordinates_of(QUESTIONS["beta and e_n"])
    found = least_squares(coordinates.problem)
    one, same, other = (starts(coordinates, found, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
