"""Rows that were copied are a finding; repeats that agree because they are rounded are none."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import at_most, rest_long, table_file
from slips_scenes import Cause, Scene, experiment

import ifrfit
from ifrfit.inference.diagnostics.copied_readings import duplicates, repeated_number
from ifrfit.inference.diagnostics.one_velocity import one_velocity
from ifrfit.inference.diagnostics.rounding_step import rounding_step
from ifrfit.inference.fit import fit
from ifrfit.inference.model.noise import resolution
from ifrfit.physics import rebound

GAMMA = np.repeat(np.linspace(10.0, 70.0, 7), 6)


def copies(data, **options):
    """What is found of copies, whatever else is said: many tables need no other fact."""
    found = fit(data, method="lsq", **options)
    asked = found.problem, found.least_squares
    return duplicates(*asked) or one_velocity(*asked)


def repeats(path, decimals, seed):
    """Six readings of each setting, rounded."""
    rng = np.random.default_rng(seed)
    beta = rebound(GAMMA, e_n=0.9, e_t=-0.9, mu=0.15, degrees=True).beta + 0.02 * rng.standard_normal(
        GAMMA.size
    )
    table_file(path, {"gamma_deg": GAMMA, "beta": beta}, f"%.{decimals}f")
    return copies(path, fix={"e_n": 0.9})


def test_copied_impacts_are_named_by_their_lines():
    fact = fit(experiment(Scene(), Cause("duplicates", 3), 1), method="lsq", independent=True).facts[
        "duplicates"
    ]
    assert fact.figures["n"] == 3
    assert "3 impacts stand in the table twice, alike in every decimal" in fact.says
    assert "--exclude" in fact.says


@pytest.mark.parametrize(("decimals", "found"), [(5, True), (1, False)])
def test_rounding_decides(tmp_path, decimals, found):
    """A table of single readings of different angles, copied: it is seen where beta has enough decimals."""
    data = experiment(Scene(("beta",), 20, 0.02, policy="unknown"), Cause(), 2).table
    rows = [f"{g:.1f},{b:.{decimals}f}" for g, b in zip(data["gamma_deg"], data["value"], strict=True)]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(["gamma_deg,beta", *rows, *rows]) + "\n", encoding="utf-8")
    assert ("duplicates" in fit(path, method="lsq", fix={"e_n": 0.8}).facts) == found


def test_steps_of_an_instrument_are_no_copies(tmp_path):
    """Single readings of one setting in steps that are coarser than their decimals."""
    path = tmp_path / "t.csv"
    steps = np.random.default_rng(1).integers(-3, 4, 40)
    path.write_text("\n".join(["e_n", *(f"{0.9 + s / 137:.6f}" for s in steps)]) + "\n", encoding="utf-8")
    assert "duplicates" not in fit(path, method="lsq").facts


@pytest.mark.parametrize("decimals", [1, 2, 3, 4])
@pytest.mark.parametrize("seeds", [5, pytest.param(300, marks=pytest.mark.long)])
def test_repeats_are_no_copies(tmp_path, decimals, seeds):
    alarms = [repeats(tmp_path / "t.csv", decimals, seed) is not None for seed in range(seeds)]
    assert sum(alarms) <= at_most(seeds, 0.001)


def test_one_velocity_as_two_observables_in_two_files(tmp_path):
    """Nothing ties the rows to one impact but their errors; other errors at the same angles are none."""
    gamma = np.linspace(8.0, 80.0, 40)
    beta_cm = rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta_cm
    noise, other = 0.02 * np.random.default_rng(1).standard_normal((2, 40))
    centre = table_file(tmp_path / "a.csv", {"gamma_deg": gamma, "beta_cm": beta_cm + noise}, "%.4f")
    for errors, twice in ((noise, True), (other, False)):
        contact = {"gamma_deg": gamma, "beta": 2.5 + 3.5 * (beta_cm + errors)}
        found = fit([centre, table_file(tmp_path / "b.csv", contact, "%.4f")], method="lsq", fix={"e_n": 0.9})
        assert ("duplicates" in found.facts) is twice
        if twice:
            assert "beta_cm and beta have the same errors at 40 angles" in found.facts["duplicates"].says
            assert found.summary().startswith("LOOK  impacts stand in the table twice")


def _two_records(folder, seed, columns, *, again, noise=0.01, off=0.0):
    """v_x and v_n, and in another file what is computed of them or of other readings at the same angles."""
    rng = np.random.default_rng(seed)
    gamma = np.sort(np.round(rng.uniform(6.0, 78.0, 40), 1))
    state = rebound(gamma + off, e_n=0.9, e_t=-0.9, mu=0.15, degrees=True)
    read = [np.array((state.v_x, state.v_n)) + noise * rng.standard_normal((2, 40)) for _ in range(2)]
    v_x, v_n = read[0 if again else 1]
    before = np.radians(gamma)
    of = {
        "beta_cm": -v_x / np.sin(before),
        "e_n": v_n / np.cos(before),
        "mu_app": (np.sin(before) - v_x) / (np.cos(before) + v_n),
    }
    a = table_file(folder / "a.csv", {"gamma_deg": gamma, "v_x": read[0][0], "v_n": read[0][1]}, "%.5f")
    b = table_file(folder / "b.csv", {"gamma_deg": gamma} | {name: of[name] for name in columns}, "%.5f")
    return [a, b]


@pytest.mark.parametrize("name", ["beta_cm", "e_n", "mu_app"])
def test_a_ratio_computed_of_a_velocity_is_that_velocity_again(tmp_path, name):
    """The two residuals differ by a factor that goes with the angle."""
    fact = fit(_two_records(tmp_path, 1, [name], again=True), method="lsq").facts["duplicates"]
    assert f"and {name} have the same errors at" in fact.says


@pytest.mark.parametrize("seeds", [4, pytest.param(50, marks=pytest.mark.long)])
@pytest.mark.parametrize(("noise", "off"), [(0.01, 0.0), (0.0005, 3.0)])
def test_other_readings_at_the_same_angles_are_others(tmp_path, seeds, noise, off):
    """Where the law misses both by much, too."""
    for seed in range(seeds):
        found = copies(_two_records(tmp_path, seed, ["beta_cm", "e_n"], again=False, noise=noise, off=off))
        assert found is None, found.says


def _readings(seed, names=("beta", "e_n"), n=30):
    rng = np.random.default_rng(seed)
    gamma = np.round(rng.uniform(10.0, 78.0, n), 1)
    state = rebound(gamma, e_n=0.9, e_t=-0.75, mu=0.15, degrees=True)
    values = {"beta": state.beta, "e_n": np.full(n, 0.9)}
    table = {name: values[name] + 0.01 * rng.standard_normal(n) for name in names}
    return pd.DataFrame({"gamma_deg": gamma} | table)


@pytest.mark.parametrize("names", [("beta",), ("beta", "e_n")])
def test_a_series_that_was_copied_into_another_is_named(tmp_path, names):
    table = _readings(1, names)
    twice = pd.concat([table.assign(series="A"), table.assign(series="B")])
    known = {} if "e_n" in names else {"e_n": 0.9}
    fact = fit(table_file(tmp_path / "t.csv", twice, "%.4f"), method="lsq", fix=known).facts["duplicates"]
    assert "all 30 impacts of B are those of A" in fact.says
    assert fact.says.endswith("--series A")


def test_rows_that_were_copied_into_another_file_are_named(tmp_path):
    a, b = _readings(1), _readings(2)
    paths = [
        table_file(tmp_path / "a.csv", a, "%.4f"),
        table_file(tmp_path / "b.csv", pd.concat([b, a[:10]]), "%.4f"),
    ]
    fact = fit(paths, method="lsq").facts["duplicates"]
    assert "10 impacts of b are those of a" in fact.says
    assert "--exclude b.csv:32" in fact.says


@pytest.mark.parametrize("decimals", [2, 3, 4])
@pytest.mark.parametrize("names", [("beta",), ("beta", "e_n")])
@pytest.mark.parametrize("seeds", [3, pytest.param(100, marks=pytest.mark.long)])
def test_series_at_the_same_angles_are_no_copies(tmp_path, decimals, names, seeds):
    alarms = 0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        beta = rebound(GAMMA, e_n=0.9, e_t=-0.9, mu=0.15, degrees=True).beta
        values = {"beta": beta, "e_n": np.full(GAMMA.size, 0.9)}
        table = {name: values[name] + 0.02 * rng.standard_normal(GAMMA.size) for name in names}
        table = {"gamma_deg": GAMMA, "series": np.resize(["A", "B", "C"], GAMMA.size)} | table
        known = {} if "e_n" in names else {"e_n": 0.9}
        path = table_file(tmp_path / "t.csv", table, f"%.{decimals}f")
        alarms += copies(path, fix=known) is not None
    assert alarms <= at_most(seeds, 0.001)


@pytest.mark.parametrize("name", ["beta", "e_n"])
@pytest.mark.parametrize("decimals", [4, 6])
def test_gaps_filled_with_the_mean_are_named(tmp_path, name, decimals):
    table = _readings(3, n=40).round(4)
    gaps = np.random.default_rng(3).choice(40, 8, replace=False)
    table.loc[gaps, name] = table[name].drop(gaps).mean()
    fact = fit(table_file(tmp_path / "t.csv", table, f"%.{decimals}f"), method="lsq").facts["repeated_number"]
    assert f"8 of 40 values of {name} are" in fact.says
    assert "the mean of all others" in fact.says


@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize("decimals", [2, 3, 5])
def test_a_last_line_of_means_is_named(tmp_path, decimals, several):
    table = _readings(3, n=24)
    if several:
        table["series"] = np.repeat(["A", "B"], 12)
    last = table.tail(12) if several else table
    means = {name: last[name].mean() for name in ("gamma_deg", "beta", "e_n")}
    whole = pd.concat([table, pd.DataFrame([{**table.iloc[-1], **means}])], ignore_index=True)
    path = table_file(tmp_path / "t.csv", whole, f"%.{decimals}f")
    says = fit(path, method="lsq").facts["repeated_number"].says
    assert f"line 26 is the mean of the {12 if several else 24} lines above it" in says
    assert "Leave it out" in says
    assert "repeated_number" not in fit(path, method="lsq", exclude=[26]).facts


@pytest.mark.parametrize("decimals", [2, 3, 4])
@pytest.mark.parametrize("seeds", [5, pytest.param(200, marks=pytest.mark.long)])
def test_readings_near_their_mean_are_no_filled_gaps(tmp_path, decimals, seeds):
    alarms = 0
    for seed in range(seeds):
        path = table_file(tmp_path / "t.csv", _readings(seed, n=40), f"%.{decimals}f")
        found = fit(path, method="lsq")
        alarms += repeated_number(found.problem, found.least_squares) is not None
    assert alarms <= at_most(seeds, 0.001)


def test_spins_computed_from_the_velocities_count_once(tmp_path):
    """By the balance of angular momentum: what v_x is off by, they are off by, too."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        gamma = np.linspace(10.0, 75.0, 30)
        after = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.9, mu=0.12)
        v_x = after.v_x + 0.01 * rng.standard_normal(30)
        columns = {"gamma_deg": gamma, "v_x": v_x, "v_n": after.v_n + 0.01 * rng.standard_normal(30)}
        computed = columns | {"spin_y_after": (v_x - np.sin(np.radians(gamma))) / 0.4}
        fact = fit(table_file(tmp_path / "t.csv", computed, "%.6g"), method="lsq").facts["duplicates"]
        assert "v_x and spin_y_after have the same errors" in fact.says
        read = columns | {"spin_y_after": after.spin_y + 0.02 * rng.standard_normal(30)}
        assert copies(table_file(tmp_path / "r.csv", read, "%.6g")) is None


