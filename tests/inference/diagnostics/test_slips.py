"""Slips of the hand in a table are named before effects, with the option that mends them."""

from __future__ import annotations

import shlex
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import slips_study
from factories import at_most, impacts_file, problem_of, rest_long, table_file
from slips_scenes import Cause, Scene, experiment

from ifrfit.data import read
from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import _rolling
from ifrfit.inference.diagnostics.slips import refit
from ifrfit.inference.diagnostics.slips.compared_fit import ComparedFit, Slip
from ifrfit.inference.diagnostics.slips.messages import slip_words
from ifrfit.inference.diagnostics.slips.nuisances import Flaw, readings
from ifrfit.inference.diagnostics.slips.refit import Misfit, best_start, refitted, starts
from ifrfit.inference.diagnostics.slips.row_slips import mixed_readings
from ifrfit.inference.fit import fit
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.physics import rebound

RAW, SPUN = Scene(), Scene(spins=True)
BETA, CENTRE = Scene(("beta",), fixed={"e_n": 0.8}), Scene(("beta_cm",), fixed={"e_n": 0.8})
ANGLES = np.linspace(4.0, 80.0, 30)


def fitted(scene, cause, seed):
    data = experiment(scene, cause, seed)
    return fit(data, method="lsq", independent=True, fix=scene.fixed, closure=scene.closure)


# those of which docs/facts.md says that not every table is named: one table would say nothing of them
BY_SHARE = (
    "angles-scale",  # the constants take most of it up; named beside the other scales
    "correlated errors",
    "two kinds",
    "errors of the angles, noise 0.003",  # 19 of 20
    "errors of the angles, noise 0.03",  # 9 to 16 of 20
    "noise that grows from 0 to 90 deg",  # 8 to 20 of 20
)
MIDDLE = [
    pytest.param(name, *cases[1 if cause.startswith(("angle-offset", "sign-")) else 2][:2], id=f"{i}-{cause}")
    for i, (cause, name, cases) in enumerate(slips_study.powers())
    if not (cause == "angle-offset" and cases[0][0].observables == ("beta",)) and cause not in BY_SHARE
]


def _turns(known):
    """Every slip once in the quick suite, with sigma or without; the other way in the long one.

    Those of one series are all there: test_slips_in_series.py has some of them in every run.
    """
    for i, each in enumerate(MIDDLE):
        marks = () if i % 2 != known and ", in " not in each.id else pytest.mark.long
        yield pytest.param(
            *each.values, known, id=f"{each.id}-sigma-{'' if known else 'un'}known", marks=marks
        )


@pytest.mark.parametrize(("name", "scene", "cause", "known"), [*_turns(True), *_turns(False)])
@pytest.mark.parametrize("seed", rest_long((0, 1)))
def test_a_cause_is_named(name, scene, cause, known, seed):
    """Of each one table in the quick suite and another in the long one; docs/facts.md has the shares."""
    named, _ = slips_study.called(replace(scene, policy="known" if known else "unknown"), cause, seed)
    assert name in named, named


QUICK, MANY = 12, 400  # clean fits


def false_alarms(first, count):
    """Clean fits of random scenes: how many name a slip, and how many fail in any fact falsely."""
    fits = [slips_study.clean_fit((21, number)) for number in range(first, first + count)]
    return sum("slips" in one.false for one in fits), sum(bool(one.false) for one in fits)


def test_clean_tables_are_called_well():
    slips, any_fact = false_alarms(0, QUICK)
    assert slips <= at_most(QUICK, 0.001)
    assert any_fact <= at_most(QUICK, 0.01)


@pytest.mark.long
def test_false_alarms_are_rare():
    slips, any_fact = false_alarms(QUICK, MANY)
    assert slips <= at_most(MANY, 0.001)
    assert any_fact <= at_most(MANY, 0.01)


# found in the errors, once the law and a known sigma have been judged; docs/facts.md has the shares
OF_ERRORS = ("independence", "mixture")


@pytest.mark.long
def test_power():
    """Of the largest size nine in ten are named; what large flaws of the errors look like is tested below."""
    for title, name, cases in slips_study.powers():
        if name not in OF_ERRORS and title not in BY_SHARE:
            scene, cause, _ = cases[-1]
            found = slips_study.run(slips_study.Task(scene, cause, 2000, 10))
            assert sum(name in named for named, _ in found) >= 8, (name, found)


