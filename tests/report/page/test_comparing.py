"""The closures in a report: compared by the question of its result, or a sentence why not."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import ifrfit
from ifrfit.inference.comparison import compare
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.physics import CLOSURES
from ifrfit.report.page import assemble
from ifrfit.report.page.closure_comparison import compared


@pytest.fixture(scope="module")
def asked(results):
    return compared(results("fixed"))


def test_it_is_the_comparison_of_the_same_data_and_choices(results, asked):
    found, missing = asked
    assert missing == ""
    assert set(found.entries) == set(CLOSURES)
    whole = compare(results("fixed").problem.observations, loo=False, fix={"e_n": 0.94})
    for name, entry in found.entries.items():
        # one is right to 1e-2, the other to 1e-4
        assert entry.log_evidence == pytest.approx(whole.entries[name].log_evidence, abs=1.01e-2)
        assert "outliers" not in entry.fit.facts
    assert found.verdict.kind == whole.verdict.kind


def test_a_result_from_a_file_is_compared_alike(results, asked, tmp_path):
    results("fixed").save(tmp_path / "result.json")
    found, _ = compared(ifrfit.load_result(tmp_path / "result.json"))
    for name, entry in found.entries.items():
        assert entry.log_evidence == pytest.approx(asked[0].entries[name].log_evidence, abs=1e-9)


def test_constants_of_each_series_are_compared_with_constants_of_each_series(results):
    found, _ = compared(results("hostile"))
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
    found, missing = compared(result)
    assert found is None
    assert missing.startswith(says)
    report = assemble(result, without_comparison=missing)
    (own,) = [part for part in report.sections if part.name == "closures"]
    assert own.blocks[0].text == f"{missing.rstrip('.')}."


def test_the_table_is_that_of_the_terminal(results, asked):
    found, _ = asked
    (own,) = [part for part in assemble(results("fixed"), found).sections if part.name == "closures"]
    words, table, pictures, _ = own.blocks
    assert words.text.rstrip(".") == found.verdict.says.rstrip(".")
    lines = [re.split(r"\s{2,}", line.strip()) for line in found.summary().splitlines()]
    assert list(table.head) in lines
    assert [list(row) in lines for row in table.rows] == [True] * len(CLOSURES)
    assert len(pictures.items[0].figure.axes) > len(CLOSURES)


def test_without_a_comparison_and_without_a_reason_there_is_no_section(results):
    assert "closures" not in [part.name for part in assemble(results("fixed")).sections]


def test_the_picture_leaves_the_verdict_to_the_words_above_it(results, asked):
    (own,) = [part for part in assemble(results("fixed"), asked[0]).sections if part.name == "closures"]
    assert own.blocks[2].items[0].figure.get_suptitle() == ""
    assert own.blocks[2].caption.endswith("Bayes factors against the best.")
    assert asked[0].plot().get_suptitle().replace("\n", " ") == asked[0].verdict.says
