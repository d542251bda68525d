from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hard_cases.synthetic import FAN, GRAZING, HEADER, STEEP, TRUTH, noise, question, rows, table, values
from scipy import special

import ifrfit
from ifrfit.inference.estimators import Profile
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.profile.objective import limit
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.inference.result.build import build_result

KNOWN = {"e_n": TRUTH["e_n"]}
Z = float(special.ndtri(0.975))


@pytest.fixture(autouse=True)
def no_numpy_warnings() -> Iterator[None]:
    with warnings.catch_warnings(), np.errstate(all="warn", under="ignore"):
        warnings.simplefilter("error")
        yield


def profiled_estimates(
    problem: Problem, fit: LeastSquaresFit
) -> tuple[Any, Any, Mapping[str, ProfileLikelihood]]:
    """Constants, derived quantities and profiles of --method profile."""
    found = build_result(problem, fit, Profile().run(problem, fit))
    return found.constants, found.derived, found.profiles


def profiles(folder: Path, text: str, **options: Any) -> dict[str, ProfileLikelihood]:
    return profile_all(*question(folder, text, **options))


def test_a_parabola_gives_the_gaussian_interval(tmp_path: Path) -> None:
    # all impacts slide and stay so over the whole region: linear in e_t and kappa
    problem, fit = question(tmp_path, table(GRAZING, sigma=0.01, seed=1, e_t=-0.9), fix={})
    sd = math.sqrt(fit.gaussian.variance(fit.gaussian.to_theta[1], 1.0))
    found = profile_all(problem, fit)["e_t"]
    value = float(fit.optimum.theta[1])
    assert found.shape == "bounded"
    assert found.status == "determined"
    assert found.value == value
    assert found.stderr == pytest.approx(sd, rel=1e-6)
    assert found.interval95 == pytest.approx((value - Z * sd, value + Z * sd), abs=1e-7)
    one = float(special.ndtri(0.84))
    assert found.interval68 == pytest.approx((value - one * sd, value + one * sd), abs=1e-7)
    np.testing.assert_allclose(found.rise, ((found.x - value) / sd) ** 2, atol=1e-6)
    assert found.rise.max() > 8.5


def test_a_profile_takes_about_a_hundred_solves_and_sixty_places(tmp_path: Path) -> None:
    for found in profiles(tmp_path, table(sigma=0.02, seed=1, e_t=-0.9)).values():
        assert found.n_evaluations <= 100
        assert 55 <= found.x.size <= 80
        assert (np.diff(found.x) > 0.0).all()
        assert not found.x.flags.writeable
        assert found.rise.min() <= 1e-9


@pytest.mark.parametrize("policy", ["unknown", "scaled"])
def test_noise_from_the_misfit_gives_students_interval(tmp_path: Path, policy: str) -> None:
    # a friction so high that all impacts stick: beta is one constant, e_t + 7/5, read n times
    beta = values(STEEP, "beta", e_t=-0.9) + noise(len(STEEP), 0.01, 3)
    sigma = None if policy == "unknown" else 0.5
    found = profiles(tmp_path, HEADER + rows(STEEP, beta, sigma), noise=policy, fix={**KNOWN, "mu": 5.0})[
        "e_t"
    ]
    n = len(STEEP)
    mean, sem = float(beta.mean()) - 1.4, float(beta.std(ddof=1)) / math.sqrt(n)
    t = float(special.stdtrit(n - 1, 0.975))
    assert found.dof == pytest.approx(n - 1)
    assert found.interval95 == pytest.approx((mean - t * sem, mean + t * sem), abs=1e-7)
    assert found.interval68[1] == pytest.approx(mean + special.stdtrit(n - 1, 0.84) * sem, abs=1e-7)
    # the normal law's interval would be too short by far more than the tolerance
    assert (t - Z) * sem > 1e-3


def test_each_group_brings_its_own_degrees_of_freedom(tmp_path: Path) -> None:
    drops = (5.0, 10.0, 15.0, 20.0)
    level = values(drops, "e_n") + noise(4, 0.01, 3)
    text = table(seed=1, true_sigma=0.02, e_t=-0.9) + rows(drops, level, None, "e_n")
    found = profiles(tmp_path, text, fix={})
    sem = float(level.std(ddof=1)) / 2.0
    t = float(special.stdtrit(3, 0.975))
    assert found["e_n"].dof == pytest.approx(3.0)
    assert found["e_n"].interval95 == pytest.approx(
        (float(level.mean()) - t * sem, float(level.mean()) + t * sem), abs=1e-6
    )
    assert found["e_t"].dof == pytest.approx(len(FAN) - 2)
    assert found["mu"].dof > found["e_t"].dof


