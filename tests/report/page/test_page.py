"""The page as a text: what it says, that it is sound HTML, and that it is the same on every run."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from factories import impacts_file, rest_long

import ifrfit
from ifrfit.inference.appraise import appraise
from ifrfit.inference.io.read_result import load_result
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.result.types import Fact
from ifrfit.report.page import assemble, page
from ifrfit.report.page.explorer import payload, reason_without_panel
from ifrfit.report.page.html import policy
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.page.sections.findings import SECTION as FINDINGS
from ifrfit.report.page.sections.repeat import from_points
from ifrfit.report.page.writing import verdict

EVERY = ("fixed", "loose", "hostile", "stand-in", "digitised", "lsq")


class Elements(HTMLParser):
    """Every element with its attributes, and the text outside scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        self._open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self._open.pop()

    def handle_endtag(self, tag):
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data):
        if not {"script", "style"} & set(self._open):
            self.words.append(data)

    def every(self, attribute: str) -> list[str]:
        return [attributes[attribute] for _, attributes in self.elements if attribute in attributes]

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def section(report, name):
    return next((section for section in report.sections if section.name == name), None)


def table_of(report, name):
    return next(block for block in section(report, name).blocks if block.kind == "table")


@pytest.mark.parametrize("name", EVERY)
def test_ids_are_unique_and_every_reference_leads_somewhere(pages, name):
    found = Elements(pages(name))
    counts = Counter(found.every("id"))
    assert [key for key, count in counts.items() if count > 1] == []
    for attribute in ("aria-labelledby", "aria-describedby", "for"):
        for value in found.every(attribute):
            assert set(value.split()) <= set(counts), (attribute, value)
    targets = [value[1:] for value in found.every("href") if value.startswith("#")]
    targets += re.findall(r"url\(#([^)]+)\)", pages(name))
    # the panel makes its own clip path when it draws
    assert set(targets) - set(counts) <= {"explorer-clip"}


@pytest.mark.parametrize("name", EVERY)
def test_nothing_is_loaded_and_nothing_is_styled_in_place(pages, name):
    found = Elements(pages(name))
    links = [*found.every("href"), *found.every("src")]
    assert [link for link in links if not link.startswith(("#", "data:"))] == []
    assert found.every("style") == []
    assert [key for _, attributes in found.elements for key in attributes if key.startswith("on")] == []
    assert len(pages(name).encode()) < 1_000_000


@pytest.mark.parametrize("name", EVERY)
def test_it_can_be_read_without_eyes(pages, name):
    found = Elements(pages(name))
    tags = Counter(tag for tag, _ in found.elements)
    assert found.elements[0] == ("html", {"lang": "en"})
    assert [tags[tag] for tag in ("h1", "main", "header", "footer", "nav")] == [1, 1, 1, 1, 1]
    for tag, attributes in found.elements:
        if tag == "th":
            assert attributes["scope"] in ("col", "row")
        if tag == "svg":
            assert attributes["role"] == "img"
            assert attributes["aria-labelledby"]
        if tag in ("input", "select"):
            assert attributes["id"] in found.every("for")


