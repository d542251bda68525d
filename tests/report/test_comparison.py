"""Text, HTML and figure of a comparison, by what they hold."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from comparison_data import FOUR, not_converged, observations
from factories import cut_off
from refusals import refused

from ifrfit import Noise
from ifrfit.errors import UsageError
from ifrfit.inference.comparison import compare
from ifrfit.report import write_folder
from ifrfit.report.comparison.figure import write_comparison
from ifrfit.report.comparison.text import findings

NASTY = "<b>&$ball$_1"


@pytest.fixture(scope="module")
def found():
    return compare(observations("ifr", sigma=0.05, e_t=-0.85), FOUR, fix={"e_n": 0.9}, noise="known")


@pytest.fixture(scope="module")
def stand_in():
    data = observations(
        "ifr",
        np.linspace(5, 80, 8),
        ("beta_cm", "spin_y_after"),
        sigma=0.05,
        e_t=-0.85,
        provenance="stand-in",
    )
    return compare(data, ("fr", "ifr"), loo=False, fix={"e_n": 0.9}, noise="scaled")


def test_numbers_of_the_table_are_those_of_the_comparison(found):
    row = next(x for x in found.summary().splitlines() if x.startswith("  FR "))
    fit = found.entries["fr"]
    for number in (f"{fit.log_evidence:.2f}", f"{fit.log_bayes_factor:.2f}", f"{fit.fit.fit.aic:.1f}"):
        assert number in row.split()
    assert "2 of 2" in row


def test_chi2_is_shown_only_where_it_says_something(found):
    data = observations("ifr", sigma=0.05, e_t=-0.85)
    unknown = compare(data, ("f", "ifr"), loo=False, fix={"e_n": 0.9}, noise="unknown").summary()
    assert " chi2 " in found.summary()
    assert " chi2 " not in unknown
    assert " AICc " in unknown
    assert " AICc " not in found.summary()


def test_there_are_criteria_where_the_likelihood_is_gaussian_alone(found):
    data = observations("ifr", sigma=0.05, e_t=-0.85)
    heavy = Noise("known", tails="student-t")
    text = compare(data, ("f", "ifr"), loo=False, fix={"e_n": 0.9}, noise=heavy).summary()
    assert " AIC " in found.summary()
    assert " AIC " not in text
    assert " nan " not in text


def test_a_p_that_is_none_is_said_to_be_small(found):
    of_f = found.entries["f"].fit
    fit = replace(of_f, fit=replace(of_f.fit, p_value=0.0))
    entries = {**found.entries, "f": replace(found.entries["f"], fit=fit)}
    (row,) = [
        line for line in replace(found, entries=entries).summary().splitlines() if line.startswith("  F  ")
    ][:1]
    assert "  < 1e-300  " in row


def _of_smooth_departure(found, name):
    fit = found.entries[name].fit
    fact = fit.facts["lack_of_fit"]
    other = replace(fact, figures={**fact.figures, "test": "smooth departure", "p": 0.5})
    changed = replace(found.entries[name], fit=replace(fit, facts={**fit.facts, "lack_of_fit": other}))
    return replace(found, entries={**found.entries, name: changed})


def test_another_test_than_chi2_is_named_where_the_best_has_it(found):
    best = found.ranked[0]
    words = "is of smooth departure, not of chi2, which is too large for sigma without a trend"
    changed = _of_smooth_departure(found, best)
    assert ("note", f"p of fit of {best.upper()} {words}") in findings(changed)
    assert changed.table().loc[best, "lack_of_fit_p"] == 0.5
    assert not any(says.startswith("p of fit") for _, says in findings(found))


def test_a_closure_that_misses_what_the_best_describes_is_judged_by_chi2(found):
    changed = _of_smooth_departure(found, "f")
    assert changed.table().loc["f", "lack_of_fit_p"] == found.entries["f"].fit.fit.p_value
    assert not any(says.startswith("p of fit") for _, says in findings(changed))


def test_what_did_not_converge_comes_first(found):
    broken = not_converged(found, "f")
    assert not broken.converged
    assert findings(broken)[0] == ("LOOK", "F: the quadrature reached 1e-2 only")
    assert ("ok", "the evidence of every closure converged") in findings(found)


def test_doubtful_cross_validation_is_said(found):
    entries = dict(found.entries)
    loo = replace(entries["fr"].loo, doubtful=("line 3", "line 9"))
    entries["fr"] = replace(entries["fr"], loo=loo)
    said = [says for kind, says in findings(replace(found, entries=entries)) if kind == "LOOK"]
    assert said == [
        "cross-validation of FR is not to be trusted: Pareto k over 0.7 in 2 impacts (line 3, ...)"
    ]


def test_html_escapes_what_comes_from_data(stand_in):
    nasty = replace(stand_in, notes=(NASTY,), verdict=replace(stand_in.verdict, says=NASTY))
    text = nasty._repr_html_()
    assert NASTY not in text
    assert "&lt;b&gt;&amp;" in text


def test_figure_holds_data_lines_residuals_and_factors(found):
    figure = found.plot()
    names = [entry.fit.problem.closure.title for entry in found.entries.values()]
    data, *strips, evidence = figure.axes
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(85.0)
    assert len(strips) == len(names) == len(FOUR)
    points = found.best.points
    assert any(
        np.allclose(line.get_xdata(), points["gamma_deg"]) for line in data.lines if line.get_marker() == "o"
    )
    for strip, (name, entry) in zip(strips, found.entries.items(), strict=True):
        (marks,) = [line for line in strip.lines if line.get_linestyle() == "None"]
        assert np.allclose(marks.get_ydata(), entry.fit.points["standardised"]), name
        assert "σ" in strip.get_ylabel()
    widths = sorted(bar.get_width() for bar in evidence.patches if bar.get_height() == pytest.approx(0.55))
    assert widths == pytest.approx(sorted(e.log_bayes_factor for e in found.entries.values()))
    assert data.get_ylabel().endswith("(–)")
    assert strips[-1].get_xlabel() == "incidence angle γ (deg)"
    assert "LOO difference" in evidence.get_xlabel()


def test_factors_beyond_all_measure_have_few_ticks(found):
    far = {**found.entries, "f": replace(found.entries["f"], log_bayes_factor=-2e10, loo=None)}
    labels = [text.get_text() for text in replace(found, entries=far).plot().axes[-1].get_xticklabels()]
    assert labels == ["\u22121e10", "\u22121e7", "\u221210\u2009000", "\u221210", "0"]


def test_figure_of_a_stand_in_says_so_everywhere(stand_in):
    figure = stand_in.plot()
    texts = [t.get_text() for axes in figure.axes for t in axes.texts]
    assert texts.count("STAND-IN") == 2  # both observables
    assert figure._suptitle.get_text().startswith("Not answerable")
    assert any("stand-in" in t.get_text() for t in figure.legends[0].get_texts())
    assert "LOO" not in figure.axes[-1].get_xlabel()


def test_nothing_of_the_figure_is_cut(found, stand_in):
    assert cut_off(found.plot()) == cut_off(stand_in.plot()) == []


def test_observables_without_an_angle_leave_the_factors(found):
    data = observations("ifr", np.zeros(6), ("e_n",), sigma=0.05, e_t=-0.85)
    figure = compare(data, ("f", "ifr"), loo=False, noise="known").plot()
    assert len(figure.axes) == 1


def test_folder_appears_whole_or_not_at_all(found, tmp_path, monkeypatch):
    out = tmp_path / "one"
    assert write_comparison(found, out, force=False) == ["compare.json", "compare.svg", "compare.png"]
    assert {path.name for path in out.iterdir()} == {"compare.json", "compare.svg", "compare.png"}
    with refused(UsageError, match="holds an earlier comparison; add --force"):
        write_comparison(found, out, force=False)
    monkeypatch.setattr(type(found), "plot", lambda self: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_comparison(found, tmp_path / "two", force=False)
    assert [path.name for path in tmp_path.iterdir()] == ["one"]


def test_a_fit_and_a_comparison_share_a_folder(found, tmp_path):
    write_comparison(found, tmp_path / "both", force=False)
    write_folder(found.best, None, tmp_path / "both", force=False)
    names = {path.name for path in (tmp_path / "both").iterdir()}
    assert names == {"compare.json", "compare.svg", "compare.png", "result.json"}


def test_open_slopes_are_said_in_words():
    data = observations("ifr", np.linspace(2, 18, 8), sigma=0.05, e_t=-0.85)
    found = compare(data, ("f", "ifr"), loo=False, fix={"e_n": 0.9}, noise="known")
    assert not found.psi_plane.sliding.determined
    assert "not determined" in found.summary()
    assert math.isinf(max(map(abs, found.psi_plane.sliding.interval95)))
