"""The table, the sentences, the text, the figure and the folder of measured costs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from refusals import refused

import ifrfit
from ifrfit.cost.inference_costs import UNIT
from ifrfit.cost.report.figure import ASIDE, FRONT_LABEL
from ifrfit.cost.report.text import error_text, ratio_text
from ifrfit.cost.timing import Cost, Timing
from ifrfit.errors import UsageError

from .made import INFERENCE, made, setting_at


@pytest.fixture(scope="module")
def costs():
    return made()


@pytest.fixture(scope="module")
def stand_in():
    return made("cross-2019", fix={"e_n": 0.94})


def test_the_table_has_the_columns_of_the_contract_first(costs):
    table = costs.table()
    contract = ["kind", "method", "setting", "time_s", "error", "error_unit", "repeats"]
    assert list(table)[:7] == contract
    assert list(table)[7:] == ["quantity", "time_low_s", "time_high_s", "on_front"]
    assert len(table) == 3 * len(INFERENCE) + 5
    row = table[(table["method"] == "mcmc") & (table["quantity"] == "sd")].iloc[1]
    assert (row["setting"], row["time_s"], row["error"], row["repeats"]) == ("1,000 steps", 6.2, 7e-3, 5)


def test_the_front_of_a_choice_is_that_of_its_worst_quantity(costs):
    table = costs.table()
    own = table[table["kind"] == "inference"].groupby(["method", "setting"])["on_front"]
    assert (own.nunique() == 1).all()
    assert [key for key, flag in own.first().items() if flag] == [
        ("exact", "tolerance 1e-1"),
        ("exact", "tolerance 1e-4"),
        ("exact", "tolerance 1e-8"),
        ("lsq", ""),
    ]


def test_sentences_follow_from_the_measurements(costs):
    best, behind, other = costs.sentences("inference")
    assert best == (
        "Cheapest for an error of at most so much of an sd: 1e-1 to 1e-3: exact, tolerance 1e-1 (12 ms); "
        "1e-4 to 1e-6: exact, tolerance 1e-4 (50 ms); 1e-7 to 1e-10: exact, tolerance 1e-8 (300 ms)"
    )
    assert behind == (
        "mcmc, 1,000 steps comes to 1.8e-2 of an sd in 6.2 s, 500 times the time of exact, tolerance 1e-1, "
        "which is no less exact"
    )
    assert other.endswith(
        "differs from it by up to 1.2 sd (least squares, 4.0 ms), 1.2 sd (profile likelihood, 400 ms) and "
        "3.7 sd (bootstrap, 90 ms)"
    )


def test_another_measurement_gives_another_sentence(costs):
    """The control: where chains were the cheapest the sentence says so."""
    quick = Timing.of([1e-4])
    changed = [replace(c, time=quick) if c.method == "mcmc" else c for c in costs.costs]
    best = replace(costs, costs=tuple(changed)).sentences("inference")[0]
    assert "1e-1: mcmc, 100 steps (100 us)" in best


def test_physics_says_what_the_fastest_comes_to(costs):
    said = costs.sentences("physics")
    assert said[0].startswith(
        "Cheapest for an error of at most so much in beta: 1e-1 to 1e-4: table, compiled"
    )
    assert (
        said[1] == "The fastest, closure IFR, e_t = -0.9, given; compiled (0.5 ns), comes to 6.0e-1 in beta"
    )
    assert said[2].startswith("annuli, 20 annuli comes to 8.0e-2 in beta in 1.2 ms, 300,000 times the time")


def test_nothing_measured_is_nothing_said(costs):
    assert replace(costs, costs=()).sentences("physics") == ()
    unknown = Cost("inference", "exact", "", "mean", Timing.of([1.0]), math.nan, UNIT)
    assert replace(costs, costs=(unknown,)).sentences("inference") == ()


def test_errors_and_ratios():
    assert [error_text(x) for x in (0.0, math.nan, 1.234e-5, math.inf, 2.3)] == [
        "0",
        "-",
        "1.2e-5",
        "infinite",
        "2.3e0",
    ]
    assert [ratio_text(x) for x in (3.14159, 1234.5, 2.345e5)] == [
        "3.1 times",
        "1,200 times",
        "230,000 times",
    ]


def test_the_text_fits_a_terminal_and_says_whose_data(costs):
    lines = costs.summary().splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[0].startswith("kharaz-2001   20 impacts")
    assert any("digitised" in line for line in lines)
    assert any(line.startswith("  * exact, tolerance 1e-1") for line in lines)
    assert any(line.startswith("    mcmc, 100 steps") for line in lines)
    text = " ".join(costs.summary().split())
    assert "against exact at tolerance 1e-9 (which reached 1e-10)" in text
    assert "of e_n, e_t and mu" in text
    assert text.endswith("note A note.")


def test_a_stand_in_says_so_in_text_and_picture(stand_in):
    assert "STAND-IN" in " ".join(stand_in.summary().splitlines()[:2])
    for kind in ("inference", "physics"):
        figure = stand_in.plot(kind)
        assert figure.get_suptitle().startswith("STAND-IN")
        assert [t.get_text() for t in figure.axes[0].texts].count("STAND-IN") == 1


def test_the_picture_shows_what_was_measured(costs):
    figure = costs.plot("inference")
    (axes,) = figure.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert figure.get_suptitle() == "kharaz-2001 (digitised): what accuracy costs, inference"
    marks = {
        (round(float(line.get_xdata()[0]), 12), float(line.get_ydata()[0])): line
        for line in axes.lines
        if line.get_linestyle() == "None" and len(line.get_xdata()) == 1 and line.get_marker() != "|"
    }
    expected = {(seconds, max(errors)) for _, _, seconds, errors in INFERENCE}
    assert set(marks) == expected
    filled = {at for at, line in marks.items() if line.get_markerfacecolor() != "white"}
    assert filled == {(0.004, 1.2), (0.0124, 1.7e-4), (0.05, 2e-7), (0.3, 1e-10)}
    (front,) = [line for line in axes.lines if line.get_label() == FRONT_LABEL]
    assert front.get_ydata()[:4].tolist() == [1.2, 1.7e-4, 2e-7, 1e-10]
    assert np.all(np.diff(front.get_xdata()) > 0.0)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"least squares †", "profile likelihood †", "bootstrap †", "exact", "mcmc"} < set(labels)
    assert figure.legends[0].get_title().get_text() == ASIDE


def test_impacts_that_lose_alike_share_a_line(costs):
    time = Timing(1e-9, 0.9e-9, 1.4e-9, 5)
    lost = {"spins of 1e6": 0.1, "slip cancels to 1e-6": 0.12, "grazing": 6e-3}
    measured = tuple(Cost("arithmetic", "float32", name, "beta", time, lost[name], "1") for name in lost)
    (axes,) = replace(costs, costs=measured).plot("arithmetic").axes
    words = [text.get_text() for text in axes.texts]
    assert words == ["slip cancels to 1e-6: beta; spins of 1e6: beta", "grazing: beta"]


def test_a_kind_that_was_not_measured_has_no_picture(costs):
    with refused(UsageError, match="Nothing of the kind arithmetic was measured"):
        costs.plot("arithmetic")


def test_the_folder_is_whole_and_is_kept(costs, tmp_path):
    names = costs.save(tmp_path / "cost")
    assert names == [
        "cost.csv",
        "cost-inference.svg",
        "cost-inference.png",
        "cost-physics.svg",
        "cost-physics.png",
    ]
    assert sorted(path.name for path in (tmp_path / "cost").iterdir()) == sorted(names)
    table = pd.read_csv(tmp_path / "cost" / "cost.csv", keep_default_na=False)
    assert list(table) == list(costs.table())
    assert table["time_s"].to_numpy() == pytest.approx(costs.table()["time_s"].to_numpy(), rel=1e-5)
    with refused(UsageError, match="holds an earlier measurement of costs; add --force"):
        costs.save(tmp_path / "cost")


def test_the_setting_of_physics_is_that_of_the_data():
    choices = {"prior": {"e_n": (0.98, 0.01)}}
    found = ifrfit.fit("kharaz-2001", method="lsq", **choices)
    setting = setting_at("kharaz-2001", **choices)
    for name in ("e_n", "e_t", "mu"):
        assert setting.constants[name] == pytest.approx(found.constants[name].value)
    maw = ifrfit.fit("kharaz-2001", closure="maw", method="lsq", **choices)
    assert setting.constants["chi"] == pytest.approx(maw.constants["chi"].value)
    assert setting.grid()[0] == found.points["gamma_deg"].min()
    assert setting.grid()[-1] == found.points["gamma_deg"].max()
    assert setting.notes == ()


def test_a_compliance_that_the_data_do_not_tell_is_the_middle_of_its_domain(impacts):
    path = impacts(gamma=np.linspace(60.0, 80.0, 20), noise=0.02, sigma=0.02)  # sliding alone
    choices = {"fix": {"e_n": 0.94}}
    setting = setting_at(path, **choices)
    assert setting.constants["chi"] == pytest.approx(0.5 * (7.0 / 6.0 + 7.0 / 4.0))
    assert setting.notes == (
        "Closure MAW does not find chi in these data: the middle of its domain, 1.46, is taken.",
    )


def test_data_without_an_angle_have_no_contact_law(tmp_path):
    path = tmp_path / "drops.csv"
    path.write_text("observable,value,sigma\ne_n,0.9,0.01\ne_n,0.91,0.01\n", encoding="utf-8")
    choices = {"fix": {"e_t": -0.9, "mu": 0.1}}
    with refused(UsageError, match="No row has an incidence angle"):
        setting_at(path, **choices)


def test_contact_laws_are_those_of_solid_spheres(impacts):
    path = impacts(gamma=np.linspace(5.0, 80.0, 20), noise=0.02, sigma=0.02)
    choices = {"fix": {"e_n": 0.94}, "inertia_factor": 2.0 / 3.0}
    with refused(UsageError, match=r"solid sphere, not for inertia factor 0\.666667: add"):
        setting_at(path, **choices)
