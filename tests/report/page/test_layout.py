"""The page in a browser of any width, by day and by night, and for readers who do not see it."""

from __future__ import annotations

from pathlib import Path

import pytest
from factories import rest_long

from ifrfit.report.page.batch import index, named_entries

EVERY = ("fixed", "hostile", "digitised", "stand-in", "loose", "lsq")
SCHEMES = [
    pytest.param(
        name,
        ("light", "dark")[(i + turn) % 2],
        marks=() if (i, turn) in ((0, 0), (1, 0)) else pytest.mark.long,
    )
    for turn in (0, 1)
    for i, name in enumerate(EVERY)
]
WIDE = {"width": 1300, "height": 900}


@pytest.mark.parametrize(("name", "scheme"), SCHEMES)
def test_axe_finds_nothing(opened, pages, name, scheme):
    from axe_playwright_python.sync_playwright import Axe

    tab = opened(pages(name), color_scheme=scheme, viewport=WIDE).tab
    tab.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    found = Axe().run(tab)
    assert found.violations_count == 0, found.generate_report()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_in_an_index(opened, results, scheme):
    from axe_playwright_python.sync_playwright import Axe

    entries = named_entries([(Path(f"{name}.json"), results(name)) for name in ("fixed", "stand-in")], "html")
    tab = opened(index(entries), color_scheme=scheme, viewport=WIDE).tab
    found = Axe().run(tab)
    assert found.violations_count == 0, found.generate_report()


def test_axe_would_find_something(opened, pages):
    """A control that must fail: a picture without words."""
    from axe_playwright_python.sync_playwright import Axe

    spoilt = pages("fixed").replace("</main>", '<img src="data:,"></main>')
    found = Axe().run(opened(spoilt).tab).response["violations"]
    assert [each["id"] for each in found] == ["image-alt"]


@pytest.mark.parametrize("name", rest_long(EVERY, 1))
def test_a_wide_window_has_two_columns(opened, pages, name):
    tab = opened(pages(name), viewport=WIDE).tab
    for columns in tab.locator(".columns").all():
        first, second = (part.bounding_box() for part in columns.locator("> div").all())
        assert first["x"] + first["width"] < second["x"]
        assert second["x"] + second["width"] <= 1300.0
        assert abs(first["y"] - second["y"]) < 1.0
    assert tab.locator(".columns").count() >= 5
    assert tab.evaluate("document.documentElement.scrollWidth") == 1300
    # what a column cannot hold is scrolled within it: of pictures nothing has to be
    wider = "(each) => each.scrollWidth > each.clientWidth + 1"
    assert tab.evaluate(f"[...document.querySelectorAll('.picture')].filter({wider}).length") == 0


@pytest.mark.parametrize("width", [400, 800])
@pytest.mark.parametrize("name", rest_long(EVERY, 1))
def test_a_narrow_window_cuts_nothing(opened, pages, name, width):
    tab = opened(pages(name), viewport={"width": width, "height": 900}).tab
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    cut = tab.evaluate(
        "([parts, width]) => [...document.querySelectorAll(parts)].filter((each) => "
        "each.getBoundingClientRect().right > width + 0.5).map((each) => each.outerHTML.slice(0, 80))",
        ["main p, main li, main dd, main pre, main figure, h1, h2", width],
    )
    assert cut == []


def test_a_narrow_window_shows_tables_as_lists_that_are_still_tables(opened, pages):
    tab = opened(pages("fixed"), viewport={"width": 400, "height": 900}).tab
    table = tab.locator("#constants table")
    assert table.bounding_box()["width"] <= 400.0
    cell = table.locator("tbody td").first
    assert cell.evaluate("(each) => getComputedStyle(each, '::before').content") == '"value"'
    # who does not see it hears rows and cells as before
    assert tab.get_by_role("table").first.get_by_role("rowheader").count() >= 5
    assert table.locator("tbody").get_by_role("cell").count() >= 20


def test_the_reader_chooses_light_or_dark(opened, pages):
    found = {}
    for scheme in ("light", "dark"):
        tab = opened(pages("fixed"), color_scheme=scheme).tab
        colour = "(name) => getComputedStyle(document.body)[name].match(/\\d+/g).slice(0, 3).map(Number)"
        found[scheme] = [sum(tab.evaluate(colour, name)) for name in ("backgroundColor", "color")]
        inverted = tab.evaluate("getComputedStyle(document.querySelector('.picture svg')).filter")
        assert (inverted == "none") == (scheme == "light")
        # paper is white whatever the screen is
        tab.emulate_media(media="print", color_scheme=scheme)
        assert sum(tab.evaluate(colour, "backgroundColor")) == 3 * 255
    assert found["light"][0] > found["light"][1]
    assert found["dark"][0] < found["dark"][1]


def test_the_table_and_the_entries_are_saved_by_one_click(opened, pages, reports):
    shown = opened(pages("fixed"))
    contents = {
        block.name: block.content
        for part in reports("fixed").sections
        for block in part.blocks
        if block.kind == "download"
    }
    for name in ("constants.csv", "constants.tex", "references.bib"):
        with shown.tab.expect_download() as saving:
            shown.tab.click(f"a[download='{name}']")
        assert saving.value.suggested_filename == name
        assert saving.value.path().read_text(encoding="utf-8") == contents[name]
    # one click chooses all of what is there to be copied
    shown.tab.locator("pre.lines code").click()
    assert shown.tab.evaluate("getSelection().toString()").startswith("@misc{domenech2023,")
