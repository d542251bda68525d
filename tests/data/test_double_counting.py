"""No measurement of an impact is taken up twice: the rule that tables in memory and streams share."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ifrfit.data.double_counting import TakenMeasurements, without_double_counting
from ifrfit.physics.observables import OBSERVABLES

NAMES = list(OBSERVABLES)


def test_what_is_measured_comes_before_what_is_computed():
    assert without_double_counting(["beta", "e_n", "beta_cm"]) == (["beta_cm", "e_n"], ["beta"])
    assert without_double_counting(["beta", "v_n", "e_n"]) == (["v_n", "beta"], ["e_n"])
    assert without_double_counting([]) == ([], [])


def test_an_impact_is_free_for_what_nothing_has_taken():
    taken = TakenMeasurements(4)
    assert taken.take("beta_cm", np.array([0, 2])).tolist() == [True, True]
    assert taken.take("beta", np.array([3, 2, 1])).tolist() == [True, False, True]
    assert taken.take("e_n", np.array([0, 1, 2, 3])).all()
    assert taken.take("spin_y_after", np.array([0, 1, 2, 3])).tolist() == [True, False, True, False]


def test_values_of_one_impact_are_taken_together():
    taken = TakenMeasurements(2)
    assert taken.take("beta", np.array([1, 1, 0])).all()
    assert not taken.take("beta", np.array([1, 1, 0])).any()


@given(st.lists(st.sets(st.sampled_from(NAMES)), min_size=1, max_size=8), st.randoms())
def test_each_impact_is_decided_as_if_it_stood_alone(measured, random):
    """Rows of several impacts, in any order, against sets of measurements of one."""
    taken = TakenMeasurements(len(measured))
    found: list[list[str]] = [[] for _ in measured]
    for name in NAMES:
        own = [number for number, names in enumerate(measured) if name in names]
        random.shuffle(own)
        for number, free in zip(own, taken.take(name, np.array(own, dtype=np.intp)), strict=True):
            found[number] += [name] if free else []
    for used, names in zip(found, measured, strict=True):
        known: set[str] = set()
        expected = []
        for name in NAMES:
            if name in names and known.isdisjoint(OBSERVABLES[name].takes):
                known |= OBSERVABLES[name].takes
                expected.append(name)
        assert used == expected == without_double_counting(names)[0]
