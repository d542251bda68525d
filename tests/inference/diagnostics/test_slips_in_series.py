"""A slip in one of several series is named with that series, before constants of each are advised."""

from __future__ import annotations

from dataclasses import replace

import pytest
from factories import rest_long, table_file
from slips_scenes import Cause, Scene, experiment

from ifrfit.data.observations import Observations
from ifrfit.inference.diagnostics.nested_models import Pooling
from ifrfit.inference.fit import fit
from ifrfit.inference.result.types import Fact

E_N = {"e_n": 0.8}
RAW = Scene(spins=True, policy="unknown", series=2)
BETA = Scene(("beta",), 34, 0.03, policy="unknown", fixed=E_N, series=2)


def facts_of(scene, cause, seed=1):
    data = experiment(scene, cause, seed)
    return fit(data, method="lsq", independent=True, fix=scene.fixed).facts


@pytest.mark.parametrize(
    ("scene", "cause", "called", "words"),
    [
        (BETA, "sign beta", "sign beta in B", "(--convention beta=opposite-sign)"),
        (BETA, "angle-from-wall", "angle-from-wall in B", "(--convention angle=from-wall)"),
        (RAW, "angle-from-wall", "angle-from-wall in B", "--series B (--convention angle=from-wall)"),
        (RAW, "sign-of-spins-y", "sign-of-spins-y spin_y_after in B", "the opposite sign in spin_y (before)"),
        (RAW, "inertia-factor", "inertia-factor in B", "(thin hollow ball 0.6667)"),
        (RAW, "angle-offset", "angle-offset in B", "angles of incidence off by"),
        (RAW, "spins-doubled spin_y_after", "spins-doubled spin_y_after in B", "a diameter for the radius"),
    ],
)
def test_the_series_is_named(scene, cause, called, words):
    size = {"inertia-factor": 2.0 / 3.0, "angle-offset": 2.0}.get(cause, 0.0)
    facts = facts_of(scene, Cause(cause, size, in_b=True))
    slips = facts["slips"]
    assert slips.figures["called"][0] == called
    assert slips.says.startswith("series B looks as if it had ")
    assert words in slips.says
    assert not slips.ok
    assert next(name for name, fact in facts.items() if not fact.ok) == "slips"
    if not facts["pooling"].ok:
        assert "--separate" not in facts["pooling"].says
        assert facts["pooling"].says.endswith("mend the slip in it first")
    assert "effects" not in facts or facts["effects"].ok


def test_what_is_advised_mends_it(tmp_path):
    """Fitted alone with the option, the series is described."""
    data = experiment(BETA, Cause("angle-from-wall", in_b=True), 2)
    rows = data.table[["gamma_deg", "series", "value"]].rename(columns={"value": "beta"})
    path = table_file(tmp_path / "t.csv", rows)
    says = fit(path, method="lsq", fix=E_N).facts["slips"].says
    assert "--series B (--convention angle=from-wall)" in says
    mended = fit(path, method="lsq", fix=E_N, series="B", convention=["angle=from-wall"])
    assert mended.facts["slips"].ok
    assert mended.facts["lack_of_fit"].ok


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("scene", [RAW, BETA], ids=["raw", "beta"])
@pytest.mark.parametrize("seeds", rest_long((1, 3)))
def test_series_of_another_constant_have_no_slip(scene, known, seeds):
    """mu differs: constants of each are advised."""
    for seed in range(seeds):
        one = experiment(replace(scene, policy="known" if known else "unknown"), Cause(), seed).table
        other = experiment(
            replace(scene, policy="known" if known else "unknown"), Cause("another-mu"), seed
        ).table
        table = one.copy()
        table[one["series"] == "B"] = other[one["series"] == "B"]
        facts = fit(Observations(table), method="lsq", independent=True, fix=scene.fixed).facts
        assert not facts["pooling"].ok
        assert "--separate mu" in facts["pooling"].says
        assert "slips" not in facts


def test_a_noisy_series_has_no_slip():
    data = experiment(RAW, Cause(), 4)
    clean = experiment(replace(RAW, noise=0.0), Cause(), 4).table["value"]
    table = data.table.copy()
    noisy = table["series"] == "B"
    table.loc[noisy, "value"] = clean[noisy] + 6.0 * (table["value"] - clean)[noisy]
    facts = fit(Observations(table), method="lsq", independent=True).facts
    assert not facts["unequal_noise"].ok
    assert facts["slips"].ok


def scaled(seed=3):
    """v_n of series B is 7 % too small, beside spins: the scale of its speeds, or an e_n of its own."""
    scene = Scene(("v_n", "spin_y_after"), 40, policy="unknown", series=2, ordered=False)
    table = experiment(scene, Cause(), seed).table.copy()
    table.loc[(table["series"] == "B") & (table["observable"] == "v_n"), "value"] *= 0.93
    return fit(Observations(table), method="lsq", independent=True).facts


def test_a_slip_that_explains_more_is_named_beside_series_that_differ():
    facts = scaled()
    says = facts["slips"].says
    assert says.startswith("series B looks as if it had speeds after impact -7")
    assert "or series that do not share e_n (" in says
    assert facts["pooling"].says.endswith("--separate e_n")


def test_a_slip_that_explains_as_much_stands_behind_series_that_differ():
    rule = Fact(False, "the series do not share e_n: --separate e_n", {}, "")
    problem = experiment(RAW, Cause(), 1)
    result = fit(problem, method="lsq", independent=True)
    shared = Pooling(rule, "e_n", result.problem, result.least_squares)
    assert shared.beside("speeds off in series B").says == f"{rule.says}; or speeds off in series B"
    assert shared.beside("") is rule
