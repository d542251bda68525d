"""Reports on sheets of A4: nothing lost, nothing cut, every heading above what it heads."""

from __future__ import annotations

import functools
import io
import re
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pypdf import PdfReader
from reportlab.lib.units import mm

from ifrfit.report.page.a4.flow import sheets
from ifrfit.report.page.a4.pictures import GAP, SMALLEST, rows_of, size_of
from ifrfit.report.page.a4.sheet_style import FOOT, HEIGHT, MARGIN, WIDTH
from ifrfit.report.page.a4.tables import column_widths, table_flowable
from ifrfit.report.page.blocks import (
    Badge,
    Code,
    Findings,
    Pairs,
    Paragraph,
    Picture,
    Pictures,
    Report,
    Section,
    Table,
)
from ifrfit.report.page.pdf import pdf
from ifrfit.report.style import MM_PER_INCH, drawing, new_figure

MM = 72.0 / 25.4


def picture(wide, tall, name="p"):
    with drawing():
        figure = new_figure(wide, tall / MM_PER_INCH)
        figure.text(0.1, 0.5, f"inside {name}")
    return Picture(name, f"Title of {name}", "", figure)


def report(*sections, **more):
    return Report(
        **{"title": "A title", "badges": (), "verdict": (), "alarm": False, **more}, sections=sections
    )


@pytest.fixture(scope="session")
def made(reports):
    """The PDFs of reports by name, each made once."""
    return functools.cache(lambda name: pdf(reports(name)))


def pages_of(content):
    """The text of every page, white space as one blank."""
    return [" ".join(page.extract_text().split()) for page in PdfReader(io.BytesIO(content)).pages]


def words(text):
    return " ".join(text.split())


def page_with(pages, text):
    (found,) = [number for number, page in enumerate(pages) if words(text) in page]
    return found


@pytest.mark.parametrize("name", ["stand-in", "hostile"])
def test_all_that_is_said_can_be_found_as_text(reports, made, name):
    one = reports(name)
    content = made(name)
    # breaks of lines may stand anywhere, and a break of pages once
    pages = [page.replace(" ", "") for page in pages_of(content)]

    def told(text):
        cuts = range(1, len(text))
        return any(text in page for page in pages) or any(
            text[:cut] in page and text[cut:] in after for page, after in pairwise(pages) for cut in cuts
        )

    assert [each for each in literal_paragraph(one) if not told(re.sub(r"\s", "", each))] == []


def test_the_same_bytes_again(reports, made):
    assert pdf(reports("fixed")) == made("fixed")


def literal_paragraph(one):
    yield one.title
    yield from one.verdict
    for section in one.sections:
        for block in section.blocks:
            if isinstance(block, Paragraph):
                yield block.text
            elif isinstance(block, Findings):
                yield from (sentence for _, sentence in block.items)
            elif isinstance(block, Table):
                yield from (block.caption, *block.head)
            elif isinstance(block, Pictures):
                yield block.caption


def test_several_figures_share_a_page(reports, made):
    one = reports("fixed")
    figures = sum(len(b.items) for s in one.sections for b in s.blocks if b.kind == "pictures")
    content = made("fixed")
    assert len(PdfReader(io.BytesIO(content)).pages) <= 2 + figures // 2
    assert content.startswith(b"%PDF-1.4")
    assert b"/CreationDate" not in content
    assert b"ifrfit report" in content[:4096]  # by which a report of ours is known
    outline = [entry.title for entry in PdfReader(io.BytesIO(content)).outline]
    assert outline[:2] == ["Constants", "Data, model and findings"]


def test_a_stand_in_says_so_on_every_sheet(made):
    assert all("STAND-IN" in page for page in pages_of(made("stand-in")))
    assert not any("STAND-IN" in page for page in pages_of(made("fixed")))


def test_text_is_no_markup():
    text = "<img src='x.png'/> a & b </para><b>c</b> &lt;"
    one = report(
        Section("s", text, (Paragraph(text), Pairs(((text, text),)), Findings((("LOOK", text),)))),
        Section("t", "T", (Code(text, text), Table(text, (text, "x"), ((text, text * 20),)))),
    )
    assert "".join(pages_of(pdf(one))).count("<img src='x.png'/> a & b </para><b>c</b> &lt;") >= 28


