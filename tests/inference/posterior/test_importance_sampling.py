"""Importance sampling against quadrature and known answers, within the errors that it states."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from posterior_agreement import agree
from posterior_questions import Question, Row, measured
from scipy import integrate as quad
from scipy import special

import ifrfit
from ifrfit.inference.diagnostics.thresholds import SAMPLING_ERROR
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.noise import mixed_noise
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import constants_density, exact_posterior, importance_sampling, integrate
from ifrfit.inference.posterior.constants_density import ConstantsDensity
from ifrfit.inference.posterior.importance_posterior import ImportancePosterior
from ifrfit.inference.posterior.importance_sampling import EvidenceByImportance, sample_by_importance
from ifrfit.physics import get_closure

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
WIDE = tuple(np.linspace(6.0, 78.0, 16).tolist())
DROPS = tuple(Row("e_n", g, v, 0.02) for g, v in ((5.0, 0.91), (9.0, 0.88), (3.0, 0.9), (4.0, 0.92)))
UNKNOWN = {"noise": "unknown"}
TWO = (
    *measured("beta", WIDE, seed=31, series="a", mu=0.14, sigma=0.02),
    *measured("beta", WIDE, seed=32, series="b", mu=0.2, sigma=0.02),
)
# contradictions: each group taken at its word is a mode, the other then is called noisy
BIMODAL = (
    *measured("beta", WIDE, seed=41, mu=0.14, c=-0.85, sigma=0.02),
    *measured("psi_after_deg", WIDE, seed=42, mu=0.17, c=-0.7, sigma=0.5),
)

QUESTIONS = {
    "known noise": Question(measured("beta", WIDE, seed=1) + DROPS),
    "unknown noises": Question(measured("beta", WIDE, seed=2) + DROPS, **UNKNOWN),  # type: ignore[arg-type]
    "scaled noise": Question(measured("beta", WIDE, seed=3) + DROPS, noise="scaled"),
    "few rows": Question(measured("beta", FAN, seed=4), fix={"e_n": 0.9}, **UNKNOWN),  # type: ignore[arg-type]
    "curved, e_n tied": Question(measured("delta_deg", FAN, seed=5, sigma=1.0), prior={"e_n": (0.9, 0.02)}),
    "F": Question(measured("beta", WIDE, seed=6, closure="f") + DROPS, "f"),
    "FR": Question(measured("beta", WIDE, seed=7, closure="fr", c=0.4) + DROPS, "fr"),
    "at a bound": Question(measured("beta", WIDE, seed=8, c=-1.0, sigma=0.1), fix={"e_n": 0.9}),
    "nothing but sticking": Question(measured("beta", (4.0, 8.0, 12.0), seed=9, mu=0.3), fix={"e_n": 0.9}),
    "separate mu": Question(TWO, separate=("mu",), fix={"e_n": 0.9}),
    "two modes": Question(BIMODAL, fix={"e_n": 0.9}, **UNKNOWN),  # type: ignore[arg-type]
}


def where_some_noises_are_known() -> Problem:
    unknown = tuple(replace(row, sigma=None) for row in DROPS)
    problem = Question(measured("beta", WIDE, seed=15) + unknown, noise="unknown").problem()
    problem = problem.with_noise(mixed_noise(problem.noise.sigma, problem.groups()))
    assert problem.noise.is_mixed
    return problem


def under_maw() -> Problem:
    problem = Question(measured("beta", WIDE, seed=11), fix={"e_n": 0.9}).problem()
    return problem.with_closure(get_closure("maw"))


def under_heavy_tails_and_a_factor() -> Problem:
    problem = Question(measured("beta", WIDE, seed=13), fix={"e_n": 0.9}, noise="scaled").problem()
    return replace(problem, error_model=ErrorModel(4.0))


@pytest.mark.parametrize("name", QUESTIONS)
def test_it_agrees_with_quadrature(name: str) -> None:
    problem = QUESTIONS[name].problem()
    start = least_squares(problem)
    exact = integrate(problem, 1e-3, start)
    assert exact.converged
    sampled = sample_by_importance(problem, start)
    agree(sampled, exact)
    assert set(sampled.names) == set(exact.names)
    transition = f"transition_tau[{problem.series[0]}]"
    assert sampled.quantile(transition, 0.5) == pytest.approx(exact.quantile(transition, 0.5), rel=0.02)


@pytest.mark.parametrize("name", QUESTIONS)
def test_an_evidence_alone_is_that_of_quadrature(name: str) -> None:
    problem = QUESTIONS[name].problem()
    start = least_squares(problem)
    found, error = EvidenceByImportance(problem, start).evidence()
    assert error <= SAMPLING_ERROR
    assert abs(found - integrate(problem, 1e-3, start).log_evidence) <= 4.0 * error + 1e-3


@pytest.mark.parametrize("made", [where_some_noises_are_known, under_maw, under_heavy_tails_and_a_factor])
def test_other_noises_and_laws_agree_with_quadrature(made: Callable[[], Problem]) -> None:
    problem = made()
    start = least_squares(problem)
    agree(sample_by_importance(problem, start), integrate(problem, 1e-3, start))


def test_it_agrees_with_the_mixture_over_offsets() -> None:
    problem = Question(measured("beta", WIDE, seed=12), fix={"e_n": 0.9}).problem()
    problem = replace(problem, error_model=replace(problem.error_model, offset=1.0))
    start = least_squares(problem)
    agree(
        sample_by_importance(problem, start), exact_posterior(problem, 1e-3, start, integrator="quadrature")
    )


def test_the_posterior_of_readings_of_e_n_is_known() -> None:
    readings = np.array([0.91, 0.88, 0.9, 0.92])
    rows = tuple(Row("e_n", 5.0, value, 0.02) for value in readings)
    found = sample_by_importance(Question(rows, fix={"mu": 0.1, "e_t": -0.9}).problem())
    sd = 0.02 / math.sqrt(4.0)
    z = (readings - readings.mean()) / 0.02
    log_peak = -0.5 * float(z @ z) - 4.0 * math.log(0.02 * math.sqrt(2.0 * math.pi))
    evidence = log_peak + math.log(sd * math.sqrt(2.0 * math.pi))
    assert abs(found.log_evidence - evidence) <= 4.0 * found.error_evidence + 1e-4
    assert found.mean("e_n") == pytest.approx(readings.mean(), abs=4.0 * found.error * sd)
    assert found.sd("e_n") == pytest.approx(sd, rel=4.0 * found.error)
    places = readings.mean() + sd * special.ndtri(np.array(LEVELS))
    np.testing.assert_allclose(found.quantile("e_n", LEVELS), places, atol=4.0 * found.error * sd)


@pytest.mark.parametrize("noise", ["known", "scaled", "unknown"])
def test_the_density_is_that_of_constants_and_noises_with_noises_integrated_out(noise: str) -> None:
    problem = Question(measured("beta", FAN, seed=14), noise=noise).problem()
    whole, constants = Density(problem), ConstantsDensity(problem)
    at = np.array([0.8, -0.8, 0.25])  # e_n, e_t and kappa = mu (1 + e_n)
    values = constants.coordinates.values(at[None])[0]
    assert values[2] == pytest.approx(0.25 / 1.8)

    def over_noise(log_noise: float) -> float:
        return math.exp(float(whole(np.append(values, log_noise)[None])[0]) - peak)

    if noise == "known":
        expected = float(whole(values[None])[0])
    else:
        ends = whole.lower[-1], whole.upper[-1]
        steps = np.linspace(*ends, 400)
        peak = max(float(whole(np.append(values, each)[None])[0]) for each in steps)
        expected = peak + math.log(quad.quad(over_noise, *ends, limit=400, points=[-1.0, 0.0])[0])
    assert constants(at[None])[0][0] == pytest.approx(expected - math.log(1.8), abs=1e-6)


def test_a_mode_that_nothing_pointed_to_is_found_or_told(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = QUESTIONS["two modes"].problem()
    start = least_squares(problem)
    assert start.rivals
    exact = integrate(problem, 1e-3, start)
    modes = importance_sampling.known_modes(ConstantsDensity(problem), start)
    for kept in modes:
        monkeypatch.setattr(importance_sampling, "known_modes", lambda *_, kept=kept: [kept])
        agree(sample_by_importance(problem, start), exact)


def test_draws_that_miss_most_of_the_posterior_do_not_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    # the control: nothing drawn uniformly, nothing adapted, a law far from the posterior
    from ifrfit.inference.posterior.mixture_proposal import Beside, Component, MixtureProposal

    problem = QUESTIONS["known noise"].problem()

    def far(density, modes, rng):
        centre, covariance = modes[0]
        root = 0.3 * np.linalg.cholesky(covariance)
        away = Component(centre + 4.0 * np.sqrt(np.diag(covariance)), root)
        return MixtureProposal(density.coordinates, (away,), np.ones(1), Beside())

    monkeypatch.setattr(importance_sampling, "adapted_proposal", far)
    monkeypatch.setattr(importance_sampling, "_REFITS", 0)
    assert not sample_by_importance(problem).converged


def test_the_seed_decides_the_draws_and_errors_are_honest_over_seeds() -> None:
    problem = QUESTIONS["unknown noises"].problem()
    start = least_squares(problem)
    exact = integrate(problem, 1e-3, start)
    found = [sample_by_importance(problem, start, seed) for seed in range(8)]
    assert sample_by_importance(problem, start, seed=3).log_evidence == found[3].log_evidence
    z = [(each.log_evidence - exact.log_evidence) / each.error_evidence for each in found]
    # t with 15 degrees of freedom each: their mean square is 15/13, with an sd of about 0.7
    assert 0.1 < np.mean(np.square(z)) < 4.0


def _large() -> Problem:
    """Rebound angles alone: e_n, e_t and mu are tied by every row."""
    return Question(measured("delta_deg", WIDE, seed=21, sigma=1.0), **UNKNOWN).problem()  # type: ignore[arg-type]


def test_sampling_takes_over_where_a_grid_is_large_and_not_elsewhere() -> None:
    assert isinstance(exact_posterior(_large()), ImportancePosterior)
    small = QUESTIONS["known noise"].problem()
    assert not isinstance(exact_posterior(small), ImportancePosterior)
    assert isinstance(exact_posterior(small, integrator="sampling"), ImportancePosterior)


def test_its_evidence_is_that_of_quadrature_where_both_work() -> None:
    problem = _large()
    start = least_squares(problem)
    exact = integrate(problem, 1e-2, start)
    agree(exact_posterior(problem, start=start), exact)  # type: ignore[arg-type]


def test_heavy_tails_take_no_array_of_points_by_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = measured("beta", np.linspace(6.0, 78.0, 500).tolist(), seed=1)
    problem = Question(rows, fix={"e_n": 0.9}).problem()
    density = ConstantsDensity(replace(problem, error_model=ErrorModel(4.0)))
    at = np.full((4000, density.coordinates.dimensions), 0.1)
    values = density.coordinates.values(at)
    whole, _ = density.log_likelihood(values)
    monkeypatch.setattr(constants_density, "_OF_IMPACTS", 50_000)
    tracemalloc.start()
    found, _ = density.log_likelihood(values)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found == pytest.approx(whole, rel=1e-12)
    assert peak < 8 * len(values) * len(rows)  # bytes


def test_a_rare_tail_that_makes_most_of_a_variance_takes_a_law_of_its_own() -> None:
    """Under IFR-contact a ten-thousandth of the posterior of cornell-glass reaches to the bound of mu."""
    problem = ifrfit.fit("cornell-glass").problem_and_optimum()[0].with_closure(get_closure("ifr-contact"))
    found = sample_by_importance(problem, target=SAMPLING_ERROR)
    assert found.converged
    assert found.weights.size <= 16384  # 131,072 of the law that is near to the posterior
    tail = found.cdf("mu", 0.3)
    assert 1e-6 < 1.0 - float(tail) < 1e-3
    other = sample_by_importance(problem, seed=1, target=SAMPLING_ERROR)
    for name in ("e_n", "e_t", "mu"):
        assert abs(found.mean(name) - other.mean(name)) < 4.0 * SAMPLING_ERROR * found.sd(name)
    assert found.sd("mu") == pytest.approx(other.sd("mu"), rel=4.0 * SAMPLING_ERROR)


def test_errors_up_to_a_limit_are_those_without_and_beyond_it_they_are_beyond() -> None:
    problem = QUESTIONS["unknown noises"].problem()
    replicates = importance_sampling._Replicates(
        ConstantsDensity(problem),
        importance_sampling.adapted_proposal(
            ConstantsDensity(problem),
            importance_sampling.known_modes(ConstantsDensity(problem), least_squares(problem)),
            np.random.default_rng(0),
        ),
        np.random.default_rng(0),
    )
    whole = replicates.posterior().error
    assert replicates.posterior(whole * 1.5).error == pytest.approx(whole, rel=0.2)  # noises are drawn anew
    assert replicates.posterior(whole / 100.0).error > whole / 100.0
