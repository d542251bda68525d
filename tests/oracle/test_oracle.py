"""Results stay what they were, to 1e-9, through every change that is not meant to change them."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from oracle.differences import differences
from oracle.freeze import load
from oracle.problems import BY_NAME, PROBLEMS, TOLERANCES, UNSTABLE, Problem
from oracle.results import run


@cache
def frozen() -> dict[str, Any]:
    return load()


RUNS = [
    pytest.param(problem, marks=() if problem.quick else pytest.mark.long, id=problem.name)
    for problem in PROBLEMS
]


@pytest.mark.parametrize("problem", RUNS)
def test_result_is_the_frozen_one(problem: Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path / "none"))
    found = json.loads(json.dumps(run(problem, tmp_path), allow_nan=False))
    said = differences(found, frozen()[problem.name], tolerance=problem.tolerance)
    differing = [difference for difference in said if not difference.startswith(problem.unstable)]
    assert not differing, "\n".join([f"{len(differing)} entries differ:", *differing])


def test_tolerances_are_those_of_problems_there_are() -> None:
    assert TOLERANCES.keys() | UNSTABLE.keys() <= BY_NAME.keys()


def test_every_problem_is_frozen_once() -> None:
    assert len(BY_NAME) == len(PROBLEMS) >= 100
    assert frozen().keys() == BY_NAME.keys()


@pytest.mark.parametrize(
    ("found", "expected", "said"),
    [
        ({"a": 1.0 + 2e-9}, {"a": 1.0}, "a: 1.000000002, not 1.0 (differs by 2e-09)"),
        ({"a": {"b": [1.0, 2]}}, {"a": {"b": [1.0, 3]}}, "a.b[1]: 2, not 3"),
        ({"a": None}, {"a": 0.5}, "a: None, not 0.5"),
        ({"a": True}, {"a": 1}, "a: True, not 1"),
        ({"a": "one-sided"}, {"a": "determined"}, "a: 'one-sided', not 'determined'"),
        ({"a": [1.0]}, {"a": [1.0, 2.0]}, "a: 1 entries, not 2"),
        ({"a": 1.0, "b": 1.0}, {"a": 1.0}, "b: is new"),
        ({"a": 1.0}, {"a": 1.0, "b": 1.0}, "b: is missing"),
        (
            {"mu": {"value": 3e-9, "stderr": 1.0}},
            {"mu": {"value": 0.0, "stderr": 1.0}},
            "mu.value: 3e-09, not 0.0 (differs by 3e-09)",
        ),
    ],
)
def test_a_difference_is_reported_with_its_path(found: object, expected: object, said: str) -> None:
    assert list(differences(found, expected)) == [said]


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ({"a": 1.0 + 9e-10}, {"a": 1.0}),
        ({"mu": {"value": 9e-10, "stderr": 1.0}}, {"mu": {"value": 0.0, "stderr": 1.0}}),
        ({"a": [5e-10, 1.0]}, {"a": [0.0, 1.0]}),
        ({"facts": {"gap": 5e-10}}, {"facts": {"gap": 0.0}}),
    ],
)
def test_rounding_is_no_difference(found: object, expected: object) -> None:
    assert list(differences(found, expected)) == []
