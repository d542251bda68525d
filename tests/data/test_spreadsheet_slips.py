"""What spreadsheets and sensors do: percent that is shown only, numbers of lines, ends of scale."""

from __future__ import annotations

import numpy as np
import pytest
from factories import table_file

from ifrfit import fit
from ifrfit.errors import DataError
from ifrfit.physics import rebound

GAMMA = np.linspace(10.0, 75.0, 24)


def _ratios(seed=0):
    rng = np.random.default_rng(seed)
    beta = rebound(GAMMA, e_n=0.9, e_t=-0.75, mu=0.15, degrees=True).beta
    noise = 0.01 * rng.standard_normal((2, GAMMA.size))
    return {"gamma_deg": GAMMA, "beta": beta + noise[0], "e_n": 0.9 + noise[1]}


def _raw(seed=0, most=np.inf):
    """Velocities of impacts at random speeds, those towards the wall cut off at the most."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(2.0, 6.0, GAMMA.size)
    state = rebound(GAMMA, e_n=0.9, e_t=-0.75, mu=0.15, degrees=True)
    u_x, u_z = (u * part(np.radians(GAMMA)) for part in (np.sin, np.cos))
    after = {"v_x_m_s": u * state.v_x, "v_z_m_s": -u * state.v_n}
    return {"u_x_m_s": u_x, "u_z_m_s": np.minimum(u_z, most)} | after


@pytest.mark.parametrize("header", ["e_n (%)", "beta [%]"])
def test_a_header_in_percent_over_fractions_is_refused(tmp_path, header):
    name = header.split()[0]
    table = {header if key == name else key: x for key, x in _ratios().items()}
    with pytest.raises(
        DataError, match=r"the header says percent, but no value is above 0\.\d+\. If they are"
    ):
        fit(table_file(tmp_path / "t.csv", table, "%.5f"))
    table[header] = 100.0 * table[header]
    found = fit(table_file(tmp_path / "t.csv", table, "%.5f"), method="lsq").constants
    assert found["e_n"].value == pytest.approx(0.9, abs=0.01)


def test_a_column_n_that_numbers_the_lines_is_refused(tmp_path):
    table = {"n": np.arange(1, GAMMA.size + 1)} | _ratios()
    with pytest.raises(DataError, match=r"1, 2, 3, \.\.\. number the lines"):
        fit(table_file(tmp_path / "t.csv", table, "%.5f"))
    table["n"] = np.full(GAMMA.size, 3)
    fit(table_file(tmp_path / "t.csv", table, "%.5f"), method="lsq")


def test_the_end_of_a_sensor_is_said(tmp_path):
    whole = fit(table_file(tmp_path / "t.csv", _raw(), "%.4f"), method="lsq")
    assert not [says for says in whole.warnings if "largest size" in says]
    cut = fit(table_file(tmp_path / "t.csv", _raw(most=3.0), "%.4f"), method="lsq")
    (said,) = [says for says in cut.warnings if "largest size" in says]
    assert "cells of u_z_m_s have its largest size, 3," in said


def test_speeds_that_were_set_have_no_end(tmp_path):
    table = _raw()
    table["u_z_m_s"] = np.resize([2.0, 3.0, 4.0], GAMMA.size)
    found = fit(table_file(tmp_path / "t.csv", table, "%.4f"), method="lsq")
    assert not [says for says in found.warnings if "largest size" in says]
