"""The incoming state: some impacts of others, at once and lazily."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit.physics.angles import Incidence


@pytest.mark.parametrize("rows", [slice(1, 4), slice(None, None, 2), np.array([3, 0, 3])])
def test_impacts_taken_lazily_are_those_taken_at_once(rows) -> None:
    whole = Incidence.of(np.linspace(5.0, 85.0, 5), 0.1, np.linspace(-1.0, 1.0, 5), degrees=True)
    at_once, lazily = whole.take(rows), whole.lazily(rows)
    for name in ("sine", "cosine", "spin_x", "spin_y", "slip_x", "slip_y", "slip", "tau"):
        assert np.array_equal(getattr(lazily, name), getattr(at_once, name)), name
    assert not hasattr(lazily, "gamma")
