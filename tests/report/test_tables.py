from __future__ import annotations

import xml.etree.ElementTree as ET

from ifrfit.report import html


def test_html_is_balanced_and_escapes_what_comes_from_data(made):
    root = ET.fromstring(html(made.separate()).replace("&nbsp;", " "))
    names = [element.tag for element in root.iter()]
    assert "oiled" not in names
    assert "mu [wet & <oiled>]" in "".join(root.itertext())
    assert names.count("tr") == 1 + 7


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
