"""Constants that follow from others, against lmfit's own expressions and a density on a line."""

from __future__ import annotations

import json
from functools import cache

import lmfit
import numpy as np
import pandas as pd
import pytest
from factories import each_once, rest_long
from json_schemas import validator
from refusals import refused

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.model.ties import Ties

GAMMA = np.linspace(5.0, 85.0, 40)
TIE = {"e_t": "-1 + 2*mu"}


def table(seed, mu=0.12, sigma=0.02):
    """Impacts whose e_t is -1 + 2 mu."""
    rng = np.random.default_rng(seed)
    beta = ifrfit.rebound(GAMMA, e_n=0.9, e_t=-1.0 + 2.0 * mu, mu=mu, degrees=True).beta
    e_n = 0.9 + 0.01 * rng.normal(size=GAMMA.size)
    beta = beta + sigma * rng.normal(size=GAMMA.size)
    return pd.DataFrame(
        {"gamma_deg": GAMMA, "beta": beta, "e_n": e_n, "sigma_beta": sigma, "sigma_e_n": 0.01}
    )


ONE, TWO, THREE = table(1), table(2, 0.15), table(3, 0.1)
# some 2,000 independent draws: means to 0.02 sd, sds to 2 %
SHORT = ifrfit.MCMC(max_steps=30)


@cache
def tied_fit(method):
    """The fit of the tie, which is frozen."""
    return ifrfit.fit(ONE, tie=TIE, method=method)


def by_lmfit(data, expression):
    """The same fit with lmfit alone, from the truth."""
    params = lmfit.Parameters()
    params.add("e_n", 0.9)
    params.add("mu", 0.12)
    params.add("e_t", expr=expression)

    def residual(p):
        state = ifrfit.rebound(GAMMA, e_n=p["e_n"].value, e_t=p["e_t"].value, mu=p["mu"].value, degrees=True)
        beta = (data["beta"] - state.beta) / data["sigma_beta"]
        return np.concatenate((beta, (data["e_n"] - p["e_n"].value) / data["sigma_e_n"]))

    return lmfit.minimize(residual, params, method="least_squares", scale_covar=False)


@pytest.mark.parametrize("expression", ["-1 + 2*mu", "-exp(-2*mu)", "-sqrt(1 - mu) + 0.1*e_n"])
def test_least_squares_are_those_of_lmfit(expression):
    fit, theirs = ifrfit.fit(ONE, tie={"e_t": expression}, method="lsq"), by_lmfit(ONE, expression)
    for name in ("e_n", "e_t", "mu"):
        found, peer = fit.constants[name], theirs.params[name]
        # lmfit ends where a step changes 1e-8 of chi2, 56: 1e-3 sd
        assert found.value == pytest.approx(peer.value, abs=5e-3 * peer.stderr)
        # an impact right on the transition is one of 13 that stick, or of those that slide
        assert found.stderr == pytest.approx(peer.stderr, rel=0.5 / 13 + 1e-2)
    assert fit.fit.chi2 <= theirs.chisqr * (1.0 + 1e-8)
    assert not fit.facts["global_optimum"].ok
    assert "no bound is known for constants that are tied" in fit.facts["global_optimum"].says
    free = ifrfit.fit(ONE, method="lsq")
    assert free.constants.e_t.stderr > 2.0 * fit.constants.e_t.stderr  # the tie says something


