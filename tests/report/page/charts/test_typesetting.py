"""Symbols as mathematics writes them, and text that stays text."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from ifrfit.physics import CLOSURES, OBSERVABLES
from ifrfit.report.page.charts.typesetting import Run, content, runs, width


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("e_n plain", [Run("e_n plain")]),
        ("$e_n$", [Run("e", True), Run("n", True, -1)]),
        (r"$\mu$", [Run("μ", True)]),
        (r"$\beta_0$ [a\$b]", [Run("β", True), Run("0", False, -1), Run(" [a$b]")]),
        (r"$\beta_\mathrm{CM}$", [Run("β", True), Run("CM", False, -1)]),
        (r"$\tan\psi_{out}$", [Run("tan"), Run("ψ", True), Run("out", True, -1)]),
        (r"$R\Omega_y/u$", [Run("R", True), Run("Ω"), Run("y", True, -1), Run("/", False), Run("u", True)]),
        (r"$x^2\,m$", [Run("x", True), Run("2", False, 1), Run("\u2009"), Run("m", True)]),
        (r"$\unknown{x$", [Run("unknown"), Run("x", True)]),
        ("$a_$", [Run("a", True)]),
    ],
)
def test_runs(text, expected):
    assert runs(text) == expected


def test_every_symbol_of_the_package_is_typeset():
    symbols = [observable.symbol for observable in OBSERVABLES.values()]
    symbols += [f"${closure.own.latex}$" for closure in CLOSURES.values() if closure.own is not None]
    for symbol in symbols:
        shown = "".join(run.text for run in runs(symbol))
        assert not set(shown) & set("$\\{}_^"), symbol


def test_text_is_escaped_and_what_no_xml_may_hold_is_left_out():
    written = content("<img> & \x00$e_<$", 8.0)
    element = ET.fromstring(f"<text>{written}</text>")
    assert "".join(element.itertext()) == "<img> & e<"


def test_a_subscript_comes_back_to_the_line():
    written = content("$e_n$ after", 10.0)
    element = ET.fromstring(f"<text>{written}</text>")
    shifts = [float(part.get("dy", "0")) for part in element]
    assert shifts == pytest.approx([0.0, 2.2, -2.2])


@pytest.mark.parametrize(
    ("text", "exact"),  # points at size 10 in DejaVu Sans
    [("incidence angle γ (deg)", 120.5), ("log Bayes factor", 81.2), ("−0.25", 31.1), ("10 000", 35.0)],
)
def test_width_is_about_that_of_the_letters(text, exact):
    assert width(text, 10.0) == pytest.approx(exact, rel=0.1)
