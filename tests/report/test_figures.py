from __future__ import annotations

import functools
import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import built_results
import matplotlib as mpl
import numpy as np
import pytest
from factories import cut_off, texts_of

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.result.types import Fact
from ifrfit.report import figures, plot
from ifrfit.report.panels import axis_label, is_outlier, outlier_limit
from ifrfit.report.regimes import regime_key, spans
from ifrfit.report.style import save_figure, series_styles


def panels_of(figure):
    """Axes with data, in pairs of values and residuals."""
    shown = [axes for axes in figure.axes if axes.axison]
    return list(zip(shown[::2], shown[1::2], strict=True))


CASES = ("fine", "stand_in", "two_observables", "all_sticking", "separate", "contradicted", "restitution")


@functools.cache
def drawn(name):
    """A case of built_results.py and its figure, for tests that only look at it."""
    result = getattr(built_results, name)()
    return result, plot(result)


@pytest.mark.parametrize("name", CASES)
def test_every_case_draws_at_column_width_with_units_on_every_axis(name):
    result, figure = drawn(name)
    observables = result.points["observable"].unique()
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(85.0 * min(len(observables), 3))
    pairs = panels_of(figure)
    assert len(pairs) == len(observables)
    for (data, residuals), observable in zip(pairs, observables, strict=True):
        assert data.get_ylabel().endswith("(deg)" if observable.endswith("_deg") else "(–)")
        assert residuals.get_ylabel() == "residual (σ)"
        assert residuals.get_xlabel() == (
            "measurement (number, in order)" if observable == "e_n" else "incidence angle γ (deg)"
        )


@pytest.mark.parametrize("name", CASES)
def test_nothing_is_cut_or_covers_another(name):
    _, figure = drawn(name)
    assert cut_off(figure) == []
    renderer = figure.canvas.get_renderer()
    top = figure.legends[0].get_window_extent(renderer).y1
    for axes in figure.axes:
        inner = axes.get_window_extent(renderer)
        assert inner.y0 > top, "the legend covers data"
        assert inner.height > (60 if axes.axison else 5)


def test_curve_holds_the_kink_and_both_regimes():
    result, figure = drawn("fine")
    (data, _), *_ = panels_of(figure)
    curve = max(data.lines, key=lambda line: len(line.get_xdata()))
    x = curve.get_xdata()
    angle = result.derived["transition_angle_deg"]["run 1"].value
    assert angle in x
    assert x.min() < 1.0
    assert x.max() > 89.0


def test_the_curve_of_a_fit_runs_through_its_fitted_values(impacts):
    path = impacts(gamma=np.linspace(3.0, 82.0, 34), noise=0.05)
    result = ifrfit.fit(path, fix={"e_n": 0.94})
    (data, _), *_ = panels_of(plot(result))
    curve = next(line for line in data.lines if len(line.get_xdata()) > 100)
    drawn = np.interp(result.points["gamma_deg"], curve.get_xdata(), curve.get_ydata())
    assert drawn == pytest.approx(result.points["fitted"].to_numpy(), abs=1e-3)


def test_all_data_are_inside_the_limits():
    for name in CASES:
        result, figure = drawn(name)
        for (data, residuals), observable in zip(
            panels_of(figure), result.points["observable"].unique(), strict=True
        ):
            rows = result.points[result.points["observable"] == observable]
            low, high = data.get_ylim()
            assert low < rows["value"].min()
            assert rows["value"].max() < high
            assert residuals.get_ylim()[1] > rows["standardised"].abs().max()


def test_sticking_is_open_and_sliding_filled():
    _, figure = drawn("fine")
    (data, _), *_ = panels_of(figure)
    marks = {
        line.get_markerfacecolor(): len(line.get_xdata()) for line in data.lines if line.get_marker() == "o"
    }
    assert marks == {"white": 12, "#0072B2": 22}


