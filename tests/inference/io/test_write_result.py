from __future__ import annotations

import json
import math
from dataclasses import fields, replace

import built_results as made
import numpy as np
import pandas as pd
import pytest
from json_schemas import validator

import ifrfit
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.io import json_text
from ifrfit.inference.io import write_result as serialise
from ifrfit.inference.io.json_text import dumps
from ifrfit.inference.io.read_result import from_dict, load_result
from ifrfit.inference.io.write_result import NULL_MARK, to_dict
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, Fact
from ifrfit.report import summary

KEYS = [
    "schema",
    "ifrfit",
    "created",
    "command",
    "seed",
    "versions",
    "input",
    "closure",
    "inertia_factor",
    "method",
    "noise",
    "constants",
    "derived",
    "correlation",
    "fit",
    "facts",
    "warnings",
    "state",
    "points",
]
CASES = (
    "fine",
    "stand_in",
    "two_observables",
    "all_sticking",
    "separate",
    "contradicted",
    "restitution",
    "posterior",
    "scaled_posterior",
)


@pytest.mark.parametrize("name", CASES)
def test_every_case_meets_the_schema_and_comes_back_the_same(name, tmp_path):
    result = getattr(made, name)()
    content = to_dict(result)
    validator("result").validate(content)
    assert list(content) == KEYS
    path = tmp_path / "result.json"
    result.save(path)
    assert json.loads(path.read_text(encoding="utf-8")) == content
    back = load_result(path)
    assert to_dict(back) == content
    for style in ("text", "markdown", "latex"):
        assert summary(back, style) == summary(result, style)
    for field in fields(FitResult):
        one, other = getattr(result, field.name), getattr(back, field.name)
        if field.name == "points":
            pd.testing.assert_frame_equal(one, other, check_exact=True)
        elif field.name == "correlation":
            assert one.names == other.names
            assert np.array_equal(one.matrix, other.matrix)
        elif field.name == "state":
            for f in fields(one):
                mine, its = getattr(one, f.name), getattr(other, f.name)
                assert (mine is None and its is None) or np.array_equal(mine, its), f.name
        elif field.compare:
            assert one == other, field.name


def test_the_schema_refuses_what_it_should():
    content = to_dict(made.posterior())
    for path, wrong in (
        (("schema",), "ifrfit/result/2"),
        (("noise", "policy"), "guessed"),
        (("constants", "mu", "status"), "good"),
        (("constants", "mu", "interval95"), [0.1]),
        (("facts", "outliers", "ok"), "yes"),
        (("input", 0, "sha256"), "abc"),
        (("fit", "n"), 1.5),
        (("constants", "mu", "mean"), "0.12"),
        (("noise", "estimates", "dry/beta", "status"), "good"),
        (("noise", "prior", "dry/beta"), [0.1]),
        (("state", "sample", "e_n"), []),
        (("state", "sample", "e_n", 3), None),
    ):
        broken = json.loads(json.dumps(content))
        place = broken
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = wrong
        assert not validator("result").is_valid(broken), path


def test_what_only_a_posterior_has_is_written_and_nothing_in_its_place_without_one():
    content = to_dict(made.posterior())
    assert content["constants"]["mu"]["mean"] == 0.1203
    assert content["noise"]["prior"] == {"dry/beta": [0.00029, 1.0], "wet & <oiled>/beta": [0.00029, 1.0]}
    assert list(content["noise"]["estimates"]["dry/beta"]) == [
        "value",
        "mean",
        "stderr",
        "interval68",
        "interval95",
        "status",
        "reason",
    ]
    assert list(content["state"]["sample"]) == ["e_n", "e_t", "kappa"]
    assert content["fit"]["log_evidence"] == 41.2367
    without = to_dict(made.fine())
    assert list(without["noise"]) == ["policy", "sigma"]
    assert "mean" not in without["constants"]["mu"]
    assert "sample" not in without["state"]
    assert without["fit"]["log_evidence"] is None


def test_the_factor_common_to_all_sigmas_has_a_name_in_the_file():
    content = to_dict(made.scaled_posterior())
    assert list(content["noise"]["estimates"]) == list(content["noise"]["prior"]) == ["factor"]
    back = from_dict(json.loads(json.dumps(content)))
    assert list(back.noise.estimates) == list(back.noise.prior) == ["factor"]