blocks = st.lists(
    st.one_of(
        st.integers(1, 60).map(lambda n: Paragraph("word " * 12 * n)),
        st.integers(1, 60).map(lambda n: Table("caption", ("a", "b"), (("1", "2"),) * n)),
        st.lists(st.tuples(st.floats(40, 260), st.floats(30, 320)), min_size=1, max_size=4).map(
            lambda sizes: Pictures(tuple(picture(*size) for size in sizes), "figcaption")
        ),
        st.integers(1, 5).map(lambda n: Code("words", "command " * 10 * n)),
        st.integers(1, 5).map(lambda n: Findings((("LOOK", "finding " * 30),) * n)),
    ),
    min_size=1,
    max_size=6,
)


@given(st.lists(blocks, min_size=1, max_size=4))
@settings(max_examples=25, deadline=None)
def test_figures_stand_whole_and_apart_and_headings_above_something(contents):
    sections = [Section(f"s{i}", f"Heading-{i}-", tuple(own)) for i, own in enumerate(contents)]
    content, places = sheets(report(*sections))
    for place in places:
        wide, tall = (length * place.scale for length in size_of(place.picture))
        assert place.x >= MARGIN - 1e-6
        assert place.x + wide <= MARGIN + WIDTH + 1e-6
        assert place.y >= FOOT - 1e-6
        assert place.y + tall <= FOOT + HEIGHT + 1e-6
    for i, one in enumerate(places):
        assert not any(overlap(one, other) for other in places[:i])
    pages = pages_of(content)
    assert len({p.page for p in places} - set(range(len(pages)))) == 0
    for section in sections:
        page = page_with(pages, section.title)
        after = pages[page].split(section.title)[1]
        first = section.blocks[0]
        if isinstance(first, Pictures):  # only its place is known here
            number = sum(len(b.items) for b in before(sections, section) if isinstance(b, Pictures))
            assert places[number].page == page
        else:
            assert re.match(r" (word|caption|words|LOOK finding|finding)", after)


def before(sections, section):
    for own in sections:
        if own is section:
            return
        yield from own.blocks


def overlap(one, other):
    if one.page != other.page:
        return False
    a, b = ([length * p.scale for length in size_of(p.picture)] for p in (one, other))
    apart = (
        one.x + a[0] <= other.x + 1e-6
        or other.x + b[0] <= one.x + 1e-6
        or one.y + a[1] <= other.y + 1e-6
        or other.y + b[1] <= one.y + 1e-6
    )
    return not apart


def test_the_head_of_a_table_is_repeated_and_no_row_is_lost():
    rows = tuple((f"r{i:03d}", f"{i * 0.5:.1f}") for i in range(200))
    table = Table("The rows", ("name-of-row", "number"), rows, frozenset({1}))
    pages = pages_of(pdf(report(Section("s", "Section", (table,)))))
    assert len(pages) >= 3
    assert all(page.count("name-of-row number") == 1 for page in pages)
    assert re.findall(r"r\d{3}", " ".join(pages)) == [name for name, _ in rows]


def test_a_table_goes_on_at_the_foot_of_a_sheet_but_not_with_its_head_alone():
    rows = tuple((f"r{i:03d}", "1") for i in range(40))
    for paragraphs in range(20, 50):
        text = (Paragraph("Words."),) * paragraphs
        pages = pages_of(pdf(report(Section("s", "S", (*text, Table("The caption", ("a", "b"), rows))))))
        own = pages[page_with(pages, "The caption")]
        assert len(re.findall(r"r\d{3}", own)) >= 2


