"""Sums that keep what rounding takes off: compiled with vectors and as they are written, to the same bits."""

from fractions import Fraction

import numpy as np
import pytest

from ifrfit.inference.sufficient_statistics.compensated_addition import add_to_sums, use_vectors
from ifrfit.physics.compiling import compiled

SUMS = 6


def added(high, low, first, terms):
    for i in range(len(first)):
        add_to_sums(high, low, first[i], (terms[i, 0], terms[i, 1], terms[i, 2], terms[i, 3]))


def drawn(seed):
    rng = np.random.default_rng(seed)
    terms = rng.standard_normal((400, 4)) * 10.0 ** rng.integers(-12, 13, (400, 4))
    return rng.integers(0, SUMS - 3, 400).astype(np.int32), terms


@pytest.mark.parametrize("seed", range(4))
def test_sums_are_those_of_fractions(seed):
    first, terms = drawn(seed)
    high, low = np.zeros(SUMS), np.zeros(SUMS)
    added(high, low, first, terms)
    for place in range(SUMS):
        met = [Fraction(terms[i, place - at]) for i, at in enumerate(first.tolist()) if 0 <= place - at < 4]
        exact, size = sum(met), float(sum(map(abs, met)))
        # what is left is the rounding of the low parts: an ulp of an ulp for each term
        assert abs(float(Fraction(high[place]) + Fraction(low[place]) - exact)) <= len(met) * 2.0**-104 * size


@pytest.mark.parametrize("seed", range(4))
def test_vectors_give_the_same_bits(seed):
    pytest.importorskip("numba")
    use_vectors()
    first, terms = drawn(seed)
    plain, taken = np.zeros((2, SUMS)), np.zeros((2, SUMS))
    added(*plain, first, terms)
    compiled(added)(*taken, first, terms)
    assert taken.tobytes() == plain.tobytes()