def readings(spread, copied=0, n=4000, seed=0):
    """Two rounded readings of each impact at whole degrees, by a noise that differs from impact to impact."""
    rng = np.random.default_rng(seed)
    gamma = rng.integers(5, 80, n).astype(float)
    sigma = 0.02 * np.exp(spread * rng.standard_normal(n))
    beta = rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta
    table = pd.DataFrame({"gamma_deg": gamma, "beta": beta, "e_n": 0.9})
    for name in ("beta", "e_n"):
        table[name] = (table[name] + sigma * rng.standard_normal(n)).round(2)
    return pd.concat([table, *(table.iloc[:200],) * copied], ignore_index=True)


@pytest.mark.parametrize("spread", [0.3, 0.6, 0.9])
def test_a_noise_that_differs_makes_no_copies(spread):
    assert copies(readings(spread)) is None


def test_copies_beside_a_noise_that_differs_are_found():
    assert not ifrfit.fit(readings(0.3, copied=10), method="lsq").facts["duplicates"].ok


def _in_steps(seed, steps, noise, *, series=3, copied=0):
    """Tables of 15 angles that are set, one for each series, in steps that are no decimals."""
    rng = np.random.default_rng(seed)
    gamma = np.linspace(10.0, 80.0, 15)
    state = rebound(gamma, e_n=0.8, e_t=-0.8, mu=0.16, degrees=True)
    delta = np.degrees(np.arctan2(state.v_x, state.v_n))
    values = {"beta": state.beta, "e_n": np.full(gamma.size, 0.8), "delta_deg": delta}
    tables = {}
    for number in range(series):
        read = {
            name: np.round(np.round((values[name] + noise[name] * rng.standard_normal(15)) / step) * step, 6)
            for name, step in steps.items()
        }
        tables["ABCDEF"[number]] = pd.DataFrame({"gamma_deg": gamma} | read)
    if copied:
        tables["B"] = pd.concat([tables["A"][:copied], tables["B"][copied:]])
    return tables