def test_an_outlier_is_ringed_and_nothing_else():
    _, figure = drawn("contradicted")
    (data, residuals), *_ = panels_of(figure)
    for axes in (data, residuals):
        rings = [line for line in axes.lines if line.get_markerfacecolor() == "none"]
        assert [len(ring.get_xdata()) for ring in rings] == [1]
    assert "ringed: outlier" in texts_of(figure)
    assert "ringed: outlier" not in texts_of(drawn("fine")[1])


def test_the_rows_that_the_fit_names_are_ringed_whatever_their_residuals(made):
    result = made.fine()
    points = result.points
    row = points.iloc[3]
    name = f"{row['source']} line {row['row']} ({row['observable']})"
    fact = Fact(False, "", {"rows": [name], "limit": 3.6}, "")
    marked = is_outlier(replace(result, facts={"outliers": fact}), points)
    assert list(np.flatnonzero(marked)) == list(np.flatnonzero(points["row"] == row["row"]))
    assert abs(row["standardised"]) < 3.6
    none = Fact(True, "Too few rows.", {"rows": [], "limit": None}, "")
    loud = made.contradicted()
    assert not is_outlier(replace(loud, facts={"outliers": none}), loud.points).any()


def test_rows_are_ringed_by_bonferroni_at_one_percent_where_the_fit_does_not_judge(made):
    result = replace(made.contradicted(), facts={})
    assert 34 * math.erfc(outlier_limit(result) / math.sqrt(2.0)) == pytest.approx(0.01)
    assert list(np.flatnonzero(is_outlier(result, result.points))) == [20]


def test_provenance_is_in_the_legend(made):
    assert "run 1 (measured)" in texts_of(drawn("fine")[1])
    unsaid = made.build((made.Run("run 1", provenance=""),))
    assert "run 1 (provenance not stated)" in texts_of(plot(unsaid))


def test_a_stand_in_is_written_across_the_picture():
    _, figure = drawn("stand_in")
    (data, _), *_ = panels_of(figure)
    mark = next(text for text in data.texts if text.get_text() == "STAND-IN")
    assert mark.get_fontsize() >= 24
    assert figure._suptitle.get_text().startswith("STAND-IN DATA")
    assert not any("STAND-IN" in text for text in texts_of(drawn("fine")[1]))


def test_series_differ_by_marker_and_line_not_only_by_colour():
    given = series_styles([f"run {i}" for i in range(7)])
    assert len({look.marker for look in given.values()}) == 7
    assert (
        len({(look.marker, str(look.line)) for look in series_styles([str(i) for i in range(40)]).values()})
        == 40
    )


def test_transitions_that_differ_are_shown_series_by_series():
    _, figure = drawn("stand_in")
    strips = [axes for axes in figure.axes if not axes.axison]
    assert len(strips) == 1
    assert [text.get_text() for text in strips[0].texts] == [
        "sticking",
        "sliding",
        "sticking",
        "sliding",
        "sliding",
    ]


def test_an_open_transition_is_said_in_words():
    assert "transition not determined: > 30 degrees (95 %)" in texts_of(drawn("all_sticking")[1])


def test_regimes_take_turns_below_the_last_transition():
    one, two = (30.0, 29.0, 31.0), (50.0, 49.0, 51.0)
    assert spans((one,)) == [(0.0, 30.0, "sticking"), (30.0, 90.0, "sliding")]
    assert [regime for _, _, regime in spans((one, two))] == ["sliding", "sticking", "sliding"]
    assert spans("sliding") == [(0.0, 90.0, "sliding")]


def test_regimes_without_a_transition_follow_the_points(made):
    result = made.build((made.Run("fast", spin_y=0.833),))
    assert regime_key(result, "fast") == "sliding"
    points = result.points
    points["sticking"] = True
    assert regime_key(replace(result, points=points), "fast") == "sticking"
    points.loc[0, "sticking"] = False
    assert regime_key(replace(result, points=points), "fast") is None


@pytest.mark.parametrize("count", [1, 2, 500])
def test_any_number_of_points(made, count):
    figure = plot(made.build((made.Run("run 1", count),)))
    low, high = panels_of(figure)[0][0].get_ylim()
    assert high - low > 0.5, "the curve has room whatever the number of points"