@pytest.mark.long
@pytest.mark.parametrize("policy", ["known", "unknown"])
def test_large_flaws_of_the_errors_are_found_under_whatever_name(policy):
    """Neighbours alike by 0.9 are a trend, a slip or a lack of fit; so are two kinds beside a known sigma.

    Larger ones are named less often than small ones, but none passes. Two kinds are named where sigma is not
    known.
    """
    for _, name, cases in slips_study.powers():
        if name in OF_ERRORS:
            scene, cause, _ = cases[-1]
            found = slips_study.run(slips_study.Task(replace(scene, policy=policy), cause, 2000, 10))
            assert all(failing for _, failing in found), (name, found)
            if (name, policy) == ("mixture", "unknown"):
                assert sum(name in named for named, _ in found) >= 8, found


def test_an_outlier_is_no_slip():
    data = experiment(RAW, Cause(), 3)
    table = data.table
    table.loc[70, "value"] += 1.0
    found = fit(type(data)(table, data.sources, ()), method="lsq", independent=True)
    assert found.facts["slips"].ok
    assert not found.facts["outliers"].ok


def test_a_slip_stands_before_what_follows_from_it():
    """It comes first, no effect is blamed, and impacts at other angles are not asked for."""
    result = fitted(BETA, Cause("percent beta"), 1)
    failing = [name for name, fact in result.facts.items() if not fact.ok]
    assert failing[0] == "slips"
    assert "effects" not in result.facts
    assert "impacts at other angles" not in result.summary()
    assert result.facts["slips"].figures["called"] == ["percent beta"]
    assert "LOOK  the table looks as if it had a slip in it" in result.summary()


def test_few_rows_are_not_tested_rather_than_fine(tmp_path):
    path = impacts_file(tmp_path / "t.csv", {"gamma": [10.0, 30.0, 50.0], "noise": 0.01, "sigma": None})
    result = fit(path, method="lsq", fix={"e_n": 0.94})
    assert result.facts["slips"].says == "no slip in the table is looked for: there are too few rows"
    notes = [line for line in result.summary().splitlines() if "too few rows" in line]
    assert [line.split()[0] for line in notes] == ["note", "note", "note"]
    assert not any(result.facts[name].is_tested for name in ("slips", "lack_of_fit", "outliers"))


TRUE = rebound(ANGLES, e_n=0.8, e_t=-0.9, mu=0.15, degrees=True)


@pytest.mark.parametrize(
    ("observable", "gamma", "value", "option"),
    [
        ("beta", 90.0 - ANGLES, TRUE.beta, "--convention angle=from-wall"),
        ("beta", ANGLES, -TRUE.beta, "--convention beta=opposite-sign"),
        ("beta", ANGLES, TRUE.beta_cm, "--convention beta=centre"),
        ("beta", np.radians(ANGLES), TRUE.beta, "--convention angle=rad"),
        (
            "psi_after_deg",
            ANGLES,
            np.degrees(TRUE.psi_out),
            "--convention column:psi_out_deg=psi_after_deg",
        ),
    ],
    ids=["wall", "sign", "centre", "radians", "outgoing"],
)
def test_the_option_that_is_named_mends_it(tmp_path, observable, gamma, value, option):
    noisy = value + 0.01 * np.random.default_rng(5).standard_normal(value.size)
    path = table_file(tmp_path / "t.csv", {"gamma_deg": gamma, observable: noisy}, "%.4f")
    slips = fit(path, method="lsq", fix={"e_n": 0.8}).facts["slips"]
    assert not slips.ok
    assert slips.says.endswith(option), slips.says
    mended = fit(path, method="lsq", fix={"e_n": 0.8}, convention=[shlex.split(option)[1]])
    assert mended.facts["slips"].ok, mended.facts["slips"].says
    assert mended.facts["lack_of_fit"].ok


