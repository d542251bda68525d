"""What is written is what was given: places are read back from the svg."""

from __future__ import annotations

import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from ifrfit.report.page.charts.chart import (
    LABEL_LETTERS,
    Axis,
    Band,
    Bars,
    Box,
    Chart,
    Entry,
    Legend,
    Line,
    Panel,
    Points,
    Words,
)
from ifrfit.report.page.charts.scales import Logarithmic, Ticks
from ifrfit.report.page.charts.svg import POINTS_PER_MM, SHAPES, TICK_LETTERS, chosen_ticks, hexadecimal, svg
from ifrfit.report.page.charts.typesetting import width
from ifrfit.report.style import MARKERS

X, Y = Axis(0.0, 10.0, "x"), Axis(1e-3, 1e3, "y", Logarithmic())


def written(*marks, x=X, y=Y, **options):
    panel = Panel(20.0, 5.0, 60.0, 40.0, x, y, marks, **options)
    return ET.fromstring(svg(Chart(90.0, 60.0, (panel,)), "own"))


def paths(root, attribute, value):
    return [path.get("d") for path in root.iter("path") if path.get(attribute) == value]


def values(path):
    """Data of the places of a path in the panel of `written`."""
    numbers = np.array(re.findall(r"-?[\d.]+", path), dtype=float).reshape(-1, 2) / POINTS_PER_MM
    return (numbers[:, 0] - 20.0) / 6.0, 10.0 ** ((45.0 - numbers[:, 1]) / 40.0 * 6.0 - 3.0)


def test_a_line_is_where_its_values_are_and_broken_where_there_are_none():
    x, y = np.array([0.0, 2.0, 4.0, 6.0]), np.array([1.0, 10.0, math.nan, 100.0])
    (path,) = paths(written(Line(x, y, "#123456")), "stroke", "#123456")
    assert path.count("M") == 2
    across, up = values(path)
    assert across == pytest.approx([0.0, 2.0, 6.0], abs=1e-3)
    assert up == pytest.approx([1.0, 10.0, 100.0], rel=1e-3)


def test_points_are_where_their_values_are_one_alone_too():
    for n in (1, 3):
        x, y = np.arange(1.0, n + 1.0), np.full(n, 10.0)
        root = written(Points(x, y, "s", 3.0, "#fff", "#000"))
        (path,) = (path for path in root.iter("path") if path.get("marker-start"))
        assert path.get("marker-mid") == path.get("marker-start")
        # the last place stands a second time: the end of a path bears no marker
        assert path.get("d").endswith("h0")
        across, up = values(path.get("d").removesuffix("h0"))
        assert across == pytest.approx(x, abs=0.01)
        assert up == pytest.approx(y, rel=0.02)


def test_a_band_is_closed_and_a_bar_has_its_ends():
    x = np.array([1.0, 2.0])
    root = written(Band(x, np.array([1.0, 2.0]), np.array([4.0, 8.0]), "#111111", 0.5))
    (path,) = paths(root, "fill", "#111111")
    assert path.endswith("z")
    assert values(path)[1] == pytest.approx([4.0, 8.0, 2.0, 1.0], rel=1e-3)
    bars = Bars(x, np.array([1.0, math.nan]), np.array([10.0, 3.0]), colour="#222222")
    (path,) = paths(written(bars), "stroke", "#222222")
    place, start, end = (float(number) / POINTS_PER_MM for number in re.findall(r"[\d.]+", path))
    assert ((place - 20.0) / 6.0, 45.0 - start, 45.0 - end) == pytest.approx(
        (1.0, 20.0, 80.0 / 3.0), abs=1e-2
    )


def test_a_box_without_end_fills_its_panel():
    root = written(Box((5.0, math.inf), (-math.inf, math.inf), "#333333", 0.5, is_hatched=True))
    box = next(each for each in root.iter("rect") if each.get("fill") == "#333333")
    found = [float(box.get(name)) / POINTS_PER_MM for name in ("x", "y", "width", "height")]
    assert found == pytest.approx([50.0, 5.0, 30.0, 40.0], abs=0.01)
    assert len(list(root.iter("pattern"))) == 1


def test_values_far_out_make_no_endless_numbers():
    (path,) = paths(
        written(Line(np.array([0.0, 1e300]), np.array([1.0, math.inf]), "#123456")), "stroke", "#123456"
    )
    assert len(path) < 40


def test_falling_axes_run_the_other_way():
    root = written(Words(0.0, 0.0, "top"), y=Axis(2.5, -0.5))
    (text,) = (each for each in root.iter("text") if each.text == "top")
    assert float(text.get("y")) / POINTS_PER_MM == pytest.approx(5.0 + 40.0 * 0.5 / 3.0, abs=1.0)


