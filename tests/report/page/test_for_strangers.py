"""What a page tells readers who have not seen the symbols before, and what they can paste from it."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.result.types import Fact
from ifrfit.physics import CLOSURES
from ifrfit.report.page.charts.chart import Line, Points, Words
from ifrfit.report.page.markdown import markdown_files
from ifrfit.report.page.references import bibtex, entries
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.page.sections.guide import closure_definition, linear_latex
from ifrfit.report.page.sections.impact_drawing import CENTRE, INCIDENCE, REBOUND, draw_impact
from ifrfit.report.page.sections.methods import methods_text
from ifrfit.report.page.sections.residuals import build
from ifrfit.report.tables import csv_text, latex


def section(report, name):
    return next(section for section in report.sections if section.name == name)


def blocks_of(report, name, kind):
    return [block for block in section(report, name).blocks if block.kind == kind]


def test_every_constant_of_the_table_is_defined(reports):
    (found,) = blocks_of(reports("fixed"), "guide", "definitions")
    assert {r"\gamma", "U_t", "e_n", r"\beta", r"\mu", r"\kappa", "e_t", "k"} == {
        each.symbol for each in found.items
    }
    formulas = {each.symbol: each.formula for each in found.items}
    assert formulas[r"\kappa"] == r"\kappa = \mu (1 + e_n)"
    assert formulas["k"] == r"k = 0.2857 (1 + e_t) + \min(0.4, \kappa U_n/|U_t|)"
    # theory: beta = e_t + 1 + J in sticking
    assert formulas["e_t"] == r"\beta = 1.4 + e_t\,\text{in sticking}"
    words = {each.symbol: each.words for each in found.items}
    assert words["k"].startswith("closure IFR (independent friction and restitution): ")
    assert "-1 to -0.4" in words["e_t"]


@pytest.mark.parametrize("name", list(CLOSURES))
def test_the_formula_of_a_closure_gives_its_impulse(name):
    """What is written is what is computed: the formula, evaluated as it stands, against the law."""
    closure = CLOSURES[name]
    found = closure_definition(closure, 0.4)
    if not closure.bilinear:
        assert found.formula == ""
        assert closure.source.partition(" (")[0] in found.words
        return
    constant = "" if closure.own is None else closure.own.latex
    code = found.formula.partition("= ")[2].replace(r"\min", "min").replace(r"\kappa U_n/|U_t|", "ratio")
    code = re.sub(r"([\d.]+) \(", r"\1*(", code)
    if constant:
        code = code.replace(constant, "c")
        code = re.sub(r"([\d.]+) c", r"\1*c", code)
    law = closure.law(0.4)
    for c in (-0.9, -0.5) if constant else (0.0,):
        for ratio in (0.01, 0.2, 3.0):
            a, b = law.a0 + law.a1 * c, law.b0 + law.b1 * c
            value = eval(code, {"min": min, "ratio": ratio, "c": c})
            assert value == pytest.approx(a + min(b, ratio), abs=2e-4), (code, c, ratio)


def test_lines_are_written_short():
    assert linear_latex(0.4, 0.0, "c") == "0.4"
    assert linear_latex(0.25, 0.25, "c") == "0.25 (1 + c)"
    assert linear_latex(0.0, -0.5, "c") == "-0.5 c"
    assert linear_latex(1.0, -0.5, "c") == "1 - 0.5 c"
    assert linear_latex(1.0, 1.0, "c") == "1 + c"
    assert linear_latex(1e-17, 1.0, "c") == "c"


def test_the_drawing_shows_the_angles_it_names():
    (panel,) = draw_impact().panels
    # one scale for both axes, or angles would not be angles
    assert panel.width / (panel.x.high - panel.x.low) == pytest.approx(
        panel.height / (panel.y.high - panel.y.low)
    )
    arrows = [m for m in panel.marks if isinstance(m, Line) and m.x.size == 2 and m.width == 1.8]
    before, after = arrows[0], next(m for m in arrows if (m.x[0], m.y[0]) == tuple(CENTRE) and m.x[1] > 0)
    for line, end, angle in ((before, 0, INCIDENCE), (after, 1, REBOUND)):
        across, up = abs(line.x[end] - CENTRE[0]), line.y[end] - CENTRE[1]
        assert math.degrees(math.atan2(across, up)) == pytest.approx(angle)
    (contact,) = (m for m in panel.marks if isinstance(m, Points))
    assert (contact.x[0], contact.y[0]) == (0.0, 0.0)
    words = {m.text for m in panel.marks if isinstance(m, Words)}
    assert {"$u$", "$v$", r"$\gamma$", r"$\omega$", "$U_t$", "$V_t$", "contact point", "normal"} <= words


def test_methods_say_what_was_done(results):
    assert methods_text(results("fixed")) == (
        "The data are 24 impacts of beta from impacts.csv (provenance not stated). The model is closure IFR "
        "(independent friction and restitution) with inertia factor 0.4 (solid sphere). Standard "
        "uncertainties of the values were taken as the data give them, with independent Gaussian errors. "
        "Fixed: e_n = 0.94. Priors: e_t uniform from -1 to -0.4; mu uniform from 0 to 2. Constants were "
        f"estimated by the posterior distribution, integrated numerically, with ifrfit {ifrfit.__version__} "
        "(seed 0). Given are medians with standard deviations and credible intervals of 95 %."
    )
    digitised = methods_text(results("digitised"))
    assert "e_n normal with mean 0.98 and standard deviation 0.01, cut to 0 to 1" in digitised
    assert "times a factor that was estimated, too" in digitised
    assert "kharaz-2001 (digitised)" in digitised
    assert "Selection: " in digitised
    assert methods_text(results("stand-in")).startswith("STAND-IN data, not an experiment. ")
    hostile = methods_text(results("hostile"))
    assert "Each series has its own mu." in hostile
    lsq = methods_text(results("lsq"))
    assert "Bounds: e_t from -1 to -0.4; mu from 0 to no end." in lsq
    assert "by least squares, with" in lsq
    assert "Given are the best values with standard deviations and confidence intervals of 95 %." in lsq


def test_methods_name_the_scheme_of_a_bootstrap(results):
    drawn = Fact(True, "all have an answer", {"scheme": "wild", "replicates": 2500}, "")
    changed = replace(results("lsq"), method="bootstrap", facts={"converged": drawn}, seed=7)
    assert "by a wild bootstrap of 2,500 replicates, with ifrfit" in methods_text(changed)
    assert "(seed 7)" in methods_text(changed)


def test_every_closure_has_an_entry_for_what_it_cites():
    cited = {key for closure in CLOSURES.values() for key in closure.references}
    assert cited == set(entries())
    for text in entries().values():
        assert text.count("{") == text.count("}")
        assert {"author", "title", "year"} <= set(re.findall(r"^  (\w+) = ", text, re.MULTILINE))


def test_bibtex_has_the_model_the_data_and_the_software(results):
    found = re.findall(r"^@\w+\{([^,]+),", bibtex(results("digitised")), re.MULTILINE)
    assert found == ["domenech2023", "data-kharaz-2001", "ifrfit"]
    assert re.findall(r"^@\w+\{([^,]+),", bibtex(results("fixed")), re.MULTILINE) == [
        "domenech2023",
        "ifrfit",
    ]
    assert f"version {ifrfit.__version__}" in bibtex(results("fixed"))


def test_the_table_can_be_saved_with_all_digits(results, reports):
    downloads = {b.name: b.content for b in blocks_of(reports("hostile"), "constants", "download")}
    assert list(downloads) == ["constants.csv", "constants.tex"]
    assert downloads["constants.tex"] == latex(results("hostile"))
    rows = list(csv.DictReader(io.StringIO(downloads["constants.csv"])))
    assert downloads["constants.csv"] == csv_text(results("hostile"))
    flat = results("hostile").flat_constants()
    for row in rows[:4]:
        name = f"{row['constant']}[{row['series']}]" if row["series"] else row["constant"]
        estimate = flat[name]
        assert float(row["value"]) == estimate.value
        if estimate.status != "fixed":
            ends = (float(row["low95"]), float(row["high95"]))
            assert ends == estimate.interval95
            assert float(row["sd"]) == estimate.stderr
    loose = {row["constant"]: row for row in csv.DictReader(io.StringIO(csv_text(results("loose"))))}
    assert loose["mu"]["value"] == ""


def test_a_transition_says_at_which_spin_it_is(reports, results):
    rows = {row[0]: row for row in section(reports("hostile"), "constants").blocks[0].rows}
    names = list(results("hostile").points["series"].unique())
    first, second = (rows[f"transition angle, deg [{name}]"][-1] for name in names)
    assert first == "determined; without spin"
    assert second == "determined; at R omega_y/u = -0.3"
    # in sentences where there is one
    words = " ".join(block.text for block in blocks_of(reports("hostile"), "findings", "paragraph"))
    assert words.count("degrees at R omega_y/u = -0.3") == 1


def test_markdown_has_formulas_and_the_entries_line_by_line(reports):
    text = markdown_files(reports("fixed"), "r")["r.md"].decode()
    assert r"- $\kappa$: what the tangential motion sees of friction $\kappa = \mu (1 + e_n)$" in text
    assert "\n    @misc{domenech2023,\n      author = " in text
    assert "![An impact](r-figures/impact.svg)" in text


def test_residuals_are_drawn_against_speed_where_speeds_differ():
    result = ifrfit.fit("cornell-glass", method="lsq")
    pictures = build(ReportInput(result, None))[0].items
    found = {picture.name: picture.figure for picture in pictures}
    (panel,) = found["residuals-speed"].panels
    drawn = np.concatenate([m.x for m in panel.marks if isinstance(m, Points) and m.fill != "none"])
    assert sorted(drawn) == pytest.approx(sorted(result.points["speed_m_s"]))
    one = ifrfit.fit("kharaz-2001", method="lsq")
    assert "residuals-speed" not in {picture.name for picture in build(ReportInput(one, None))[0].items}


def test_a_file_that_is_far_too_long_is_not_written_to_find_that_out(results, monkeypatch):
    from ifrfit.report.page.sections import repeat

    lengths = []

    def counted(result):
        lengths.append(len(result.points))
        return repeat.points_csv(result)

    short = results("fixed")
    many = replace(short, points=short.points.loc[short.points.index.repeat(5000)])
    assert len(repeat.points_csv(many)) > repeat.MOST_INSIDE
    assert repeat._is_too_long(many, counted)
    assert lengths == [repeat.MOST_SHOWN]
    assert not repeat._is_too_long(short, counted)
