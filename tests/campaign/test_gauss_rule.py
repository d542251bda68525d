"""Gauss's rule of three nodes for given weights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ifrfit.campaign.many_groups.gauss_rule import three_nodes

PLACES, _ = np.polynomial.legendre.leggauss(6)


@given(log_weights=arrays(float, (5, 6), elements=st.floats(-6.0, 6.0)))
def test_polynomials_up_to_degree_five_keep_their_integral(log_weights):
    weights = np.exp(log_weights)
    nodes, found = three_nodes(PLACES, weights)
    assert (found > 0.0).all()
    assert (np.diff(np.sort(nodes, axis=1), axis=1) > 0.0).all()
    assert ((nodes > PLACES[0]) & (nodes < PLACES[-1])).all()
    for degree in range(6):
        there = (found * nodes**degree).sum(axis=1)
        np.testing.assert_allclose(
            there, (weights * PLACES**degree).sum(axis=1), atol=1e-9 * weights.sum(axis=1).max()
        )


def test_three_nodes_of_legendre_weights_are_those_of_legendre():
    places, weights = np.polynomial.legendre.leggauss(12)
    nodes, found = three_nodes(places, weights)
    order = np.argsort(nodes)
    expected = np.polynomial.legendre.leggauss(3)
    np.testing.assert_allclose((nodes[order], found[order]), expected, atol=1e-13)


@pytest.mark.parametrize("weights", [(0, 0, 2, 0, 0, 0), (0, 0, 0, 0, 0, 0), (1e-300, 2, 0, 0, 0, 0)])
def test_weight_on_one_place_stays_there(weights):
    nodes, found = three_nodes(PLACES, np.array(weights, dtype=float))
    assert found.sum() == pytest.approx(sum(weights))
    assert (found * nodes).sum() == pytest.approx(np.dot(weights, PLACES))