STEPS = [
    ({"beta": 0.005, "e_n": 0.005}, {"beta": 0.01, "e_n": 0.01}),
    ({"beta": 0.0025, "e_n": 0.0025}, {"beta": 0.005, "e_n": 0.005}),
    ({"beta": 0.02, "e_n": 0.02}, {"beta": 0.02, "e_n": 0.02}),
    ({"delta_deg": 0.5, "e_n": 0.02}, {"delta_deg": 0.4, "e_n": 0.012}),
]


@pytest.mark.parametrize(("steps", "noise"), STEPS)
@pytest.mark.parametrize("seeds", rest_long([6, 150]))
def test_readings_in_steps_of_a_scale_are_no_copies(steps, noise, seeds):
    """Steps of 2, 2.5 or 5 of the last decimal: they agree more often than those of the decimal would."""
    alarms = [copies(_in_steps(seed, steps, noise, series=6)) is not None for seed in range(seeds)]
    assert sum(alarms) <= at_most(seeds, 0.001)


@pytest.mark.parametrize(("steps", "noise"), STEPS)
def test_copies_in_steps_of_a_scale_are_named(steps, noise):
    """13 of 15 rows of B: 1 to 5 pairs are expected in two series, by step/(2 sqrt(pi) sigma) squared."""
    fact = fit(_in_steps(1, steps, noise, series=2, copied=13), method="lsq").facts["duplicates"]
    assert fact.figures["n"] >= 13
    assert "impacts of B are those of A" in fact.says


