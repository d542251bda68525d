"""Symbols typeset as mathematics writes them, in charts and in HTML, and about how wide a text is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from itertools import groupby

SUBSCRIPT = 0.72  # size of sub- and superscripts
LOWERED, RAISED = 0.22, -0.38  # by shares of the size
GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η",
    "theta": "θ", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "pi": "π", "rho": "ρ",
    "sigma": "σ", "tau": "τ", "phi": "φ", "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ",
    "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π", "Sigma": "Σ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω",
}  # fmt: skip
_TOKEN = re.compile(
    r"\\(?P<command>[A-Za-z]+)|\\(?P<space>[,;: !])|(?P<shift>[_^])|(?P<brace>[{}])|(?P<one>.)"
)
_RELATIONS = {"leq": "≤", "geq": "≥", "cdot": "·", "times": "×", "pm": "±"}
_UPRIGHT = {"mathrm", "text", "rm", "operatorname"}
_INVALID = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")  # what no XML may hold

# widths in DejaVu Sans over the size, by kind of letter
_NARROW, _WIDE, _CAPITAL, _USUAL = 0.36, 0.93, 0.7, 0.61


@dataclass(frozen=True)
class Run:
    """A piece of text of one look: slanted or not, and on the line (0), below (-1) or above it (1)."""

    text: str
    is_slanted: bool = False
    level: int = 0


def runs(text: str) -> list[Run]:
    r"""Pieces of a text in which LaTeX stands between dollars; ``\$`` is a dollar.

    Known are Greek letters, sub- and superscripts, ``\mathrm`` and its kind, and spaces; another command is
    shown as its name, upright, as functions are.
    """
    found: list[Run] = []
    for i, part in enumerate(re.split(r"(?<!\\)\$", text)):
        if i % 2:
            found += _mathematics(part)
        elif part:
            found.append(Run(part.replace(r"\$", "$")))
    return found


def _mathematics(latex: str) -> list[Run]:
    """Neighbours of the same look are one."""
    found: list[Run] = []
    _group(_TOKEN.finditer(latex), 0, False, found)
    looks = groupby(found, key=lambda run: (run.is_slanted, run.level))
    return [Run("".join(run.text for run in several), *look) for look, several in looks]


def _group(tokens: Iterator[re.Match[str]], level: int, is_upright: bool, found: list[Run]) -> None:
    """Everything up to a closing brace."""
    for token in tokens:
        if token["brace"] == "}":
            return
        _item(token, tokens, level, is_upright, found)


def _item(
    token: re.Match[str], tokens: Iterator[re.Match[str]], level: int, is_upright: bool, found: list[Run]
) -> None:
    """A letter, a command or a group; a shift or a change of type together with what it applies to."""
    is_type = token["command"] in _UPRIGHT
    if token["shift"] or is_type:
        following = next(tokens, None)
        if following is not None:
            shifted = level or (0 if is_type else -1 if token["shift"] == "_" else 1)
            _item(following, tokens, shifted, is_upright or is_type, found)
    elif token["brace"]:
        _group(tokens, level, is_upright, found)
    else:
        text, is_slanted = _letters(token, is_upright)
        found.append(Run(text, is_slanted, level))


def _letters(token: re.Match[str], is_upright: bool) -> tuple[str, bool]:
    if token["command"]:
        name = _RELATIONS.get(token["command"], token["command"])
        return (GREEK[name], not is_upright and name[0].islower()) if name in GREEK else (name, False)
    if token["space"]:
        return "\u2009", False
    letter = token["one"].replace("-", "−")
    return letter, letter.isalpha() and not is_upright


def width(text: str, size: float) -> float:
    """About how wide a text is, in the unit of its size: within 10 % for words in DejaVu Sans."""
    return sum(
        size * (SUBSCRIPT if run.level else 1.0) * sum(map(_letter_width, run.text)) for run in runs(text)
    )


def _letter_width(letter: str) -> float:
    if letter in "ijlftrI.,:;'|!()[]/ \u2009⁻":
        return _NARROW
    if letter in "mwMW%@−+=±×–":
        return _WIDE
    return _CAPITAL if letter.isupper() else _USUAL


def content(text: str, size: float) -> str:
    """A text as the content of an svg ``text`` element of that size: escaped, symbols as ``tspan``."""
    pieces, lowered = [], 0.0
    for run in runs(text):
        words = escape(_INVALID.sub("", run.text), quote=False)
        place = size * (LOWERED if run.level < 0 else RAISED if run.level > 0 else 0.0)
        attributes = f' dy="{place - lowered:.1f}"' if place != lowered else ""
        attributes += ' font-style="italic"' if run.is_slanted else ""
        attributes += f' font-size="{SUBSCRIPT * size:.1f}"' if run.level else ""
        pieces.append(f"<tspan{attributes}>{words}</tspan>" if attributes else words)
        lowered = place
    return "".join(pieces)


def html(text: str) -> str:
    """A text as HTML: escaped, symbols slanted, sub- and superscripts as ``sub`` and ``sup``."""
    pieces = []
    for run in runs(text):
        words = escape(_INVALID.sub("", run.text))
        words = f"<i>{words}</i>" if run.is_slanted else words
        tag = "sub" if run.level < 0 else "sup" if run.level > 0 else ""
        pieces.append(f"<{tag}>{words}</{tag}>" if tag else words)
    return "".join(pieces)
