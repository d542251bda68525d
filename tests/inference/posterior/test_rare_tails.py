"""Rare tails and modes that make much of a standard deviation: sampled against brute force.

The tables are of random searches, in which sampling called itself converged with an sd that was too small by
up to a factor of four.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from factories import rest_long
from posterior_questions import Question, Row

import ifrfit
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.prior_laws import HalfNormal, LogNormal
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import proposal_adaptation
from ifrfit.inference.posterior.constants_density import ConstantsDensity
from ifrfit.inference.posterior.importance_sampling import sample_by_importance
from ifrfit.inference.posterior.mixture_proposal import Uniform
from ifrfit.inference.posterior.tempering import tempered_points

SHARE = 0.4 / 1.4
STUCK = (
    (62.744, 1.89662), (64.4, 2.04613), (65.112, 2.10881), (68.421, 2.4725), (69.123, 2.56906),
    (69.249, 2.58521), (69.961, 2.67964),
)  # fmt: skip
SIGMA = 0.00305


def stuck() -> Problem:
    """Seven readings that stick. All of them may slide, with exp(-17) of the likelihood, at any beta0."""
    rows = tuple(Row("tan_psi_after", gamma, value, SIGMA) for gamma, value in STUCK)
    return Question(rows, "fr").problem()


def brute_force() -> tuple[float, float, float]:
    """Log evidence, mean and sd of beta0 by a grid in numpy alone; e_n is integrated out in closed form.

    The contact velocity over U_n is tau - min(tau (1 + beta0), kappa/share), and with e_n uniform from 0 to 1
    and mu from 0 to 2, kappa = mu (1 + e_n) has the density ln(min(2, 4/kappa))/2.
    """
    tau = np.tan(np.radians([gamma for gamma, _ in STUCK]))
    value = np.array([value for _, value in STUCK])
    beta0 = np.concatenate((np.linspace(-1.0, -0.96, 2001), np.linspace(-0.96, 1.0, 801)[1:]))
    kappa = np.concatenate((np.linspace(0.0, 0.03, 3001), np.linspace(0.03, 4.0, 2001)[1:]))

    def weights(x):
        return np.concatenate(([x[1] - x[0]], x[2:] - x[:-2], [x[-1] - x[-2]])) / 2.0

    prior = 0.5 * np.log(np.minimum(2.0, 4.0 / np.maximum(kappa, 1e-9))) * weights(kappa)
    constant = -tau.size * math.log(SIGMA * math.sqrt(2.0 * math.pi)) - math.log(2.0)
    density = np.empty(beta0.size)
    for i, b in enumerate(beta0):
        z = (value - tau + np.minimum(tau * (1.0 + b), kappa[:, None] / SHARE)) / SIGMA
        density[i] = np.exp(constant - 0.5 * np.einsum("ij,ij->i", z, z)) @ prior
    mass = density * weights(beta0)
    mean = float(mass @ beta0 / mass.sum())
    return math.log(mass.sum()), mean, math.sqrt(float(mass @ (beta0 - mean) ** 2 / mass.sum()))


@pytest.mark.parametrize("seed", rest_long(range(6), 2))
def test_a_tail_of_a_millionth_is_in_the_sd(seed: int) -> None:
    problem = stuck()
    evidence, mean, sd = brute_force()
    found = sample_by_importance(problem, seed=seed)
    assert found.converged
    assert abs(found.log_evidence - evidence) <= 4.0 * found.error_evidence + 0.01
    assert abs(found.mean("beta0") - mean) <= 4.0 * found.error * sd
    assert found.sd("beta0") == pytest.approx(sd, rel=4.0 * found.error)


def test_without_a_look_at_the_tails_the_sd_is_too_small_and_nothing_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # the control: laws fitted near to the posterior alone
    monkeypatch.setattr(proposal_adaptation._Population, "add_tempered", lambda _: None)
    monkeypatch.setattr(proposal_adaptation, "_MOST_FAR", 0)
    monkeypatch.setattr(proposal_adaptation, "_FAR", 1e-9)
    _, _, sd = brute_force()
    sampled = (sample_by_importance(stuck(), seed=seed) for seed in range(4))  # as many as it takes
    assert any(found.converged and found.sd("beta0") < 0.7 * sd for found in sampled)


@dataclass(frozen=True)
class Table:
    """A table with log evidence and sds by another sampler: 600,000 points of 120 laws, errors below 0.4 %.

    Its laws are about points of ensembles of walkers at three temperatures, its box is rejected, not cut.
    """

    rows: tuple[Row, ...]
    closure: str
    errors: ErrorModel
    log_evidence: float
    sd: Mapping[str, float]
    prior: Mapping[str, object] = field(default_factory=dict)
    noise: str = "known"

    def problem(self) -> Problem:
        question = Question(self.rows, self.closure, prior=self.prior, noise=self.noise)  # type: ignore[arg-type]
        return replace(question.problem(), error_model=self.errors)


TABLES = {
    # both modes fit two of three observables; the second has 3 % and least squares do not know it
    "a mode beside heavy tails": Table(
        (
            Row("e_n", 76.382, 0.951684, 0.000229, series="a"),
            Row("spin_y_after", 79.004, -0.672834, 0.000301, series="a"),
            Row("tan_psi_after", 77.587, -0.297053, 0.00229, series="a"),
            Row("e_n", 74.3, 0.948902, 0.0018, series="b"),
            Row("spin_y_after", 83.556, -0.394576, 0.00177, series="b"),
            Row("tan_psi_after", 76.449, 0.0661094, 0.00858, series="b"),
        ),
        "ifr",
        ErrorModel(8.0),
        -36.7449,
        {"e_n": 0.000266, "e_t": 0.02303, "mu": 0.01551},
        prior={"mu": HalfNormal(0.4)},
    ),
    "a ridge beside an offset of the angles": Table(
        (
            Row("v_x", 81.947, 0.900062, 0.00234),
            Row("v_x", 82.566, 0.911118, 0.00234),
            Row("delta_deg", 76.965, 80.4824, 0.0126),
            Row("delta_deg", 82.951, 85.2769, 0.0126),
        ),
        "fr",
        ErrorModel(offset=2.96),
        4.3008,
        {"e_n": 0.005245, "beta0": 0.4461, "mu": 0.007454, "angle_offset": 0.06038},
        prior={"e_n": (0.618, 0.02)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("seed", rest_long(range(6)))
@pytest.mark.parametrize("name", TABLES)
def test_a_rare_mode_is_in_the_sd(name: str, seed: int) -> None:
    table = TABLES[name]
    found = sample_by_importance(table.problem(), seed=seed)
    assert found.converged
    assert abs(found.log_evidence - table.log_evidence) <= 4.0 * found.error_evidence + 0.01
    for constant, sd in table.sd.items():
        assert found.sd(constant) == pytest.approx(sd, rel=4.0 * found.error + 0.01), constant


def test_points_of_a_power_are_as_wide_as_its_law() -> None:
    # four readings of e_n: the posterior is normal with a sd of 0.01, to the power 1/16 four times as wide
    rows = tuple(Row("e_n", 5.0, value, 0.02) for value in (0.71, 0.68, 0.7, 0.72))
    density = ConstantsDensity(Question(rows, fix={"mu": 0.1, "e_t": -0.9}).problem())
    rng = np.random.default_rng(0)
    uniform = rng.random((2048, 1))
    powers = 1.0 / 16.0, 1.0 / 4.0, 1.0
    found = tempered_points(density, uniform, density(uniform)[0], powers, rng)
    for power, points in zip(powers, found, strict=True):
        # half of the walkers are not resampled, and lag behind by a part of the last factor of sqrt(2)
        assert float(points.std()) == pytest.approx(0.01 / math.sqrt(power), rel=math.sqrt(2.0) - 1.0)
        assert float(points.mean()) == pytest.approx(0.7025, abs=0.25 * 0.01 / math.sqrt(power))


def test_points_are_enough_for_a_covariance_where_walkers_are_stuck_on_a_ridge() -> None:
    # three readings and an offset: a ridge so thin that hardly a walker is near to the best of them
    rows = (
        Row("spin_y_after", 84.218, -0.188609, 0.0108),
        Row("psi_out_deg", 74.991, 53.0249, 0.00374),
        Row("mu_app", 75.333, 0.407593, 0.00945),
    )
    question = Question(rows, "f", prior={"e_n": (0.823, 0.02), "mu": LogNormal(0.413, 1.42)})  # type: ignore[dict-item]
    density = ConstantsDensity(replace(question.problem(), error_model=ErrorModel(offset=1.36)))
    for seed in range(4):
        rng = np.random.default_rng(seed)
        uniform = Uniform().draw(density.coordinates, rng.random((2048, density.coordinates.dimensions)))
        found = tempered_points(density, uniform, density(uniform)[0], (1.0 / 16.0, 1.0), rng)
        assert all(len(points) >= 64 and np.isfinite(points).all() for points in found)


# least squares find a mu of 3.5, where the posterior ends at 2, and draws about that end have exp(-290) of
# its likelihood; there is a better place at mu = 0.037, with a log evidence of 0.463
BEYOND = (
    Row("e_n", 71.639, 0.9228, 0.00696, 0.9643, -0.4838, "a"),
    Row("v_x", 63.909, 0.67664, 0.005, -0.4357, -0.1528, "a"),
    Row("spin_y_after", 44.606, -0.452456, 0.000858, -0.3087, 0.3355, "a"),
    Row("e_n", 28.844, 0.914598, 0.000392, 0.7081, -0.2662, "b"),
    Row("v_x", 44.464, 0.477475, 0.00118, 0.0433, 0.0645, "b"),
    Row("spin_y_after", 85.754, -0.454612, 0.000388, -0.7737, 0.4956, "b"),
)


def beyond() -> Problem:
    """Six readings whose least squares optimum lies beyond the end of the prior of mu."""
    return replace(Question(BEYOND, "ifr-contact").problem(), error_model=ErrorModel(offset=1.43))


@pytest.mark.parametrize("seed", range(3))
def test_an_optimum_beyond_the_prior_does_not_hide_the_mode_within(seed: int) -> None:
    found = sample_by_importance(beyond(), seed=seed)
    assert found.converged
    assert abs(found.log_evidence - 0.463) < 0.02


def test_draws_far_below_the_known_modes_do_not_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    # the negative control: without a search within the prior, draws of some seeds are all about its end
    monkeypatch.setattr(Problem, "within_prior", lambda problem: problem)
    sampled = [sample_by_importance(beyond(), seed=seed) for seed in range(3)]
    is_far = [found.log_evidence < -200.0 for found in sampled]
    assert any(is_far)
    for found, far in zip(sampled, is_far, strict=True):
        assert not found.converged if far else abs(found.log_evidence - 0.463) < 0.1


def test_a_closure_whose_optimum_is_beyond_the_prior_converges() -> None:
    # maw on real impacts: least squares find mu = 47, and the posterior has its mass well below 2
    problem, _ = ifrfit.fit("wang-2018-limestone", closure="maw", method="lsq").problem_and_optimum()
    assert least_squares(problem, proven=False).optimum.theta.max() > 2.0
    found = sample_by_importance(problem)
    assert found.converged
    assert found.log_evidence == pytest.approx(118.83, abs=0.05)
