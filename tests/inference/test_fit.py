"""What `fit` says: statuses, intervals, facts, noise, selection of a whole result."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from factories import problem_of
from refusals import refused
from scipy import stats

import ifrfit
from ifrfit import DataError, UsageError
from ifrfit.data.catalogue import printed_constants
from ifrfit.inference.diagnostics.optimum_facts import noise_converged
from ifrfit.inference.estimators import ESTIMATORS, MCMC, Bootstrap
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.physics import rebound

GAMMA = np.linspace(4.0, 86.0, 34)


def test_the_covariance_agrees_with_lmfit(impacts):
    path = impacts(gamma=GAMMA, observables=("beta", "e_n"), noise=0.03, sigma=0.03, c=-0.8, seed=1)
    found = ifrfit.fit(path, method="lsq")
    theirs = found.lmfit_result
    assert theirs.chisqr == pytest.approx(found.fit.chi2, rel=1e-9)
    for name in ("e_n", "e_t", "mu"):
        assert found.constants[name].value == pytest.approx(theirs.params[name].value, abs=1e-7)
        assert found.constants[name].stderr == pytest.approx(theirs.params[name].stderr, rel=1e-4)
    names, matrix = found.correlation.names, found.correlation.matrix
    at = names.index("e_t"), names.index("mu")
    assert matrix[at] == pytest.approx(theirs.params["e_t"].correl["mu"], abs=1e-4)


def test_intervals_are_those_of_the_normal_law_far_from_bounds(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.7), fix={"e_n": 0.94}, method="lsq")
    mu = found.constants["mu"]
    low, high = mu.interval(0.95)
    assert (low, high) == pytest.approx(
        (mu.value - 1.959964 * mu.stderr, mu.value + 1.959964 * mu.stderr), rel=1e-6
    )
    low, high = mu.interval(0.68)
    assert high - low == pytest.approx(2.0 * stats.norm.ppf(0.84) * mu.stderr, rel=1e-6)
    with refused(UsageError, match=r"kept at 0\.68 and 0\.95"):
        mu.interval(0.9)


def test_unknown_noise_uses_students_law_and_finds_the_noise(impacts):
    found = ifrfit.fit(
        impacts(gamma=GAMMA, noise=0.05, sigma=None, c=-0.7, seed=3), fix={"e_n": 0.94}, method="lsq"
    )
    assert found.noise.policy == "unknown"
    assert found.noise.sigma["run/beta"] == pytest.approx(0.05, rel=0.35)
    e_t = found.constants["e_t"]
    half = (e_t.interval95[1] - e_t.interval95[0]) / 2.0
    assert half == pytest.approx(stats.t.ppf(0.975, 32) * e_t.stderr, rel=1e-6)


def test_scaled_noise_multiplies_the_errors_by_one_factor(impacts):
    path = impacts(gamma=GAMMA, noise=0.05, sigma=0.01, c=-0.7, seed=3)
    known = ifrfit.fit(path, fix={"e_n": 0.94}, noise="known", method="lsq")
    scaled = ifrfit.fit(path, fix={"e_n": 0.94}, noise="scaled", method="lsq")
    factor = math.sqrt(known.fit.chi2 / known.fit.dof)
    assert scaled.constants["mu"].value == pytest.approx(known.constants["mu"].value, rel=1e-12)
    assert scaled.constants["mu"].stderr == pytest.approx(factor * known.constants["mu"].stderr, rel=1e-9)
    assert known.facts["scatter_too_large"].figures["factor"] == pytest.approx(factor)  # five times
    assert scaled.facts["lack_of_fit"].ok


def test_two_groups_of_unknown_noise_are_told_apart(impacts):
    quiet = {"gamma": GAMMA, "noise": 0.01, "sigma": None, "c": -0.7, "series": "quiet", "seed": 1}
    loud = {"gamma": GAMMA, "noise": 0.1, "sigma": None, "c": -0.7, "series": "loud", "seed": 2}
    found = ifrfit.fit(impacts(quiet, loud), fix={"e_n": 0.94}, method="lsq", separate="noise")
    assert found.noise.sigma["quiet/beta"] == pytest.approx(0.01, rel=0.35)
    assert found.noise.sigma["loud/beta"] == pytest.approx(0.1, rel=0.35)
    assert found.facts["converged"].ok


@pytest.mark.parametrize("dof", [math.inf, 8.0])
def test_what_did_not_settle_is_not_said_to_have_converged(impacts, dof):
    settled = least_squares(
        problem_of(ifrfit.read(impacts({"gamma": np.linspace(5.0, 80.0, 30), "sigma": 0.02})))
    )
    assert noise_converged(replace(settled, noise_dof=dof)).ok
    fact = noise_converged(replace(settled, noise_dof=dof, change=2e-3))
    assert not fact.ok
    assert "not settled: the last step was still one of 0.2 %" in fact.says


def test_one_angle_cannot_tell_the_constants_apart(impacts):
    found = ifrfit.fit(impacts(gamma=np.full(12, 60.0), noise=0.02, sigma=0.02), fix={"e_n": 0.94})
    assert "one slip ratio" in found.facts["identifiable"].says
    assert found.constants["e_t"].value is None


def test_a_constant_on_its_bound_is_one_sided(impacts):
    """By chance 2.5 % lie more than 1.96 sd above the bound; 5 or more of 20 would have p < 3e-4."""
    statuses = []
    for seed in range(20):
        path = impacts(gamma=GAMMA, noise=0.02, sigma=0.02, c=-1.0, seed=seed)
        e_t = ifrfit.fit(path, fix={"e_n": 0.94}).constants["e_t"]
        statuses.append(e_t.status)
        if e_t.status == "one_sided":
            assert e_t.interval95[0] == -1.0
            assert -1.0 < e_t.interval95[1] < -0.95
    assert statuses.count("one_sided") >= 16


def test_a_useless_prior_changes_nothing(impacts):
    path = impacts(gamma=GAMMA, observables=("beta", "e_n"), noise=0.03, sigma=0.03, c=-0.8)
    found = ifrfit.fit(path, prior={"e_n": (0.5, 10.0)})
    assert found.constants["e_n"].status == "determined"


def test_information_criteria_count_rank_and_free_noise(impacts):
    path = impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8)
    known = ifrfit.fit(path)
    assert known.fit.rank == 2  # three names, two combinations
    assert known.fit.aic == pytest.approx(2 * 2 - 2 * known.fit.log_likelihood)
    log_l = stats.norm.logpdf(known.points["residual"], scale=0.03).sum()
    assert known.fit.log_likelihood == pytest.approx(log_l)
    unknown = ifrfit.fit(path, noise="unknown")
    assert unknown.fit.aic == pytest.approx(2 * 3 - 2 * unknown.fit.log_likelihood)
    assert unknown.fit.bic == pytest.approx(3 * math.log(34) - 2 * unknown.fit.log_likelihood)


def test_transition_and_sticking_restitution_follow_from_the_constants(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, c=-0.8), fix={"e_n": 0.94}, method="lsq")
    assert found.derived["beta_sticking"].value == pytest.approx(0.6, abs=1e-9)
    angle = found.derived["transition_angle_deg"]["run"]
    assert angle.value == pytest.approx(math.degrees(math.atan(2.5 * 0.12 * 1.94)), abs=1e-7)


@pytest.mark.parametrize("method", ["lsq", "exact", "profile"])
@pytest.mark.parametrize("fix", [{"e_n": 0.94}, {"e_n": 0.94, "mu": 0.12}])
def test_what_kappa_is_is_no_reason_of_the_transition(impacts, method, fix):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8), fix=fix, method=method)
    kappa, angle = found.derived["kappa"], found.derived["transition_angle_deg"]["run"]
    assert (kappa.reason, angle.reason) == ("mu (1 + e_n)", "")
    assert angle.status == kappa.status


def test_top_spin_has_two_transitions(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, c=-0.8, mu=0.062, spin_y=-0.5), fix={"e_n": 0.94})
    first, second = found.derived["transition_angle_deg"]["run"]
    assert 0.0 < first.value < 30.0 < second.value < 90.0
    assert first.interval95[0] <= first.value <= first.interval95[1]


@pytest.mark.parametrize("policy", ["unknown", "scaled"])
def test_too_few_points_need_a_sigma(policy, impacts):
    path = impacts(gamma=np.array([20.0, 60.0]), sigma=None if policy == "unknown" else 0.05)
    with refused(DataError, match=r"2 values of beta .* need a sigma\. Add a column sigma"):
        ifrfit.fit(path, fix={"e_n": 0.94}, noise=policy)


USAGE = [
    ({"fix": {"e_t": -2.0}}, r"--fix e_t=-2: outside the domain \[-1, -0\.4\]"),
    ({"fix": {"e_n": np.nan}}, r"--fix e_n=nan: outside the domain"),
    ({"fix": {"beta": 0.4}}, r"--fix beta: closure IFR has no such constant\. It has e_n, e_t, mu\."),
    ({"bounds": {"mu": (-0.3, 0.1)}}, r"mu cannot be negative"),
    ({"bounds": {"mu": (1.0, 0.0)}}, r"--bounds mu: the lower end 1 must lie below the upper end 0\."),
    ({"separate": "e_n", "fix": {"e_n": 0.9}}, r"--fix e_n contradicts --separate e_n: keep one\."),
    ({"prior": {"mu": (0.3, 0.0)}}, r"--prior mu: the standard deviation must be positive and sensible"),
    ({"fix": {"e_n": 0.9}, "prior": {"e_n": (0.9, 0.1)}}, r"--fix e_n contradicts --prior e_n: keep one"),
    ({"inertia_factor": 2.0}, r"the passive domain \[-1, -2\] of e_t is empty"),
    ({"seed": -1}, r"--seed -1: it must be 0 or more"),
    ({"fix": {"mu": 1e300}}, r"--fix mu=1e\+300: no impact has such a value"),
    ({"prior": {"mu": (1e300, 1.0)}}, r"--prior mu: no impact has a mean of 1e\+300"),
    ({"prior": {"mu": (0.1, 1e-300)}}, r"--prior mu=0\.1,1e-300: an sd below 1e-05 fixes mu"),
    ({"prior": {"mu": (0.1, 9e-6)}}, r"an sd below 1e-05 fixes mu\. Use --fix mu=0\.1\."),
    ({"prior": {"mu": (0.1, -1.0)}}, r"--prior mu: the standard deviation must be positive and sensible"),
    ({"bounds": {"e_t": (-np.inf, np.inf)}}, r"--bounds e_t: both ends must be finite"),
]

QUICK = {"bootstrap": Bootstrap(replicates=100), "mcmc": MCMC(max_steps=1000)}


@pytest.mark.parametrize(("choices", "text"), USAGE)
def test_wrong_choices_are_refused_in_words(choices, text, impacts):
    with refused(UsageError, match=text):
        ifrfit.fit(impacts(gamma=GAMMA), **choices)


@pytest.mark.parametrize(
    "method", [pytest.param(m, marks=pytest.mark.long) if m == "bootstrap" else m for m in ESTIMATORS]
)
def test_the_narrowest_prior_is_as_good_as_a_fixed_value(method, impacts):
    path = impacts({"gamma": GAMMA, "noise": 0.03, "seed": 3, "observables": ("beta", "e_n")})
    narrow = ifrfit.fit(path, prior={"mu": (0.1, 1e-5)}, method=QUICK.get(method, method))
    fixed = ifrfit.fit(path, fix={"mu": 0.1}, method="lsq")
    assert narrow.constants["mu"].value == pytest.approx(0.1, abs=2e-5)
    for name in ("e_n", "e_t"):
        # a median lies beside the optimum, and a few draws scatter
        allowed = 0.5 * fixed.constants[name].stderr
        assert narrow.constants[name].value == pytest.approx(fixed.constants[name].value, abs=allowed)
        assert narrow.constants[name].status == "determined"


def test_nothing_to_fit_is_refused():
    with refused(UsageError, match="nothing to fit"):
        ifrfit.fit([])


def test_several_files_share_constants_by_default(impacts):
    one = impacts({"gamma": GAMMA, "noise": 0.03, "seed": 1, "series": "a"}, name="a.csv")
    two = impacts({"gamma": GAMMA, "noise": 0.03, "seed": 2, "series": "b"}, name="b.csv")
    both = ifrfit.fit([one, two], fix={"e_n": 0.94})
    alone = ifrfit.fit(one, fix={"e_n": 0.94})
    assert both.fit.n == 2 * alone.fit.n
    assert both.constants["mu"].stderr < alone.constants["mu"].stderr
    assert [source.name for source in both.inputs] == ["a.csv", "b.csv"]


def test_the_observations_are_not_changed_by_a_fit(impacts):
    data = ifrfit.read(impacts(gamma=GAMMA))
    before = data.table
    ifrfit.fit(data, fix={"e_n": 0.94})
    assert data.table.equals(before)


@pytest.mark.parametrize("wrong", [0.05, 0.20])
def test_a_wrong_e_n_is_not_recovered_from_beta_but_kappa_is(wrong):
    """mu from beta inherits the error of e_n, kappa = mu (1 + e_n) does not."""
    truth = printed_constants("cross-2019")["no spin"]
    kappa = truth["mu"] * (1.0 + truth["e_n"])
    found = ifrfit.fit("cross-2019", fix={"e_n": truth["e_n"] - wrong})
    right = ifrfit.fit("cross-2019", fix={"e_n": truth["e_n"]})
    lo, hi = found.derived["kappa"].interval95
    assert lo < kappa < hi
    assert found.derived["kappa"].value == pytest.approx(right.derived["kappa"].value, rel=1e-9)
    np.testing.assert_allclose(
        found.constants["mu"].value * (1.0 + truth["e_n"] - wrong),
        right.constants["mu"].value * (1.0 + truth["e_n"]),
        rtol=1e-9,
    )


@pytest.mark.parametrize("method", ["lsq", "exact", "profile"])
def test_constants_that_are_all_fixed_are_held_against_the_data(method):
    """Nothing is left to estimate, and residuals still are judged."""
    found = ifrfit.fit("kharaz-2001", fix={"e_n": 0.98, "e_t": -0.9, "mu": 0.09}, method=method)
    assert {each.status for each in found.constants.values()} == {"fixed"}
    assert not found.correlation.names
    assert not found.facts["prior_conflict"].ok


@pytest.mark.parametrize("method", ["lsq", "exact", "profile", "bootstrap"])
def test_constants_that_are_all_fixed_go_through_files_and_pages(tmp_path, method):
    """Residuals that drift are told, though no interval is too short."""
    gamma = np.linspace(5.0, 80.0, 25)
    beta = ifrfit.rebound(gamma, e_n=0.9, e_t=-0.95, mu=0.15, degrees=True).beta + np.linspace(
        -0.04, 0.04, 25
    )
    fix = {"e_n": 0.9, "e_t": -0.95, "mu": 0.15}
    found = ifrfit.fit(gamma_deg=gamma, beta=beta, sigma=0.02, fix=fix, method=method)
    says = found.facts["independence"].says
    assert "residuals of neighbours along the table are alike" in says
    assert "too short" not in says
    assert found.predict([10.0])["hi95"].notna().all()
    found.save(tmp_path / "result.json")
    again = ifrfit.load_result(tmp_path / "result.json")
    assert again.to_dict() == found.to_dict()
    again.report(tmp_path / "report.md")
    found.plot()


def test_a_prior_beside_two_equal_angles():
    found = ifrfit.fit(gamma_deg=[78.7, 78.7], mu_app=[0.57, 0.63], prior={"mu": (0.2, 0.02)})
    assert found.constants.mu.status == "prior"
    assert found.constants.e_t.status != "determined"


def test_values_that_count_no_unknown_noise():
    tangent = [-0.20669535815597548, -0.19728142718224959, -0.1379052568699911]
    tangent += [-0.13401321406173017, -0.11161169953746225, -0.12647853934526287]
    total = [0.8239180753039481, 0.8155506972327629, 0.9156510277869551]
    total += [0.7601508002863461, 0.8731760616705136, 0.8985562351564407]
    found = ifrfit.fit(
        gamma_deg=[14.604451689319585] * 6, tan_psi_after=tangent, beta_tot=total, closure="f", method="lsq"
    )
    assert found.constants.e_n.status == "not_determined"


@pytest.mark.parametrize("method", ["exact", "lsq", "profile"])
def test_sigma_so_small_that_chi2_has_no_digits_is_refused(method):
    """It was an internal error of one method, and ten minutes of another."""
    gamma = np.linspace(10.0, 80.0, 20)
    state = rebound(gamma, 0.0, 0.0, degrees=True, e_n=0.8, e_t=-0.6, mu=0.2)
    scatter = 0.02 * np.random.default_rng(0).standard_normal((2, 20))
    columns = {"gamma_deg": gamma, "beta": state.beta + scatter[0], "e_n": 0.8 + scatter[1]}
    for sigma in (1e-10, 1e-13):
        table = pd.DataFrame(columns | {"sigma_beta": sigma, "sigma_e_n": sigma})
        with refused(DataError, match=r"no digits are left .* --noise scaled"):
            ifrfit.fit(table, method=method)
        assert ifrfit.fit(table, method=method, noise="scaled").constants["e_n"].status == "determined"