def test_draws_take_one_line_a_name_and_keep_all_digits(tmp_path):
    result = made.posterior()
    result.save(tmp_path / "r.json")
    lines = (tmp_path / "r.json").read_text(encoding="utf-8").splitlines()
    sample = result.state.sample
    start = next(i for i, line in enumerate(lines) if line == '    "sample": {')
    assert [line.split(":")[0].strip() for line in lines[start + 1 : start + 4]] == [
        '"e_n"',
        '"e_t"',
        '"kappa"',
    ]
    back = load_result(tmp_path / "r.json").state.sample
    assert back.shape == sample.shape == (50, 3)
    assert (back == sample).all()
    with pytest.raises(ValueError, match="read-only"):
        back[0, 0] = 1.0


@pytest.mark.parametrize("method", ["exact", "lsq", "profile"])
def test_a_fit_of_each_method_comes_back_and_predicts_the_same(impacts, tmp_path, method):
    gamma = np.linspace(4.0, 86.0, 30)
    path = impacts(gamma=gamma, noise=0.03, c=-0.8)
    result = ifrfit.fit(path, fix={"e_n": 0.94}, method=method)
    result.save(tmp_path / "result.json")
    content = result.to_dict()
    validator("result").validate(content)
    back = load_result(tmp_path / "result.json")
    assert back.to_dict() == content
    assert back.method == method
    assert back.noise == result.noise
    for style in ("text", "markdown", "latex"):
        assert summary(back, style) == summary(result, style)
    pd.testing.assert_frame_equal(back.predict(gamma), result.predict(gamma))
    assert ("sample" in content["state"]) == (method == "exact")


def test_infinity_and_nan_are_null_and_said_once_each():
    base = made.all_sticking()
    fit = replace(base.fit, log_likelihood=math.inf, rmse=math.nan)
    fact = Fact(
        True, "Fine.", {"gap": np.float64("nan"), "all": np.array([1.0, -np.inf]), "n": np.int64(3)}, ""
    )
    content = to_dict(replace(base, fit=fit, facts={"global_optimum": fact}))
    assert content["constants"]["mu"]["interval95"] == [0.2134, None]
    assert content["state"]["upper"] == [1.0, -0.4, None]
    assert content["fit"]["log_likelihood"] is None
    assert content["facts"]["global_optimum"]["figures"] == {"gap": None, "all": [1.0, None], "n": 3}
    assert content["warnings"] == [
        "Written as null: ends of intervals and bounds that are infinite.",
        "Written as null: fit.rmse (not a number), fit.log_likelihood (infinite), "
        "facts.global_optimum.figures.gap (not a number), facts.global_optimum.figures.all[1] (infinite).",
        "Written as null: cells without a finite number in the columns sigma_spin_x, sigma_spin_y, "
        "speed_m_s, sigma, sigma_gamma_deg of points.",
    ]
    back = from_dict(content)
    assert back.warnings == ()
    assert math.isnan(back.fit.rmse)
    assert back.constants["mu"].interval95 == (0.2134, math.inf)


def test_grazing_incidence_keeps_its_infinite_slip_ratio():
    result = made.fine()
    points = result.points
    points.loc[0, "tau"] = math.inf
    back = from_dict(json.loads(dumps(to_dict(replace(result, points=points)))))
    assert back.points.loc[0, "tau"] == math.inf


def test_points_beyond_the_limit_are_left_out_and_said(monkeypatch):
    monkeypatch.setattr(serialise, "MOST_ROWS", 30)
    content = to_dict(made.fine())
    validator("result").validate(content)
    assert content["points"] is None
    assert (
        content["warnings"][-1] == NULL_MARK + "points, as 34 rows are more than the 30 that a result keeps."
    )
    back = from_dict(content)
    assert len(back.points) == 0
    assert set(made.fine().points.columns) == set(back.points.columns)
    assert "34 rows, measured" in summary(back)


def test_two_transitions_and_separate_series_of_any_name():
    base = made.separate()
    angles = (made.estimate(12.0, 0.5), made.estimate(40.0, 1.0))
    derived = {**base.derived, "transition_angle_deg": {"status": None, "value": angles}}
    constants = {
        **base.constants,
        "mu": {"status": made.estimate(0.1, 0.01), "value": made.estimate(0.2, 0.01)},
    }
    result = replace(base, derived=derived, constants=constants)
    content = to_dict(result)
    validator("result").validate(content)
    back = from_dict(json.loads(json.dumps(content)))
    assert back.derived == derived
    assert back.constants == constants


def test_an_estimate_without_a_reason_is_read():
    content = to_dict(made.fine())
    del content["constants"]["mu"]["reason"]
    assert isinstance(from_dict(content).constants["mu"], Estimate)


