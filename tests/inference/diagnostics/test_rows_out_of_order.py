"""Columns sorted, shifted or shuffled by themselves: values stand beside angles that are not their own."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import each_once, rest_long, table_file

from ifrfit import fit, rebound

N = 30
SETS = {"beta": ("beta",), "beta and e_n": ("beta", "e_n"), "raw": ("v_x", "v_n", "spin_y_after")}
NOISES = [(0.01, None), (0.01, 0.01), (0.05, None), (0.05, 0.05)]


def fitted(folder, seed, names, move, *, moved=None, errors=(0.01, None), series=1, **law):
    """Values of some observables, the first by default, moved against the angles of their series."""
    rng = np.random.default_rng([seed, 61])
    noise, sigma = errors
    law = {"e_n": 0.9, "e_t": -0.7, "mu": 0.15} | law
    parts = []
    for number in range(series):
        gamma = rng.uniform(10.0, 80.0, N)
        state = rebound(gamma, degrees=True, **law)
        true = {name: getattr(state, "spin_y" if name == "spin_y_after" else name) for name in names}
        read = {name: x + noise * rng.standard_normal(N) for name, x in true.items()}
        order = rng.permutation(N)
        ids = [f"{number}-{i}" for i in range(N)]
        setting = {"gamma_deg": gamma, "series": "AB"[number], "impact_id": ids}
        for name, x in read.items():
            value = move(x, order) if name in (moved or names[:1]) else x
            known = {} if sigma is None else {"sigma": sigma}
            parts.append(pd.DataFrame({**setting, "observable": name, "value": value, **known}))
    path = table_file(folder / "t.csv", pd.concat(parts).dropna(subset=["value"]), "%.6f")
    fix = {} if {"e_n", "v_n"} & set(names) else {"e_n": law["e_n"]}
    return fit(path, method="lsq", fix=fix)


def shuffled(x, order):
    return x[order]


def down(x, _):
    """By one line, as by an empty cell too many."""
    return np.append(np.nan, x[:-1])


def up(x, _):
    return np.append(x[1:], x[0])


def ascending(x, _):
    return np.sort(x)


def descending(x, _):
    return np.sort(x)[::-1]


@pytest.mark.parametrize("names", list(SETS.values()), ids=list(SETS))
@pytest.mark.parametrize(("move", "errors"), each_once([ascending, descending], NOISES))
@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_a_column_that_was_sorted_is_named(tmp_path, seed, errors, move, names):
    """Down the lines, whatever the order of the angles."""
    slips = fitted(tmp_path, seed, names, move, errors=errors).facts["slips"]
    assert slips.figures["called"][0] == f"sorted {names[0]}", slips.says
    assert "give each value beside the angle that it was read at" in slips.says


@pytest.mark.parametrize(
    ("names", "move", "errors"),
    each_once(SETS.values(), [(down, "shifted-down"), (up, "shifted-up")], NOISES),
)
@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_a_column_that_was_shifted_is_named(tmp_path, seed, errors, move, names):
    move, called = move
    slips = fitted(tmp_path, seed, names, move, errors=errors).facts["slips"]
    assert slips.figures["called"][0] == f"{called} {names[0]}", slips.says
    assert f"{names[0]} one line {'below' if move is down else 'above'} the angle it is of" in slips.says


@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_shifted_angles_are_named(tmp_path, seed):
    """All values of a line are one below their angle."""
    slips = fitted(tmp_path, seed, SETS["raw"], down, moved=SETS["raw"]).facts["slips"]
    assert slips.figures["called"] == ["shifted-down"], slips.says
    assert "move all values up by a line, beside their angle" in slips.says


@pytest.mark.parametrize("names", list(SETS.values()), ids=list(SETS))
@pytest.mark.parametrize(("series", "errors"), each_once([1, 2], NOISES))
@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_a_column_that_was_shuffled_is_said(tmp_path, seed, errors, series, names):
    result = fitted(tmp_path, seed, names, shuffled, errors=errors, series=series)
    found = result.facts["unrelated_readings"]
    assert not found.ok
    assert found.figures["observables"] == [names[0]]
    assert "do not go with the angle" in found.says
    assert "LOOK  readings do not go with the angle" in result.summary()
    # nothing else is a reason of its own
    assert not {"slips", "pooling", "effects", "scatter_too_large", "truncation", "mixture"} & {
        name for name, fact in result.facts.items() if not fact.ok
    }


@pytest.mark.parametrize("noise", [0.01, 0.05])
@pytest.mark.parametrize("names", list(SETS.values()), ids=list(SETS))
@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_impacts_that_all_stick_have_nothing_to_explain(tmp_path, seed, names, noise):
    """Control."""
    facts = fitted(tmp_path, seed, names, lambda x, _: x, errors=(noise, None), mu=1.2).facts
    assert "unrelated_readings" not in facts
    assert facts["slips"].ok, facts["slips"].says


@pytest.mark.parametrize("seed", rest_long(range(40), 8))
def test_a_law_whose_range_lies_within_the_scatter_is_no_shuffle(tmp_path, seed):
    """Spins of a ball that hardly rubs."""
    rng, gamma = np.random.default_rng([seed, 62]), np.linspace(5.0, 85.0, 24)
    state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=0.01, degrees=True)
    columns = {
        "gamma_deg": gamma,
        "delta_deg": np.degrees(state.delta) + 0.573 * rng.standard_normal(24),
        "e_n": 0.9 + 0.01 * rng.standard_normal(24),
        "spin_y_after": state.spin_y + 0.01 * rng.standard_normal(24),
    }
    assert "unrelated_readings" not in fit(table_file(tmp_path / "t.csv", columns), method="lsq").facts
