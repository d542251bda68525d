"""Readings of e_n are held against angle, speed, what was fixed or known, and 1."""

from __future__ import annotations

import numpy as np
from factories import impacts_file, jet, problem_of, table_file

from ifrfit import fit
from ifrfit.data import read
from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import LAWS
from ifrfit.physics import rebound

ANGLES = np.linspace(5.0, 80.0, 20)


def table(path, e_n, *, noise=0.01, sigma=None, speed=None, seed=0):
    """beta by one set of constants, and readings of e_n as given."""
    rng = np.random.default_rng(seed)
    beta = rebound(ANGLES, degrees=True, e_n=0.9, e_t=-0.8, mu=0.2).beta
    columns = {
        "gamma_deg": ANGLES,
        "beta": beta + 0.01 * rng.standard_normal(ANGLES.size),
        "e_n": e_n + noise * rng.standard_normal(ANGLES.size),
    }
    if sigma:
        columns |= {"sigma_beta": 0.01, "sigma_e_n": sigma}
    if speed is not None:
        columns["speed_m_s"] = speed
    return table_file(path, columns, "%.6g")


def restitution(path, **choices):
    return fit(path, method="lsq", **choices).facts["normal_restitution"]


def test_readings_that_fall_with_the_speed_are_not_one_value(tmp_path):
    speed = np.random.default_rng(1).permutation(np.geomspace(0.5, 10.0, ANGLES.size))
    found = restitution(table(tmp_path / "t.csv", 0.95 - 0.06 * np.log(speed), speed=speed))
    assert not found.ok
    assert "m/s" in found.says


def test_readings_contradict_a_prior(tmp_path):
    assert not restitution(table(tmp_path / "t.csv", 0.9, sigma=0.01), prior={"e_n": (0.8, 0.01)}).ok
    assert restitution(table(tmp_path / "t.csv", 0.9, sigma=0.01), prior={"e_n": (0.88, 0.01)}).ok


def test_readings_above_one_are_impossible(tmp_path):
    found = restitution(table(tmp_path / "t.csv", 1.05))
    assert not found.ok
    assert "gains energy" in found.says
    single = np.full(ANGLES.size, 0.9)
    single[3] = 1.2
    assert not restitution(table(tmp_path / "one.csv", single, sigma=0.01)).ok


def test_a_rise_beyond_one_is_said_to_be_impossible(tmp_path):
    """A normal velocity that is not divided by the cosine of the angle, or one that is divided twice."""
    above = "e_n above 1 cannot be"
    assert above in restitution(table(tmp_path / "t.csv", 0.9 / np.cos(np.radians(ANGLES)))).says
    assert above not in restitution(table(tmp_path / "t.csv", 0.8 + 0.002 * ANGLES)).says
    assert above in restitution(table(tmp_path / "t.csv", 0.96 + 0.001 * ANGLES)).says
    assert above not in restitution(table(tmp_path / "t.csv", 0.93 + 0.001 * ANGLES, noise=0.02)).says


def test_false_alarms_are_as_rare_as_stated(tmp_path):
    """600 clean tables: at one in a thousand or fewer, 4 or more alarms have a probability below 0.004."""
    from ifrfit.inference.diagnostics.normal_restitution import normal_restitution
    from ifrfit.inference.optimize.least_squares import least_squares

    problem = problem_of(read(table(tmp_path / "t.csv", 0.9)), noise="unknown")
    found = least_squares(problem)
    normal = problem.rows.of_kind("normal")
    rng = np.random.default_rng(5)
    smallest = []
    for _ in range(600):
        value = problem.rows.value.copy()
        value[normal] = 0.9 + 0.02 * rng.standard_normal(int(normal.sum()))
        object.__setattr__(problem.rows, "value", value)
        smallest.append(normal_restitution(problem, found).figures["p"])
    assert sum(p < 0.001 for p in smallest) < 4
    assert 0.02 < np.mean(np.array(smallest) < 0.1) < 0.15  # Bonferroni is at most 0.1, and little below it


def test_readings_of_v_n_are_brought_to_e_n(tmp_path):
    """v_n falls with the angle because the normal velocity does, not because e_n does."""
    parts = {"gamma": ANGLES, "observables": ("beta", "v_n"), "noise": 0.01, "sigma": 0.01, "e_n": 0.9}
    found = restitution(impacts_file(tmp_path / "t.csv", parts))
    assert found.ok
    assert found.figures["p"] > 0.001


def drops(path, restitution_at, *, seed=0, noise=0.03):
    """Raw velocities of 40 impacts of two speeds, e_n by a function of angle and normal speed."""
    rng = np.random.default_rng(seed)
    gamma = np.radians(np.tile(np.linspace(20.0, 80.0, 20), 2))
    speed = np.repeat([4.0, 7.0], 20) * rng.uniform(0.9, 1.1, 40)
    e_n = restitution_at(gamma, speed * np.cos(gamma))
    impact = rebound(gamma, e_n=0.8, e_t=-0.9, mu=0.3)
    noises = noise * rng.standard_normal((2, 40))
    v_x = speed * (impact.v_x + noises[0])
    v_n = speed * np.maximum(e_n * np.cos(gamma) + noises[1] * np.cos(gamma), 0.01)
    u_x, u_z = speed * np.sin(gamma), speed * np.cos(gamma)
    columns = {"u_x_m_s": u_x, "u_z_m_s": u_z, "v_x_m_s": v_x, "v_n_m_s": v_n}
    return fit(table_file(path, columns, "%.6g"), method="lsq", closure="fr")


def test_restitution_that_rises_with_the_angle_is_not_blamed_on_yield(tmp_path):
    found = drops(tmp_path / "t.csv", lambda gamma, speed: 0.35 + 0.5 * gamma**3)
    fact = found.facts["normal_restitution"]
    assert not fact.ok
    assert fact.figures["p_laws_of_speed"] < 1e-3
    assert "neither yield nor viscosity makes e_n rise so with the angle" in fact.says
    assert "effects" not in found.facts


def test_yield_is_still_called_yield(tmp_path):
    """Control: e_n by the law of an elastic, perfectly plastic sphere rises with the angle, too."""
    law = LAWS["plasticity"](0.6)
    found = drops(tmp_path / "t.csv", lambda gamma, speed: law(speed / 3.0))
    fact = found.facts["normal_restitution"]
    assert not fact.ok
    assert "p_laws_of_speed" not in fact.figures
    assert "yield" not in fact.says
    assert found.facts["effects"].figures["called"][0] == "plasticity"


def test_errors_of_one_speed_are_no_trend_over_it(tmp_path):
    """Those of the normal velocity before are in e_n and in the speed."""
    for seed in range(12):
        path = jet(tmp_path / "t.csv", seed, noise=0.04, gamma=np.linspace(8.0, 60.0, 24))
        fact = fit(path, method="lsq").facts.get("normal_restitution")
        assert fact is None or "m/s" not in fact.says
