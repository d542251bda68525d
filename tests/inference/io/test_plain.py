"""Dataclasses become plain values and come back the same, by their type hints; what is wrong is named."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from json_schemas import validator
from numpy.typing import NDArray

from ifrfit.data import Descriptor, Source
from ifrfit.errors import DataError
from ifrfit.inference.accuracy.request import Effort
from ifrfit.inference.comparison.result import PriorRow, PsiPlane, Verdict
from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine, SceneOfData
from ifrfit.inference.io.json_text import dumps
from ifrfit.inference.io.plain import (
    INTERNAL,
    OPTIONAL,
    Node,
    Null,
    Nulls,
    Shape,
    from_plain,
    layout,
    to_plain,
)
from ifrfit.inference.io.write_result import ParameterInFile
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import (
    Constants,
    Estimate,
    Fact,
    FitStatistics,
    NoiseSummary,
    State,
    Status,
)

finite = st.floats(allow_nan=False, allow_infinity=False)
texts, counts = st.text(max_size=8), st.integers(0, 10**6)
perhaps = finite | st.none()
intervals = st.tuples(finite | st.just(-math.inf), finite | st.just(math.inf))
estimates = st.builds(
    Estimate, perhaps, perhaps, intervals, intervals, st.sampled_from(get_args(Status)), texts, mean=perhaps
)


def several(values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.lists(values, max_size=3).map(tuple)


def by_name(values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.dictionaries(texts, values, max_size=3)


figures = st.recursive(
    finite | counts | texts | st.booleans() | st.none(),
    lambda own: st.lists(own, max_size=3) | by_name(own),
    max_leaves=5,
)
descriptors = st.builds(
    Descriptor,
    texts,
    texts,
    texts,
    conditions=by_name(figures),
    default_series=several(texts),
    noise=texts | st.none(),
    faces=several(several(texts)),
    inertia_factor=finite,
    printed_constants=by_name(finite),
)
positive = st.floats(1e-6, 45.0)
choices = st.builds(
    ErrorModel,
    st.floats(1.0, 1e6) | st.none(),
    st.just("measured"),
    st.tuples(st.floats(0.0, 40.0), st.floats(41.0, 90.0)),
    positive | st.none(),
    positive,
    positive | st.none(),
) | st.just(ErrorModel())
VALUES = {
    Estimate: estimates,
    Fact: st.builds(Fact, st.booleans(), texts, by_name(figures), texts),
    FitStatistics: st.builds(
        FitStatistics, *[counts] * 4, finite, finite, counts, perhaps, perhaps, *[finite] * 4
    ),
    NoiseSummary: st.builds(
        NoiseSummary, texts, by_name(finite), by_name(estimates), by_name(intervals), choices, st.booleans()
    ),
    ParameterInFile: st.builds(
        ParameterInFile, intervals, perhaps, st.tuples(finite, finite) | st.none(), st.booleans()
    ),
    Source: st.builds(
        Source, texts, texts, counts, counts, by_name(counts), texts, texts, descriptors | st.none()
    ),
    Effort: st.builds(Effort, perhaps, perhaps, texts, perhaps, counts | st.none(), perhaps, finite, texts),
    SceneOfData: st.builds(SceneOfData, texts, texts, texts, several(texts), several(texts)),
    EffectLine: st.builds(
        EffectLine,
        texts,
        texts,
        perhaps,
        perhaps,
        st.booleans() | st.none(),
        perhaps,
        texts,
        texts,
        perhaps,
        texts,
    ),
    Verdict: st.builds(
        Verdict, st.sampled_from(["refuted", "preferred"]), texts, several(texts), texts | st.none(), perhaps
    ),
    PriorRow: st.builds(PriorRow, texts, by_name(perhaps)),
    PsiPlane: st.builds(PsiPlane, texts, counts, counts, counts, left_out=by_name(texts)),
}


def there_and_back(kind: Any, value: Any) -> Any:
    return from_plain(kind, Node(json.loads(dumps({"at": to_plain(value)}))["at"], "at", "a.json"))


@pytest.mark.parametrize("kind", VALUES, ids=lambda kind: kind.__name__)
def test_what_is_written_is_read_as_the_same(kind):
    @given(VALUES[kind])
    def check(value):
        assert there_and_back(kind, value) == value

    check()


@given(by_name(estimates | by_name(estimates)))
def test_a_constant_is_told_from_a_series_of_constants_whatever_the_series_are_called(constants):
    assert there_and_back(Constants, constants) == constants


@given(st.integers(1, 4), st.data())
def test_arrays_of_a_state_come_back_with_their_bounds_and_cannot_be_written_to(n, data):
    def numbers(*shape: int) -> NDArray[np.float64]:
        size = math.prod(shape)
        return np.array(data.draw(st.lists(finite, min_size=size, max_size=size))).reshape(shape)

    names = tuple(f"c{i}" for i in range(n))
    lower = np.where(data.draw(st.lists(st.booleans(), min_size=n, max_size=n)), numbers(n), -math.inf)
    state = State(names, numbers(n), numbers(n), numbers(n, n), lower, np.full(n, math.inf))
    found = there_and_back(State, state)
    assert found.names == names
    for each in fields(State)[1:-1]:
        assert np.array_equal(getattr(found, each.name), getattr(state, each.name))
        assert not getattr(found, each.name).flags.writeable


@dataclass(frozen=True)
class Inner:
    x: float


@dataclass(frozen=True)
class Marked:
    renamed: int = field(metadata={"key": "other"})
    kind: Literal["a", "b"]
    ends: Annotated[tuple[float, float], Null((-math.inf, math.inf))]
    either: Inner | Sequence[Inner] | None
    left_out: Mapping[str, int] = field(default_factory=dict, metadata=OPTIONAL)
    hidden: int = field(default=1, metadata=INTERNAL)


@dataclass(frozen=True)
class Square:
    names: tuple[str, ...]
    matrix: Annotated[NDArray[np.float64], Shape(("names", "names"))]


MARKED = {"other": 3, "kind": "a", "ends": [None, 1.0], "either": None}


def test_metadata_rename_leave_out_and_hide():
    value = Marked(3, "a", (-math.inf, 1), None, hidden=7)
    assert to_plain(value) == MARKED
    assert list(to_plain(Marked(3, "a", (0, 1), None, {"n": 2}))) == [*MARKED, "left_out"]
    assert from_plain(Marked, Node(MARKED, "", "")) == Marked(3, "a", (-math.inf, 1.0), None)


@pytest.mark.parametrize("either", [Inner(1.0), (), (Inner(1.0), Inner(2.0)), None])
def test_a_member_of_a_union_is_known_by_its_form(either):
    assert there_and_back(Marked, Marked(1, "b", (0.0, 1.0), either)).either == either


def test_what_is_null_is_noted_by_its_key_and_open_ends_once():
    nulls = Nulls()
    made = to_plain(
        {"m": Marked(3, "a", (-math.inf, math.inf), Inner(math.nan)), "a": np.array([math.inf])}, nulls
    )
    assert made["m"]["either"] == {"x": None}
    assert nulls == Nulls(True, ["m.either.x (not a number)", "a[0] (infinite)"])


def test_everything_else_becomes_json_too():
    made = to_plain({1: {"b", "a"}, "n": np.int64(3), "t": np.bool_(True), "e": math, "x": np.eye(1)})
    assert made == {"1": ["a", "b"], "n": 3, "t": True, "e": str(math), "x": [[1.0]]}


@pytest.mark.parametrize(
    ("kind", "content", "says"),
    [
        (Marked, MARKED | {"other": True}, "the key 'at.other' must be a whole number"),
        (Marked, MARKED | {"kind": "c"}, "the key 'at.kind' must be one of a, b"),
        (Marked, MARKED | {"ends": [1.0]}, "the key 'at.ends' must be a list of two numbers or null"),
        (Marked, MARKED | {"either": [{"x": "1"}]}, "the key 'at.either[0].x' must be a number"),
        (Marked, MARKED | {"either": [None]}, "the key 'at.either[0]' must be an object"),
        (Marked, {}, "the key 'at.other' is missing"),
        (Square, {"names": ["a"], "matrix": [[1, 2]]}, "the key 'at.matrix[0]' must be a list of 1 numbers"),
        (Square, {"names": ["a"], "matrix": []}, "the key 'at.matrix' must be a list of 1 lists"),
        (Square, {"names": "a", "matrix": []}, "the key 'at.names' must be a list"),
        (Mapping[str, int], {"n": None}, "the key 'at.n' must be a whole number"),
        (Constants, {"mu": []}, "the key 'at.mu' must be an object"),
    ],
)
def test_what_is_wrong_is_named(kind, content, says):
    with pytest.raises(DataError) as caught:
        from_plain(kind, Node(content, "at", "a.json"))
    assert str(caught.value) == f"a.json: {says}. Fit the data again to get a whole file."


def test_the_file_of_a_result_has_the_keys_of_its_schema():
    schema = validator("result").schema
    kept = {key: each for each, key, _ in layout(FitResult)}
    optional = {key for key, each in kept.items() if "optional" in each.metadata}
    assert kept.keys() | {"schema", "ifrfit", "asked", "points"} == schema["properties"].keys()
    assert kept.keys() - optional | {"schema", "ifrfit", "points"} == set(schema["required"])
