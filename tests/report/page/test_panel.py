"""The page in a real browser: the panel moves, nothing leaves the page, names from files do no harm."""

from __future__ import annotations

import re

import numpy as np
import pytest
from factories import rest_long

from ifrfit.physics import get_closure, transition_angles, transition_tau
from ifrfit.report.page.explorer import coordinates, values_of

EVERY = ("fixed", "loose", "hostile", "digitised", "stand-in", "lsq")


def first_number(text: str) -> float:
    return float(text.split()[0].rstrip(";°").replace("−", "-"))


def chi2(result, e_n, c, mu):
    """Misfit of all rows at other constants, by the package."""
    problem = result.problem
    residual = problem.rows.value - problem.predict(np.array([e_n, c, mu]))
    yardstick = problem.noise.sigma if problem.noise.is_scaled else result.points["sigma_used"].to_numpy()
    return float(((residual / yardstick) ** 2).sum())


@pytest.mark.parametrize("name", rest_long(EVERY, 4))
def test_nothing_is_said_to_the_console_and_nothing_is_asked_for(opened, pages, name):
    shown = opened(pages(name))
    shown.tab.wait_for_selector("#explorer-plot .datum", state="attached")
    assert shown.said == []
    assert [url for url in shown.asked if not url.startswith(("file:", "data:"))] == []
    assert len(shown.asked) <= 2  # the page itself, and its empty icon
    assert shown.tab.title() != "taken"
    assert shown.tab.locator("img").count() == 0


@pytest.mark.parametrize("slider", ["e_n", "c", "mu", "spin_y"])
def test_a_slider_moves_the_curve_and_the_button_brings_it_back(opened, pages, slider):
    shown = opened(pages("fixed"))
    start = shown.attribute("curve", "d")
    best = shown.attribute("best", "d")
    low = float(shown.attribute(slider, "min"))
    high = float(shown.attribute(slider, "max"))
    shown.move(slider, low + 0.4 * (high - low))
    assert shown.attribute("curve", "d") != start
    assert shown.attribute("best", "d") == best
    shown.tab.click("#explorer-back")
    assert shown.attribute("curve", "d") == start
    assert shown.text("distance").startswith("0.00 sd")


def test_every_readout_is_what_the_package_computes(opened, pages, results):
    result = results("fixed")
    shown = opened(pages("fixed"))
    _, best, covariance, free = coordinates(result, None)
    assert first_number(shown.text("chi2")) == pytest.approx(
        chi2(result, 0.94, best[1], best[2] / 1.94), rel=1e-3
    )
    e_t, mu = best[1] + 0.02, best[2] / 1.94 - 0.004
    shown.move("c", e_t)
    shown.move("mu", mu)
    assert first_number(shown.text("chi2")) == pytest.approx(chi2(result, 0.94, e_t, mu), rel=1e-3)
    off = (np.array([0.94, e_t, 1.94 * mu]) - best)[free]
    expected = np.sqrt(off @ np.linalg.solve(covariance[np.ix_(free, free)], off))
    assert first_number(shown.text("distance")) == pytest.approx(expected, abs=0.006)
    angle = transition_angles(transition_tau(get_closure("ifr"), e_t, 1.94 * mu))[0]
    assert first_number(shown.text("transition")) == pytest.approx(angle, abs=0.006)


def test_a_fixed_constant_that_is_moved_is_named(opened, pages):
    shown = opened(pages("fixed"))
    shown.move("e_n", 0.5)
    assert "en had no spread in the fit" in shown.text("distance")


def test_a_start_that_the_data_do_not_determine_is_called_that(opened, pages):
    assert "Not determined by the data: en, μ;" in opened(pages("loose")).text("note")
    assert "Not determined" not in opened(pages("fixed")).text("note")


def test_another_closure_keeps_the_restitution_in_sticking(opened, pages):
    shown = opened(pages("fixed"))
    shown.tab.select_option("#explorer-closure", "fr")
    assert shown.text("c-label") == "β0"
    assert shown.tab.locator("#explorer-c-label i").text_content() == "β"
    assert "not defined: the fit is of closure IFR" in shown.text("distance")
    e_t = first_number(shown.tab.get_attribute("#explorer-c", "aria-valuetext")) - 1.4
    shown.tab.click("#explorer-back")
    assert first_number(shown.tab.get_attribute("#explorer-c", "aria-valuetext")) == pytest.approx(
        e_t, abs=2e-4
    )
    shown.tab.select_option("#explorer-closure", "f")
    assert not shown.tab.is_visible("#explorer-c")


def test_the_note_says_which_sigma_chi2_rests_on(opened, pages, results):
    shown = opened(pages("fixed"))
    assert "with the sigma that the data state." in shown.text("note")
    # digitised data with scaled noise
    scaled = opened(pages("digitised"))
    result = results("digitised")
    found = re.search(r"the noise of the fit is ([\d.]+) times that", scaled.text("note"))
    assert float(found[1]) == pytest.approx(result.noise.estimates["factor"].value, rel=5e-3)
    names, best, _, _ = coordinates(result, None)
    at = values_of(names, best)
    assert first_number(scaled.text("chi2")) == pytest.approx(
        chi2(result, at["e_n"], at["e_t"], at["mu"]), rel=1e-3
    )


