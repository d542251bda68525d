"""Angles that were rounded to 5 degrees: each may have been any within the step."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import table_file

from ifrfit import fit, rebound

TRUTH = {"e_n": 0.9, "e_t": -0.7, "mu": 0.15}


def fitted(folder, seed, *, names=("beta", "e_n"), noise=0.005, step=5.0, n=60, known=False, rounded=True):
    """Impacts at any angle, which the table has rounded; or at the angles that it has."""
    rng = np.random.default_rng([seed, 8])
    gamma = rng.uniform(10.0, 80.0, n)
    given = step * np.round(gamma / step)
    state = rebound(gamma if rounded else given, degrees=True, **TRUTH)
    table = {"gamma_deg": given}
    for name in names:
        exact = np.full(n, TRUTH["e_n"]) if name == "e_n" else getattr(state, name.removesuffix("_after"))
        table[name] = exact + noise * rng.standard_normal(n)
        if known:
            table[f"sigma_{name}"] = noise
    return fit(table_file(folder / "impacts.csv", pd.DataFrame(table)), method="lsq")


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("names", [("beta", "e_n"), ("beta_cm", "e_n"), ("v_x", "v_n", "spin_y_after")])
def test_rounding_is_named_with_its_step(tmp_path, names, known):
    for seed in range(3):
        noise = 0.003 if "beta_cm" in names else 0.005
        facts = fitted(tmp_path, seed, names=names, known=known, noise=noise).facts
        fact = facts["angle_scatter"]
        assert "as where they are rounded to 5 degrees" in fact.says
        assert fact.figures["size"] == pytest.approx(5.0 / np.sqrt(12.0), abs=0.05)
        assert "--sigma-gamma 1.4" in fact.says
        assert not {"mixture", "scatter_by_angle", "scatter_too_large", "lack_of_fit"} & {
            name for name, one in facts.items() if not one.ok
        }


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("step", [5.0, 1.0])
def test_angles_that_were_set_are_not_called_rounded(tmp_path, step, known):
    for seed in range(4):
        assert "angle_scatter" not in fitted(tmp_path, seed, step=step, known=known, rounded=False).facts
