"""What users choose: refused in words where it cannot be, and in the result where it can."""

from __future__ import annotations

import numpy as np
import pytest
from factories import BILINEAR, table_file
from refusals import refused

import ifrfit
from ifrfit import AngleErrors, Noise
from ifrfit.errors import IfrfitError
from ifrfit.inference.appraise import appraise
from ifrfit.inference.io.plain import Node, from_plain, to_plain
from ifrfit.inference.model.error_law import STUDENT_T
from ifrfit.inference.model.error_model import PLAIN, ErrorModel
from ifrfit.inference.option_fields import build
from ifrfit.inference.result.restore import question
from ifrfit.physics import rebound
from ifrfit.report.page import page

SET = Noise(angles=AngleErrors("set"))


def table_of(tmp_path, observables=("beta",), *, sigma=0.05, sigma_gamma=1.5, n=24, name="a.csv"):
    rng = np.random.default_rng(2)
    gamma = np.linspace(10.0, 80.0, n)
    r = rebound(gamma + 1.5 * rng.standard_normal(n), e_n=0.9, e_t=-0.85, mu=0.15, degrees=True)
    values = {
        "beta": r.beta,
        "v_x": r.v_x,
        "v_n": r.v_n,
        "spin_y_after": r.spin_y,
        "mu_app": r.mu_app,
        "beta_cm": r.beta_cm,
    }
    columns = {"gamma_deg": gamma} | {o: values[o] + 0.05 * rng.standard_normal(n) for o in observables}
    if sigma:
        columns |= {f"sigma_{o}": sigma for o in observables}
    if sigma_gamma:
        columns["sigma_gamma_deg"] = sigma_gamma
    return table_file(tmp_path / name, columns, "%.6g")


def said(call):
    with refused(IfrfitError) as caught:
        call()
    return caught.value.in_shell


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        ({"tails": "cauchy"}, "--tails cauchy: choose gaussian or student-t"),
        ({"dof": 3.0}, "--dof belongs to --tails student-t"),
        ({"tails": "student-t", "dof": 0.2}, "--dof 0.2: choose 1 (Cauchy) or more"),
        ({"angle_errors": "berkson"}, "choose none, effective, set or measured"),
        ({"angle_errors": "measured"}, "needs --angle-population LO,HI"),
        ({"angle_errors": "set", "angle_population": (0.0, 90.0)}, "belongs to --angle-errors measured"),
        ({"angle_errors": "measured", "angle_population": (50.0, 10.0)}, "0 <= LO < HI <= 90"),
        ({"sigma_gamma": 1.0}, "--sigma-gamma needs --angle-errors"),
        ({"angle_errors": "set", "sigma_gamma": -1.0}, "it must lie above 0"),
        ({"sigma_spin": 0.1}, "--sigma-spin needs --sigma-velocity"),
        ({"sigma_velocity": 0.0}, "--sigma-velocity 0: it must be positive"),
    ],
)
def test_choices_that_cannot_be_are_refused_in_words(choice, words):
    assert words in said(lambda: build(Noise, choice))


def test_choices_come_back_as_they_were_made():
    assert ErrorModel() == PLAIN
    assert ErrorModel(tails="student-t").dof == STUDENT_T.default_dof
    choices = {
        "dof": 7.0,
        "angle_errors": "measured",
        "angle_population": (5.0, 80.0),
        "sigma_gamma": 0.7,
        "sigma_velocity": None,
        "sigma_spin": None,
        "tails": "student-t",
    }
    chosen = build(Noise, choices).error_model
    assert to_plain(chosen) == choices | {"angle_population": [5.0, 80.0]}
    assert from_plain(ErrorModel, Node(to_plain(chosen), "", "")) == chosen
    assert ErrorModel(velocity=0.01, spin=0.02).is_plain


# method, scatter, closure: run, or refused with these words (docs/noise.md shows the same table)
SUPPORT = [
    ("exact", {"tails": "student-t"}, None),
    ("exact", {"angle_errors": "effective"}, None),
    ("exact", {"angle_errors": "set"}, None),
    ("exact", {"angle_errors": "measured", "angle_population": (5.0, 85.0)}, None),
    ("exact", {"sigma_velocity": 0.04, "sigma_spin": 0.03}, None),
    ("lsq", {"tails": "student-t"}, None),
    ("lsq", {"angle_errors": "effective"}, None),
    ("lsq", {"sigma_velocity": 0.04, "sigma_spin": 0.03}, None),
    ("lsq", {"angle_errors": "set"}, "--method lsq cannot integrate true angles out"),
    ("profile", {"sigma_velocity": 0.04, "sigma_spin": 0.03}, None),
    ("profile", {"tails": "student-t"}, "--method profile knows independent Gaussian errors"),
    ("profile", {"angle_errors": "effective"}, "--method profile knows independent Gaussian errors"),
]


# every line with one closure, and every closure with a fourth of the lines; the others with -m long
EACH = [
    pytest.param(*line, closure, marks=() if closure == "ifr" or (i + j) % 4 == 0 else pytest.mark.long)
    for i, closure in enumerate(BILINEAR)
    for j, line in enumerate(SUPPORT)
]


@pytest.mark.parametrize(("method", "choice", "refusal", "closure"), EACH)
def test_support_of_method_by_noise_by_closure(tmp_path, closure, method, choice, refusal):
    path = table_of(tmp_path)

    def run():
        return ifrfit.fit(path, closure=closure, method=method, noise=build(Noise, choice), fix={"e_n": 0.9})

    if refusal:
        assert refusal in said(run)
        return
    result = run()
    assert result.method == method
    assert result.noise.error_model == build(Noise, choice).error_model
    assert result.noise.error_model.words in result.summary().replace("\n  ", " ")
    assert result.constants["mu"].interval95[0] < result.constants["mu"].interval95[1]