def test_chains_have_the_density_over_the_free_constants():
    fit = ifrfit.fit(ONE, tie=TIE, fix={"e_n": 0.9}, method="mcmc")
    mu = np.linspace(0.115, 0.125, 4001)
    chi2 = np.zeros(mu.size)
    for gamma, beta in zip(GAMMA, ONE["beta"], strict=True):
        own = ifrfit.rebound(gamma, e_n=0.9, e_t=-1.0 + 2.0 * mu, mu=mu, degrees=True).beta
        chi2 += ((beta - own) / 0.02) ** 2
    weight = np.exp(-0.5 * (chi2 - chi2.min()))
    mean = float((weight * mu).sum() / weight.sum())
    sd = float(np.sqrt((weight * (mu - mean) ** 2).sum() / weight.sum()))
    draws = fit.facts["converged"].figures["ess_bulk_min"]
    within = 4.0 / np.sqrt(draws)
    assert fit.constants.mu.mean == pytest.approx(mean, abs=within * sd)
    assert fit.constants.mu.stderr == pytest.approx(sd, rel=within)
    e_t, drawn = fit.constants.e_t, fit.draws(500, np.random.default_rng(1))
    np.testing.assert_allclose(drawn["e_t"], -1.0 + 2.0 * drawn["mu"], atol=1e-12)
    assert e_t.stderr == pytest.approx(2.0 * fit.constants.mu.stderr, rel=1e-9)


@pytest.mark.parametrize("noise", ["known", "scaled", "unknown"])
def test_series_that_are_tied_are_shared(noise):
    separate = {"separate": ("e_t", "mu"), "method": "lsq", "noise": ifrfit.Noise(noise)}
    tied = ifrfit.fit({"a": ONE, "b": TWO}, tie={"e_t[b]": "e_t[a]"}, **separate)
    shared = ifrfit.fit({"a": ONE, "b": TWO}, **{**separate, "separate": ("mu", "noise")})
    for name, own in shared.flat_constants().items():
        for entry in ("e_t[a]", "e_t[b]") if name == "e_t" else (name,):
            found = tied.flat_constants()[entry]
            assert found.value == pytest.approx(own.value, abs=1e-3 * own.stderr)
            assert found.stderr == pytest.approx(own.stderr, rel=1e-3)


def test_two_of_three_series_share_and_the_third_has_its_own():
    three = {"a": ONE, "b": TWO, "c": THREE}
    fit = ifrfit.fit(three, separate=("e_t", "mu"), tie={"e_t[b]": "e_t[a]"}, method="lsq")
    e_t = fit.constants.e_t
    assert e_t["a"].value == e_t["b"].value != e_t["c"].value
    assert e_t["b"].reason == "tied: e_t[a]"


@pytest.mark.parametrize("method", rest_long(["lsq", "mcmc"]))
def test_a_tied_fit_goes_through_files_and_pages(tmp_path, method):
    fit = tied_fit(method)
    text = fit.summary()
    assert "determined: tied: -1 + 2*mu" in text
    assert "Tied: e_t = -1 + 2*mu" in text
    fit.save(tmp_path / "result.json")
    content = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    validator("result").validate(content)
    assert content["asked"]["e_t"]["ties"] == TIE
    again = ifrfit.load_result(tmp_path / "result.json")
    assert again.to_dict() == fit.to_dict()
    again.report(tmp_path / "report.md")
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "--tie 'e_t=-1 + 2*mu'" in page
    free, tied = (fit.predict([20.0], bands=True)["hi95"][0], again.predict([20.0])["hi95"][0])
    assert free == pytest.approx(tied, abs=1e-12)
    both = fit.to_uncertainties()
    assert (both["e_t"] - 2.0 * both["mu"]).std_dev < 1e-3 * both["e_t"].std_dev


def test_draws_of_least_squares_obey_the_tie_and_its_width():
    fit = tied_fit("lsq")
    draws = fit.draws(4000, np.random.default_rng(3))
    np.testing.assert_allclose(draws["e_t"], -1.0 + 2.0 * draws["mu"], atol=2e-4 * 0.1)
    assert draws["mu"].std() == pytest.approx(fit.constants.mu.stderr, rel=0.05)


def test_parameters_of_lmfit_may_hold_expressions():
    params = lmfit.Parameters()
    params.add("mu", 0.1, min=0.0)
    params.add("e_t", expr="-1 + 2*mu")
    found = ifrfit.fit(ONE, params=params, method="lsq").constants
    assert found == tied_fit("lsq").constants