@pytest.mark.parametrize("length", [40.0, 80.0, 200.0])
@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-0.99991, -0.99987), (9000.0, 31000.0), (0.0, 3e-7)])
def test_labels_keep_a_distance(low, high, length):
    axis = Axis(low, high, most=8)
    found = chosen_ticks(axis, length, is_upright=False)
    places = (np.array(found.places) - low) / (high - low) * length
    halves = np.array([0.5 * width(label, TICK_LETTERS) for label in found.labels])
    if len(places) > 2:  # two are the least
        assert (np.diff(places) > halves[1:] + halves[:-1]).all()


def test_labels_stay_on_the_chart():
    axis = Axis(0.0, 10.0, ticks=Ticks((10.0,), ("a very long label",)))
    panel = Panel(20.0, 5.0, 68.0, 40.0, axis, Y, ())
    root = ET.fromstring(svg(Chart(90.0, 60.0, (panel,)), "own"))
    (label,) = (each for each in root.iter("text") if each.text == "a very long label")
    end = float(label.get("x")) + 0.5 * width("a very long label", TICK_LETTERS)
    assert end <= 90.0 * POINTS_PER_MM + 0.01


def test_ids_bear_the_name_and_every_reference_leads_somewhere():
    x = np.array([1.0, 2.0])
    points = Points(x, x, "o", 3.0, "#fff", "#000")
    panel = Panel(20.0, 5.0, 60.0, 30.0, X, Y, (points, points), title="<title>")
    legend = Legend(50.0, ((Entry("A & B", Line(x, x, "0.5", dashes="--"), points),),))
    text = svg(Chart(90.0, 60.0, (panel, panel), legend), "own", attributes={"role": "img"})
    root = ET.fromstring(text)
    ids = [each.get("id") for each in root.iter() if each.get("id")]
    assert len(ids) == len(set(ids)) == 2  # a clip path and a shape, whoever refers to them
    assert all(name.startswith("own-") for name in ids)
    assert set(re.findall(r"url\(#([^)]+)\)", text)) == set(ids)
    assert "A & B" in "".join(root.itertext())
    assert root.get("role") == "img"


def test_every_marker_of_the_styles_has_a_shape():
    assert set(MARKERS) <= set(SHAPES)


def test_grey_levels_are_colours():
    assert hexadecimal("0.5") == "#808080"
    assert hexadecimal("0") == "#000000"
    assert hexadecimal("#0072B2") == "#0072B2"


def test_charts_need_no_matplotlib():
    code = (
        "import sys, numpy as np\n"
        "from ifrfit.report.page.blocks import Picture\n"
        "from ifrfit.report.page.registries import SECTIONS\n"
        "from ifrfit.report.page.sections.posterior import draw_corner\n"
        "from ifrfit.report.page.svg import inline\n"
        "draws = np.random.default_rng(0).standard_normal((2, 500))\n"
        "chart = draw_corner({'e_n': draws[0], 'mu': draws[1]}, {})\n"
        "assert inline(Picture('corner', 'Corner', '', chart)).startswith('<svg')\n"
        "print([name for name in sys.modules if name.partition('.')[0] in ('matplotlib', 'PIL')])\n"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "[]\n"


def test_a_label_stands_before_the_note_of_its_ticks():
    note = "10^-6 +0.14000"
    axis = Axis(0.0, 10.0, "label", ticks=Ticks((0.0, 5.0), ("0", "5"), note))
    chart = Chart(90.0, 60.0, (Panel(20.0, 5.0, 25.0, 40.0, axis, Y, ()),))
    texts = ET.fromstring(svg(chart, "own")).iter("text")
    places = {text.text: float(text.get("x")) for text in texts if text.get("x")}
    start = places[note] - width(note, 0.9 * TICK_LETTERS)
    assert places["label"] + 0.5 * width("label", LABEL_LETTERS) < start


def test_a_label_beside_long_labels_of_ticks_is_not_cut():
    axis = Axis(0.0, 10.0, "label", ticks=Ticks((0.0, 5.0), ("-0.400200", "-0.400100")))
    chart = Chart(90.0, 60.0, (Panel(15.0, 5.0, 60.0, 40.0, X, axis, ()),))
    (found,) = [text for text in ET.fromstring(svg(chart, "own")).iter("text") if text.text == "label"]
    across = float(found.get("x") or re.search(r"translate\(([-\d.]+)", found.get("transform"))[1])
    assert across >= 0.5 * LABEL_LETTERS
