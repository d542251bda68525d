"""The numbers beside the pictures: against known answers, and against what is drawn."""

from __future__ import annotations

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from ifrfit.data.catalogue import load_dataset
from ifrfit.paper import schemes
from ifrfit.paper.figures import FIGURES, PAPER
from ifrfit.paper.scene import HEADER, rounded, rows_of, write_rows
from ifrfit.physics import rebound

WITH_POINTS = [f.name for f in FIGURES if f.kind in ("points", "real")]
KHARAZ = [f for f in FIGURES if f.case.startswith("kharaz")]
WITH_AXES = [f.name for f in FIGURES if f.kind != "scheme"]


def rows(scene, name, **wanted):
    return [
        row
        for row in rows_of(scene(name))
        if all(getattr(row, key) == value for key, value in wanted.items())
    ]


def marks(scene, name, kind):
    return [
        row for row in rows(scene, name, kind=kind) if row.label.startswith("transition") and row.y is None
    ]


# transitions of the printed constants, degrees: Eq. (23) with the constants of each caption
@pytest.mark.parametrize(
    ("name", "angles"),
    [
        ("3", [30.20]),
        ("4a", [2.55]),
        ("4b", [30.96]),
        ("6", [23.45]),
        ("8", [30.20]),
        ("9", [30.20]),
        ("A2.1a", [31.76]),
        ("A2.1b", []),
        pytest.param("5", [19.03], marks=pytest.mark.long),
        pytest.param("7", [26.34], marks=pytest.mark.long),
    ],
)
def test_transitions_of_the_printed_constants(scene, name, angles):
    figure = next(figure for figure in PAPER if figure.name == name)
    found = [float(figure.x.gamma(np.array(row.x))) for row in marks(scene, name, "printed_constants")]
    assert found == pytest.approx(angles, abs=0.01)


@pytest.mark.parametrize(
    ("gamma", "angle"),
    [
        (0.0, -90.0), (5.0, -68.83), (10.0, -52.34), (20.0, -33.34), (30.0, -24.23), (31.757838, -23.14),
        (35.0, -18.43), (45.0, -9.875), (60.0, -4.468), (75.0, -2.009),
    ],
)  # fmt: skip
def test_lateral_deviation_over_the_angle(scene, gamma, angle):
    near = [
        row.y for row in rows(scene, "A2.1a", kind="printed_constants") if row.y and abs(row.x - gamma) < 1e-5
    ]
    assert near
    assert near == pytest.approx([angle] * len(near), abs=0.01)


@pytest.mark.parametrize(
    ("spin", "angle"),
    [(0.1, -3.648), (0.2, -7.004), (0.3, -9.875), (0.4, -12.21), (0.6, -15.47), (1.0, -18.70)],
)
def test_lateral_deviation_over_the_spin(scene, spin, angle):
    (row,) = (row for row in rows(scene, "A2.1b", kind="printed_constants") if abs(row.x - spin) < 1e-9)
    assert row.y == pytest.approx(angle, abs=0.011)


def test_the_printed_sign_of_34_jumps_and_the_corrected_one_does_not(scene):
    for kind, jump in (("as_printed", 46.28), ("printed_constants", 0.0)):
        y = [row.y for row in rows(scene, "A2.1a", kind=kind) if row.y is not None]
        assert max(abs(np.diff(y)[20:])) == pytest.approx(jump, abs=0.02 if jump else 2.0)
    below = [row for row in rows(scene, "A2.1a", kind="as_printed") if row.x < 31.7]
    assert all(row.y > 0.0 for row in below)


@pytest.mark.parametrize(("name", "sticking"), [("3", 0.42), ("4a", -0.60), ("4b", -0.65), ("6", 0.42)])
def test_sticking_level_of_the_printed_constants(scene, name, sticking):
    line = rows(scene, name, kind="printed_constants", panel="data")
    first = next(row for row in line if row.y is not None)
    assert first.y == pytest.approx(sticking, abs=1e-12)


def test_both_readings_of_fig_4a(scene):
    at = {
        row.label: row.y
        for row in rows_of(scene("4a"))
        if row.x == 89.0 and row.kind in ("printed_constants", "other")
    }
    cotangent = 1.0 / math.tan(math.radians(89.0))
    assert at["printed: $e_n$ 0.78, $e_t$ −0.80, μ 0.01"] == pytest.approx(
        0.80 - 0.0623 * cotangent, abs=1e-6
    )
    centre = next(y for label, y in at.items() if label.startswith("printed, for values"))
    assert centre == pytest.approx(0.942857 - 0.0178 * cotangent, abs=1e-6)