@pytest.mark.parametrize(
    ("tie", "said"),
    [
        ({"e_t": "e_t + 1"}, "ties e_t to itself"),
        ({"e_t": "mu - 1", "mu": "e_t + 1"}, "a circle of e_t and mu"),
        ({"e_t": "my - 1"}, r"no constant my\. There are e_n, e_t and mu"),
        ({"e_x": "mu"}, "has no such constant"),
        ({"e_t[b]": "mu - 1"}, r"no constant e_t\[b\]"),
        ({"e_t": "-0.9"}, "names no other constant\\. Use --fix"),
        ({"e_t": "-1 +"}, "is no expression"),
        ({"e_t": "mu" + "+mu" * 100}, "up to 200 characters"),
        ({"e_t": "mu + 3"}, "leads out of the domain"),
        ({"e_t": "log(-mu)"}, "has no value anywhere"),
        ({"e_t": "max(mu, 1)"}, "knows the functions exp, log"),
        ({"e_t": 3}, "not an expression"),
    ],
    ids=str,
)
def test_what_says_nothing_is_refused(tie, said):
    with refused(UsageError, match=said):
        ifrfit.fit(ONE, tie=tie, method="lsq")


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true') + mu",
        "mu.real",
        "[x for x in mu]",
        "(lambda: mu)()",
        "exp.__class__(mu)",
        "mu if mu else 1",
        "f'{mu}'",
        "open('x') + mu",
        "mu := 3",
        "exp(*[mu])",
    ],
)
def test_what_is_no_arithmetic_never_runs(text):
    with refused(UsageError, match="--tie|tie="):
        Ties(("e_n", "e_t", "mu"), {"e_t": text}).check((), ())


@pytest.mark.parametrize(
    "method", ["exact", "profile", "bootstrap", ifrfit.Automatic(accuracy=0.01)], ids=str
)
def test_other_methods_refuse_in_words(method):
    with refused(UsageError, match=r"does not know --tie 'e_t=.*mcmc"):
        ifrfit.fit(ONE, tie=TIE, method=method)


def test_what_else_does_not_know_ties_says_so(tmp_path):
    with refused(UsageError, match="contradicts --fix of e_t"):
        ifrfit.fit(ONE, tie=TIE, fix={"e_t": -0.8}, method="lsq")
    with refused(UsageError, match="contradicts --prior of e_t"):
        ifrfit.fit(ONE, tie=TIE, prior={"e_t": (-0.8, 0.1)}, method="lsq")
    with refused(UsageError, match="independent Gaussian errors"):
        ifrfit.fit(
            ONE[["gamma_deg", "beta", "sigma_beta"]],
            tie=TIE,
            fix={"e_n": 0.9},
            method="lsq",
            noise=ifrfit.Noise("known", tails="student-t"),
        )
    with refused(UsageError, match="does not know --tie"):
        ifrfit.compare(ONE, tie=TIE)
    with refused(UsageError, match="known to two of them"):
        ifrfit.measure_costs(ONE, tie=TIE)
    ONE.to_csv(tmp_path / "part.csv", index=False)
    with refused(UsageError, match="rows that are held in memory"):
        ifrfit.fit(tmp_path, tie=TIE, method="lsq")
    fit = tied_fit("lsq")
    for ask in (fit.intervals, fit.plot_compare, lambda: fit.plot_profile("mu"), lambda: fit.lmfit_result):
        with refused(UsageError, match="tied"):
            ask()


@pytest.mark.parametrize("tie", [{"mu": "0.5*(e_t + 1)"}, {"e_n": "1.02 - mu"}, {"e_n": "1.02 - mu", **TIE}])
def test_any_constant_may_be_tied_and_both_methods_agree(tie):
    by_lsq, by_chains = (ifrfit.fit(ONE, tie=tie, method=method).constants for method in ("lsq", SHORT))
    for name, found in by_lsq.items():
        # the posterior leans by some tenths of an sd where the transition passes an impact
        assert by_chains[name].value == pytest.approx(found.value, abs=0.3 * found.stderr)
        assert by_chains[name].stderr == pytest.approx(found.stderr, rel=0.15)


