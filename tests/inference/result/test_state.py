"""The distribution that a file keeps is that of the fit."""

from __future__ import annotations

import numpy as np
import pytest

import ifrfit

LEVELS = [0.025, 0.16, 0.5, 0.84, 0.975]


@pytest.mark.parametrize(
    ("name", "choices"),
    [
        (
            "wang-2018-limestone",
            {},
        ),  # e_t lies on its bound, far from where the uncut Gaussian has its centre
        ("cornell-glass", {"closure": "fr"}),
        ("cornell-glass", {}),
    ],
)
def test_quantiles_are_kept(name, choices, tmp_path):
    fit = ifrfit.fit(name, method="lsq", **choices)
    fit.save(tmp_path / "r.json")
    again = ifrfit.load_result(tmp_path / "r.json").distribution
    for quantity in again.names:
        found, wanted = (np.array(d.quantile(quantity, LEVELS)) for d in (again, fit.distribution))
        # a file does not keep how few rows the noise came from: Student's t of 22 degrees of freedom and
        # more there, normal here, 0.12 sd at these levels, and twice that where a far tail is cut at a bound
        np.testing.assert_allclose(found, wanted, atol=0.3 * fit.distribution.sd(quantity), err_msg=quantity)
