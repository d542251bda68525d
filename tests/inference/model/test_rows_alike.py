"""Rows that are alike in several columns have one number, in the order of the columns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.inference.model.rows import numbered


@pytest.mark.parametrize("seed", range(20))
def test_numbers_are_those_of_sorted_tuples(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 60))
    columns = [
        rng.integers(4, size=n),
        np.zeros(n),
        rng.choice([0.0, -0.0, 0.5, np.inf], size=n),
        rng.standard_normal(n) if seed % 2 else rng.integers(3, size=n),
    ]
    tuples = list(zip(*(column.tolist() for column in columns), strict=True))
    place = {each: number for number, each in enumerate(sorted(set(tuples)))}
    assert numbered(*columns).tolist() == [place[each] for each in tuples]


def test_what_is_missing_is_alike_and_comes_last():
    assert numbered(np.array([math.nan, 1.0, math.nan, 0.0])).tolist() == [2, 1, 2, 0]


def test_no_rows_have_no_number():
    assert numbered(np.empty(0), np.empty(0, dtype=np.intp)).size == 0
