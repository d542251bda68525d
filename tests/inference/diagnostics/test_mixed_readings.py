"""Two kinds of reading in one column, in some rows at random or from one on: the finding names the rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import each_once, rest_long, table_file

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


def spun(folder, seed, written, *, noise=0.01, sigma=None, series=1, names=("v_x", "v_n", "spin_y_after")):
    """Impacts of either spin before, which is written in another way."""
    rng = np.random.default_rng([seed, 41])
    gamma, label = rng.uniform(10.0, 80.0, 30), np.resize(["A", "B"][:series], 30)
    spin = rng.choice([-1.0, 1.0], 30) * rng.uniform(0.05, 0.5, 30)
    state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=0.15, spin_y=spin, degrees=True)
    values = {"v_x": state.v_x, "v_n": state.v_n, "spin_y_after": state.spin_y, "beta": state.beta}
    read = {name: np.asarray(values[name]) + noise * rng.standard_normal(30) for name in names}
    setting = {"gamma_deg": gamma, "spin_y": written(spin), "series": label, "impact_id": np.arange(30)}
    known = {} if sigma is None else {"sigma": sigma}
    rows = [pd.DataFrame({**setting, "observable": name, "value": x, **known}) for name, x in read.items()]
    fix = {} if "v_n" in names else {"e_n": 0.9}
    return fit(table_file(folder / "spun.csv", pd.concat(rows), "%.6f"), method="lsq", fix=fix)


def some_turned(spin):
    """Every third spin of the other sign."""
    return np.where(np.arange(spin.size) % 3 == 0, -spin, spin)


@pytest.mark.parametrize(
    ("names", "series", "errors"),
    each_once(
        [("v_x", "v_n", "spin_y_after"), ("beta",)],
        [2, 1],
        [(0.01, 0.01), (0.01, None), (0.05, 0.05), (0.05, None)],
    ),
)
@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_spins_before_without_their_sign_are_named(tmp_path, seed, errors, series, names):
    noise, sigma = errors
    result = spun(tmp_path, seed, np.abs, noise=noise, sigma=sigma, series=series, names=names)
    slips = result.facts["slips"]
    assert slips.figures["called"][0] == "size-of-spin-y-before", slips.says
    assert "spin_y (before) without its sign, which is the other one in lines (" in slips.says
    assert "give the spins their signs (positive is back-spin)" in slips.says
    assert result.summary().startswith("LOOK")


@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_spins_before_of_the_other_sign_in_some_lines_are_named(tmp_path, seed):
    slips = spun(tmp_path, seed, some_turned).facts["slips"]
    assert slips.figures["called"] == ["mixed-sign-of-spin-y-before"], slips.says
    assert "turn the sign round in these lines (positive is back-spin)" in slips.says


@pytest.mark.parametrize("sigma", [None, 0.01])
@pytest.mark.parametrize("seed", rest_long(range(8), 3))
def test_spins_of_one_sign_are_no_sizes(tmp_path, seed, sigma):
    """Control: back-spin alone, given as it was."""
    rng = np.random.default_rng([seed, 43])
    gamma, spin = rng.uniform(10.0, 80.0, 30), rng.uniform(0.05, 0.5, 30)
    state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=0.15, spin_y=spin, degrees=True)
    values = {"v_x": state.v_x, "v_n": state.v_n, "spin_y_after": state.spin_y}
    setting = {"gamma_deg": gamma, "spin_y": spin, "series": "A", "impact_id": np.arange(30)}
    known = {} if sigma is None else {"sigma": sigma}
    rows = [
        pd.DataFrame({**setting, "observable": name, "value": x + 0.01 * rng.standard_normal(30), **known})
        for name, x in values.items()
    ]
    result = fit(table_file(tmp_path / "t.csv", pd.concat(rows), "%.6f"), method="lsq")
    assert result.facts["slips"].ok, result.facts["slips"].says


def heights(folder, seed, e_n, *, noise=0.01, sigma=None, low=None, series=1):
    """Readings of e_n beside beta; some of them squared, or of a ball of e_n = `low`."""
    rng = np.random.default_rng([seed, 47])
    gamma = rng.uniform(10.0, 80.0, 30)
    label = np.resize(["A", "B"][:series], 30)
    some = rng.permutation(30) < 10
    e_ns = np.where(some & (low is not None), low or e_n, e_n)
    beta = [
        float(rebound(g, e_n=e, e_t=-0.7, mu=0.15, degrees=True).beta)
        for g, e in zip(gamma, e_ns, strict=True)
    ]
    read = e_ns + noise * rng.standard_normal(30)
    read = np.where(some & (low is None), read**2, read)
    known = {} if sigma is None else {"sigma": sigma}
    setting = {"gamma_deg": gamma, "series": label, "impact_id": np.arange(30), **known}
    beta = np.array(beta) + noise * rng.standard_normal(30)
    rows = [
        pd.DataFrame({**setting, "observable": k, "value": x}) for k, x in (("beta", beta), ("e_n", read))
    ]
    return fit(table_file(folder / "heights.csv", pd.concat(rows), "%.6f"), method="lsq")


@pytest.mark.parametrize("series", [1, 2])
@pytest.mark.parametrize(
    ("e_n", "noise", "sigma"),
    [(0.9, 0.007, None), (0.9, 0.007, 0.007), (0.6, 0.01, None), (0.6, 0.02, None), (0.6, 0.02, 0.02)],
)
@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_ratios_of_heights_in_some_lines_are_named(tmp_path, seed, e_n, noise, sigma, series):
    slips = heights(tmp_path, seed, e_n, noise=noise, sigma=sigma, series=series).facts["slips"]
    assert slips.figures["called"] == ["mixed-squared e_n"], slips.says
    assert "e_n as a ratio of energies or heights in some of its lines (" in slips.says
    assert "take the square root of the values of these lines" in slips.says


@pytest.mark.parametrize("low", [0.85, 0.7, 0.5])
@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_balls_of_two_e_n_are_no_squares(tmp_path, seed, low):
    """Control: the smaller number is no square of the larger one."""
    called = heights(tmp_path, seed, 0.9, low=low).facts["slips"].figures["called"]
    assert "mixed-squared e_n" not in called
