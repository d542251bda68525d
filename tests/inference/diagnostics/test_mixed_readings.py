"""Two kinds of reading in one column, in some rows at random or from one on: the finding names the rows."""

from __future__ import annotations

import numpy as np
import pytest
from factories import rest_long, table_file

from ifrfit import fit, rebound

LAST = np.arange(20, 30)
SCATTERED = np.array([0, 4, 5, 9, 13, 14, 20, 22, 27])


def fitted(folder, rows, kind, seed):
    rng = np.random.default_rng(seed)
    gamma = np.round(rng.uniform(5.0, 80.0, 30), 1)
    beta = rebound(gamma, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True).beta + 0.03 * rng.standard_normal(30)
    if kind == "percent":
        beta[rows] *= 100.0
    elif kind == "sign":
        beta[rows] *= -1.0
    elif kind == "angle-from-wall":
        gamma[rows] = 90.0 - gamma[rows]
    elif kind == "angle-in-radians":
        gamma[rows] = np.round(np.radians(gamma[rows]), 3)
    e_n = 0.9 + 0.02 * rng.standard_normal(30)
    path = table_file(folder / "mixed.csv", {"gamma_deg": gamma, "beta": beta, "e_n": e_n})
    return fit(path, method="lsq")


@pytest.mark.parametrize("rows", [LAST, SCATTERED], ids=["last", "scattered"])
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("percent", "beta in percent in some of its lines"),
        ("sign", "beta of the opposite sign in some of its lines"),
        ("angle-from-wall", "angles from the wall beside angles from the normal in some of its lines"),
        ("angle-in-radians", "angles of incidence in radians in some of its lines"),
    ],
)
@pytest.mark.parametrize("seeds", rest_long((1, 2)))
def test_rows_of_another_reading_are_named(tmp_path, kind, words, rows, seeds):
    for seed in range(seeds):
        result = fitted(tmp_path, rows, kind, seed)
        slips = result.facts["slips"]
        assert not slips.ok
        assert slips.figures["called"][0].startswith(f"mixed-{kind}")
        assert words in slips.says
        named = {int(line) for line in slips.says.partition("lines (")[2].partition(")")[0].split(", ")}
        # a row whose readings are alike may be on either side
        assert len(named ^ {int(row) + 2 for row in rows}) <= 2
        assert result.summary().startswith("LOOK")


@pytest.mark.parametrize("seeds", rest_long((2, 4)))
def test_one_kind_of_reading_is_enough(tmp_path, seeds):
    for seed in range(seeds):
        assert fitted(tmp_path, LAST, "", seed).facts["slips"].ok


@pytest.mark.parametrize("seeds", rest_long((4, 10)))
def test_scatter_alone_is_not_divided(tmp_path, seeds):
    """Impacts that slide at nearly one angle: the law explains little, two readings could share the rest."""
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        gamma = rng.uniform(42.0, 50.0, 25)
        state = rebound(gamma, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True)
        beta = state.beta + 0.2 * rng.standard_normal(25)
        path = table_file(tmp_path / "narrow.csv", {"gamma_deg": gamma, "beta": beta})
        assert fit(path, method="lsq", fix={"e_n": 0.9}).facts["slips"].ok


def test_a_line_with_two_values_is_listed_once(tmp_path):
    rng = np.random.default_rng(0)
    gamma = np.linspace(8.0, 76.0, 30)
    state = rebound(gamma, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True)
    values = {"v_x": state.v_x, "v_n": state.v_n}
    values = {name: np.asarray(x) + 0.01 * rng.standard_normal(30) for name, x in values.items()}
    gamma[SCATTERED] = 90.0 - gamma[SCATTERED]
    says = (
        fit(table_file(tmp_path / "t.csv", {"gamma_deg": gamma} | values), method="lsq").facts["slips"].says
    )
    lines = says.partition("lines (")[2].partition(")")[0].split(", ")
    assert lines == [str(row + 2) for row in SCATTERED]
