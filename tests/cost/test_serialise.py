"""Measured costs as JSON: by the schema, and with the numbers and sentences of the table and the text."""

from __future__ import annotations

import math
import os
from dataclasses import replace

import pytest
from json_schemas import strict_json, validator

from ifrfit.cost.inference_costs import UNIT
from ifrfit.cost.report import text
from ifrfit.cost.timing import Cost, Timing
from ifrfit.inference.io.json_text import dumps

from .made import made


@pytest.fixture(scope="module")
def costs():
    return made("cross-2019", fix={"e_n": 0.94})


def test_the_numbers_are_those_of_the_table(costs):
    content = strict_json(dumps(costs.to_dict()))
    validator("cost").validate(content)
    assert content == costs.to_dict()
    assert content["costs"] == costs.table().to_dict("records")


def test_the_sentences_are_those_of_the_text(costs):
    content = costs.to_dict()
    assert list(content["kinds"]) == ["inference", "physics"]
    for kind, told in content["kinds"].items():
        assert tuple(told["says"]) == costs.sentences(kind)
    assert content["kinds"]["inference"]["reference"] == {"tolerance": 1e-9, "error": 1e-10}
    assert content["kinds"]["physics"]["at"] == costs.about["physics"]
    assert content["notes"] == ["A note."]


def test_whose_data_and_which_machine(costs):
    content = costs.to_dict()
    assert content["input"][0]["provenance"] == "stand-in"
    assert content["warnings"][0].startswith("cross-2019 is a STAND-IN")
    assert content["machine"]["cores"] == os.cpu_count() >= 1
    assert content["asked"]["e_n"]["fixed"] == 0.94


def test_an_error_that_there_is_none_of_is_null(costs):
    unknown = Cost("inference", "exact", "", "mean", Timing.of([1.0]), math.nan, UNIT)
    content = strict_json(dumps(replace(costs, costs=(unknown,)).to_dict()))
    validator("cost").validate(content)
    assert [row["error"] for row in content["costs"]] == [None]


def test_the_schema_refuses_what_it_should(costs):
    content = costs.to_dict()
    row = content["costs"][0]
    for key, value in (
        ("schema", "ifrfit/cost/2"),
        ("kinds", {}),
        ("costs", []),
        ("costs", [row | {"time_s": -1.0}]),
        ("costs", [row | {"extra": 1}]),
        ("machine", {}),
        ("extra", 1),
    ):
        assert not validator("cost").is_valid({**content, key: value}), key


@pytest.mark.parametrize(
    ("cores", "system", "words"),
    [(1, "Linux", "1 core (x86_64, Linux), Python "), (8, "Darwin", "8 cores (x86_64, Darwin), Python ")],
)
def test_a_machine_in_words(monkeypatch, cores, system, words):
    own = {"cores": cores, "architecture": "x86_64", "system": system}
    monkeypatch.setattr(text, "machine", lambda: own)
    assert text.machine_words().startswith(words)