@pytest.mark.parametrize(
    ("cause", "flaw"),
    [
        (Cause(), Flaw()),
        (Cause("camera-turn", 0.7), Flaw(turn=0.7)),
        (Cause("angle-offset", 1.3), Flaw(offset=1.3)),
        (Cause("angle-scale", 0.04), Flaw(angle=0.04)),
        (Cause("speed-scale", 0.1), Flaw(speed=0.1)),
        (Cause("scale-along-wall", 0.07), Flaw(along=0.07)),
        (Cause("spin-scale", 0.1), Flaw(spin=0.1)),
        (Cause("incoming-roll", 0.2), Flaw(rolled=0.2)),
    ],
    ids=str,
)
def test_readings_against_the_study(cause, flaw):
    """The scenes of the study compute components on their own."""
    names = ("v_x", "v_n", "spin_y_after", "e_n", "beta_cm", "beta", "tan_psi_after", "delta_deg")
    scene = Scene(names, 20, 0.0, policy="unknown", fixed={"e_n": 0.8})
    data = experiment(scene, cause, 7)
    table = data.table.assign(sigma=0.01)
    noisy = fit(type(data)(table), method="lsq", independent=True, fix=scene.fixed)
    problem = noisy.problem
    clean = fit(
        experiment(Scene(names, 20, 1e-6, fixed={"e_n": 0.8}), Cause(), 7), method="lsq", independent=True
    )
    theta = clean.least_squares.optimum.theta
    exact = readings(problem, theta, flaw)
    np.testing.assert_allclose(exact, problem.rows.value, rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("known", [True, False])
def test_the_search_finds_the_certified_optimum(known):
    result = fitted(Scene(policy="known" if known else "unknown", spins=True), Cause(), 5)
    problem, theta = result.problem, result.least_squares.optimum.theta
    misfit = Misfit.of(problem)
    start = best_start(
        lambda x, rows: problem.with_rows(rows).predict(x),
        misfit,
        problem.rows.value,
        starts(problem, theta)[:-1],
    )
    _, residual = refitted(problem, misfit, start)
    certified = problem.rows.value - problem.predict(theta)
    assert float(misfit.likelihood(residual)) <= float(misfit.likelihood(certified)) + 0.01


def test_a_size_on_the_limit_of_the_search_is_a_least_one():
    """No factor is advised."""
    problem = fitted(RAW, Cause(), 1).problem
    for name, words in (("spin-scale", "spins at least 50 % off"), ("speed-scale", "at least 50 % off")):
        slip = Slip(name, 40.0, 1e-6, size=0.5, sd=0.01, usual=0.2, is_least=True)
        says = slip_words(problem, [slip], [])
        assert words in says
        assert "divide" not in says


@pytest.mark.parametrize("name", slips_study.UNITS)
def test_spins_in_another_unit_are_named_before_their_scale(name):
    """The inertia factor that closes as well is no first choice."""
    slips = fitted(RAW, Cause(f"{name} spin_y_after"), 3).facts["slips"]
    assert slips.figures["called"][0] == f"{name} spin_y_after"
    assert "% off beside the speeds" not in slips.says


def test_a_size_that_is_no_unit_stays_a_scale():
    slips = fitted(RAW, Cause("spin-scale", 0.3), 3).facts["slips"]
    assert slips.figures["called"][0] == "spin-scale"


def test_a_number_that_is_repeated_stands_for_nothing():
    data = experiment(BETA, Cause(), 4)
    table = data.table
    table.loc[[10, 20, 30, 40], "value"] = -1.0
    slips = fit(type(data)(table), method="lsq", fix=BETA.fixed).facts["slips"]
    assert slips.figures["called"] == ["code-for-missing beta"]
    lines = " ".join(f"--exclude {table['row'].iloc[i]}" for i in (10, 20, 30, 40))
    assert slips.says.endswith(f"empty these cells, or {lines}")
    assert "-1 for 'not measured' in beta (4 of its cells)" in slips.says


def test_the_unit_of_spins_stands_before_the_inertia_factor(tmp_path):
    """Raw velocities with half the radius: angular momentum asks for another body, the slip for the unit."""
    rng = np.random.default_rng(3)
    state = rebound(ANGLES, e_n=0.9, e_t=-0.9, mu=0.15, degrees=True)
    sine, cosine = np.sin(np.radians(ANGLES)), np.cos(np.radians(ANGLES))
    columns = {
        "u_x_m_s": 2.0 * sine,
        "u_z_m_s": 2.0 * cosine,
        "v_x_m_s": 2.0 * state.v_x + 0.01 * rng.standard_normal(ANGLES.size),
        "v_z_m_s": -2.0 * state.v_n + 0.01 * rng.standard_normal(ANGLES.size),
        "omega_y_after_rad_s": 200.0 * state.spin_y + rng.standard_normal(ANGLES.size),
        "radius_mm": np.full(ANGLES.size, 5.0),
    }
    facts = fit(table_file(tmp_path / "t.csv", columns, "%.6g"), method="lsq").facts
    failing = [name for name, fact in facts.items() if not fact.ok]
    assert failing[:2] == ["slips", "angular_momentum"]
    assert facts["slips"].figures["called"][0] == "spins-halved spin_y_after"
    assert "spins 2 times as large close as well" in facts["angular_momentum"].says


def test_values_divided_by_their_largest():
    """Tried only where the largest is 1 in every decimal."""
    result = fitted(BETA, Cause(), 1)
    table = result.problem.observations.table.copy()
    largest = float(table.loc[table.observable == "beta", "value"].max())
    for by, called in ((largest, True), (1.01 * largest, False)):
        other = table.copy()
        other.loc[table.observable == "beta", "value"] = (table.value / by).round(4)
        other["sigma"] = np.nan
        fact = fit(type(result.problem.observations)(other), method="lsq", independent=True).facts["slips"]
        assert (fact.figures["called"][:1] == ["divided-by-largest"]) is called
        if called:
            percent = float(fact.says.split("largest is 1 exactly, ")[1].split()[0])
            assert percent == pytest.approx(100.0 * (1.0 / largest - 1.0), abs=2.0)


def test_sizes_of_spins_and_columns_that_were_sorted_by_themselves(tmp_path):
    rng = np.random.default_rng(2)
    spin = rng.normal(0.0, 0.6, 40)
    gamma = rng.uniform(8.0, 80.0, 40)
    state = rebound(gamma, spin_y=spin, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True)
    columns = {
        "gamma_deg": gamma,
        "spin_y": spin,
        "spin_y_after": np.abs(state.spin_y + 0.01 * rng.standard_normal(40)),
        "e_n": 0.9 + 0.01 * rng.standard_normal(40),
    }
    says = fit(table_file(tmp_path / "t.csv", columns), method="lsq").facts["slips"].says
    assert says.startswith("the table looks as if it had spin_y_after without its sign")
    state = rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True)
    columns = {"gamma_deg": gamma, "beta": state.beta + 0.02 * rng.standard_normal(40), "e_n": columns["e_n"]}
    columns = {name: np.sort(column) for name, column in columns.items()}
    says = fit(table_file(tmp_path / "t.csv", columns), method="lsq").facts["slips"].says
    # e_n is sorted by itself as well, which one slip of beta leaves
    assert "in part the table looks as if it had beta sorted by itself, not along with the angles" in says


