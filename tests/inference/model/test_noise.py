"""The last decimal that values are written with."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit.inference.model.noise import in_steps, resolution


@pytest.mark.parametrize("at", [0, 255, 256, 999])
def test_one_value_with_more_decimals_tells_wherever_it_stands(at):
    value = np.round(np.random.default_rng(0).normal(size=1000), 2)
    assert in_steps(value, 0.01)
    assert resolution(value) == 0.01
    value[at] = 0.1234
    assert not in_steps(value, 0.01)
    assert resolution(value) == pytest.approx(1e-4, rel=1e-12)
