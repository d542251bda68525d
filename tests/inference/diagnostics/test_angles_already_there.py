"""No other angles are asked for where all are there."""

from __future__ import annotations

import numpy as np
import pytest
from factories import jet, table_file

from ifrfit import fit, rebound


def fitted(folder, gamma, noise, divided=None, mu=0.15):
    rng = np.random.default_rng(1)
    state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=mu, degrees=True)
    by = np.ones(gamma.size) if divided is None else divided(np.radians(gamma))
    columns = {
        "gamma_deg": gamma,
        "v_x": (state.v_x + noise * rng.standard_normal(gamma.size)) / by,
        "v_n": (state.v_n + 0.01 * rng.standard_normal(gamma.size)) / by,
        "spin_y_after": (state.spin_y + noise * rng.standard_normal(gamma.size)) / by,
    }
    return fit(table_file(folder / "t.csv", columns), method="lsq")


@pytest.mark.parametrize(
    ("last", "noise", "divided", "mu", "says"),
    [
        (80.0, 0.02, np.cos, 0.15, "see first why the law does not describe them"),
        (80.0, 0.6, None, 0.15, "more impacts or smaller errors would tell"),
        (60.0, 0.02, None, 0.9, "measure beyond 60 degrees"),
    ],
)
def test_what_to_do_beside_the_angles(tmp_path, last, noise, divided, mu, says):
    found = fitted(tmp_path, np.linspace(8.0, last, 30), noise, divided, mu)
    fact = found.facts["identifiable"]
    assert not fact.ok
    assert says in fact.says
    if last == 80.0:
        assert "from 8 to 80 degrees are there already" in fact.says
        assert "other angles" not in fact.says


@pytest.mark.parametrize("gamma", [45.0, 60.0])
def test_one_angle_made_of_velocities_tells_no_constant(tmp_path, gamma):
    """What spread it has are errors of the velocities before."""
    for seed in range(6):
        fact = fit(jet(tmp_path / "t.csv", seed, noise=0.03, gamma=gamma), method="lsq").facts["identifiable"]
        assert not fact.ok
        assert "is errors" in fact.says
    wide = jet(tmp_path / "w.csv", 0, noise=0.03, gamma=np.linspace(10.0, 70.0, 24))
    assert "is errors" not in fit(wide, method="lsq").facts["identifiable"].says


def test_tangents_for_degrees_give_a_mu_of_no_contact(tmp_path):
    """They divide every slip ratio by nearly one number, and nothing in the residuals tells."""
    rng = np.random.default_rng(3)
    gamma = np.linspace(8.0, 75.0, 24)
    beta = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.9, mu=0.12).beta + 0.02 * rng.standard_normal(24)
    table = {"gamma_deg": np.tan(np.radians(gamma)), "beta": beta}
    fact = fit(table_file(tmp_path / "t.csv", table, "%.5g"), method="lsq", fix={"e_n": 0.9}).facts[
        "tiny_friction"
    ]
    assert "no tangents?" in fact.says
    right = table_file(tmp_path / "r.csv", table | {"gamma_deg": gamma}, "%.5g")
    assert "tiny_friction" not in fit(right, method="lsq", fix={"e_n": 0.9}).facts
