"""What decides the answer although nobody said so stands in the output."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
import pytest
from factories import impacts_file, table_file

import ifrfit
from ifrfit.inference.appraise import appraise
from ifrfit.inference.optimize.angle_offset import slope_by_offset
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.options import AngleErrors, Noise
from ifrfit.inference.result.assumptions import moved_by
from ifrfit.physics import rebound
from ifrfit.report.page import page

SILENT = "gamma_deg,beta\n" + "\n".join(f"{g},{b}" for g, b in zip(range(10, 90, 8), [
    0.6, 0.62, 0.58, 0.3, 0.05, -0.1, -0.2, -0.31, -0.36, -0.4], strict=True)) + "\n"  # fmt: skip
STATED = SILENT.replace("gamma_deg,beta", "gamma_deg,beta,spin_x,spin_y,sigma_beta")
STATED = STATED.replace("\n", ",0,0,0.02\n").replace("sigma_beta,0,0,0.02", "sigma_beta")
FIX = {"e_n": 0.9}
CLOSURE = "closure IFR"
SCATTER = "errors as large as the scatter"
INDEPENDENT = "errors independent of one another"
COMPLETE = "no reading left out or picked for its value"


@pytest.fixture
def file(tmp_path):
    def written(text):
        path = tmp_path / "a.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return written


@pytest.mark.parametrize(
    ("text", "choices", "assumed"),
    [
        (SILENT, {}, ("inertia factor 0.4 (solid sphere)", "no spin before impact", SCATTER)),
        (SILENT, {"inertia_factor": 0.4}, ("no spin before impact", SCATTER)),
        (STATED, {}, ("inertia factor 0.4 (solid sphere)",)),
        (STATED, {"inertia_factor": 0.4}, ()),
        (
            STATED,
            {"inertia_factor": 0.4, "noise": "scaled"},
            ("errors as large as the scatter, in the proportions of sigma",),
        ),
    ],
)
def test_a_table_that_is_silent(file, text, choices, assumed):
    fit = ifrfit.fit(file(text), method="lsq", fix=FIX, **choices)
    said = tuple(one.split(" (R omega/u of 0.1 would move ")[0] for one in fit.assumed)
    assert said[:-1] == (CLOSURE, *assumed, INDEPENDENT, COMPLETE)
    assert fit.assumed[-1].startswith("angles of incidence without an offset (1 degree would move mu by ")


def test_a_closure_that_nobody_chose_is_an_assumption(file):
    for choices, said in (({}, True), ({"closure": "fr"}, False)):
        assert (CLOSURE in ifrfit.fit(file(SILENT), method="lsq", fix=FIX, **choices).assumed) is said


def test_an_offset_that_moves_nothing_is_not_told(file):
    gamma = np.arange(5.0, 85.0, 2.5)
    beta = -rebound(gamma, e_n=0.92, e_t=-0.85, mu=0.14, degrees=True).beta  # e_t and mu will be on bounds
    rows = [
        f"{g},{b},0.03,{0.92 + 0.02 * (-1) ** i},0.02\n"
        for i, (g, b) in enumerate(zip(gamma, beta, strict=True))
    ]
    fit = ifrfit.fit(file("gamma_deg,beta,sigma_beta,e_n,sigma_e_n\n" + "".join(rows)), method="lsq")
    assert fit.assumed[-1] == COMPLETE
    # no constant that has a value moves, but for rounding
    assert ifrfit.fit("cornell-glass", closure="f").assumed[-1] == COMPLETE


def test_a_lateral_spin_that_nobody_measured_is_assumed_away(tmp_path):
    """With what 0.1 of it would move: the optimum of the same rows with it."""
    path = impacts_file(
        tmp_path / "t.csv",
        {"gamma": np.linspace(8.0, 75.0, 60), "noise": 0.002, "sigma": 0.002, "spin_y": 0.1},
    )
    text = path.read_text(encoding="utf-8")
    planar, lateral = tmp_path / "planar.csv", tmp_path / "lateral.csv"
    planar.write_text(text.replace(",spin_x", "").replace(",0.0,0.1,", ",0.1,"), encoding="utf-8")
    lateral.write_text(text.replace(",0.0,0.1,", ",0.1,0.1,"), encoding="utf-8")
    fit, other = (ifrfit.fit(each, method="lsq", fix=FIX) for each in (planar, lateral))
    (said,) = (one for one in fit.assumed if "lateral" in one)
    assert said.startswith(
        "motion in one plane, no lateral spin before impact (R omega_x/u of 0.1 would move "
    )
    assert not any("lateral" in one for one in other.assumed)
    name, by = said.split("would move ")[1].split(",")[0].split(" by ")
    assert abs(other.constants[name].value - fit.constants[name].value) == pytest.approx(float(by), rel=0.3)


@pytest.mark.parametrize("spin", [0.03, 0.1])
@pytest.mark.parametrize("lowest", [15.0, 30.0])
def test_a_spin_that_nobody_measured_is_assumed_away(tmp_path, lowest, spin):
    """With what 0.1 of it would move: the optimum of impacts that had some, in a table without the column."""
    silent = []
    for before in (0.0, spin):
        impacts = {
            "gamma": np.linspace(lowest, 75.0, 60),
            "noise": 0.002,
            "sigma": 0.002,
            "spin_y": before,
        }
        table = pd.read_csv(impacts_file(tmp_path / "t.csv", impacts)).drop(columns=["spin_x", "spin_y"])
        silent.append(ifrfit.fit(table, method="lsq", fix=FIX))
    (said,) = (one for one in silent[0].assumed if one.startswith("no spin before impact"))
    name, by = re.search(r" \(R omega/u of 0\.1 would move (\w+) by ([\d.]+), ", said).groups()
    moved = abs(silent[1].constants[name].value - silent[0].constants[name].value)
    assert moved * 0.1 / spin == pytest.approx(float(by), rel=0.3)


def test_a_dataset_says_what_hit_what():
    said = ifrfit.fit("kharaz-2001", method="lsq").assumed
    assert said[:3] == (CLOSURE, f"{SCATTER}, in the proportions of sigma", INDEPENDENT)


def test_readings_of_e_n_alone_assume_nothing_of_the_ball(file):
    assert ifrfit.fit(file("e_n\n0.91\n0.9\n0.92\n0.89\n"), method="lsq").assumed == (
        SCATTER,
        INDEPENDENT,
        COMPLETE,
    )


@pytest.mark.parametrize("degrees", [0.02, -0.02])
def test_what_an_offset_would_move_is_what_it_moves(tmp_path, degrees):
    """The optimum of the same rows at other angles."""
    path = impacts_file(
        tmp_path / "t.csv", {"gamma": np.linspace(8.0, 75.0, 60), "noise": 0.005, "sigma": 0.005}
    )
    fit = ifrfit.fit(path, method="lsq", fix=FIX)
    slope = slope_by_offset(fit.problem, fit.least_squares.optimum.theta)
    moved = moved_by(fit.problem, fit.least_squares, slope)
    turned = least_squares(fit.problem.at_offset(degrees)).optimum.theta - fit.least_squares.optimum.theta
    for name, found in zip(fit.problem.parameters.names, turned, strict=True):
        assert found == pytest.approx(degrees * moved[name], rel=0.05, abs=1e-9)
    largest = max(("e_t", "mu"), key=lambda name: abs(moved[name]) / fit.constants[name].stderr)
    share = abs(moved[largest]) / fit.constants[largest].stderr
    assert f"move {largest} by {abs(moved[largest]):.2g}, {share:.2g} sd" in fit.assumed[-1]


def test_an_offset_that_is_fitted_is_not_assumed_away(file):
    fit = ifrfit.fit(file(SILENT), method="lsq", fix=FIX, noise=Noise(angles=AngleErrors(offset_sd=1.0)))
    assert not any("without an offset" in one for one in fit.assumed)


def test_it_is_kept_in_the_file_and_stands_on_the_page(file, tmp_path):
    fit = ifrfit.fit(file(SILENT), method="lsq", fix=FIX)
    fit.save(tmp_path / "r.json")
    assert json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))["assumed"] == list(fit.assumed)
    again = ifrfit.load_result(tmp_path / "r.json")
    assert again.to_dict() == fit.to_dict()
    text = page(again, appraise(again, closures=False))
    assert (
        "Assumed: closure IFR, inertia factor 0.4 (solid sphere), no spin before impact (R omega/u of 0.1 "
        in text
    )


def test_of_two_files_the_one_without_spin_is_named(tmp_path):
    (tmp_path / "silent.csv").write_text(SILENT, encoding="utf-8")
    spun = impacts_file(tmp_path / "spun.csv", {"gamma": np.arange(10.0, 80.0, 9.0), "spin_y": 0.1})
    fit = ifrfit.fit([tmp_path / "silent.csv", spun], method="lsq", fix=FIX)
    assert any(one.startswith("no spin before impact in silent.csv (R omega/u") for one in fit.assumed)


@pytest.mark.parametrize(("angle", "told"), [(0.0, True), (40.0, False)])
def test_e_n_that_was_read_at_other_angles_is_an_assumption(tmp_path, angle, told):
    e_n = {"gamma": [angle] * 4, "observables": ("e_n",), "noise": 0.01, "sigma": 0.01}
    beta = {"gamma": np.linspace(8.0, 80.0, 12), "noise": 0.02, "sigma": 0.02}
    found = ifrfit.fit(impacts_file(tmp_path / "t.csv", e_n, beta), method="lsq")
    words = "e_n as read at 0 degrees, for impacts at 8 to 80"
    assert (words in found.assumed) == told


@pytest.mark.parametrize(
    ("step", "were_set", "said"),
    [(5.0, False, True), (10.0, False, True), (5.0, True, False), (1.0, False, False)],
)
def test_angles_that_may_have_been_rounded_down(tmp_path, step, were_set, said):
    """With what half a step moves: as 1 degree does, times half a step."""
    gamma = np.random.default_rng(1).uniform(10.0, 85.0, 60)
    given = np.arange(5.0, 86.0, 5.0) if were_set else step * np.floor(gamma / step)
    path = impacts_file(
        tmp_path / "t.csv", {"gamma": np.arange(5.0, 86.0, 5.0) if were_set else gamma, "noise": 0.02}
    )
    angles = iter(given.tolist())
    lines = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    rows = [[*line[:2], repr(next(angles)), *line[3:]] for line in lines[1:]]
    path.write_text("\n".join(",".join(row) for row in [lines[0], *rows]) + "\n", encoding="utf-8")
    fit = ifrfit.fit(path, method="lsq", fix=FIX)
    words = f"angles of incidence, all multiples of {step:g} degrees, exact (rounded down they would be "
    assert fit.assumed[-1].startswith(words + f"{0.5 * step:g} too small") is said
    if said:
        moved = moved_by(
            fit.problem, fit.least_squares, slope_by_offset(fit.problem, fit.least_squares.optimum.theta)
        )
        name, by = fit.assumed[-1].split("would move ")[1].split(",")[0].split(" by ")
        assert float(by) == pytest.approx(0.5 * step * abs(moved[name]), rel=0.1)


def test_a_camera_past_the_plane_of_motion(tmp_path):
    """What it would move is what one that looks 5 degrees past it moves."""
    gamma = np.linspace(8.0, 80.0, 60)
    state = rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True)
    v_x, v_n = (v + 0.003 * np.random.default_rng(0).standard_normal(60) for v in (state.v_x, state.v_n))
    fits = []
    for shorter in (1.0, np.cos(np.radians(5.0))):
        columns = {
            "u_x_m_s": shorter * np.sin(np.radians(gamma)),
            "u_z_m_s": np.cos(np.radians(gamma)),
            "v_x_m_s": shorter * v_x,
            "v_z_m_s": -v_n,
        }
        fits.append(ifrfit.fit(table_file(tmp_path / "t.csv", columns), method="lsq"))
    (said,) = (one for one in fits[0].assumed if "past the plane" in one)
    name, by = said.split("would move ")[1].split(",")[0].split(" by ")
    moved = fits[1].constants[name].value - fits[0].constants[name].value
    assert abs(moved) == pytest.approx(float(by), rel=0.1)


def test_a_largest_reading_of_one(file):
    said = "beta as read, not divided by the largest, which is 1 exactly"
    table = SILENT.replace("0.62", "1.000").replace("0.58", "0.583")
    assert said in ifrfit.fit(file(table), method="lsq", fix=FIX).assumed
    assert said not in ifrfit.fit(file(table.replace("1.000", "1.002")), method="lsq", fix=FIX).assumed
    assert said not in ifrfit.fit(file(SILENT.replace("0.62", "1")), method="lsq", fix=FIX).assumed
