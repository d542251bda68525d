"""How the evidence moves with the widths of the priors: cut posteriors against integrals of their own."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from comparison_data import FOUR, observations
from factories import problem_of

import ifrfit
from ifrfit.inference.comparison import compare, compare_result, prior_sensitivity
from ifrfit.inference.comparison.prior_sensitivity import MU_WIDTHS, prior_of
from ifrfit.inference.posterior import exact_posterior, log_evidence


@pytest.fixture(scope="module")
def found():
    return compare(
        observations("ifr", sigma=0.1, e_t=-0.85), FOUR, loo=False, fix={"e_n": 0.9}, noise="known"
    )


def test_stated_priors_come_first(found):
    first = found.priors[0]
    assert first.varied == ""
    assert first.log_evidence == {name: e.log_evidence for name, e in found.entries.items()}


def test_every_row_is_the_evidence_under_that_prior(found):
    data = found.best.problem.observations
    for row in found.priors[1:]:
        for name, value in row.log_evidence.items():
            bounds = {}
            if row.varied.startswith("mu up to "):
                bounds = {"mu": (0.0, float(row.varied.removeprefix("mu up to ")))}
            elif f"of {found.entries[name].fit.problem.closure.title} in" in row.varied:
                low, high = (float(x) for x in row.varied.partition("[")[2][:-1].split(","))
                own = next(
                    c for c in found.entries[name].fit.problem.parameters if c.name == row.varied.split()[0]
                )
                # the ends are printed with four digits, too few where all is on the bound
                low, high = (
                    end if abs(x - end) < 1e-3 else x
                    for x, end in zip((low, high), (own.lower, own.upper), strict=True)
                )
                bounds = {own.name: (low, high)}
            own = problem_of(data, name, noise="known", fix={"e_n": 0.9}, bounds=bounds)
            assert value == pytest.approx(log_evidence(own), abs=2e-3), (row.varied, name)


def test_rows_are_of_mu_and_of_each_closure_with_a_constant(found):
    words = [row.varied for row in found.priors[1:]]
    assert words[: len(MU_WIDTHS)] == ["mu up to 0.5", "mu up to 1", "mu up to 4"]
    assert [w.partition(" in")[0] for w in words[3:]] == [
        "beta0 of FR",
        "e_t of IFR",
        "e_t of IFR-contact",
    ]


def test_half_the_domain_gains_log_2_where_the_data_decide():
    found = compare(observations("ifr", sigma=0.02, e_t=-0.7), ("fr", "ifr"), loo=False, fix={"e_n": 0.9})
    stated = found.priors[0].log_evidence
    for row in found.priors[4:]:
        gains = [row.log_evidence[name] - stated[name] for name in stated]
        assert sorted(gains) == pytest.approx([0.0, math.log(2.0)], abs=1e-3)


def test_what_the_user_set_is_not_varied():
    data = observations("ifr", sigma=0.1, e_t=-0.85)
    found = compare(
        data,
        ("f", "ifr"),
        loo=False,
        fix={"e_n": 0.9, "e_t": -0.9},
        prior={"mu": (0.15, 0.05)},
        noise="known",
    )
    assert [row.varied for row in found.priors] == [""]
    assert found.verdict.over_priors is None


def test_separate_constants_are_integrated_afresh():
    one = observations("ifr", [5, 10, 40, 60, 80], sigma=0.1, e_t=-0.85)
    two = observations("ifr", [5, 10, 40, 60, 80], sigma=0.1, e_t=-0.85, seed=4)
    other = two.table
    other["series"] = "second"
    data = type(one)(pd.concat([one.table, other], ignore_index=True), one.sources)
    fixed = {"e_n": 0.9, "e_t": -0.85}
    found = compare(data, ("f", "ifr"), loo=False, fix=fixed, separate=["mu"], noise="known")
    row = next(r for r in found.priors if r.varied == "mu up to 0.5")
    own = problem_of(data, "ifr", noise="known", fix=fixed, separate=["mu"], bounds={"mu": (0.0, 0.5)})
    assert row.log_evidence["ifr"] == pytest.approx(log_evidence(own), abs=1e-3)


def test_priors_are_stated():
    problem = problem_of(observations("ifr", e_t=-0.9), "ifr", prior={"e_n": (0.9, 0.02)})
    assert prior_of(problem) == {
        "e_n": {"lower": 0.0, "upper": 1.0, "mean": 0.9, "sd": 0.02},
        "e_t": {"lower": -1.0, "upper": -0.4},
        "mu": {"lower": 0.0, "upper": 2.0},
    }


@pytest.mark.parametrize("gamma", [[5, 10, 40, 60, 80], [3, 5, 8, 10]])
def test_a_wider_prior_is_integrated_where_the_posterior_reaches_its_end(gamma):
    """Impacts that all stick leave mu up to the end of its domain; others do not."""
    data, fixed = observations("ifr", gamma, sigma=0.05, e_t=-0.85), {"e_n": 0.9, "e_t": -0.85}
    found = compare(data, ("f", "ifr"), loo=False, fix=fixed, noise="known")
    row = next(r for r in found.priors if r.varied == "mu up to 4")
    own = problem_of(data, "ifr", noise="known", fix=fixed, bounds={"mu": (0.0, 4.0)})
    assert row.log_evidence["ifr"] == pytest.approx(log_evidence(own), abs=1e-3)


def test_half_the_domain_ends_where_the_domain_does():
    """0.3 above -0.7 is more than -0.4, by rounding: the posterior would be integrated anew."""
    data = observations("ifr", sigma=0.05, e_t=-0.41)
    found = compare(data, ("f", "ifr"), loo=False, fix={"e_n": 0.9}, noise="known").entries["ifr"].fit
    constant = found.problem.parameters["e_t"]
    low, high = prior_sensitivity._half(found.distribution, ["e_t"], constant)
    assert (low, high) == (pytest.approx(-0.7), constant.upper)


def test_weighted_draws_know_their_share_between_ends(monkeypatch):
    one = observations("ifr", [5, 8, 40, 60, 80], sigma=0.2, e_t=-0.85)
    two = observations("ifr", [5, 8, 12, 16, 20], sigma=0.2, e_t=-0.85, seed=4)
    other = two.table
    other["series"] = "second"
    data = type(one)(pd.concat([one.table, other], ignore_index=True), one.sources)
    fixed, labels = {"e_n": 0.9}, ["mu[0]", "mu[second]"]
    problem = problem_of(data, "ifr", noise="known", fix=fixed, separate=["mu"])
    labels = [name for name in problem.parameters.names if name.startswith("mu")]
    sampled = exact_posterior(problem, integrator="sampling")
    for end in (0.5, 1.0):
        cut = problem_of(data, "ifr", noise="known", fix=fixed, separate=["mu"], bounds={"mu": (0.0, end)})
        exact = log_evidence(cut) - log_evidence(problem) - 2.0 * math.log(2.0 / end)
        share = prior_sensitivity._share_between(sampled, labels, (0.0, end))
        assert -1.5 < exact < -0.1
        assert math.log(share) == pytest.approx(exact, abs=0.04)
    # far outside no draw tells
    assert sampled.share_of(np.zeros(sampled.weights.size, dtype=bool)) == (0.0, math.inf)


@pytest.fixture(scope="module")
def rocks():
    """Faceted rocks by fr and maw, whose best mu is 47."""
    return compare("wang-2018-limestone", ["fr", "maw"], loo=False)


def test_an_optimum_beyond_the_prior_is_told_beside_its_criteria(rocks):
    # by AIC maw is as good as fr, by the evidence 64 behind, since its mu of 47 is no prior's
    both = rocks
    assert both.converged
    (said,) = [note for note in both.notes if "AIC" in note]
    assert said.startswith("AIC, BIC and p of fit of MAW are of mu = 47")
    aic = both.table()["aic"]
    assert aic["maw"] < aic["fr"]
    assert both.entries["maw"].log_bayes_factor < -50.0
    # the same within the prior, by a bound: AIC is more by what is said
    within = ifrfit.fit("wang-2018-limestone", closure="maw", bounds={"mu": (0.0, 2.0)}).fit
    assert within.aic - aic["maw"] == pytest.approx(129.0, abs=0.5)
    assert within.log_evidence == pytest.approx(both.entries["maw"].log_evidence, abs=0.02)


def test_an_optimum_within_the_prior_says_nothing(found):
    assert not [note for note in found.notes if "AIC" in note]


def test_closures_beside_a_fit_of_a_command_speak_its_words():
    fit = ifrfit.fit("cornell-glass", command="ifrfit fit cornell-glass")
    assert {e.fit.command for e in compare_result(fit).entries.values()} == {fit.command}


def test_a_mu_beyond_its_prior_turns_no_verdict_in_silence():
    # drawn by IFR with mu = 2.6: within mu up to 2 another closure leads by 126, and chi2 is 52.6 for IFR
    rng = np.random.default_rng(3)
    gamma = np.radians(rng.uniform(40.0, 88.0, 25))
    friction = 3.5 * 2.6 * 1.6 / np.tan(gamma)
    data = {
        "gamma_deg": np.degrees(gamma),
        "beta": -0.9 + np.minimum(1.4, friction) + rng.normal(0.0, 0.02, 25),
        "e_n": 0.6 + rng.normal(0.0, 0.02, 25),
        "sigma_beta": np.full(25, 0.02),
        "sigma_e_n": np.full(25, 0.02),
    }
    stated = compare(data, ["fr", "ifr", "ifr-contact"], loo=False)
    assert stated.ranked[0] == "ifr-contact"
    assert stated.verdict.kind == "undecided"
    assert "hangs on how large mu may be" in stated.verdict.says
    assert "Give mu that room, by bounds up to 4" in stated.verdict.says
    row = next(row for row in stated.priors if row.mu_upper == 4.0)
    wide = compare(data, ["fr", "ifr", "ifr-contact"], loo=False, bounds={"mu": (0.0, 4.0)})
    assert wide.ranked[0] == "ifr"
    assert "hangs on" not in wide.verdict.says
    for name, entry in wide.entries.items():
        assert row.log_evidence[name] == pytest.approx(entry.log_evidence, abs=0.02)


def test_a_mu_that_no_friction_reaches_makes_no_row_and_no_verdict(rocks):
    both = rocks
    assert both.table()["aic"]["maw"] < both.table()["aic"]["fr"]  # at mu = 47
    assert max(row.mu_upper or 0.0 for row in both.priors) == 4.0
    assert both.verdict.kind == "refuted"