def test_fr_is_flat_where_it_slides(scene):
    fr = [row for row in rows_of(scene("9")) if row.label.startswith("FR")]
    assert {round(row.y, 12) for row in fr if row.x > 0.6} == {0.12}
    others = {row.label for row in rows(scene, "9", kind="other")}
    assert len([label for label in others if "our choice" in label]) == 3


@pytest.mark.parametrize(
    ("name", "dataset", "series", "observable", "sign"),
    [
        ("3", "cross-2019", "no spin", "beta", 1.0),
        ("4b", "hashemnia-2019", "no spin", "beta", -1.0),
        ("8", "cross-2019", "no spin", "psi_after_deg", 1.0),
        ("9", "cross-2019", "no spin", "mu_app", 1.0),
    ],
)
def test_every_point_of_the_dataset_is_in_the_table(scene, name, dataset, series, observable, sign):
    table = load_dataset(dataset).table
    own = table[(table["series"] == series) & (table["observable"] == observable)]
    found = rows(scene, name, panel="data", kind="data")
    assert [row.y for row in found] == pytest.approx(list(sign * own["value"]))
    assert {row.provenance for row in found} == {"stand-in"}
    residuals = rows(scene, name, panel="residuals")
    assert [row.x for row in residuals] == [row.x for row in found]


def numbers(rows):
    """Pairs as the csv has them, by where they may be drawn."""
    lines = {(f"{r.x:.8g}", f"{r.y:.8g}") for r in rows if r.y is not None}
    limits = {(f"{r.x:.8g}", f"{v:.8g}") for r in rows for v in r.limits if v is not None}
    uprights = {f"{r.x:.8g}" for r in rows if r.y is None}
    return lines, limits, uprights


@pytest.mark.parametrize("name", [n for n in WITH_AXES if n not in ("5", "7")])
def test_every_curve_and_point_drawn_is_in_the_csv(picture, name):
    made = picture(name)
    lines, limits, uprights = numbers(made.rows)
    drawn = 0
    for axes in made.figure.axes:
        if not axes.axison:
            continue
        for line in axes.lines:
            x, y = (np.asarray(v, dtype=float) for v in line.get_data())
            if line.get_transform() != axes.transData:
                assert len(x) == 2
                assert x[0] != x[1] or f"{x[0]:.8g}" in uprights
                continue
            for a, b in zip(x, y, strict=True):
                pair = f"{a:.8g}", f"{b + 0.0:.8g}"
                assert pair in lines or pair in limits or not np.isfinite(b), (name, pair)
                drawn += 1
        for band in axes.collections:
            if isinstance(band, PolyCollection):
                ends = {(f"{a:.8g}", f"{b:.8g}") for a, b in band.get_paths()[0].vertices}
                assert ends <= limits | lines
    assert drawn > 100


def shifted(scene, by):
    """The scene with curves, points and residuals off by a relative `by`."""
    curves = tuple(replace(c, x=c.x * (1.0 + by), y=c.y * (1.0 - by)) for c in scene.curves)
    points = tuple(
        replace(p, y=p.y * (1.0 + by), sigma=p.sigma * (1.0 - by), residual=p.residual * (1.0 + by))
        for p in scene.points
    )
    return replace(scene, curves=curves, points=points)


@pytest.mark.parametrize(("by", "same"), [(1e-13, True), (1e-4, False)])
def test_the_last_bits_of_a_processor_are_not_in_the_csv(scene, by, same):
    here, there = (list(rows_of(rounded(s))) for s in (scene("3"), shifted(scene("3"), by)))
    assert (here == there) is same


def test_a_curve_that_is_not_in_the_csv_would_be_seen(picture):
    """Control: the rows of another figure do not hold these curves."""
    lines, limits, _ = numbers(picture("3").rows)
    other = next(line for line in picture("8").figure.axes[0].lines if len(line.get_xdata()) > 50)
    pairs = {(f"{a:.8g}", f"{b:.8g}") for a, b in zip(*other.get_data(), strict=True)}
    assert not pairs <= lines | limits


