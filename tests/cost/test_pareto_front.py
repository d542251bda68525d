"""The front and the cheapest choice, by hand and by their properties."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from ifrfit.cost.result import best_for, cheapest, choices_of
from ifrfit.cost.timing import Cost, Timing


def cost(method, seconds, error, *, quantity="mean", setting="", kind="inference"):
    return Cost(kind, method, setting, quantity, Timing.of([seconds]), error, "posterior sd")


def test_quantities_of_a_choice_come_together_and_the_worst_counts():
    choices = choices_of([cost("a", 1.0, 0.1), cost("a", 1.0, 0.3, quantity="sd"), cost("b", 2.0, 0.2)])
    assert [c.errors for c in choices] == [{"mean": 0.1, "sd": 0.3}, {"mean": 0.2}]
    assert [c.error for c in choices] == [0.3, 0.2]
    assert [c.on_front for c in choices] == [True, True]


def test_the_front_by_hand():
    found = choices_of(
        [
            cost("fast", 1.0, 1.0),
            cost("beaten", 3.0, 1e-2),
            cost("good", 2.0, 1e-3),
            cost("as good but slower", 2.5, 1e-3),
            cost("best", 9.0, 1e-9),
            cost("unknown", 0.1, math.nan),
        ]
    )
    assert [c.method for c in found if c.on_front] == ["fast", "good", "best"]


def test_kinds_do_not_compete():
    found = choices_of([cost("a", 1.0, 1e-3), cost("b", 5.0, 1.0, kind="physics")])
    assert all(c.on_front for c in found)


def test_in_arithmetic_each_kind_of_impacts_is_a_question_of_its_own():
    found = choices_of(
        [
            cost("float32", 1.0, 1e-7, setting="easy", kind="arithmetic"),
            cost("float32", 1.0, 1e-2, setting="hard", kind="arithmetic"),
            cost("float64", 2.0, 1e-16, setting="easy", kind="arithmetic"),
            cost("float64", 2.0, 1e-10, setting="hard", kind="arithmetic"),
        ]
    )
    assert all(c.on_front for c in found)


def test_cheapest_for_each_target():
    choices = choices_of([cost("a", 1.0, 2e-2), cost("b", 2.0, 1e-4), cost("c", 3.0, 1e-5)])
    assert cheapest(choices, 1e-6) is None
    found = [
        (loose, tight, c.method) for loose, tight, c in best_for(choices, [1e-1, 1e-2, 1e-3, 1e-5, 1e-7])
    ]
    assert found == [(1e-1, 1e-1, "a"), (1e-2, 1e-3, "b"), (1e-5, 1e-5, "c")]


measured = st.lists(
    st.tuples(st.floats(1e-6, 1e3), st.one_of(st.floats(0.0, 10.0), st.just(math.nan))),
    min_size=1,
    max_size=12,
)


@given(measured)
def test_nothing_on_the_front_is_beaten_and_everything_off_it_is(points):
    choices = choices_of([cost(str(i), t, e) for i, (t, e) in enumerate(points)])
    front = [c for c in choices if c.on_front]
    for one in choices:
        beaten = [
            o
            for o in front
            if o.time.median <= one.time.median
            and o.error <= one.error
            and (o.time.median, o.error) != (one.time.median, one.error)
        ]
        assert one.on_front == (not beaten and not math.isnan(one.error))


@given(measured, st.floats(1e-9, 10.0))
def test_the_cheapest_lies_on_the_front_or_is_matched_there(points, target):
    choices = choices_of([cost(str(i), t, e) for i, (t, e) in enumerate(points)])
    best = cheapest(choices, target)
    within = [c for c in choices if c.on_front and c.error <= target]
    assert (best is None) == (not within)
    if best is not None:
        assert best.time.median == min(c.time.median for c in within)