def test_saving_replaces_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "result.json"
    made.fine().save(path)
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(json_text.os, "replace", fail)
    with pytest.raises(UsageError, match=r"cannot be written \(No space left"):
        made.stand_in().save(path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["result.json"]


def broken(path: tuple[object, ...], value: object, result: FitResult | None = None) -> dict[str, object]:
    """The content of a result with one value changed, or taken away (...)."""
    content = json.loads(dumps(to_dict(result or made.fine())))
    place = content
    for key in path[:-1]:
        place = place[key]
    if value is ...:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return content


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (("input", 0, "sha256"), ..., "the key 'input[0].sha256' is missing"),
        (("correlation", "matrix"), [], "the key 'correlation.matrix' must be a list of 2 lists"),
        (("state", "point"), [1.0], "the key 'state.point' must be a list of 3 numbers"),
        (("state", "point", 1), 10**400, "the key 'state.point[1]' must be a number below 1e308"),
        (("points", "value"), ..., "the key 'points.value' is missing"),
        (("points", "tau"), [1.0], "the key 'points.tau' must be as long as points.value (34)"),
        (("points", "value", 3), "x", "the key 'points.value[3]' must be a number"),
        (("points", "series", 3), 1, "the key 'points.series[3]' must be text"),
        (("points", "row", 3), 1.5, "the key 'points.row[3]' must be a whole number"),
        (("points", "sticking", 3), 1.5, "the key 'points.sticking[3]' must be true or false"),
    ],
)
def test_a_damaged_result_names_file_and_key(path, value, says):
    """Further faults of values are those of any dataclass, in test_plain.py."""
    with pytest.raises(DataError) as caught:
        from_dict(broken(path, value), name="old.json")
    assert str(caught.value) == f"old.json: {says}. Fit the data again to get a whole file."


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ((), [[1.0]], "' must be an object"),
        (("kappa",), ..., ".kappa' is missing"),
        (("e_t",), [], "' must be an object of lists that are not empty"),
        (("e_t",), 3, ".e_t' must be a list"),
        (("e_t", 7), None, ".e_t[7]' must be a number"),
        (("e_t", 7), True, ".e_t[7]' must be a number"),
        (("e_t", 7), math.inf, ".e_t' must be a list of finite numbers"),
        (("e_t", 7), 10**400, ".e_t' must be a list of finite numbers"),
        (("kappa",), [1.0], ".kappa' must be as long as state.sample.e_n (50)"),
    ],
)
def test_damaged_draws_are_named(path, value, says):
    with pytest.raises(DataError) as caught:
        from_dict(broken(("state", "sample", *path), value, made.posterior()), name="old.json")
    assert str(caught.value).startswith("old.json: the key 'state.sample")
    assert f"{says}. Fit the data again" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "stated"),
    [({"schema": "ifrfit/result/2"}, "schema 'ifrfit/result/2'"), ({"a": 1}, "no key 'schema'")],
)
def test_another_schema_is_refused(content, stated):
    with pytest.raises(DataError) as caught:
        from_dict(content, name="old.json")
    assert str(caught.value) == (
        f"old.json: has {stated}; this version of ifrfit reads 'ifrfit/result/1'. "
        "Name the result.json of a fit, or use the ifrfit that wrote the file."
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "",
            ", line 1, column 1: this is not JSON (Expecting value). Fit the data again to get a whole file.",
        ),
        (
            '{\n  "a": }',
            ", line 2, column 8: this is not JSON (Expecting value). Fit the data again to get a whole file.",
        ),
        (
            '{"a": NaN}',
            ": this is not strict JSON (it holds NaN). Fit the data again to get a whole file.",
        ),
        ("[1]", ": the file must be an object. Fit the data again to get a whole file."),
    ],
)
def test_a_file_that_is_no_result(tmp_path, text, says):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(DataError) as caught:
        load_result(path)
    assert str(caught.value) == f"{path}{says}"


def test_a_file_that_cannot_be_read(tmp_path):
    missing, binary = tmp_path / "missing.json", tmp_path / "binary.json"
    binary.write_bytes(b"\xff\xfe\x00")
    for path, says in (
        (missing, "there is no such file. Name the result.json of a fit."),
        (binary, "cannot be read (it is not text). Name the result.json of a fit."),
        (tmp_path, "cannot be read (Is a directory). Name the result.json of a fit."),
    ):
        with pytest.raises(DataError) as caught:
            load_result(path)
        assert str(caught.value) == f"{path}: {says}"


def test_deep_nesting_does_not_crash(tmp_path):
    path = tmp_path / "deep.json"
    path.write_text("[" * 200_000)
    with pytest.raises(DataError, match="JSON"):
        load_result(path)
