"""Costs of effects as text, table, JSON and figure."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pandas as pd
import pytest

from ifrfit.cost.effect_costs import EffectCosts, change_text, cost_lines, plot_costs, supplement
from ifrfit.cost.timing import Cost, Timing, table_of
from ifrfit.report.simulation.figure import SIMULATION, dumps, write_simulation
from ifrfit.report.simulation.text import summary
from ifrfit.simulation.simulate import simulate

LATERAL = Path(__file__).parents[2] / "docs" / "scenes" / "lateral-spin.toml"


def cost(method, setting, error, ns, quantity="beta", unit="1"):
    time = Timing(1e-9 * ns, 0.9e-9 * ns, 1.2e-9 * ns, 5)
    return Cost("physics", method, setting, quantity, time, error, unit)


COSTS = EffectCosts(
    Timing(12e-9, 11e-9, 14e-9, 5),
    Timing(61.4e-9, 60e-9, 70e-9, 5),
    (
        cost("lateral-spin", "on", math.inf, 5.43),
        cost("plasticity", "constant", math.nan, 20.0),
        cost("adhesion", "off", 2.9e-9, 0.3, "delta_deg", "rad"),
        cost("compliance", "constant", 0.12, 68.0),
        cost("rolling", "on", 0.0, 22.0),
    ),
    10_000,
)


def test_the_table_of_a_terminal():
    assert cost_lines(COSTS) == [
        "  what an effect changes, and what it adds to an impact: measured now, numpy on one thread,",
        "  10,000 impacts of this scene a call",
        "                               changes               ns an impact",
        "        closure alone, planar                                  12   (11 to 14)",
        "  on    lateral spin           whether beta exists            5.4   (4.9 to 6.5)",
        "  off   plasticity             does not act here               20   (18 to 24)",
        "  off   adhesion               delta_deg by 2.9e-09           < 1   (< 1 to < 1)",
        "  off   compliance             beta by 0.12                    68   (61 to 82)",
        "  on    rolling                nothing                         22   (20 to 26)",
        "        as planned                                             61   (60 to 70)",
    ]


def test_compliance_in_the_closures_place():
    assert change_text(cost("compliance", "on", math.nan, 70.0)) == "takes the closure's place"


def test_the_figure_by_its_data():
    figure = plot_costs(COSTS, 1e-3, "A title with $ in it")
    axes = figure.axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    low, high = 2.9e-10, 1.2
    points = {line.get_label(): line for line in axes.lines if ":" in line.get_label()}
    expected = {
        "lateral spin, on: whether beta exists": (5.43, high),
        "adhesion, off: delta_deg by 2.9e-09": (0.5, 2.9e-9),
        "compliance, off: beta by 0.12": (68.0, 0.12),
        "rolling, on: nothing": (22.0, low),
    }
    assert set(points) == set(expected)
    for label, (x, y) in expected.items():
        assert points[label].get_xdata()[0] == pytest.approx(x)
        assert points[label].get_ydata()[0] == pytest.approx(y)
        assert (points[label].get_markerfacecolor() == "white") == (", off" in label)
    bottom, top = axes.get_ylim()
    assert bottom < low < high < top
    assert axes.get_xlabel() == "added to an impact (ns)"


def test_the_folder_holds_table_and_figure(tmp_path):
    found = simulate(LATERAL)
    names = write_simulation(found, tmp_path / "a", force=False, supplement=supplement(COSTS, found))
    assert sorted(names) == sorted(SIMULATION.files) == sorted(p.name for p in (tmp_path / "a").iterdir())
    table = pd.read_csv(tmp_path / "a" / "cost.csv")
    assert list(table)[:7] == ["kind", "method", "setting", "time_s", "error", "error_unit", "repeats"]
    assert table["time_s"].tolist() == pytest.approx(table_of(COSTS.costs)["time_s"].tolist(), rel=1e-5)
    content = json.loads((tmp_path / "a" / "simulation.json").read_text(encoding="utf-8"))
    assert content == json.loads(dumps(found, supplement(COSTS, found)))
    assert content.pop("cost")["effects_ns"]["compliance"] == pytest.approx(
        {"median": 68.0, "low": 61.2, "high": 81.6}
    )
    assert content == found.to_dict()


@pytest.mark.usefixtures("blank_pictures")
def test_a_later_simulation_without_costs_leaves_none_behind(tmp_path):
    found = simulate(LATERAL)
    write_simulation(found, tmp_path / "a", force=False, supplement=supplement(COSTS, found))
    write_simulation(found, tmp_path / "a", force=True)
    left = {path.name for path in (tmp_path / "a").iterdir()}
    assert left == set(SIMULATION.files) - {"cost.csv", "cost.svg", "cost.png"}


def test_the_summary_tells_costs_after_the_plan():
    found = simulate(LATERAL)
    text = summary(found, supplement(COSTS, found))
    assert "\n".join(cost_lines(COSTS)) in text
    assert text.replace("\n".join(cost_lines(COSTS)) + "\n\n", "") == found.summary()
    assert max(map(len, text.splitlines())) <= 100
