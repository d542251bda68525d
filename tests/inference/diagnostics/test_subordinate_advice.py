"""A finding that something before it explains advises nothing that would be wrong then."""

from __future__ import annotations

import numpy as np
from factories import table_file

from ifrfit import fit
from ifrfit.physics import rebound

ANGLES = np.linspace(6.0, 82.0, 30)
RADIUS = 0.005


def raw(path, tilt=0.0, spin=1.0):
    """Raw velocities of a camera that is turned by degrees, spins times a factor in every row."""
    rng = np.random.default_rng(8)
    state = rebound(ANGLES, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True)
    sine, cosine = np.sin(np.radians(ANGLES)), np.cos(np.radians(ANGLES))
    turn = np.radians(tilt)
    v_x, v_n = (v + 0.005 * rng.standard_normal(ANGLES.size) for v in (state.v_x, state.v_n))
    columns = {
        "u_x_m_s": sine * np.cos(turn) + cosine * np.sin(turn),
        "u_z_m_s": cosine * np.cos(turn) - sine * np.sin(turn),
        "v_x_m_s": v_x * np.cos(turn) - v_n * np.sin(turn),
        "v_z_m_s": -(v_n * np.cos(turn) + v_x * np.sin(turn)),
        "omega_y_rad_s": 0.0,
        "omega_y_after_rad_s": spin * (state.spin_y + 0.005 * rng.standard_normal(ANGLES.size)) / RADIUS,
        "radius_mm": 1e3 * RADIUS,
    }
    return table_file(path, columns, "%.6g")


def test_what_follows_from_a_slip_advises_no_other_remedy(tmp_path):
    """A turned camera makes e_n rise with the angle, and angular momentum miss as of another body."""
    facts = fit(raw(tmp_path / "t.csv", tilt=2.0), method="lsq").facts
    failing = [name for name, fact in facts.items() if not fact.ok]
    assert failing[0] == "slips"
    assert "a camera turned against the wall by 2.0" in facts["slips"].says
    assert {"angular_momentum", "normal_restitution"} <= set(failing)
    every = " ".join(fact.says for name, fact in facts.items() if name != "slips")
    assert "--inertia-factor" not in every
    assert "Fit a narrower range" not in every
    assert "Mend the slip in the table first" in facts["angular_momentum"].says
    assert "Mend the slip in the table first" in facts["normal_restitution"].says


def test_an_inertia_factor_that_no_ball_has_is_not_advised(tmp_path):
    """Every second spin in another unit: the least squares of all would ask for J = 0.05."""
    spin = np.where(np.arange(ANGLES.size) % 2, 30.0 / np.pi, 1.0)
    fact = fit(raw(tmp_path / "t.csv", spin=spin), method="lsq").facts["angular_momentum"]
    assert not fact.ok
    assert "try --inertia-factor" not in fact.says
    assert "close, so that no inertia factor is the reason: look at the unit and the sign" in fact.says


def copied(path, provenance="measured"):
    rng = np.random.default_rng(4)
    beta = rebound(ANGLES, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True).beta
    beta = beta + 0.03 * rng.standard_normal(beta.size)
    columns = {"gamma_deg": ANGLES, "beta": beta, "e_n": 0.91327, "sigma_e_n": 0.02, "provenance": provenance}
    return table_file(path, columns, "%.5f")


def test_a_mean_that_was_copied_down_is_one_reading(tmp_path):
    result = fit(copied(tmp_path / "t.csv"), method="lsq")
    fact = result.facts["repeated_number"]
    assert not fact.ok
    assert fact.says.startswith(
        "e_n is 0.91327 in all 30 rows: a mean that was copied down is one reading, not 30"
    )
    assert result.summary().startswith("LOOK  one number stands in the place of several readings")
    assert "--noise" not in " ".join(each.says for each in result.facts.values() if not each.ok)
    assert not {"independence", "scatter_too_small"} & result.facts.keys()


def test_simulated_readings_may_be_one_number(tmp_path):
    facts = fit(copied(tmp_path / "t.csv", "simulated"), method="lsq").facts
    assert "repeated_number" not in facts


def doubled(tmp_path, twice):
    """Impacts that stand in two series, or stand once."""
    rng = np.random.default_rng(11)
    gamma = np.round(rng.uniform(6.0, 80.0, 40), 1)
    state = rebound(gamma, e_n=0.85, e_t=-0.75, mu=0.15, degrees=True)
    table = {"gamma_deg": gamma, "beta": state.beta + 0.02 * rng.standard_normal(40)}
    table["e_n"] = 0.85 + 0.02 * rng.standard_normal(40)
    if twice:
        table = {name: np.tile(value, 2) for name, value in table.items()}
        table["series"] = np.repeat(["a", "b"], 40)
    return fit(table).facts


def test_what_may_follow_from_rows_that_count_twice_says_so(tmp_path):
    facts = doubled(tmp_path, twice=True)
    failing = {name: fact.says for name, fact in facts.items() if not fact.ok}
    assert "duplicates" in failing
    others = failing.keys() - {"duplicates"}
    assert others
    for name in others:
        assert "may follow from the rows that count twice: leave these out first" in failing[name]
        assert "Try " not in failing[name]
    assert not [name for name, fact in doubled(tmp_path, twice=False).items() if not fact.ok]


def test_outliers_behind_a_slip_that_explains_much_may_follow_from_it():
    """Angles from the wall, sigma known."""
    rng = np.random.default_rng(3)
    gamma = np.round(rng.uniform(6.0, 80.0, 40), 1)
    beta = rebound(gamma, e_n=0.85, e_t=-0.75, mu=0.15, degrees=True).beta
    beta = beta + 0.02 * rng.standard_normal(40)
    facts = fit({"gamma_deg": 90.0 - gamma, "beta": beta, "sigma_beta": 0.02}, fix={"e_n": 0.85}).facts
    failing = {name: fact.says for name, fact in facts.items() if not fact.ok}
    assert "slips" in failing
    assert "outliers" in failing
    assert "may follow from the slip: mend it first" in failing["outliers"]