def test_a_mu_that_only_the_tie_knows_is_not_held_back_by_the_default_prior():
    sticking = ONE[ONE["gamma_deg"] < 20.0]
    tied = ifrfit.fit(sticking, tie={"e_t": "-1 + 0.1*mu"}, method="lsq").constants
    free = ifrfit.fit(sticking, method="lsq", fix={"mu": 2.0}).constants  # none slides
    assert tied.e_t.value == pytest.approx(free.e_t.value, abs=1e-3 * free.e_t.stderr)
    assert tied.mu.value == pytest.approx(10.0 * (1.0 + free.e_t.value), abs=1e-2 * tied.mu.stderr)
    assert tied.mu.value > 2.0


@pytest.mark.parametrize(
    ("method", "tie"),
    each_once(["lsq", "mcmc"], [{"e_t": "-e_n"}, {"e_n": "-e_t"}, {"e_n": "0.9 + 0.1*(1 + e_t)"}]),
    ids=str,
)
def test_what_a_tie_tells_of_e_n_and_mu_is_not_called_open(tie, method):
    """Beta tells e_t and kappa; the tie tells e_n then, and both tell mu."""
    beta = ONE[["gamma_deg", "beta", "sigma_beta"]]
    alone = ifrfit.fit(beta, method="lsq", fix={"e_n": 0.9}).constants
    # of chains some 8,000 independent draws: sds to 1 %
    chosen = ifrfit.MCMC(max_steps=100) if method == "mcmc" else method
    found = ifrfit.fit(beta, method=chosen, tie=tie).constants
    names = {"e_n": 0.0, "e_t": alone.e_t.value, "mu": 0.0}
    (text,) = tie.values()
    slope = -1.0 if text.startswith("-") else 0.1
    names["e_n"] = -names["e_t"] if slope == -1.0 else 0.9 + 0.1 * (1.0 + names["e_t"])
    names["mu"] = alone.mu.value * 1.9 / (1.0 + names["e_n"])
    for name, value in names.items():
        assert found[name].status == "determined"
        assert found[name].value == pytest.approx(value, abs=0.2 * found[name].stderr)
    assert found.e_n.stderr == pytest.approx(abs(slope) * alone.e_t.stderr, rel=0.05)


@pytest.mark.parametrize("method", rest_long(["lsq", "exact", "profile", "mcmc"], 3))
def test_a_constant_that_follows_from_fixed_ones_is_fixed_by_the_tie(method, tmp_path):
    fit = ifrfit.fit(ONE, tie={"e_t": "-e_n"}, fix={"e_n": 0.8}, method=method)
    plain = ifrfit.fit(ONE, fix={"e_n": 0.8, "e_t": -0.8}, method=method)
    own = fit.constants.e_t
    assert (own.value, own.stderr, own.status, own.reason) == (-0.8, None, "fixed", "fixed by a tie: -e_n")
    assert "fixed by a tie: -e_n" in fit.summary()
    assert fit.facts["converged"].ok
    # the question is that of the value itself
    assert fit.constants.mu == plain.constants.mu
    fit.save(tmp_path / "result.json")
    kept = ifrfit.load_result(tmp_path / "result.json")
    assert kept.constants == fit.constants
    assert kept.asked == fit.asked
    assert dict(kept.asked[1].ties) == {"e_t": "-e_n"}
    kept.report(tmp_path / "report.md")  # the question is put again
    assert "Tied: e\\_t = -e\\_n" in (tmp_path / "report.md").read_text()


