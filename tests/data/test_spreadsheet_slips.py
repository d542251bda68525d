"""What spreadsheets and sensors do: percent that is shown only, numbers of lines, thousands."""

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


def test_thousands_with_a_sign_are_refused(tmp_path):
    path = table_file(tmp_path / "t.csv", _ratios(), "%.4f")
    lines = path.read_text(encoding="utf-8").splitlines()
    for cell in ('"1,082"', "1'082"):
        lines[3] = f"{lines[3].split(',')[0]},{cell},0.9"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        with pytest.raises(
            DataError, match=r"line 4, column beta: .* is not a number\. Write thousands without"
        ):
            fit(path)