def test_the_keyboard_moves_and_returns(opened, pages):
    shown = opened(pages("fixed"))
    start = shown.attribute("curve", "d")
    shown.tab.focus("#explorer-mu")
    before = first_number(shown.attribute("mu", "aria-valuetext"))
    shown.tab.keyboard.press("ArrowRight")
    assert first_number(shown.attribute("mu", "aria-valuetext")) > before
    assert shown.attribute("curve", "d") != start
    while shown.tab.evaluate("document.activeElement.id") != "explorer-back":
        shown.tab.keyboard.press("Tab")
    shown.tab.keyboard.press("Enter")
    assert shown.attribute("curve", "d") == start


def test_a_series_with_constants_of_its_own_is_judged_by_its_own_rows(opened, pages, results):
    result = results("hostile")
    shown = opened(pages("hostile"))
    first = first_number(shown.text("chi2"))
    shown.tab.select_option("#explorer-series", "1")
    second = first_number(shown.text("chi2"))
    names = list(result.points["series"].unique())
    _, best, _, _ = coordinates(result, names[1])
    theta = np.array([0.94, best[1], 0.0, best[2] / 1.94])
    rows = result.problem.rows.series == 1
    residual = (result.problem.rows.value - result.problem.predict(theta)) / result.problem.noise.sigma
    assert second == pytest.approx(float((residual[rows] ** 2).sum()), rel=1e-3)
    assert first != second
    assert names[1] in shown.text("note")


def test_the_spin_chosen_is_told_from_the_spin_of_the_data(opened, pages):
    shown = opened(pages("fixed"))
    chi = shown.text("chi2")
    shown.move("spin_y", 0.3)
    assert shown.text("chi2") == chi
    assert "the data of run are not" in shown.text("note")
    assert shown.attribute("curve", "stroke-dasharray") == "8 4"


@pytest.mark.parametrize("name", rest_long(("fixed", "hostile", "digitised", "stand-in"), 3))
def test_a_narrow_window_needs_no_sideways_scrolling(opened, pages, name):
    shown = opened(pages(name), viewport={"width": 360, "height": 780})
    assert shown.tab.evaluate("document.documentElement.scrollWidth") <= 360
    box = shown.tab.locator("#explorer-plot").bounding_box()
    assert box["x"] >= 0.0
    assert box["x"] + box["width"] <= 360.0


def test_without_script_the_picture_stands_and_a_sentence_says_so(opened, pages):
    shown = opened(pages("fixed"), java_script_enabled=False)
    assert not shown.tab.is_visible("#explorer")
    assert shown.tab.is_visible("noscript p")
    assert shown.tab.is_visible("[aria-labelledby='fit-title fit-description']")


def test_paper_shows_no_controls_and_reduced_motion_does_not_glide(opened, pages):
    shown = opened(pages("fixed"), reduced_motion="reduce")
    assert shown.tab.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == "auto"
    shown.tab.emulate_media(media="print")
    assert not shown.tab.is_visible("#explorer")
    assert not shown.tab.is_visible("nav")
    assert shown.tab.is_visible("#constants table")
    for part in (".picture", ".scroll", ".verdict"):  # on sheets these are not cut in two
        inside = f"getComputedStyle(document.querySelector('{part}')).breakInside"
        assert shown.tab.evaluate(inside) == "avoid", part


def test_the_policy_stops_what_is_not_ours(opened, pages):
    """A control that must fail: scripts, handlers and styles that somebody adds are refused."""
    added = (
        "<script>document.title='taken'</script><img src=x onerror=\"document.title='taken'\">"
        '<p id="painted" style="color: rgb(1, 2, 3)">x</p><img src="https://example.org/spy.png">'
    )
    shown = opened(pages("fixed").replace("</main>", added + "</main>"))
    shown.tab.wait_for_timeout(200)
    assert shown.tab.title() != "taken"
    assert shown.tab.evaluate("getComputedStyle(document.getElementById('painted')).color") != "rgb(1, 2, 3)"
    assert any("Content Security Policy" in sentence for sentence in shown.said)
    assert shown.tab.text_content("#explorer-distance").startswith("0.00 sd")


def test_a_page_with_a_changed_script_does_not_run_it(opened, pages):
    text = pages("fixed")
    assert text.count("root.hidden = false;") == 1
    shown = opened(text.replace("root.hidden = false;", "root.hidden = false; document.title = 'taken';"))
    assert shown.tab.title() != "taken"
    assert not shown.tab.is_visible("#explorer")


def test_the_files_inside_the_page_can_be_saved(opened, pages):
    shown = opened(pages("fixed"))
    with shown.tab.expect_download() as saving:
        shown.tab.click("a[download='points.csv']")
    assert saving.value.suggested_filename == "points.csv"
