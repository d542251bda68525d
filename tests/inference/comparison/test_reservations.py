"""No verdict without what stands against it: where a fit says LOOK to the table, so does the comparison."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.comparison.compare import compare_result
from ifrfit.inference.comparison.reservations import reservations, with_reservations
from ifrfit.inference.result.types import Fact
from ifrfit.report.comparison.text import findings

CLOSURES = ("ifr", "fr", "maw")
RNG = np.random.default_rng(21)
N = 30
GAMMA = np.round(RNG.uniform(6.0, 80.0, N), 1)
NOISE = 0.02 * RNG.standard_normal((2, N))
E_N = 0.85 + NOISE[0]


def beta(mu=0.15):
    return ifrfit.rebound(GAMMA, e_n=0.85, e_t=-0.8, mu=mu, degrees=True).beta + NOISE[1]


def table(**changed):
    return {"gamma_deg": GAMMA, "beta": beta(), "e_n": E_N} | changed


def compared(data, **kw):
    return ifrfit.compare(data, CLOSURES, loo=False, **kw)


def looks(found):
    return [says for kind, says in findings(found) if kind == "LOOK"]


def with_an_outlier():
    values = beta()
    values[np.argmax(GAMMA)] += 0.6
    return table(beta=values)


def two_series():
    gamma, noise = RNG.uniform(6.0, 80.0, N), 0.02 * RNG.standard_normal((2, N))
    true = ifrfit.rebound(gamma, e_n=0.85, e_t=-0.8, mu=0.3, degrees=True).beta
    return {"a": table(), "b": {"gamma_deg": gamma, "beta": true + noise[0], "e_n": 0.85 + noise[1]}}


CASES = {
    "outliers": (with_an_outlier, "outlier: table row"),
    "drift": (lambda: table(beta=beta() + np.linspace(-0.1, 0.1, N)), "a drift of "),
    "zeros": (lambda: table(beta=np.where(np.arange(N) % 6, beta(), 0.0)), "0 for 'not measured' in beta"),
    "two kinds": (lambda: table(beta=np.where(np.arange(N) % 2, beta(), beta(0.3))), "impacts of two kinds"),
    "series": (two_series, "the series do not share their constants"),
    "from wall": (lambda: table(gamma_deg=90.0 - GAMMA), "angles of incidence from the wall"),
    "sign": (lambda: table(beta=-beta()), "the opposite sign in beta"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_the_fit_says_look_to_stands_before_the_verdict_is_believed(case):
    make, words = CASES[case]
    data = make()
    assert words in " ".join(str(ifrfit.fit(data)).split())
    found = compared(data)
    # before lack of fit, effects and slopes
    assert words in looks(found)[0]
    assert " Settle first: " in found.verdict.says
    assert found.verdict.says.endswith(").")
    best = found.to_dict()["closures"][found.ranked[0]]
    assert not all(fact["ok"] for fact in best["facts"].values())


def test_a_table_without_faults_has_its_verdict_alone():
    found = compared(table())
    assert not looks(found)
    assert "Settle first" not in found.verdict.says


def test_options_are_named_as_the_comparison_was_asked_for():
    (said,) = looks(compared(with_an_outlier()))
    assert "exclude=" in said
    assert "--exclude" not in said
    (said,) = looks(compared(with_an_outlier(), command="ifrfit compare made.csv"))
    assert "--exclude" in said


def test_a_fact_of_closures_that_tie_is_told_once():
    found = compared(with_an_outlier())
    told = reservations(found.entries, found.ranked)
    assert [name for name, own in told.items() if "outliers" in own] == [found.ranked[0]]


def test_one_sentence_names_every_closure_that_fails_alike():
    """From the wall the best of the refuted closures sees another slip than the one that mends the table."""
    says = compared(CASES["from wall"][0]()).verdict.says
    assert says.count("the table looks as if it had a slip in it") == 1


def test_the_page_of_a_fit_tells_of_its_own_faults_beside_the_closures():
    fit = ifrfit.fit(with_an_outlier())
    found = compare_result(fit)
    assert found.ranked[0] == "ifr"
    assert "Settle first: outliers (IFR)." in found.verdict.says
    assert any("1 outlier" in says for says in looks(found))


def test_a_best_closure_that_was_fitted_in_brief_is_provisional_where_the_fit_has_faults():
    """FR made the data, of which one reading is off; IFR was asked for."""
    k = np.minimum(2.0 / 7.0 * 1.5, 0.15 * 1.85 / np.tan(np.radians(GAMMA)))
    values = 3.5 * k - 1.0 + NOISE[1]
    values[np.argmax(GAMMA)] += 0.6
    found = compare_result(ifrfit.fit(table(beta=values)))
    verdict = replace(found.verdict, kind="preferred", tied=("fr",), says="FR it is.")
    brief = set(found.entries) - {"ifr"}
    own = found.entries["ifr"]
    fit = replace(own.fit, facts={**own.fit.facts, "outliers": Fact(False, "1 outlier", {}, "rule")})
    entries = {**found.entries, "ifr": replace(own, fit=fit)}
    assert with_reservations(verdict, entries, brief).says == (
        "FR it is. Provisional: what the fit of IFR tells of the table was not looked for in that of FR."
    )
    assert with_reservations(verdict, entries).says == "FR it is."