def test_result_file_keeps_the_scatter(tmp_path):
    path = table_of(tmp_path)
    result = ifrfit.fit(path, noise=Noise(tails="student-t", angles=AngleErrors("set")), fix={"e_n": 0.9})
    result.save(tmp_path / "r.json")
    again = ifrfit.load_result(tmp_path / "r.json")
    assert again.noise.error_model == result.noise.error_model
    assert again.to_dict() == result.to_dict()
    problem, optimum = question(again)
    assert problem.error_model == result.noise.error_model
    assert optimum.optimum.theta == pytest.approx(result.least_squares.optimum.theta, abs=1e-9)
    assert any("Student-t errors (4 degrees of freedom)" in warning for warning in result.warnings)
    assert not any("Not propagated" in warning for warning in result.warnings)


def test_profiles_and_their_comparison_do_not_know_it(tmp_path):
    result = ifrfit.fit(table_of(tmp_path), noise=Noise(tails="student-t"), fix={"e_n": 0.9})
    assert "Intervals are compared for independent Gaussian errors" in said(result.intervals)
    text = page(result, appraise(result, closures=False))
    assert "Profiles know independent Gaussian errors of the values only." in text


def test_one_unknown_noise_is_named_as_such(tmp_path):
    result = ifrfit.fit(table_of(tmp_path, sigma=None), noise=Noise(tails="student-t"), fix={"e_n": 0.9})
    assert result.noise.policy == "unknown"
    (name,) = result.noise.estimates
    assert name == "a/beta"
    low, high = result.noise.estimates[name].interval95
    assert 0.02 < low < high < 0.2
    assert "one unknown noise" in result.summary()


def test_several_unknown_noises_are_refused(tmp_path):
    path = table_of(tmp_path, ("beta_cm", "spin_y_after"), sigma=None)
    words = said(lambda: ifrfit.fit(path, noise=Noise(tails="student-t"), fix={"e_n": 0.9}))
    assert "2 unknown noises (a/beta_cm, a/spin_y_after) beside --tails student-t" in words


def test_data_without_errors_of_angles_are_refused(tmp_path):
    path = table_of(tmp_path, sigma_gamma=None)
    assert "no row states an uncertainty of its angle" in said(lambda: ifrfit.fit(path, noise=SET))
    assert (
        ifrfit.fit(path, noise=Noise(angles=AngleErrors("set", sigma_deg=1.5)), fix={"e_n": 0.9}).method
        == "exact"
    )


def test_angles_outside_their_population_are_refused(tmp_path):
    narrow = Noise(angles=AngleErrors("measured", population=(40.0, 80.0)))
    words = said(lambda: ifrfit.fit(table_of(tmp_path), noise=narrow))
    assert "line 2: the angle 10 lies more than five of its standard uncertainties outside" in words


def test_angles_that_tie_e_n_are_left_to_sampling(tmp_path):
    path = table_of(tmp_path, ("mu_app",), n=12)
    found = ifrfit.fit(path, noise=SET)
    assert found.facts["converged"].figures["integrator"] == "importance sampling"
    words = said(lambda: ifrfit.fit(path, noise=SET, method=ifrfit.Exact(integrator="quadrature")))
    assert "--angle-errors set with mu_app: the true angle ties e_n" in words


def test_sampled_true_angles_agree_with_the_grid_where_there_is_one(tmp_path):
    path = table_of(tmp_path, ("mu_app",), n=12)
    by_grid, sampled = (
        ifrfit.fit(path, noise=SET, fix={"e_n": 0.9}, method=ifrfit.Exact(integrator=each))
        for each in ("automatic", "sampling")
    )
    assert "integrator" not in by_grid.facts["converged"].figures
    error = sampled.distribution.error
    for name in ("e_t", "mu"):
        sd = by_grid.distribution.sd(name)
        assert abs(sampled.distribution.mean(name) - by_grid.distribution.mean(name)) <= 4.0 * error * sd
        assert abs(sampled.distribution.sd(name) - sd) <= 4.0 * error * sd
    gap = abs(sampled.distribution.log_evidence - by_grid.distribution.log_evidence)
    assert gap <= 4.0 * sampled.distribution.error_evidence + 1e-3


def test_errors_propagate_from_velocities(tmp_path):
    path = table_of(tmp_path, ("beta_cm", "spin_y_after", "v_n"), sigma=None)
    result = ifrfit.fit(path, noise=Noise(sigma_velocity=0.02, sigma_spin=0.01))
    points = result.points
    of = dict(list(points.groupby("observable")))
    assert of["spin_y_after"]["sigma_used"].to_numpy() == pytest.approx(0.01)
    if "v_n" in of:
        assert of["v_n"]["sigma_used"].to_numpy() == pytest.approx(0.02)
    sine = np.sin(np.radians(of["beta_cm"]["gamma_deg"]))
    assert of["beta_cm"]["sigma_used"].to_numpy() == pytest.approx(0.02 / sine)
    assert result.noise.policy == "known"


def test_errors_that_depend_on_the_constants_are_not_propagated(tmp_path):
    path = table_of(tmp_path, ("mu_app",))
    assert "cannot be propagated" in said(lambda: ifrfit.fit(path, noise=Noise(sigma_velocity=0.02)))
    path = table_of(tmp_path, ("beta",))
    assert "needs --sigma-spin" in said(lambda: ifrfit.fit(path, noise=Noise(sigma_velocity=0.02)))