def test_a_series_whose_constant_follows_from_a_fixed_one_is_fixed_and_others_are_not():
    # one entry follows from a fixed constant, another from a free one
    tables = {"one": ONE, "two": TWO}
    both = pd.concat([own.assign(series=name) for name, own in tables.items()])
    tie = {"e_t[one]": "-e_n", "e_t[two]": "-1 + 2*mu"}
    fit = ifrfit.fit(both, separate=["e_t"], tie=tie, fix={"e_n": 0.8}, method="lsq")
    assert fit.constants.e_t["one"].reason == "fixed by a tie: -e_n"
    assert fit.constants.e_t["two"].reason == "tied: -1 + 2*mu"
    assert fit.constants.e_t["two"].stderr == pytest.approx(2.0 * fit.constants.mu.stderr, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [("2*e_n", "is 1.6 at what is fixed, and the domain is"), ("log(e_n - 1)", "has no value")],
)
def test_a_tie_to_fixed_ones_beyond_the_domain_is_refused(text, said):
    with refused(UsageError, match=said):
        ifrfit.fit(ONE, tie={"e_t": text}, fix={"e_n": 0.8}, method="lsq")


def test_chains_start_where_the_tie_ends_the_domain_at_the_optimum():
    # warnings are errors here; half of all places near the optimum, and its own, have no density
    beta = np.asarray(ifrfit.rebound(GAMMA, e_n=0.9, e_t=-1.0, mu=0.15, degrees=True).beta)
    fit = ifrfit.fit(
        gamma_deg=GAMMA, beta=beta, sigma=0.02, tie={"e_t": "-mu"}, fix={"e_n": 0.9}, method=SHORT
    )
    assert fit.constants.mu.value == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [("-exp(1000*mu)", "leads out of the domain"), ("entry_2_", "no constant entry_2_")],
)
def test_numbers_of_any_size_and_words_of_ours_are_refused_in_words(text, said):
    with refused(UsageError, match=said):
        ifrfit.fit(ONE, tie={"e_t": text}, method="lsq")


def test_a_tie_may_leave_nothing_free():
    fit = ifrfit.fit(ONE, tie={"e_t": "-1 + 2*mu"}, fix={"e_n": 0.9, "mu": 0.12}, method="lsq")
    assert fit.constants.e_t.value == pytest.approx(-0.76, abs=1e-12)


def test_intervals_of_least_squares_say_when_they_reach_beyond_the_domain_of_another():
    """With e_n from 0 to 1 mu lies between kappa / 2 and kappa."""
    beta = ONE[["gamma_deg", "beta", "sigma_beta"]]
    says = "the tie may end"
    by_lsq, by_chains = (ifrfit.fit(beta, tie={"e_t": "-1 + mu"}, method=m) for m in ("lsq", SHORT))
    kappa = by_lsq.derived["kappa"].value
    assert by_lsq.constants.mu.interval95[1] > kappa  # more than any e_n leaves
    assert any(says in each and "e_n" in each and "mcmc" in each for each in by_lsq.warnings)
    assert by_chains.constants.mu.interval95[1] < 1.02 * kappa
    assert not any(says in each for each in by_chains.warnings)
    inside = ifrfit.fit(beta, tie={"e_t": "-1 + 1.15*mu"}, method="lsq")
    assert inside.constants.e_n.status == "determined"
    assert not any(says in each for each in inside.warnings)


def test_a_constant_of_one_series_is_fitted_alone():
    """What the sentences about a constant in one series name works, and what they do not is refused."""
    both = {"brass": ONE, "glass": TWO}
    for option, value in (("fix", 0.95), ("prior", (0.9, 0.1)), ("bounds", (0.8, 1.0))):
        with pytest.raises(
            UsageError, match=f"{option} is of a constant in all series. Name e_n, or fit brass on"
        ):
            ifrfit.fit(both, method="lsq", **{option: {"e_n[brass]": value}})
    with pytest.raises(UsageError, match=r'Use fix={"e_n": ...}, which is of all series.*series="brass"'):
        ifrfit.fit(both, method="lsq", separate="e_n", tie={"e_n[brass]": "0.95"})
    assert ifrfit.fit(both, method="lsq", series="brass", fix={"e_n": 0.95}).constants.e_n.value == 0.95
