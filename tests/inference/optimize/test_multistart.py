"""The search from many starts, where no proof is known."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit import fit, rebound


@pytest.mark.parametrize("seed", range(4))
def test_repeated_angles_do_not_crowd_the_starts(seed, tmp_path):
    """Six readings at each of two angles: the optimum is no worse than the constants that made them."""
    rng = np.random.default_rng(seed)
    gamma = np.repeat([15.4, 43.4], 6)
    made = rebound(gamma, degrees=True, e_n=0.664, e_t=-0.82, mu=0.19)
    lines = ["observable,gamma_deg,value,sigma"]
    chi2 = 0.0
    for name, exact, sigma in (
        ("delta_deg", np.degrees(np.arctan2(made.v_x, made.v_n)), 0.48),
        ("e_n", np.full(12, 0.664), 0.008),
    ):
        errors = rng.standard_normal(12)
        chi2 += float(errors @ errors)
        values = zip(gamma, exact + sigma * errors, strict=True)
        lines += [f"{name},{g},{v:.6f},{sigma}" for g, v in values]
    path = tmp_path / "impacts.csv"
    path.write_text("\n".join(lines) + "\n")
    result = fit(path, method="lsq")
    assert result.fit.chi2 < chi2 + 1e-3
    assert result.facts["lack_of_fit"].ok
