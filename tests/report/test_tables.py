from __future__ import annotations

from html.parser import HTMLParser

from ifrfit.report import html


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.names: list[str] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.names.append(tag)
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def parsed(fragment: str) -> Tags:
    tags = Tags()
    tags.feed(fragment)
    assert not tags.open
    return tags


def test_html_is_balanced_and_escapes_what_comes_from_data(made):
    tags = parsed(html(made.separate()))
    assert "oiled" not in tags.names
    assert "mu [wet & <oiled>]" in tags.text
    assert tags.names.count("tr") == 1 + 7


def test_html_never_lets_a_stand_in_pass_unsaid(made):
    fragment = html(made.stand_in())
    assert "<strong>cross-2019: 51 impacts, beta, stand-in, sigma given. STAND-IN, generated" in fragment
    assert "<strong>" not in html(made.fine())


def test_html_says_first_what_is_not_fine(made):
    assert html(made.all_sticking()).startswith(
        '<div class="ifrfit-result"><p><strong>LOOK: mu is not determined.</strong></p>'
    )


def test_repr_html_is_the_table(made):
    result = made.fine()
    assert result._repr_html_() == html(result)
