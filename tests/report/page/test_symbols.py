"""Names of constants in sentences become symbols; what is there to be typed does not."""

from __future__ import annotations

import pytest

from ifrfit.report.page.charts.typesetting import html
from ifrfit.report.page.symbols import typeset

E_N, MU = "<i>e</i><sub><i>n</i></sub>", "<i>μ</i>"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("e_n and mu, chi2", f"{E_N} and {MU}, <i>χ</i><sup>2</sup>"),
        ("mu (1 + e_n)", f"{MU} (1 + {E_N})"),
        ("kappa = 0.2 +- 0.1.", "<i>κ</i> = 0.2 +- 0.1."),
        ("beta0 -1 to 1; beta in sticking", "<i>β</i><sub>0</sub> -1 to 1; <i>β</i> in sticking"),
        ("mu[wet] by 0.0098", f"{MU}[wet] by 0.0098"),
        ("a factor e^289, (m/s)^-2", "a factor e<sup>289</sup>, (m/s)<sup>−2</sup>"),
    ],
)
def test_names_become_symbols(text, shown):
    assert typeset(text) == shown


@pytest.mark.parametrize(
    "text",
    [
        "add --fix e_n=0.94 or --separate mu",
        "--prior e_n=0.9,0.05",
        "the column 'mu' is empty",
        "series [e_n]",
        "mu.csv line 3",
        "data/mu/e_n.csv",
        "beta_cm and much",
        "e_n=0.94",
    ],
)
def test_what_is_typed_stays_as_it_is(text):
    assert typeset(text) == text.replace("'", "&#x27;")


def test_the_rest_is_escaped():
    assert typeset("<b> & mu") == f"&lt;b&gt; &amp; {MU}"
    assert typeset("[<b>] --x=<i>") == "[&lt;b&gt;] --x=&lt;i&gt;"


def test_formulas_are_typeset():
    assert html(r"$k = \min(0.4, \kappa U_n/|U_t|)$") == (
        "<i>k</i> = min(0.4, <i>κ</i> <i>U</i><sub><i>n</i></sub>/|<i>U</i><sub><i>t</i></sub>|)"
    )
    assert html(r"$P_f \leq x$ <b>") == "<i>P</i><sub><i>f</i></sub> ≤ <i>x</i> &lt;b&gt;"