def test_five_observables_wrap_and_a_label_with_signs_stays_a_label(made):
    runs = (made.Run("_$run"), made.Run("b", 20, 0.3, 0.2))
    figure = plot(made.build(runs, ("beta", "beta_cm", "mu_app", "delta_deg", "tan_psi_out")))
    assert len(panels_of(figure)) == 5
    assert r" _\$run (measured)" in texts_of(figure)
    figure.draw_without_rendering()


def test_long_meanings_are_wrapped():
    assert max(map(len, axis_label("tan_psi_out").split("\n"))) <= 40


def test_two_runs_give_the_same_bytes_and_text_stays_text(made, tmp_path):
    for run in ("a", "b"):
        figure = plot(made.stand_in())
        for suffix in (".svg", ".png"):
            save_figure(figure, tmp_path / f"{run}{suffix}")
    for suffix in (".svg", ".png"):
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
    svg = ET.parse(tmp_path / "a.svg")
    words = {node.text for node in svg.iter("{http://www.w3.org/2000/svg}text")}
    assert {"STAND-IN", "no spin (stand-in)", "residual (σ)"} <= words
    assert "<dc:date>" not in (tmp_path / "a.svg").read_text(encoding="utf-8")


# fits and draws without the page, whose sameness test_page.py looks after


def test_the_layout_is_settled_to_six_digits(made):
    figure = plot(made.two_observables())
    before = [axes.get_position().bounds for axes in figure.axes]
    assert all(x == round(x, 6) for bounds in before for x in bounds[:2])
    figure.draw_without_rendering()
    assert [axes.get_position().bounds for axes in figure.axes] == before


def test_a_refuted_fit_says_so_in_the_picture(made):
    assert plot(made.fine())._suptitle is None
    result = made.contradicted()
    title = plot(result)._suptitle.get_text()
    assert " ".join(title.split()) == "The data contradict one set of constants (p = 2e-09)"
    assert title.endswith("(p = 2e-09)"), "the number stays in one piece"

    def with_p(p, of=result):
        fact = Fact(False, "", {"p": p}, "")
        return " ".join(plot(replace(of, facts={"lack_of_fit": fact}))._suptitle.get_text().split())

    assert with_p(0.0) == "The data contradict one set of constants (p < 1e-99)"
    assert with_p(None) == "The data contradict one set of constants"
    separate = with_p(7e-4, made.separate())
    assert separate == "The data contradict one set of constants a series (p = 7e-04)"
    both = with_p(7e-4, made.stand_in())
    assert both.startswith("STAND-IN DATA")
    assert both.endswith("The data contradict one set of constants (p = 7e-04)")


def test_the_legend_names_bands_by_what_they_are(made):
    local, sampled = made.fine(), made.posterior()
    drawn_anew = replace(sampled, facts={"lack_of_fit": sampled.facts["lack_of_fit"]})
    for result, method, words in (
        (local, "lsq", "68, 95 % bands (least squares)"),
        # the profiles are of the constants: the bands are still those of the optimum
        (local, "profile", "68, 95 % bands (least squares)"),
        (drawn_anew, "bootstrap", "68, 95 % bands (bootstrap)"),
        (sampled, "exact", "68, 95 % credible bands"),
        (sampled, "mcmc", "68, 95 % credible bands"),
    ):
        found = texts_of(plot(replace(result, method=method)))
        assert [text for text in found if "68, 95 %" in text] == [words]
    assert "residuals of ±2 σ" in found


def test_open_and_filled_are_explained_only_where_both_occur(made):
    def explained(result):
        return [t for t in texts_of(plot(result)) if t.startswith(("open", "filled", "all"))]

    assert explained(made.fine()) == ["open: sticking", "filled: sliding"]
    # the panel itself says "sliding"
    assert explained(made.build((made.Run("fast", spin_y=0.833),))) == []
    assert explained(made.build((made.Run("oblique", gamma=(50.0, 80.0)),))) == []
    # no word in the panel where the transition is open
    assert explained(made.all_sticking()) == ["all impacts stick"]
    assert explained(made.build(observables=("e_n",))) == []


