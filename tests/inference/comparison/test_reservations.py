"""No verdict without what stands against it: where a fit says LOOK to the table, so does the comparison."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from factories import rest_long

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


@cache
def fine():
    """The comparison of a table without faults, which is frozen."""
    return compared(table())


@cache
def with_outlier():
    """That of a table with one outlier."""
    return compared(with_an_outlier())


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
    "series": (two_series, "the series do not share mu"),
    "from wall": (lambda: table(gamma_deg=90.0 - GAMMA), "angles of incidence from the wall"),
    "sign": (lambda: table(beta=-beta()), "the opposite sign in beta"),
}


@pytest.mark.parametrize("case", rest_long(CASES, 3))
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
    found = fine()
    assert not looks(found)
    assert "Settle first" not in found.verdict.says


def test_options_are_named_as_the_comparison_was_asked_for():
    (said,) = looks(with_outlier())
    assert "exclude=" in said
    assert "--exclude" not in said
    (said,) = looks(compared(with_an_outlier(), command="ifrfit compare made.csv"))
    assert "--exclude" in said


def test_a_fact_of_closures_that_tie_is_told_once():
    found = with_outlier()
    told = reservations(found.entries, found.ranked)
    assert [name for name, own in told.items() if "outliers" in own] == [found.ranked[0]]


def failing(found, name, **facts):
    """Entries of a comparison in which facts of one closure fail."""
    own = found.entries[name]
    failed = {key: Fact(False, f"{key} of {name}", figures, "rule") for key, figures in facts.items()}
    fit = replace(own.fit, facts={**own.fit.facts, **failed})
    return replace(found, entries={**found.entries, name: replace(own, fit=fit)})


def slip(called, drop, p_left):
    return {"called": [called], "tests": {called: {"drop": drop}}, "p_left": p_left}


@pytest.mark.parametrize(
    ("of_other", "says"),
    [
        # it explains all, and more than that of the best
        (slip("angle-from-wall", 1e4, 0.5), "the table looks as if it had a slip in it (FR)"),
        # it is the same
        (slip("sign beta", 1e4, 0.5), "outliers (IFR); the table looks as if it had a slip in it (IFR)"),
        # it leaves a misfit
        (
            slip("angle-from-wall", 1e4, 1e-9),
            "outliers (IFR); the table looks as if it had a slip in it (IFR)",
        ),
        # it takes less than the gap in evidence
        (
            slip("angle-from-wall", 10.0, 0.5),
            "outliers (IFR); the table looks as if it had a slip in it (IFR)",
        ),
    ],
)
def test_the_slip_that_mends_the_table_takes_the_place_of_what_it_feigns(of_other, says):
    found = fine()
    best, other = found.ranked[:2]
    assert (best, other) == ("ifr", "fr")
    found = failing(found, best, slips=slip("sign beta", 100.0, 1e-9), outliers={})
    found = failing(found, other, slips=of_other)
    verdict = replace(found.verdict, kind="refuted", says="Refuted.")
    said = with_reservations(verdict, found.entries).says
    assert said == f"Refuted. Settle first: {says}."
    # where closures are not refuted the slips of others do not count
    verdict = replace(found.verdict, says="Preferred.")
    assert "(FR)" not in with_reservations(verdict, found.entries).says


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
    entries = failing(found, "ifr", outliers={}).entries
    assert with_reservations(verdict, entries, brief).says == (
        "FR it is. Provisional: what the fit of IFR tells of the table was not looked for in that of FR."
    )
    assert with_reservations(verdict, entries).says == "FR it is."