def test_the_policy_names_the_hashes_of_what_the_page_holds(pages):
    text = pages("fixed")
    stated = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    sheet = re.search(r"<style>(.*?)</style>", text, re.DOTALL)
    script = re.search(r"<script>(.*?)</script>", text, re.DOTALL)
    assert stated is not None
    assert stated[1].replace("&#39;", "'") == policy(sheet[1], script[1])
    digest = base64.b64encode(hashlib.sha256(script[1].encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy(sheet[1], script[1])
    assert "unsafe" not in stated[1]
    assert "script-src 'none'" in policy("", "")


def test_names_from_a_file_stay_text(pages, results):
    text = pages("hostile")
    for name in results("hostile").points["series"].unique():
        assert name not in text
        assert name in Elements(text).text
    assert text.count("<script>") == 1
    assert Counter(tag for tag, _ in Elements(text).elements)["script"] == 2


@pytest.mark.parametrize("name", rest_long(("fixed", "hostile", "digitised"), 2))
def test_the_same_bytes_again_and_from_the_file(results, appraisals, pages, tmp_path, name):
    results(name).save(tmp_path / "result.json")
    loaded = load_result(tmp_path / "result.json")
    known = appraisals(name) if name == "hostile" else appraise(loaded, closures=False)
    assert page(loaded, known) == pages(name)


def test_the_verdict_is_two_sentences(reports):
    found, against = reports("fixed").verdict
    assert found.startswith("24 impacts (beta) give e_t = -0.")
    assert found.endswith("; e_n = 0.94 was given to the fit.")
    assert against.startswith("Nothing found contradicts it: no lack of fit (p = ")
    report = reports("loose")
    assert "; they do not determine e_n (95 % in [0.00, 1.00]) and mu (95 % in [" in report.verdict[0]
    assert report.alarm
    assert "needs attention" in [badge.text for badge in report.badges]


def test_what_contradicts_the_fit_is_in_the_verdict(made):
    result = made.contradicted()
    report = assemble(result, appraise(result))
    assert report.verdict[1] == (
        "Against it stands: The data contradict a constant closure constant below 12 degrees (p = 2e-9): "
        "7 of 7 residuals positive; outliers."
    )
    assert report.alarm


def test_names_of_series_stay_as_they_are(tmp_path):
    gamma = np.linspace(3.0, 85.0, 12)
    parts = ({"gamma": gamma, "noise": 0.05, "c": -0.8, "series": name} for name in ("dry", "d. wet"))
    result = ifrfit.fit(impacts_file(tmp_path / "a.csv", *parts), fix={"e_n": 0.94}, method="lsq")
    words = " ".join(block.text for block in FINDINGS.build(ReportInput(result, None))[:-1])
    assert " dry: " in words
    assert " d. wet: " in words
    assert " Assumed: " in words


def test_a_limit_alone_is_a_bound(results):
    estimate = replace(
        results("fixed").constants["e_t"], value=None, status="one_sided", interval95=(-0.6, -0.4)
    )
    limited = replace(results("fixed"), constants={**results("fixed").constants, "e_t": estimate})
    assert "; they only bound e_t (95 % in [-0.600, -0.400]); " in verdict(limited)[0]


def test_strengths_of_effects_have_the_digits_of_their_sd(reports):
    for row in section(reports("digitised"), "effects").blocks[1].rows:
        value, sd = row[1:3]
        assert [len(text.partition(".")[2]) for text in (value, sd)] == [len(sd.partition(".")[2])] * 2, row


def test_a_stand_in_is_impossible_to_overlook(pages, reports):
    report = reports("stand-in")
    assert report.badges[0].text == "STAND-IN, not an experiment"
    assert report.verdict[0].startswith(
        "A fit to generated data, which shows that the tool works and is no finding: "
    )
    words = Elements(pages("stand-in")).text
    for start in ("Data, the fitted curve", "Standardised residuals", "The data: 17 rows", "The data used"):
        assert f"STAND-IN data, not an experiment. {start}" in words
    assert '"stand_in": true' in pages("stand-in")
    assert "STAND-IN" not in Elements(pages("digitised")).text


def test_the_table_of_constants_has_both_intervals_and_the_status(reports):
    table = table_of(reports("digitised"), "constants")
    rows = {row[0]: row for row in table.rows}
    assert table.head == ("constant", "value", "sd", "68 % interval", "95 % interval", "status")
    assert rows["e_t"][:3] == ("e_t", "-0.9990", "0.0011")
    assert rows["e_t"][3:5] == ("[-1.0000, -0.9985]", "[-1.0000, -0.9966]")
    assert rows["e_t"][5] == "one-sided: lies on its bound -1"
    assert rows["e_n"][-1] == "prior: rests on your prior of e_n"
    assert rows["transition angle, deg"][1:3] == ("24.71", "0.21")
    assert rows["noise"][-1] == "times the given sigma"


def test_the_points_inside_the_page_give_the_same_fit(results, tmp_path, monkeypatch, reports):
    monkeypatch.chdir(tmp_path)
    for name, choices in (
        ("digitised", {"prior": {"e_n": (0.98, 0.01)}, "noise": "scaled"}),
        ("hostile", {"fix": {"e_n": 0.94, "e_t": -0.8}, "separate": "mu", "noise": "known"}),
    ):
        report = reports(name)
        blocks = section(report, "repeat").blocks
        (tmp_path / "points.csv").write_text(
            next(block.content for block in blocks if block.kind == "download"), encoding="utf-8"
        )
        again = ifrfit.fit("points.csv", **choices)
        for label, estimate in results(name).flat_constants().items():
            found = again.flat_constants()[label]
            assert found.value == pytest.approx(estimate.value, rel=1e-9)
            assert found.interval95 == pytest.approx(estimate.interval95, rel=1e-9)
            assert found.status == estimate.status
        commands = [block.text for block in blocks if block.kind == "code"]
        assert commands[-1].startswith("ifrfit fit points.csv --closure ifr --method exact --noise ")


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (ErrorModel(), ""),
        (ErrorModel(dof=4.0), " --dof 4.0 --tails student-t"),
        (
            ErrorModel(angles="measured", population=(5.0, 80.0)),
            " --angle-errors measured --angle-population 5.0,80.0",
        ),
        (ErrorModel(offset=3.0), " --angle-offset 3.0"),
        (ErrorModel(velocity=0.005, spin=0.01), " --sigma-velocity 0.005 --sigma-spin 0.01"),
    ],
)
def test_the_line_that_repeats_the_fit_has_its_errors(results, model, words):
    fitted = results("fixed")
    changed = replace(fitted, noise=replace(fitted.noise, error_model=model))
    line = f"ifrfit fit a.csv --closure ifr --method exact --noise known{words} --fix e_n=0.94"
    assert from_points(changed, "a.csv") == line


