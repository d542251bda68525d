"""The weights of rows with heavy tails settle: steps that shrink by one ratio are summed."""

from __future__ import annotations

import pytest

from ifrfit.inference.fit import fit
from ifrfit.inference.options import Noise


@pytest.mark.parametrize("closure", ["ifr", "ifr-contact", "fr", "f"])
@pytest.mark.parametrize("data", ["cross-2019", "kharaz-2001", "buck-2017"])
def test_weights_settle(data, closure):
    found = fit(data, method="lsq", closure=closure, noise=Noise("known", tails="student-t")).least_squares
    assert found.change <= 1e-8