def test_on_its_bound(tmp_path: Path) -> None:
    found = profiles(tmp_path, table(sigma=0.02, seed=4, e_t=-1.0))
    e_t = found["e_t"]
    assert e_t.shape == "one_sided"
    assert e_t.status == "one_sided"
    assert e_t.interval95[0] == e_t.interval68[0] == e_t.central95[0] == -1.0
    assert e_t.estimate().value is not None
    assert -1.0 <= e_t.value < e_t.interval68[1] < e_t.interval95[1] < e_t.central95[1]
    assert "its bound -1" in e_t.reason
    assert found["mu"].status == "determined"
    sticking = found["beta_sticking"]
    assert sticking.interval95 == pytest.approx((0.4, e_t.interval95[1] + 1.4))
    assert sticking.stderr == pytest.approx(e_t.stderr)


def test_one_tail_is_cut_where_the_normal_law_has_it(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(GRAZING, sigma=0.01, seed=1, e_t=-0.993), fix={})
    sd = math.sqrt(fit.gaussian.variance(fit.gaussian.to_theta[1], 1.0))
    found = profile_all(problem, fit)["e_t"]
    assert found.status == "one_sided"
    assert found.interval95[1] == pytest.approx(found.value + special.ndtri(0.95) * sd, abs=1e-6)
    assert found.central95[1] == pytest.approx(found.value + Z * sd, abs=1e-6)


def test_sticking_impacts_leave_mu_a_lower_limit(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(STEEP, sigma=0.01, seed=1))
    found = profile_all(problem, fit)
    mu = found["mu"]
    assert (mu.shape, mu.status, mu.reason) == ("one_sided", "one_sided", "only a lower limit")
    assert mu.estimate().value is None
    assert 0.08 < mu.interval95[0] < TRUTH["mu"]
    assert mu.interval95[1] == math.inf
    assert (mu.rise[mu.x > 0.12] <= 1e-6).all()  # flat all the way
    assert found["kappa"].interval95[0] == pytest.approx(mu.interval95[0] * 1.94)
    angle = found["transition_angle_deg[run]"]
    assert angle.interval95[1] == 90.0
    assert math.tan(math.radians(angle.interval95[0])) == pytest.approx(2.5 * found["kappa"].interval95[0])
    _, derived, _ = profiled_estimates(problem, fit)
    assert derived["transition_angle_deg"] == {"run": None}


def test_two_optima_are_two_pieces(tmp_path: Path) -> None:
    # two points: sticking and sliding explain them, and sliding alone does too
    found = profiles(tmp_path, table((20.0, 60.0), sigma=0.01))
    mu = found["mu"]
    assert mu.shape == "multimodal"
    assert mu.status == "not_determined"
    assert len(mu.pieces) == 2
    assert mu.pieces[0][1] < 0.08 < 0.1 < mu.pieces[1][0]
    assert mu.interval95 == (mu.pieces[0][0], mu.pieces[1][1])
    barrier = mu.rise[(mu.x > mu.pieces[0][1]) & (mu.x < mu.pieces[1][0])]
    assert barrier.max() > limit(0.95)
    # the control: a third point between them decides, and one piece is left
    alone = profiles(tmp_path, table((20.0, 40.0, 60.0, 80.0), sigma=0.01))["mu"]
    assert alone.shape == "bounded"
    assert alone.pieces == (alone.interval95,)
    assert alone.status == "determined"


def test_what_the_data_do_not_see_is_never_determined(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(GRAZING, sigma=0.001, seed=1), fix={})
    constants, derived, found = profiled_estimates(problem, fit)
    assert found["e_n"].shape == "flat"
    assert found["mu"].shape == "bounded"
    mu = constants["mu"]
    assert (mu.status, mu.value) == ("not_determined", None)
    assert mu.reason == "the data fix kappa = mu (1 + e_n) only"
    kappa = derived["kappa"]
    assert kappa.status == "determined"
    assert mu.interval95 == pytest.approx((kappa.interval95[0] / 2.0, kappa.interval95[1]), rel=1e-6)


def test_a_prior_that_narrows_is_named(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(GRAZING, sigma=0.01, seed=1), fix={}, prior={"e_n": (0.94, 0.01)})
    constants, _, found = profiled_estimates(problem, fit)
    assert constants["e_n"].status == "prior"
    assert constants["e_n"].interval95 == pytest.approx((0.94 - Z * 0.01, 0.94 + Z * 0.01), abs=1e-6)
    assert "your prior of e_n" in constants["mu"].reason
    assert found["kappa"].status == "determined"


