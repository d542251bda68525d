"""One sentence for every case: preferred, undecided, refuted, and none on stand-ins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from comparison_data import FOUR, not_converged, observations

from ifrfit.data.schema import STAND_IN
from ifrfit.inference.comparison import compare
from ifrfit.inference.comparison.verdict import curve_distance, strength_of, verdict_of
from ifrfit.inference.result.types import Fact

FIX = {"e_n": 0.9}


def compared(*args, closures=FOUR, fix=FIX, noise="known", **kw):
    return compare(observations(*args, **kw), closures, loo=False, fix=fix, noise=noise)


@pytest.mark.parametrize(
    ("made", "own"),
    [("fr", {"beta0": 0.75}), ("ifr", {"e_t": -0.7}), ("ifr-contact", {"e_t": -0.7}), ("f", {})],
)
def test_the_right_closure_is_preferred_where_the_data_decide(made, own):
    found = compared(made, sigma=0.02, **own).verdict
    if made == "f":  # which IFR-contact is, at e_t = -1
        assert found.kind in ("preferred", "undecided")
    else:
        assert (found.kind, found.strength) == ("preferred", "very strong")
    assert found.tied[0] == made
    assert found.over_priors is None or found.over_priors[0] <= found.log_bayes_factor <= found.over_priors[1]


def test_a_preference_is_one_sentence_with_its_scale():
    found = compared("ifr", sigma=0.02, e_t=-0.7).verdict
    assert found.says.startswith(
        "The data favour IFR over FR, the next best, very strongly (log Bayes factor "
    )
    assert "over 1 positive, over 3 strong, over 5 very strong" in found.says
    assert found.says.count(". ") == 0


def test_where_closures_coincide_the_data_cannot_tell():
    """IFR at e_t = -1 is FR at beta0 = 2/5."""
    found = compared("ifr", closures=("fr", "ifr"), sigma=0.05, seed=3, e_t=-1.0)
    assert found.verdict.kind == "undecided"
    assert set(found.verdict.tied) == {"fr", "ifr"}
    assert found.verdict.says.startswith("These data cannot tell ")
    assert curve_distance(found.entries["fr"].fit, found.entries["ifr"].fit) < 1.0


def test_a_nested_closure_is_told_by_the_room_of_its_prior_only():
    """F is IFR-contact at e_t = -1: precise data of F leave but the width of the prior between them."""
    found = compared("f", closures=("f", "ifr-contact"), sigma=0.005, seed=1)
    gap = -found.entries["ifr-contact"].log_bayes_factor
    assert gap > 1.0
    assert found.verdict.kind == "undecided"
    assert "only weighs the widths of the priors" in found.verdict.says
    assert (
        "F from IFR-contact, whose best curve coincides with its own within the noise" in found.verdict.says
    )


def test_curves_that_differ_are_no_tie():
    found = compared("ifr", closures=("fr", "ifr"), sigma=0.02, e_t=-0.7)
    assert curve_distance(found.entries["ifr"].fit, found.entries["fr"].fit) > 10.0


def test_all_are_refuted_where_none_describes_the_data():
    made = observations("ifr", sigma=0.02, e_t=-0.8)
    table = made.table
    table["value"] += 0.3 * np.sin(np.radians(6.0 * table["gamma_deg"]))
    found = compare(type(made)(table, made.sources), FOUR, loo=False, fix=FIX, noise="known").verdict
    assert found.kind == "refuted"
    assert found.says.startswith("All 4 closures are refuted: even ")
    assert "has lack of fit (p = " in found.says


def test_a_best_closure_that_alone_is_refuted_is_said():
    found = compared("ifr", sigma=0.05, seed=1, e_t=-0.9, closures=("fr", "ifr"))
    best, other = found.ranked
    bad = Fact(False, "bad", {"p": 1e-5, "where": "in beta up to 12 degrees"}, "rule")
    entries = dict(found.entries)
    fit = entries[best].fit
    entries[best] = replace(entries[best], fit=replace(fit, facts={**fit.facts, "lack_of_fit": bad}))
    assert found.entries[other].fit.facts["lack_of_fit"].ok
    said = verdict_of(entries, found.priors)
    assert said.kind == "refuted"
    assert "doubt the noise" in said.says


@pytest.mark.parametrize("made", [("ifr", {"e_t": -0.7}), ("fr", {"beta0": 0.9}), ("f", {})])
def test_stand_ins_carry_no_verdict_whatever_the_numbers(made):
    name, own = made
    found = compared(name, closures=("f", "ifr"), sigma=0.01, provenance=STAND_IN, **own).verdict
    assert found.kind == "stand_in"
    assert found.says.startswith("Not answerable until real points are installed: made.csv is a stand-in")
    assert (found.tied, found.next, found.log_bayes_factor, found.strength) == ((), None, None, "")


def test_one_stand_in_row_is_enough():
    made = observations("ifr", sigma=0.01, e_t=-0.7)
    table = made.table
    table.loc[3, "provenance"] = STAND_IN
    found = compare(type(made)(table, made.sources), ("f", "ifr"), loo=False, fix=FIX)
    assert found.verdict.kind == "stand_in"


def test_refuted_stand_ins_carry_no_verdict_either():
    made = observations("ifr", sigma=0.001, noise=0.3, e_t=-0.8, provenance=STAND_IN)
    found = compare(made, ("f", "ifr"), loo=False, fix=FIX, noise="known")
    assert found.verdict.kind == "stand_in"


def test_simulations_say_that_they_are():
    found = compared("ifr", closures=("f", "ifr"), sigma=0.02, provenance="simulated", e_t=-0.7).verdict
    assert found.kind == "preferred"
    assert found.says.startswith("Of the simulation, not of an experiment: the data favour IFR")


def test_what_did_not_converge_is_provisional():
    found = compared("ifr", sigma=0.02, e_t=-0.7)
    assert verdict_of(not_converged(found, "fr").entries, found.priors).says.endswith(
        " Provisional: the fit of FR did not converge."
    )


def test_a_preference_that_rests_on_the_priors_says_so():
    found = compared("ifr", closures=("fr", "ifr"), sigma=0.02, e_t=-0.7)
    gap = found.verdict.log_bayes_factor
    rows = list(found.priors)
    low = {**rows[1].log_evidence, "fr": rows[1].log_evidence["fr"] + gap - 0.5}
    rows[1] = replace(rows[1], log_evidence=low)
    said = verdict_of(found.entries, rows)
    assert said.kind == "preferred"
    assert "but that rests on the widths of the priors: over the table of priors it is 0.5 to " in said.says


@pytest.mark.parametrize(
    ("factor", "word"),
    [(0.0, ""), (1.0, ""), (1.01, "positive"), (3.01, "strong"), (5.0, "strong"), (5.01, "very strong")],
)
def test_scale_of_kass_and_raftery(factor, word):
    assert strength_of(factor) == word