@pytest.mark.parametrize("name", ["3", "6", "9", "kharaz-mu-app", "cornell-mu-app"])
def test_bands_are_nested_about_the_curve(scene, name):
    for curve in (c for c in scene(name).curves if c.credible is not None):
        inner, outer = curve.credible, curve.predictive
        assert (inner.lo95 <= inner.lo68).all()
        assert (inner.lo68 <= curve.y + 1e-12).all()
        assert (curve.y <= inner.hi68 + 1e-12).all()
        assert (inner.hi68 <= inner.hi95).all()
        width, wider = inner.hi95 - inner.lo95, outer.hi95 - outer.lo95
        finite = np.isfinite(width) & np.isfinite(wider)
        assert (wider[finite] > 0.95 * width[finite]).all()


def test_the_csv_has_the_columns_of_the_contract(scene, tmp_path):
    write_rows(list(rows_of(scene("3"))), tmp_path / "fig3.csv")
    with (tmp_path / "fig3.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.reader(file))
    columns = "panel,kind,label,x,y,y_lo68,y_hi68,y_lo95,y_hi95,sigma,provenance"
    assert ",".join(table[0]) == ",".join(HEADER) == columns
    assert {row[0] for row in table[1:]} == {"data", "residuals"}
    assert {row[1] for row in table[1:]} == {"data", "printed_constants", "recovered", "other"}
    assert not {"nan", "inf", "-inf", "None"} & {cell for row in table for cell in row}


def test_the_arrows_of_fig_1_are_the_impact_to_scale():
    ends = {(row.panel[0], row.label): (row.x, row.y) for row in schemes.rows()}
    r = rebound(40.0, 0.50, 0.35, degrees=True, e_n=0.90, e_t=-0.90, mu=0.15)
    head, tail = ends["c", "U_t head"], ends["c", "U_t tail"]
    slip = head[0] - tail[0], tail[1] - head[1]  # y is down
    assert slip[0] / slip[1] == pytest.approx(float(r.incidence.slip_x) / float(r.incidence.slip_y))
    incoming = math.dist(ends["a", "u tail"], ends["a", "u head"])
    outgoing = math.dist(ends["a", "v tail"], ends["a", "v head"])
    assert outgoing / incoming == pytest.approx(math.hypot(float(r.v_x), float(r.v_n)))


def test_kharaz_points_are_the_measurements_and_left_out_ones_have_no_residual(scene):
    for figure in KHARAZ:
        shown = scene(figure.name)
        fitted = [p for p in shown.points if p.residual is not None]
        assert sum(p.x.size for p in fitted) == 15
        left = [p for p in shown.points if "not fitted" in p.label and "directly" not in p.label]
        assert sum(p.x.size for p in left) == 5
        assert all((p.x < 15.0).all() for p in left)
        assert not shown.stand_in
        assert all(p.provenance == "digitised" for p in shown.points)


def test_the_delta_read_directly_agrees_with_the_one_from_the_centre(scene):
    shown = {p.label: p for p in scene("kharaz-delta").points}
    direct = next(p for label, p in shown.items() if "directly" in label)
    fitted = next(p for label, p in shown.items() if "CM" in label and p.residual is not None)
    curve = next(c for c in scene("kharaz-delta").curves if c.kind == "recovered")
    for points in (direct, fitted):
        beyond = points.x > 15.0
        assert np.abs(points.y - np.interp(points.x, curve.x, curve.y))[beyond].max() < 1.5


@pytest.mark.parametrize("name", ["beta", "psi-after", "mu-app", "delta"])
def test_cornell_points_are_all_collisions_in_both_regimes_and_both_closures_hold_them(scene, name):
    shown = scene(f"cornell-{name}")
    (points,) = shown.points
    assert (points.x.size, int(points.sticking.sum()), points.provenance) == (24, 13, "measured")
    ifr, fr, chart = shown.curves
    assert [curve.kind for curve in shown.curves] == ["recovered", "other", "printed_constants"]
    assert fr.label.startswith("FR: ")
    within = [np.interp(np.linspace(5.0, 55.0, 11), c.x, c.y) for c in (ifr, fr, chart)]
    spread = np.median(points.sigma)
    assert np.abs(np.ptp(within, axis=0)).max() < 0.5 * spread
    assert shown.warnings == ()


def test_the_authors_chart_is_walton_with_their_constants(scene):
    chart = scene("cornell-beta").curves[2]
    kappa = 0.092 * 1.97
    assert np.interp(10.0, chart.x, chart.y) == pytest.approx(0.44)
    assert np.interp(60.0, chart.x, chart.y) == pytest.approx(
        -1.0 + 3.5 * kappa / math.tan(math.radians(60.0))
    )
