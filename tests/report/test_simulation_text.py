"""A simulation at the terminal, in a figure and in a folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ifrfit.errors import UsageError
from ifrfit.physics.effects import Criterion, PlanLine
from ifrfit.physics.scenes import Quantity
from ifrfit.report.simulation.figure import SIMULATION, plot, write_simulation
from ifrfit.report.simulation.text import plan_text, quantity_text
from ifrfit.simulation.simulate import simulate

SCENES = Path(__file__).parents[2] / "docs" / "scenes"


@pytest.fixture(scope="module")
def found():
    """Example scenes by name, simulated once."""
    done = {}

    def one(name, samples=None):
        if (name, samples) not in done:
            done[name, samples] = simulate(SCENES / f"{name}.toml", samples=samples)
        return done[name, samples]

    return one


def line(**changes):
    given = {
        "effect": "adhesion",
        "title": "adhesion",
        "state": "off",
        "criterion": Criterion("V_s/V", 5e-4, 0.045),
        "change": 1e-7,
        "observable": "e_n",
        "reason": "",
    }
    return PlanLine(**(given | changes))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "off   adhesion        V_s/V = 0.0005 (acts above 0.045), would change e_n by 1e-07"),
        ({"change": 0.0}, "off   adhesion        V_s/V = 0.0005 (acts above 0.045), changes nothing"),
        (
            {"state": "on", "change": 0.5, "remark": "stretched"},
            "on    adhesion        V_s/V = 0.0005 (acts above 0.045), changes e_n by 0.5: stretched",
        ),
        (
            {"state": "on", "change": np.inf},
            "on    adhesion        V_s/V = 0.0005 (acts above 0.045), decides whether e_n exists",
        ),
        (
            {"state": "refused", "alarm": True, "reason": "not computed", "remark": "a gas"},
            "LOOK  adhesion        V_s/V = 0.0005 (acts above 0.045), would change e_n by 1e-07: not "
            "computed; a gas",
        ),
        (
            {"state": "unknown", "criterion": None, "change": None, "reason": "not given: the mass"},
            "-     adhesion        not given: the mass",
        ),
        (
            {"state": "constant", "reason": "constants.e_n is given and stays"},
            "off   adhesion        V_s/V = 0.0005 (acts above 0.045), constants.e_n is given and stays",
        ),
        (
            {"criterion": Criterion("St", np.inf, 35.0, above=False)},
            "off   adhesion        St = infinite (acts below 35), would change e_n by 1e-07",
        ),
    ],
)
def test_an_effect_in_a_line(changes, says):
    assert " ".join(part.strip() for part in plan_text(line(**changes))) == says


@pytest.mark.parametrize(
    ("quantity", "says"),
    [
        (Quantity("value", (2.0,), 0, 9), "2"),
        (Quantity("grid", (5.0, 10.0, 85.0), 0, 90), "5 to 85"),
        (Quantity("normal", (2.0, 0.5), 0, 9), "2 +- 0.5"),
        (Quantity("uniform", (2.0, 3.0), 0, 9), "2 to 3 (uniform)"),
        (Quantity("lognormal", (30.0, 1.3), 0, 99), "30 */ 1.3"),
    ],
)
def test_quantities_in_words(quantity, says):
    assert quantity_text(quantity) == says


def test_a_missed_effect_is_told_first(found):
    text = found("fine-glass").summary()
    assert text.startswith("LOOK  fluid: not computed, though it matters here.")
    assert "15 are captured" in text
    assert found("table-tennis").summary().startswith("table-tennis ")


@pytest.mark.parametrize("name", ["lateral-spin", "dust", "fine-glass", "wet-bead", "kharaz", "table-tennis"])
def test_text_fits_a_terminal_and_says_simulated(found, name):
    text = found(name, 3).summary()
    assert max(map(len, text.splitlines())) <= 100
    assert "simulated" in text
    assert text == text.rstrip()
    assert all(row == row.rstrip() for row in text.splitlines())


def test_curves_are_drawn_by_their_data(found):
    simulation = found("wet-bead", 30)
    figure, curves = plot(simulation), simulation.curves()
    assert len(figure.axes) == 3
    for axes, name in zip(figure.axes, simulation.scene.observables, strict=True):
        mine = curves[curves["observable"] == name]
        np.testing.assert_array_equal(axes.lines[0].get_xdata(), mine["gamma_deg"])
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), mine["value"])
        assert len(axes.collections) == 2  # two bands
        assert axes.get_xlabel() == "incidence angle γ (deg)"
    assert "simulated" in figure.get_suptitle()


def test_few_values_of_a_second_condition_are_curves(found):
    figure = plot(found("fine-glass"))
    for axes in figure.axes:
        drawn = [line.get_linestyle() != "None" for line in axes.lines]
        assert (sum(drawn), len(drawn)) == (3, 6)  # each with its points
    assert figure.axes[0].get_xlabel() == "incoming speed (m/s)"
    assert figure.axes[0].get_xscale() == "log"
    assert "LOOK: fluid would matter" in figure.get_suptitle()


def test_many_are_a_map(found):
    simulation = found("table-tennis")
    figure, curves = plot(simulation), simulation.curves()
    mesh = figure.axes[0].collections[0]
    wide = curves[curves["observable"] == "beta"].pivot(index="spin_x", columns="gamma_deg", values="value")
    np.testing.assert_array_equal(np.asarray(mesh.get_array()).ravel(), wide.to_numpy().ravel())
    assert figure.axes[0].get_ylabel() == "$\\omega_x$ (rad/s)"
    np.testing.assert_allclose(wide.index, np.linspace(0, 500, 21))


def test_without_a_grid_impacts_are_points_or_histograms(tmp_path):
    text = (SCENES / "lateral-spin.toml").read_text()
    grid = "gamma_deg = { from = 0, to = 85, count = 18 }"
    spread = text.replace(grid, "gamma_deg = { low = 10, high = 80 }")
    (tmp_path / "a.toml").write_text(spread)
    points = plot(simulate(tmp_path / "a.toml", samples=40))
    assert points.axes[0].lines[0].get_xdata().size == 40
    same = text.replace(grid, "gamma_deg = 30").replace("spin_x = 0.30", "spin_x = { mean = 0, sd = 0.1 }")
    (tmp_path / "b.toml").write_text(same)
    bars = plot(simulate(tmp_path / "b.toml", samples=50))
    assert sum(patch.get_height() for patch in bars.axes[0].patches) == 50
    (tmp_path / "c.toml").write_text(text.replace(grid, "gamma_deg = 30"))
    with pytest.raises(UsageError, match="One impact makes no figure"):
        plot(simulate(tmp_path / "c.toml"))


def test_captured_speeds_are_marked(tmp_path):
    text = (SCENES / "fine-glass.toml").read_text().replace("gamma_deg = [0, 30, 60]", "gamma_deg = 30")
    (tmp_path / "a.toml").write_text(text)
    figure = plot(simulate(tmp_path / "a.toml"))
    assert [text.get_text() for text in figure.axes[1].texts] == ["captured"]
    assert "captured" in simulate(tmp_path / "a.toml").summary()


def test_the_folder_appears_whole_and_the_same_bytes_each_time(found, tmp_path):
    simulation = found("wet-bead", 5)
    names = write_simulation(simulation, tmp_path / "one", force=False)
    expected = sorted(name for name in SIMULATION.files if not name.startswith("cost."))
    assert sorted(names) == expected == sorted(p.name for p in (tmp_path / "one").iterdir())
    write_simulation(simulation, tmp_path / "two", force=False)
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name
    content = json.loads((tmp_path / "one" / "simulation.json").read_text())
    assert content == simulation.to_dict()


def test_nothing_is_left_where_writing_fails(found, tmp_path, monkeypatch):
    def fail(*_arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("ifrfit.report.simulation.figure.save_svg_and_png", fail)
    with pytest.raises(UsageError, match="No space left"):
        write_simulation(found("lateral-spin"), tmp_path / "a" / "b", force=False)
    assert list(tmp_path.iterdir()) == []
