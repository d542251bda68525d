"""The call: closures of the registry, choices where they apply, errors, and compare.json by its schema."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from comparison_data import FOUR, observations
from factories import BILINEAR
from json_schemas import validator
from refusals import refused

import ifrfit
from ifrfit import Noise
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.comparison import compare
from ifrfit.inference.comparison.compare import chosen_closures
from ifrfit.inference.io.json_text import dumps
from ifrfit.physics.closures import CLOSURES


@pytest.fixture(scope="module")
def data():
    return observations("ifr", sigma=0.05, e_t=-0.85)


@pytest.fixture(scope="module")
def found(data):
    return compare(data, FOUR, fix={"e_n": 0.9}, noise="known", command="ifrfit compare made.csv")


def test_choices_hold_where_the_constant_is(data):
    found = compare(
        data, FOUR, loo=False, fix={"e_n": 0.9, "e_t": -0.8}, bounds={"beta0": (0.0, 1.0)}, noise="known"
    )
    assert found.entries["ifr"].fit.constants["e_t"].status == "fixed"
    assert found.entries["ifr-contact"].fit.constants["e_t"].status == "fixed"
    assert found.entries["fr"].prior["beta0"] == {"lower": 0.0, "upper": 1.0}
    assert all(e.fit.constants["e_n"].value == 0.9 for e in found.entries.values())
    assert found.notes == (
        "--fix e_t holds for IFR and IFR-contact; F and FR have no such constant.",
        "--bounds beta0 holds for FR; F, IFR and IFR-contact have no such constant.",
    )


def test_lmfit_parameters_hold_where_the_constant_is(data):
    import lmfit

    params = lmfit.Parameters()
    params.add("e_n", value=0.9, vary=False)
    params.add("e_t", value=-0.8, vary=False)
    found = compare(data, ("f", "ifr"), loo=False, params=params, noise="known")
    assert found.entries["ifr"].fit.constants["e_t"].value == -0.8
    assert found.entries["f"].fit.constants["e_n"].status == "fixed"


@pytest.mark.parametrize(
    ("closures", "choices", "says"),
    [
        (("ifr",), {}, "Only closure IFR is named, so there is nothing to compare it with."),
        ("ifr", {}, "Only closure IFR is named"),
        (("ifr", "ifr"), {}, "Only closure IFR is named"),
        (("ifr", "walton"), {}, "There is no closure 'walton'."),
        (None, {"fix": {"beta": 1.0}}, "--fix beta: no closure of this comparison has such a constant."),
        (None, {"separate": "e_q"}, "--separate e_q: no closure of this comparison"),
        (("ifr", "f"), {"fix": {"beta0": 0.4}}, "They have e_n, e_t, mu."),
        (None, {"fix": {"e_t": -0.2}}, "Closure IFR: --fix e_t=-0.2: outside the domain [-1, -0.4]"),
        (None, {"fix": {"e_n": 1.4}}, "--fix e_n=1.4: outside the domain [0, 1]"),
        (None, {"method": "lsq"}, "leave out `method` and `closure`"),
        (None, {"observable": "betta"}, "--observable betta: not in the data."),
    ],
)
def test_wrong_calls_are_refused(data, closures, choices, says):
    with refused(UsageError) as error:
        compare(data, closures, loo=False, **choices)
    assert says in error.value.in_shell
    if not says.startswith("Closure"):
        assert not error.value.in_shell.startswith("Closure")


def test_a_closure_that_takes_too_much_is_named():
    few = observations("ifr", [10.0, 70.0], e_t=-0.85, given=False)
    with refused(DataError, match="Add a column sigma"):
        compare(few, FOUR, loo=False, fix={"e_n": 0.9})
    few = observations("ifr", [70.0], e_t=-0.85, given=False)
    with refused(DataError, match=r"^Closure IFR: .* needs a sigma"):
        compare(few, ("f", "ifr"), loo=False, fix={"e_n": 0.9, "mu": 0.15})


def test_table_has_a_row_a_closure_the_best_first(found):
    table = found.table()
    assert list(table.index) == list(found.ranked)
    assert (np.diff(table["log_evidence"]) <= 0.0).all()
    assert table["probability"].sum() == pytest.approx(1.0)
    assert table["aicc"].isna().all()
    assert table["elpd_loo"].notna().all()
    assert isinstance(table, pd.DataFrame)


def test_json_meets_its_schema(found):
    content = json.loads(dumps(found.to_dict()))
    validator("compare").validate(content)
    assert content == found.to_dict()
    assert content["command"] == "ifrfit compare made.csv"
    assert list(content["closures"]) == list(found.ranked)
    assert len(content["closures"]["ifr"]["loo"]["pareto_k"]) == 25


@pytest.mark.parametrize(
    "choices",
    [
        {"loo": False, "noise": "unknown", "provenance": "stand-in"},
        {"loo": False, "noise": "scaled", "observables": ("delta_deg",)},
        {"loo": True, "noise": "known", "gamma": [4.0, 6.0, 40.0, 60.0, 80.0]},
    ],
)
def test_json_of_other_cases_meets_the_schema_too(choices):
    made = {key: choices[key] for key in ("provenance", "observables", "gamma") if key in choices}
    data = observations("f", sigma=0.05, **made)
    found = compare(data, ("f", "ifr"), loo=choices["loo"], noise=choices["noise"], fix={"e_n": 0.9})
    validator("compare").validate(json.loads(dumps(found.to_dict())))


def test_schema_refuses_what_it_should(found):
    content = found.to_dict()
    for key, value in (("schema", "ifrfit/compare/2"), ("verdict", {}), ("closures", {}), ("extra", 1)):
        assert not validator("compare").is_valid({**content, key: value}), key


def test_save_writes_the_whole_file(found, tmp_path):
    path = tmp_path / "compare.json"
    found.save(path)
    assert json.loads(path.read_text(encoding="utf-8")) == found.to_dict()
    assert [p.name for p in tmp_path.iterdir()] == ["compare.json"]


def test_scatter_that_a_closure_does_not_know_leaves_it_out(data):
    every, said = chosen_closures(None, plain=True)
    assert [c.name for c in every] == list(CLOSURES)
    assert said == ()
    some, said = chosen_closures(None, plain=False)
    assert [c.name for c in some] == list(BILINEAR)
    assert said == ("MAW is left out: it knows independent Gaussian errors of the values only.",)
    with refused(UsageError, match=r"^Closure MAW knows independent Gaussian errors"):
        compare(data, ("ifr", "maw"), loo=False, fix={"e_n": 0.9}, noise=Noise(tails="student-t"))


def test_student_errors_are_compared_by_their_own_evidence(data):
    found = compare(data, ("f", "ifr"), fix={"e_n": 0.9, "mu": 0.15}, noise=Noise("known", tails="student-t"))
    own = ifrfit.fit(
        data, closure="ifr", fix={"e_n": 0.9, "mu": 0.15}, noise=Noise("known", tails="student-t")
    )
    assert found.entries["ifr"].log_evidence == own.fit.log_evidence
    assert found.psi_plane.reason == "it knows Gaussian errors of the values only"
    assert found.entries["ifr"].loo is not None


def test_an_unknown_offset_of_the_angles_turns_the_lines_of_the_plane(data):
    noise = Noise("known", angles=ifrfit.AngleErrors(offset_sd=1.0))
    found = compare(data, ("f", "ifr"), fix={"e_n": 0.9}, noise=noise, loo=False)
    assert found.psi_plane.reason == "the angles have another offset under each closure"
    assert found.psi_plane.sliding is None


def test_without_oblique_impacts_no_closure_is_told_from_another_and_the_reason_is_said():
    data = observations("ifr", observables=("e_n", "mu"), e_t=-0.85)
    found = compare(data, loo=False)
    assert max(abs(entry.log_bayes_factor) for entry in found.entries.values()) < 1e-6
    assert found.verdict.kind == "undecided"
    assert found.notes == ("No row is of an oblique impact: e_n and mu alone say nothing of a closure.",)
    oblique = observations("ifr", e_t=-0.85)
    assert compare(oblique, ("f", "ifr"), loo=False, fix={"e_n": 0.9}).notes == ()
