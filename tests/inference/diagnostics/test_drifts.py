"""A constant that drifts along the table: named as that, before impacts of two kinds and errors alike."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import rest_long, table_file

from ifrfit import fit, rebound


def fitted(folder, seed, *, mu=(0.14, 0.14), e_t=(-0.85, -0.85), n=40, is_sorted=False, series=1):
    rng = np.random.default_rng(seed)
    gamma = np.round(rng.uniform(5.0, 80.0, n), 1)
    if is_sorted:
        gamma.sort()
    along = np.tile(np.linspace(0.0, 1.0, n // series), series)
    values = [
        float(rebound(g, e_n=0.9, e_t=e_t[0] + t * (e_t[1] - e_t[0]), mu=mu[0] + t * (mu[1] - mu[0]),
                      degrees=True).beta)
        for g, t in zip(gamma, along, strict=True)
    ]  # fmt: skip
    table = {
        "series": np.repeat([f"day {i}" for i in range(series)], n // series),
        "gamma_deg": gamma,
        "beta": np.array(values) + 0.02 * rng.standard_normal(n),
        "e_n": 0.9 + 0.02 * rng.standard_normal(n),
    }
    return fit(table_file(folder / "run.csv", table), method="lsq")


@pytest.mark.parametrize("series", [1, 2])
@pytest.mark.parametrize("seeds", rest_long((2, 4)))
def test_a_wall_that_wears_is_named(tmp_path, series, seeds):
    for seed in range(seeds):
        facts = fitted(tmp_path, seed, mu=(0.10, 0.16), series=series).facts
        slips = facts["slips"]
        assert not slips.ok
        assert slips.figures["called"] == ["friction-drift"]
        assert "a drift of mu along it, from 0." in slips.says
        assert "look for wear, dirt or temperature" in slips.says
        assert "--separate mu" in slips.says
        assert "mixture" not in facts
        assert 0.03 < slips.figures["tests"]["friction-drift"]["size"] < 0.09


def test_so_is_a_constant_of_sticking(tmp_path):
    called = [fitted(tmp_path, seed, e_t=(-0.95, -0.75), n=60).facts["slips"] for seed in range(3)]
    assert all(fact.figures["called"][:1] == ["sticking-drift"] for fact in called)
    assert "--separate e_t" in called[0].says


@pytest.mark.parametrize("seeds", rest_long((2, 5)))
def test_constants_that_stay_do_not_drift(tmp_path, seeds):
    for seed in range(seeds):
        assert fitted(tmp_path, seed).facts["slips"].ok


def test_in_the_order_of_the_angle_it_is_not_told(tmp_path):
    tests = fitted(tmp_path, 0, mu=(0.10, 0.16), is_sorted=True).facts["slips"].figures["tests"]
    assert not any(name.endswith("drift") for name in tests)


def test_observables_under_one_another_are_in_the_order_of_the_angle_each(tmp_path):
    """In a long table without impact_id a reading of beta stands far from that of e_n."""
    gamma = np.tile(np.linspace(5.0, 80.0, 20), 2)
    beta = rebound(gamma[:20], e_n=0.9, e_t=-0.85, mu=0.14, degrees=True).beta
    value = np.concatenate((beta + 0.05 * np.sin(gamma[:20]), 0.9 + 0.01 * np.cos(gamma[:20])))
    table = {"observable": np.repeat(["beta", "e_n"], 20), "gamma_deg": gamma, "value": value}
    tests = fit(table_file(tmp_path / "long.csv", table), method="lsq").facts["slips"].figures["tests"]
    assert not any(name.endswith("drift") for name in tests)


def of_e_n(folder, seed, *, drift=0.0, noise=0.02, order=(), n=40):
    """Two series of readings of beta and e_n, e_n drifting along each; sorted by the columns of `order`."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(5.0, 80.0, n)
    beta = rebound(gamma, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True).beta + 0.03 * rng.standard_normal(n)
    along = np.tile(np.linspace(-0.5, 0.5, n // 2), 2)
    table = {
        "series": np.repeat(["a", "b"], n // 2),
        "gamma_deg": gamma,
        "beta": beta,
        "e_n": 0.9 + drift * along + noise * rng.standard_normal(n),
    }
    rows = pd.DataFrame(table)
    if order:
        rows = rows.sort_values(list(order))
    return fit(table_file(folder / "run.csv", rows), method="lsq").facts


@pytest.mark.parametrize("order", [("e_n",), ("series", "e_n")])
@pytest.mark.parametrize("seeds", rest_long((2, 20)))
def test_a_table_that_was_sorted_by_e_n_does_not_drift(tmp_path, order, seeds):
    for seed in range(seeds):
        facts = of_e_n(tmp_path, seed, order=order)
        assert facts["slips"].ok, facts["slips"].says
        assert not any(name.endswith("drift") for name in facts["slips"].figures["tests"])
        assert "independence" not in facts


def test_two_rows_out_of_the_order_change_nothing(tmp_path):
    of_e_n(tmp_path, 0, order=("series", "e_n"))
    rows = pd.read_csv(tmp_path / "run.csv")
    path = table_file(tmp_path / "run.csv", rows.iloc[[*range(10), 11, 10, *range(12, 40)]])
    facts = fit(path, method="lsq").facts
    assert facts["slips"].ok
    assert "independence" not in facts


@pytest.mark.parametrize(("drift", "noise"), [(0.08, 0.01), (0.1, 0.005)])
def test_a_drift_of_e_n_far_above_the_noise_is_one(tmp_path, drift, noise):
    """Control: 20 standard deviations along each series still leave steps back."""
    slips = of_e_n(tmp_path, 0, drift=drift, noise=noise)["slips"]
    assert slips.figures["called"][:1] == ["restitution-drift"]