def test_the_line_that_repeats_a_bootstrap_has_its_scheme(results):
    drawn = Fact(True, "all have an answer", {"scheme": "wild", "replicates": 250}, "")
    changed = replace(results("fixed"), method="bootstrap", facts={"converged": drawn})
    assert " --method bootstrap --noise known --resample wild --replicates 250 " in from_points(
        changed, "a.csv"
    )


def test_the_result_inside_the_page_is_result_json(results, reports):
    downloads = [b for b in section(reports("fixed"), "repeat").blocks if b.kind == "download"]
    assert [download.name for download in downloads] == ["points.csv", "result.json"]
    assert json.loads(downloads[1].content) == results("fixed").to_dict()


def test_a_file_of_an_earlier_version_says_what_it_lacks(results):
    content = results("fixed").to_dict()
    del content["asked"]
    result = ifrfit.inference.io.read_result.from_dict(content)
    report = assemble(result, appraise(result))
    said = "The result does not say with which bounds and priors it was fitted. Fit the data again."
    assert section(report, "profiles").blocks[0].text == said
    assert section(report, "constants").blocks[-1].text == f"Other methods are not shown here. {said}"
    assert [block.kind for block in section(report, "identifiability").blocks] == ["paragraph"]
    commands = [block for block in section(report, "repeat").blocks if block.kind == "code"]
    assert all("points.csv" not in block.text for block in commands)


def test_a_result_without_points_has_a_report_all_the_same(results):
    result = replace(results("fixed"), points=results("fixed").points.iloc[:0], problem=None)
    report = assemble(result, appraise(result))
    assert section(report, "residuals") is None
    assert section(report, "fit").blocks[0].text.startswith("The result holds no points")
    assert "The result holds no points" in section(report, "profiles").blocks[0].text


def test_chains_are_shown_only_where_a_sampler_ran(results, reports, appraisals):
    result = results("fixed")
    assert section(reports("fixed"), "chains") is None
    figures = {"steps": 4000, "each": {"e_t": {"rhat": 1.002, "ess_bulk": 2300.0}, "mu": {"rhat": 1.001}}}
    sampled = replace(
        result,
        method="mcmc",
        facts={**result.facts, "converged": Fact(True, "the chains converged", figures, "R-hat < 1.01")},
    )
    blocks = section(assemble(sampled, appraisals("fixed")), "chains").blocks
    assert blocks[1].head == ("quantity", "R-hat", "bulk ESS")
    assert blocks[1].rows == (("e_t", "1.002", "2300"), ("mu", "1.001", "-"))
    assert blocks[2].rows == (("steps", "4000"),)


def test_the_panel_says_that_angles_hold_the_fitted_offset(results):
    fitted = results("fixed")
    offset = replace(fitted, noise=replace(fitted.noise, angle_offset=fitted.constants["mu"]))
    assert payload(fitted)["across"] == "incidence angle γ (deg)"
    assert payload(offset)["across"] == "incidence angle γ (deg), fitted offset added"


def test_the_axis_of_the_panel_holds_the_fitted_curve(results):
    fitted = results("fixed")
    near = replace(fitted, points=fitted.points[fitted.points["gamma_deg"] > 40.0])
    low, high = payload(near)["observables"][0]["limits"]
    curve = fitted.predict(np.array([6.0, 84.0]), observable="beta", bands=False)["value"]
    assert low < curve.min()
    assert high > curve.max()


def test_a_closure_that_is_no_pair_of_lines_has_no_panel(made):
    assert "maw" not in payload(made.fine())["closures"]
    says = reason_without_panel(replace(made.fine(), closure="maw"))
    assert says == "The panel knows no closure maw: the picture above stands alone."


def test_every_way_of_result_has_a_page(made):
    for name in ("two_observables", "all_sticking", "restitution"):
        result = getattr(made, name)()
        text = page(result, appraise(result, closures=False))
        counts = Counter(Elements(text).every("id"))
        assert max(counts.values()) == 1, name


@pytest.mark.parametrize("n", [600, pytest.param(2000, marks=pytest.mark.long)])
def test_many_rows_stay_in_a_page_that_can_be_sent(impacts, n):
    path = impacts(gamma=np.linspace(3.0, 86.0, n), noise=0.05)
    result = ifrfit.fit(path, fix={"e_n": 0.94}, method="lsq")
    text = page(result, appraise(result))
    assert text.count("<image") >= 2  # points and residuals of the fit are pixels
    assert len(text.encode()) < 2_000_000
