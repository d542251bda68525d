"""Names of constants in sentences as mathematics writes them; what is there to be typed stays as it is."""

from __future__ import annotations

import re
from functools import cache
from html import escape

from ifrfit.physics.closures import CLOSURES
from ifrfit.report.constants_rows import constant_symbols
from ifrfit.report.page.charts.typesetting import html

_FURTHER = {
    "beta": r"$\beta$",
    "chi2": r"$\chi^2$",
    "U_n": "$U_n$",
    "U_t": "$U_t$",
    "V_t": "$V_t$",
    "mu_r": r"$\mu_r$",
    "omega_x": r"$\omega_x$",
    "omega_y": r"$\omega_y$",
}
# options with what follows them, quotations, and names of series in brackets
_VERBATIM = r"--[\w-]+(?:[ =][^\s,;.:)]+(?:[.,:][^\s,;.:)]+)*)?|'[^']*'|\[[^\]]*\]"


def symbols() -> dict[str, str]:
    """Names that sentences hold, with their LaTeX between dollars."""
    return constant_symbols() | _FURTHER


def typeset(text: str) -> str:
    """A sentence as HTML, escaped, with the names of constants as symbols.

    Options of commands, quotations, paths, and names of series in brackets are left as they are: what is
    copied from a sentence has to work.
    """
    pieces, end = [], 0
    known = _typeset_symbols(tuple(CLOSURES))
    for found in _pattern(tuple(CLOSURES)).finditer(text):
        pieces.append(escape(text[end : found.start()]))
        pieces.append(_one(found, known))
        end = found.end()
    return "".join([*pieces, escape(text[end:])])


def _one(found: re.Match[str], known: dict[str, str]) -> str:
    """A symbol, a power, or something verbatim."""
    if found["name"]:
        return known[found["name"]]
    if found["power"]:
        return f"<sup>{escape(found['power'][1:].replace('-', '−'))}</sup>"
    return escape(found[0])


@cache
def _typeset_symbols(closures: tuple[str, ...]) -> dict[str, str]:
    """Of the closures there are: a registered one may bring a constant of its own."""
    return {name: html(latex) for name, latex in symbols().items()}


@cache
def _pattern(closures: tuple[str, ...]) -> re.Pattern[str]:
    names = "|".join(re.escape(name) for name in sorted(symbols(), key=len, reverse=True))
    symbol = rf"(?<![\w./\\=-])(?P<name>{names})(?![\w\\=(-]|/\S*\.\w|\.\w)"
    return re.compile(rf"{_VERBATIM}|{symbol}|(?<=[\w)])(?P<power>\^-?\d+)")
