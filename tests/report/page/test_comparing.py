"""The closures in a report: compared by the question of its result, or a sentence why not."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.appraise import appraise
from ifrfit.inference.comparison import compare
from ifrfit.inference.comparison.compare import compare_result
from ifrfit.inference.comparison.result import Loo
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.physics import CLOSURES
from ifrfit.report.comparison.figure import strip_labels
from ifrfit.report.page import assemble
from ifrfit.report.page.charts.chart import Bars, Box, Points, Words
from ifrfit.report.page.charts.typesetting import width
from ifrfit.report.page.sections.closures import LONGEST, _entries, draw_closures, evidence_text
from ifrfit.report.page.svg import inline
from ifrfit.report.style import series_styles


@pytest.fixture
def appraisal(compared):
    return compared


def test_it_is_the_comparison_of_the_same_data_and_choices(results, appraisal):
    found = appraisal.comparison
    assert appraisal.without_comparison == ""
    assert set(found.entries) == set(CLOSURES)
    whole = compare(results("fixed").problem.observations, loo=False, fix={"e_n": 0.94})
    for name, entry in found.entries.items():
        # one is right to 1e-2, the other to 1e-4
        assert entry.log_evidence == pytest.approx(whole.entries[name].log_evidence, abs=1.01e-2)
        assert ("outliers" in entry.fit.facts) == (name == "ifr")
    # the fit itself stands for its closure
    assert found.entries["ifr"].log_evidence == results("fixed").fit.log_evidence
    assert found.verdict.kind == whole.verdict.kind


def test_a_result_from_a_file_is_compared_alike(results, appraisal, tmp_path):
    results("fixed").save(tmp_path / "result.json")
    found = compare_result(ifrfit.load_result(tmp_path / "result.json"))
    for name, entry in found.entries.items():
        # of its own closure the fit had the finer one
        exactly = 1.01e-2 if name == "ifr" else 1e-9
        of_fit = appraisal.comparison.entries[name].log_evidence
        assert entry.log_evidence == pytest.approx(of_fit, abs=exactly)


def test_constants_of_each_series_are_compared_with_constants_of_each_series(results):
    found = compare_result(results("hostile"))
    assert {entry.fit.problem.parameters["mu"].separate for entry in found.entries.values()} == {True}


@pytest.mark.parametrize("case", ["rows", "curved", "angles", "early"])
def test_what_would_take_long_or_cannot_be_done_is_said(results, case):
    result = results("fixed")
    if case == "rows":
        result = replace(result, points=result.points.loc[result.points.index.repeat(100)])
        says = "2400 rows and 2 free constants take long: ifrfit compare puts the closures side by side"
    elif case == "curved":
        points = result.points.loc[result.points.index.repeat(4)].assign(observable="delta_deg")
        result = replace(result, points=points)
        says = f"{len(points)} rebound angles or total restitutions take long: ifrfit compare"
    elif case == "angles":
        error_model = ErrorModel(angles="set", gamma=1.0)
        result = replace(result, noise=replace(result.noise, policy="scaled", error_model=error_model))
        says = "Such a scatter with a noise that is not known takes long: ifrfit compare"
    else:
        result = replace(result, problem=None, asked=())
        says = "They cannot be compared here. The result does not say with which bounds"
    found = appraise(result)
    assert found.comparison is None
    assert found.without_comparison.startswith(says)
    report = assemble(result, found)
    (own,) = [part for part in report.sections if part.name == "closures"]
    assert own.blocks[0].text == f"{found.without_comparison.rstrip('.')}."


def test_the_table_is_that_of_the_terminal(results, appraisal):
    found = appraisal.comparison
    (own,) = [part for part in assemble(results("fixed"), appraisal).sections if part.name == "closures"]
    words, table, pictures, _ = own.blocks
    assert words.text.rstrip(".") == found.verdict.says.rstrip(".")
    lines = [re.split(r"\s{2,}", line.strip()) for line in found.summary().splitlines()]
    assert list(table.head) in lines
    assert [list(row) in lines for row in table.rows] == [True] * len(CLOSURES)
    chart = pictures.items[0].figure
    assert len(chart.panels) == 1 + len(CLOSURES) + 1
    for name, strip in zip(found.entries, chart.panels[1:-1], strict=True):
        (points,) = (mark for mark in strip.marks if isinstance(mark, Points))
        expected = found.entries[name].fit.points["standardised"].to_numpy(dtype=float)
        assert points.y == pytest.approx(expected)
    bars = [mark.x[0] for mark in chart.panels[-1].marks if isinstance(mark, Box)][1:]
    assert bars == [found.entries[name].log_bayes_factor for name in found.ranked]


def test_every_bar_says_its_number_and_stands_clear_of_it(appraisal):
    found = appraisal.comparison
    chart = draw_closures(found)
    panel = chart.panels[-1]
    written = [mark for mark in panel.marks if isinstance(mark, Words)]
    assert [words.text for words in written] == [
        evidence_text(found.entries[name].log_bayes_factor) for name in found.ranked
    ]
    assert evidence_text(0.0) == "best"
    assert (evidence_text(-1.26), evidence_text(-123.4)) == ("−1.3", "−123")
    low, high = panel.x.scale.position(np.array([panel.x.low, panel.x.high]))
    for words, name in zip(written, found.ranked, strict=True):
        assert words.x < min(0.0, found.entries[name].log_bayes_factor)
        place = (panel.x.scale.position(np.array([words.x]))[0] - low) / (high - low) * panel.width
        # millimetres from the frame, of a text that ends there
        assert place > width(words.text, words.size) * 25.4 / 72.0


def test_cross_validation_is_drawn_beside_the_evidence(appraisal):
    found = appraisal.comparison
    loo = Loo(10.0, 1.0, 2.0, -3.0, 1.5, 100, 0.5, (), (), ("1",), np.zeros(1), np.zeros(1))
    first = found.ranked[1]
    entries = {**found.entries, first: replace(found.entries[first], loo=loo)}
    panel = draw_closures(replace(found, entries=entries)).panels[-1]
    (point,) = (mark for mark in panel.marks if isinstance(mark, Points))
    (bar,) = (mark for mark in panel.marks if isinstance(mark, Bars))
    assert (point.x.tolist(), point.y.tolist()) == ([-3.0], [1.0])
    assert (bar.at.tolist(), bar.low.tolist(), bar.high.tolist()) == ([1.0], [-4.5], [-1.5])
    assert "LOO" in panel.x.label
    assert "LOO" not in draw_closures(found).panels[-1].x.label


def test_without_a_comparison_and_without_a_reason_there_is_no_section(reports):
    assert "closures" not in [part.name for part in reports("fixed").sections]


def test_the_picture_leaves_the_verdict_to_the_words_above_it(results, appraisal):
    (own,) = [part for part in assemble(results("fixed"), appraisal).sections if part.name == "closures"]
    drawn = inline(own.blocks[2].items[0]).split("</desc>")[1]
    assert appraisal.comparison.verdict.says not in drawn
    assert own.blocks[2].caption.endswith(
        "Bayes factors against the best: a closure at -5 is 148 times less probable than the best."
    )
    assert appraisal.comparison.plot().get_suptitle().replace("\n", " ") == appraisal.comparison.verdict.says


def test_the_legend_of_a_long_name_has_room_and_its_provenance(appraisal):
    found, name = appraisal.comparison, "m" * 80
    entries = {
        closure: replace(entry, fit=replace(entry.fit, points=entry.fit.points.assign(series=name)))
        for closure, entry in found.entries.items()
    }
    entry = _entries(replace(found, entries=entries), series_styles(list(entries)), ["beta"])[-1]
    assert entry.label == f"{'m' * (LONGEST - 1)}… (provenance not stated)"


@pytest.mark.parametrize(("tick", "label"), [(2.0, "2"), (60.0, "60"), (2e4, "2e4")])
def test_labels_of_a_strip_are_short(tick, label):
    assert strip_labels(tick) == (f"−{label}", label)