def test_a_figure_is_drawn_where_its_place_is():
    """The control for the places: text inside a figure lies in it, a legend outside its axes too."""
    from matplotlib.figure import Figure

    figure = Figure((4.0, 2.0), layout="constrained")
    figure.subplots().plot([0, 1], label="curve")
    figure.legend(loc="outside lower center")
    both = (picture(85, 60, "left"), Picture("right", "Right", "", figure))
    one = report(Section("s", "S", (Paragraph("Words. " * 100), Pictures(both, "A caption."))))
    _, places = sheets(one)
    found = {}

    def visit(text, matrix, of_text, _font, _size):
        x, y = of_text[4], of_text[5]
        at = matrix[0] * x + matrix[2] * y + matrix[4], matrix[1] * x + matrix[3] * y + matrix[5]
        found.setdefault(text.strip(), at)

    PdfReader(io.BytesIO(pdf(one))).pages[0].extract_text(visitor_text=visit)
    for place, text in zip(places, ("inside left", "curve"), strict=True):
        wide, tall = (length * place.scale for length in size_of(place.picture))
        x, y = found[text]
        assert place.x < x < place.x + wide
        assert place.y < y < place.y + tall


def test_rows_are_as_full_as_the_width_allows():
    rows = rows_of([picture(62, 48) for _ in range(5)], [])
    assert [len(row.pictures) for row in rows] == [3, 2]
    assert SMALLEST <= rows[0].scale < 1.0
    assert rows[0].scale * 3 * 62 * MM + 2 * GAP == pytest.approx(WIDTH)
    assert rows[1].scale == rows[0].scale
    assert [len(row.pictures) for row in rows_of([picture(110, 40), picture(110, 40)], [])] == [1, 1]
    (large,) = rows_of([picture(300, 100)], [])
    assert large.scale == pytest.approx(WIDTH / (300 * MM))


def test_a_figure_without_room_stands_on_the_next_sheet():
    for several in (False, True):
        above = Pictures((picture(100, 200, "above"),), "A caption.")
        figures = (picture(160, 90, "a"), picture(160, 90, "b"))[: 1 + several]
        places = sheets(report(Section("s", "S", (above, Pictures(figures, "figcaption")))))[1]
        assert [(place.page, place.scale) for place in places] == [(0, 1.0), *[(1, 1.0)] * (1 + several)]


def test_an_endless_caption_goes_on():
    figure = Pictures((picture(100, 200),), "caption " * 1500)
    content, places = sheets(report(Section("s", "The-heading", (figure,))))
    pages = pages_of(content)
    assert places[0].page == page_with(pages, "The-heading")
    assert "".join(pages).count("caption") == 1500


@given(st.lists(st.tuples(st.floats(1, 300), st.floats(0, 1)), min_size=1, max_size=8), st.floats(100, 600))
def test_columns_fit_and_the_widest_give_way(columns, room):
    natural = [wide for wide, _ in columns]
    least = [wide * share for wide, share in columns]
    found = column_widths(natural, least, room)
    assert sum(found) <= room * (1 + 1e-9)
    if sum(natural) <= room:
        assert found == natural
    elif sum(least) <= room:
        assert all(a - 1e-9 <= x <= b + 1e-9 for a, x, b in zip(least, found, natural, strict=True))
        assert sum(found) == pytest.approx(room, rel=1e-6)


def test_a_wide_table_stays_on_the_sheet():
    head = tuple(f"a long heading {i}" for i in range(14))
    rows = (tuple(f"-1{i}.2345678" for i in range(14)),) * 3
    table = table_flowable(Table("wide", head, rows, frozenset(range(14))))
    assert table.wrap(WIDTH, HEIGHT)[0] <= WIDTH + 1e-6
    text = table_flowable(Table("text", ("a", "b"), (("x", "a very long sentence " * 20),)))
    assert text.wrap(WIDTH, HEIGHT)[0] <= WIDTH + 1e-6


def test_the_sheet_is_a4():
    (page,) = PdfReader(io.BytesIO(pdf(report(Section("s", "S", (Paragraph("x"),)))))).pages
    assert [float(x) for x in page.mediabox[2:]] == pytest.approx((210 * mm, 297 * mm), rel=1e-5)


def test_badges_stand_under_the_title():
    badges = (Badge("measured"), Badge("needs attention", "look"))
    (page,) = pages_of(pdf(report(badges=badges, verdict=("It is.",))))
    assert page.count("A title measured · needs attention It is.") == 1
    assert page.count("A title · needs attention 1") == 1
