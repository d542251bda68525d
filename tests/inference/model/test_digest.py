"""The digest of a problem changes with every field of it, and with nothing else."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from posterior_questions import Question, measured

from ifrfit.inference.model.digest import EXCLUDED, digest
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.problem import Problem

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
# where the rows come from, and at which spins a transition is quoted: reported, and part of no computation
WITHOUT = {"observations": None, "quoted_spins": ((0.0, 0.5),)}


def question() -> Problem:
    """A problem in which every field has something to change."""
    rows = measured("beta", FAN, seed=1, series="a") + measured("beta", FAN, seed=2, series="b")
    asked = Question(rows, prior={"mu": (0.1, 0.05)}, separate=("e_t",), noise="scaled")
    problem = asked.problem().with_fixed({"e_n": 0.9, "e_t[b]": -0.8})
    problem = problem.with_noise(problem.noise.with_bounds({"": (0.1, 10.0)}))
    return replace(problem, error_model=ErrorModel(4.0, "measured", (5.0, 80.0), 1.0, 0.01, 0.02))


PROBLEM = question()
Path = tuple[str | int, ...]


def places(value: object) -> Iterator[Path]:
    """The way to everything that is no dataclass and no tuple, through fields and elements."""
    if is_dataclass(value):
        for each in fields(value):
            if not each.metadata.keys() & EXCLUDED.keys():
                yield from ((each.name, *way) for way in places(getattr(value, each.name)))
    elif isinstance(value, tuple) and value:
        for i, each in enumerate(value):
            yield from ((i, *way) for way in places(each))
    else:
        yield ()


def changed(value: Any, way: Path, change: Callable[[Any], Any]) -> Any:
    """The same value with what is at the end of the way changed."""
    if not way:
        return change(value)
    first, rest = way[0], way[1:]
    if isinstance(first, int):
        return (*value[:first], changed(value[first], rest, change), *value[first + 1 :])
    twin = object.__new__(type(value))  # not checked: any other value will do
    for each in fields(value):
        own = getattr(value, each.name)
        object.__setattr__(twin, each.name, changed(own, rest, change) if each.name == first else own)
    return twin


def another(value: Any) -> Any:
    """Another value of the same kind."""
    if isinstance(value, np.ndarray):
        out = value.copy()
        out.flat[-1] = 0.5 if np.isnan(out.flat[-1]) else out.flat[-1] + 1
        return out
    if value is None:
        return 0.25
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return 0.5 if np.isinf(value) else float(np.nextafter(value, 2.0 + value))
    if isinstance(value, str):
        return value + "'"
    if isinstance(value, Mapping):
        return {key: another(each) for key, each in value.items()} or {"key": 1.0}
    if isinstance(value, tuple):
        return (*(another(each) for each in value), "one more")
    assert callable(value)
    return lambda *given: value(*given)


PLACES = list(places(PROBLEM))


def test_every_field_has_its_place() -> None:
    assert {way[0] for way in PLACES} == {each.name for each in fields(Problem)} - {*WITHOUT}
    inside = {".".join(part for part in way if isinstance(part, str)) for way in PLACES}
    assert {
        "closure.own.domain",
        "closure.law",
        "error_model.population",
        "noise.prior_bounds",
        "parameters.parameters.lower",
        "parameters.fixed_entries",
        "rows.incidence.slip_y",
        "rows.impact",
    } <= inside


@pytest.mark.parametrize("way", PLACES, ids=lambda way: ".".join(str(part) for part in way))
def test_every_field_counts(way: Path) -> None:
    other = changed(PROBLEM, way, another)
    assert digest(other) != digest(PROBLEM)


@pytest.mark.parametrize("name", WITHOUT)
def test_what_is_reported_of_the_source_does_not_count(name: str) -> None:
    other = replace(PROBLEM.observations, notes=("another",)) if name == "observations" else WITHOUT[name]
    assert replace(PROBLEM, **{name: other}).digest == PROBLEM.digest


def test_the_same_question_has_the_same_digest() -> None:
    assert question().digest == PROBLEM.digest
    assert len(PROBLEM.digest) == 64


def test_some_of_the_rows_are_another_question() -> None:
    some = [PROBLEM.with_rows(np.array(rows)).digest for rows in ([0, 1], [1, 0], [0, 2])]
    assert len({PROBLEM.digest, *some}) == 4


def test_a_digest_does_not_depend_on_the_process() -> None:
    value = "{'b': (1, 2.5, None, True), 'a': 'text'}"
    code = f"from ifrfit.inference.model.digest import digest; print(digest({value}))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == digest({"a": "text", "b": (1, 2.5, None, True)})


KINDS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5)
VALUES = st.recursive(KINDS, lambda inner: st.lists(inner, max_size=3).map(tuple), max_leaves=5)


@given(VALUES, VALUES)
def test_different_values_have_different_digests(one: object, other: object) -> None:
    assert (digest(one) == digest(other)) == (repr(one) == repr(other))


def test_arrays_count_with_type_and_shape() -> None:
    arrays = [
        np.zeros(4),
        np.zeros((2, 2)),
        np.zeros(4, dtype=np.float32),
        np.zeros(8),
        np.zeros(4, dtype=int),
    ]
    assert len({digest(array) for array in arrays}) == len(arrays)
    assert digest(np.arange(6.0)[::2]) == digest(np.array([0.0, 2.0, 4.0]))


def test_a_callable_object_counts_with_what_it_holds() -> None:
    class Line:
        def __init__(self, slope: float) -> None:
            self.slope = slope

        def __call__(self, x: float) -> float:
            return self.slope * x

    assert digest(Line(1.0)) == digest(Line(1.0)) != digest(Line(2.0))
    assert digest(partial(pow, 2)) != digest(partial(pow, 3))


def test_what_has_no_digest_is_refused() -> None:
    with pytest.raises(TypeError, match="has no digest"):
        digest(object())