def test_many_rows_at_many_places_take_no_array_of_them_all(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(refit, "_AT_ONCE", 100_000)
    gamma = np.linspace(5.0, 75.0, 20_000)
    rows = {"gamma": gamma, "observables": ("beta",), "closure": "ifr", "c": -0.9, "noise": 0.02, "seed": 1}
    path = impacts_file(tmp_path / "t.csv", rows)
    problem = problem_of(read(path), "ifr", noise="unknown")
    found = least_squares(problem)
    theta, whole = found.optimum.theta, ComparedFit.of(problem, found)
    (rolling,) = _rolling(problem, theta)
    assert rolling.values is not None
    array = 8 * len(starts(problem, theta)) * len(problem.rows)  # bytes
    for looked_for in (
        lambda: list(mixed_readings(problem, whole.misfit, theta)),
        lambda: whole.with_size(rolling.values, 0.01, (0.0, np.inf), rolling.likely),
    ):
        tracemalloc.start()
        looked_for()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 2 * array


@pytest.mark.parametrize("here", ["e_n", "delta_deg"])
@pytest.mark.parametrize("seed", rest_long((1, 2)))
def test_another_observable_in_the_column(tmp_path, here, seed):
    """Total restitution for that of the normal velocity, the angle of the contact for that of the centre."""
    rng, gamma = np.random.default_rng(seed), np.linspace(8.0, 80.0, 36)
    state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
    columns = {"gamma_deg": gamma, "delta_deg": np.degrees(state.delta), "e_n": np.full(36, 0.9)}
    there = {"e_n": "beta_tot", "delta_deg": "psi_out_deg"}[here]
    columns[here] = {"e_n": state.beta_tot, "delta_deg": np.degrees(state.psi_out)}[here]
    for name, noise in (("delta_deg", 0.3), ("e_n", 0.005)):
        columns[name] = columns[name] + noise * rng.standard_normal(36)
    found = fit(table_file(tmp_path / "t.csv", columns), method="lsq")
    fact = found.facts["slips"]
    assert next(name for name, one in found.facts.items() if not one.ok) == "slips"
    assert f"{there} in the column of {here}" in fact.says
    assert f"--convention column:{there}={here}" in fact.says