@pytest.mark.parametrize(
    ("value", "step"),
    [
        (0.005 * np.arange(160, 172), 0.005),
        (0.0025 * np.arange(160, 172), 0.0025),
        (0.02 * np.arange(-3, 9), 0.02),
        (0.5 * np.arange(20, 30), 0.5),
        (20.0 * np.arange(7), 20.0),
        (0.001 * np.arange(800, 812), 0.001),
        (np.array([0.8, 0.85]), 0.01),  # one that is not the most frequent: by chance in 1 of 5
        (0.02 * np.array([40, 41, 42, 43, 44]), 0.01),  # four: in 1 of 16
        (np.zeros(9), 1.0),
        (np.array([0.8] * 20 + [0.85] * 20), 0.01),  # of one setting: they may be copies
        (np.random.default_rng(1).standard_normal(20), 1e-6),
        (1e300 * np.array([1.0, 2.0, 3.0]), 1.0),
    ],
)
def test_the_step_is_the_largest_that_chance_does_not_explain(value, step):
    setting = [np.zeros(value.size)]
    assert rounding_step(value, setting, np.zeros(value.size, dtype=np.intp)) == pytest.approx(step)


def test_chance_of_a_step_is_at_most_what_is_said():
    """Readings of two decimals about one value, by how they scatter: multiples of 2 or 5 by accident."""
    rng = np.random.default_rng(0)
    for scatter in (0.003, 0.01, 0.03, 0.1):
        value = np.round(0.9 + 0.01 * rng.random((2000, 1)) + scatter * rng.standard_normal((2000, 8)), 2)
        wrong = 0
        for each in value:
            known = rounding_step(each, [np.arange(8.0)], np.zeros(8, dtype=np.intp))
            wrong += known > 1.01 * resolution(each)
        assert wrong <= at_most(2000, 0.05), scatter
