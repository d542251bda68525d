"""Readings at the end of a sensor's scale are a finding, in the units in which they were read."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, each_once, table_file

from ifrfit import fit
from ifrfit.physics import rebound


def _table(seed=0, *, n=40, u=None, noise=0.02, given=False):
    """Velocities of impacts at random speeds and angles."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(10.0, 78.0, n)
    u = rng.uniform(2.0, 6.0, n) if u is None else u
    state = rebound(gamma, e_n=0.9, e_t=-0.75, mu=0.15, degrees=True)
    errors = noise * rng.standard_normal((5, n))
    if given:
        before = {"gamma_deg": gamma, "speed_m_s": u}
    else:
        u_x, u_z = (u * part(np.radians(gamma)) for part in (np.sin, np.cos))
        before = {"u_x_m_s": u_x + errors[0], "u_z_m_s": u_z + errors[1]}
    spins = (u * state.spin_y + errors[4]) / 0.01
    after = {"v_x_m_s": u * state.v_x + errors[2], "v_z_m_s": -u * state.v_n + errors[3]}
    return before | after | {"omega_y_after_rad_s": spins, "radius_mm": np.full(n, 10.0)}


def _clipped(table, column, share=0.25):
    size = np.abs(table[column])
    most = float(np.round(np.quantile(size, 1.0 - share), 3))
    return table | {column: np.clip(table[column], -most, most)}


def _found(path, table, form="%.4f"):
    return fit(table_file(path, table, form), method="lsq").facts.get("censoring")


@pytest.mark.parametrize("column", ["v_x_m_s", "v_z_m_s", "omega_y_after_rad_s"])
def test_velocities_and_spins_at_the_end_of_a_sensor_are_named(tmp_path, column):
    fact = _found(tmp_path / "t.csv", _clipped(_table(1), column))
    assert not fact.ok
    assert "exactly, the " in fact.says
    assert fact.figures["n"] == 10


@pytest.mark.parametrize("column", ["u_x_m_s", "u_z_m_s", "speed_m_s"])
def test_incoming_speeds_at_the_end_of_a_sensor_are_named(tmp_path, column):
    fact = _found(tmp_path / "t.csv", _clipped(_table(1, given=column == "speed_m_s"), column))
    assert not fact.ok
    assert "seems to end there" in fact.says
    assert fact.figures["n"] == 10


def _scan(seed):
    """Most impacts at one set speed, the others once each at less."""
    rng = np.random.default_rng(seed)
    u = np.where(np.arange(40) < 25, 5.0, rng.uniform(1.0, 4.9, 40))
    return _table(seed, u=u, given=True)


def _of_angles(seed):
    """Five angles, repeated."""
    table = _table(seed, u=np.full(40, 3.0), given=True)
    gamma = np.repeat([10.0, 25.0, 40.0, 55.0, 70.0], 8)
    state = rebound(gamma, e_n=0.9, e_t=-0.75, mu=0.15, degrees=True)
    errors = 0.02 * np.random.default_rng(seed).standard_normal((3, 40))
    return table | {
        "gamma_deg": gamma,
        "v_x_m_s": 3.0 * state.v_x + errors[0],
        "v_z_m_s": -3.0 * state.v_n + errors[1],
        "omega_y_after_rad_s": (3.0 * state.spin_y + errors[2]) / 0.01,
    }


@pytest.mark.parametrize(("form", "scene"), each_once(["%.4f", "%.1f"], [_table, _scan, _of_angles]))
@pytest.mark.parametrize("seeds", [5, pytest.param(150, marks=pytest.mark.long)])
def test_set_speeds_repeated_angles_and_coarse_readings_have_no_end(tmp_path, scene, form, seeds):
    alarms = sum(_found(tmp_path / "t.csv", scene(seed), form) is not None for seed in range(seeds))
    assert alarms <= at_most(seeds, 0.001)