def test_the_estimate_lies_on_top_of_values_that_have_no_angle(made):
    (data, _), *_ = panels_of(plot(made.restitution()))
    level = next(line for line in data.lines if len(set(line.get_ydata())) == 1)
    marks = [line for line in data.lines if line.get_marker() == "o" and line.get_markersize() < 9.0]
    assert marks
    for line in marks:
        assert line.get_zorder() < level.get_zorder()
        assert line.get_alpha() <= 0.5
    bands = [part for part in data.collections if part.get_zorder() > marks[0].get_zorder()]
    assert len(bands) == 4, "two for each of the two series"
    (angled, _), *_ = panels_of(plot(made.fine()))
    small, usual = (max(x.get_markersize() for x in a.lines if x.get_marker() == "o") for a in (data, angled))
    assert small < usual


def test_legend_columns_are_filled_as_matplotlib_fills_them():
    entries = [(None, str(i)) for i in range(7)]
    for count in range(1, 8):
        expected = [list(part) for part in np.array_split([label for _, label in entries], count)]
        assert figures._columns(entries, count) == expected


def test_drawing_leaves_the_settings_of_matplotlib_alone(made, tmp_path):
    before = dict(mpl.rcParams)
    with mpl.rc_context({"axes.facecolor": "black", "font.size": 20.0}):
        figure = plot(made.fine())
        save_figure(figure, tmp_path / "fit.png")
        assert mpl.rcParams["font.size"] == 20.0
    assert figure.axes[0].get_facecolor() == (1.0, 1.0, 1.0, 1.0)
    assert dict(mpl.rcParams) == before


def test_a_result_without_points_cannot_be_drawn(made):
    result = made.fine()
    with pytest.raises(UsageError) as caught:
        plot(replace(result, points=result.points.iloc[:0]))
    assert str(caught.value) == (
        "This result holds no points, so there is nothing to draw. Fit the data again."
    )


def test_horizontal_error_bars_where_the_angle_has_one(made):
    with_bars = made.build((made.Run("a", sigma_gamma=1.0),))
    count = [len(panels_of(plot(r))[0][0].collections) for r in (with_bars, made.fine())]
    assert count[0] == count[1] + 1
    assert np.isfinite(panels_of(plot(with_bars))[0][0].get_ylim()).all()


def test_a_narrow_regime_is_named_upright(made):
    result = made.build(truth={"mu": 0.045})
    (data, _), *_ = panels_of(plot(result))
    turned = {text.get_text(): text.get_rotation() for text in data.texts}
    assert turned == {"sticking": 90.0, "sliding": 0.0}


def test_residuals_are_drawn_against_speed_where_speeds_are_known_and_differ(made):
    result = ifrfit.fit("cornell-glass", method="lsq")
    figure = plot(result)
    shown = [axes for axes in figure.axes if axes.axison]
    labels = [axes.get_xlabel() for axes in shown]
    by_speed = [axes for axes in shown if axes.get_xlabel() == "incoming speed (m/s)"]
    assert len(by_speed) == 2, labels
    for axes, observable in zip(by_speed, result.points["observable"].unique(), strict=True):
        rows = result.points[result.points["observable"] == observable]
        marks = [line for line in axes.lines if line.get_marker() == "o"]
        drawn = np.concatenate([np.stack(line.get_data(), axis=1) for line in marks])
        expected = rows[["speed_m_s", "standardised"]].to_numpy(dtype=float)
        order = [part[np.argsort(part[:, 0])] for part in (drawn, expected)]
        np.testing.assert_allclose(*order)
    assert cut_off(figure) == []
    # e_n, which was read at each angle, stands over the angle
    assert labels[:2] == ["", "incidence angle γ (deg)"]
    assert shown[0].get_ylabel().startswith("normal restitution")
    one_speed = plot(ifrfit.fit("kharaz-2001", method="lsq"))
    assert not any("speed" in axes.get_xlabel() for axes in one_speed.axes)
