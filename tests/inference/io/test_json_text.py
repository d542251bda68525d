"""Plain values as text: strict JSON whose lines can be read."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ifrfit.inference.io.json_text import render

floats = st.floats(allow_nan=False, allow_infinity=False)
leaves = st.none() | st.booleans() | st.integers() | floats | st.text()
values = st.recursive(leaves, lambda own: st.lists(own) | st.dictionaries(st.text(), own), max_leaves=20)


@given(values)
def test_the_text_means_the_value(value):
    assert json.loads(render(value)) == value


def test_a_list_of_numbers_takes_one_line_and_objects_take_many():
    assert render({"a": [1, 2.5], "b": {}, "c": [{"d": "\u03b2"}, []]}) == (
        '{\n  "a": [1, 2.5],\n  "b": {},\n  "c": [\n    {\n      "d": "\u03b2"\n    },\n    []\n  ]\n}'
    )


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_json_does_not_know_is_refused(value):
    with pytest.raises(ValueError, match="Out of range float values"):
        render({"a": [value]})
