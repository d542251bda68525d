"""Rows by intervals of tau: every row lies in its own, edges never cross, and what has none is said to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ifrfit.inference.model.slip_intervals import SlipIntervals


@given(seed=st.integers(0, 10_000), n=st.integers(2, 40_000), spread=st.floats(1e-3, 8.0))
def test_each_row_lies_in_its_interval_and_none_is_lost(seed: int, n: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    tau = 10.0 ** rng.normal(0.0, spread, n)
    found = SlipIntervals.of(tau)
    assert found is not None
    assert np.array_equal(found.count, np.bincount(found.which, minlength=found.count.size))
    assert (np.diff(found.which[np.argsort(tau)].astype(int)) >= 0).all()
    assert (found.edges[0], found.edges[-1]) == (0.0, np.inf)
    assert (np.diff(found.edges) > 0.0).all()
    # rounding may put a row beside an edge
    assert (tau >= found.edges[found.which] * (1.0 - 1e-9) - 1e-9).all()
    assert (tau <= found.edges[found.which + 1] * (1.0 + 1e-9) + 1e-9).all()


@pytest.mark.parametrize("tau", [[], [0.0, 1.0], [1.0, np.inf], [1.0, 1.0], [1.0, 1.0 + 1e-7], [np.nan, 1.0]])
def test_there_are_none_where_tau_is_no_number_or_does_not_spread(tau: list[float]) -> None:
    assert SlipIntervals.of(np.array(tau)) is None