def test_separate_constants_under_a_shared_one(tmp_path: Path) -> None:
    few = FAN[::3]  # what profiles cost grows with the rows
    second = table(few, sigma=0.02, seed=2, mu=0.2, e_t=-0.9).removeprefix(HEADER).replace("run,", "second,")
    text = table(few, sigma=0.02, seed=1, e_t=-0.9) + second
    problem, fit = question(tmp_path, text, separate="mu")
    constants, derived, found = profiled_estimates(problem, fit)
    assert set(found) == {
        "e_t", "mu[run]", "mu[second]", "kappa[run]", "kappa[second]", "beta_sticking",
        "transition_angle_deg[run]", "transition_angle_deg[second]",
    }  # fmt: skip
    for place, series in ((2, "run"), (3, "second")):
        sd = math.sqrt(fit.gaussian.variance(fit.gaussian.to_theta[place], 1.0))
        mu = constants["mu"][series]
        assert mu.status == "determined"
        assert mu.value == pytest.approx(float(fit.optimum.theta[place]))
        assert 0.7 < mu.stderr / sd < 1.3
        assert derived["kappa"][series].value == pytest.approx(1.94 * mu.value)
        assert derived["transition_angle_deg"][series].status == "determined"


def test_walton_profiles_its_transition_over_both_constants(tmp_path: Path) -> None:
    text = table(sigma=0.01, seed=1, closure="fr", beta0=0.45, e_t=None)
    problem, fit = question(tmp_path, text, closure="fr")
    _, derived, found = profiled_estimates(problem, fit)
    angle = derived["transition_angle_deg"]["run"]
    lsq = ifrfit.fit(tmp_path / "impacts.csv", fix=KNOWN, closure="fr", method="lsq").derived[
        "transition_angle_deg"
    ]["run"]
    assert angle.value == pytest.approx(lsq.value)
    assert angle.stderr == pytest.approx(lsq.stderr, rel=0.3)
    assert found["transition_angle_deg[run]"].rise.min() <= 1e-9


def test_spin_that_sticks_between_two_slidings_has_two_transitions(tmp_path: Path) -> None:
    gamma = tuple(float(g) for g in range(2, 86, 3))
    state = ifrfit.rebound(np.array(gamma), 0.0, -0.8, e_n=0.94, e_t=-0.9, mu=0.12, degrees=True)
    beta = np.asarray(state.beta) + noise(len(gamma), 0.01, 1)
    lines = [f"run,beta,{g!r},0,-0.8,{b!r},0.01\n" for g, b in zip(gamma, beta.tolist(), strict=True)]
    text = "series,observable,gamma_deg,spin_x,spin_y,value,sigma\n" + "".join(lines)
    problem, fit = question(tmp_path, text)
    _, derived, found = profiled_estimates(problem, fit)
    first, second = derived["transition_angle_deg"]["run"]
    assert first.interval95[0] < first.value < first.interval95[1] < second.interval95[0]
    assert second.interval95[0] < second.value < second.interval95[1]
    assert "transition_angle_deg[run] (first)" in found


def test_a_search_that_stopped_too_early_is_found_out(tmp_path: Path) -> None:
    # the control: from a fit that is not the optimum the profile finds the better place, and says so
    problem, fit = question(tmp_path, table(GRAZING, sigma=0.01, seed=1, e_t=-0.9))
    wrong = fit.optimum.theta.copy()
    wrong[1] += 0.02
    moved = replace(fit, optimum=replace(fit.optimum, theta=wrong, minima=((0.0, wrong),)))
    right, found = profile_all(problem, fit)["e_t"], profile_all(problem, moved)["e_t"]
    assert found.value == pytest.approx(right.value, abs=1e-4)
    assert found.interval95 == pytest.approx(right.interval95, abs=1e-5)


def test_curved_observables_are_searched(tmp_path: Path) -> None:
    text = HEADER + rows(
        FAN, values(FAN, "beta_tot", e_t=-0.8) + noise(len(FAN), 0.003, 1), 0.003, "beta_tot"
    )
    problem, fit = question(tmp_path, text)
    found = profile_all(problem, fit, curves=False)
    for name, truth in (("e_t", -0.8), ("mu", 0.12)):
        assert found[name].central95[0] < found[name].value < found[name].central95[1]
        assert abs(found[name].value - truth) < 4.0 * found[name].stderr


def test_over_the_outgoing_velocity_e_n_may_be_open(tmp_path: Path) -> None:
    # tan_psi_out has no limit at e_n = 0, to which both kinds of profile go
    few = GRAZING[::3]  # what the search for a curved observable costs grows with the rows
    text = HEADER + rows(few, np.full(len(few), 0.5), 3.0, "tan_psi_out")
    fix = {"e_t": TRUTH["e_t"]}
    problem, fit = question(tmp_path, text, fix=fix)
    constants, _, found = profiled_estimates(problem, fit)
    lsq = ifrfit.fit(tmp_path / "impacts.csv", method="lsq", fix=fix).constants["e_n"]
    # such a noise leaves e_n one end at least, and the profile was followed to it
    assert found["e_n"].shape in ("flat", "one_sided")
    assert constants["e_n"].status == lsq.status
    assert constants["e_n"].value is None
