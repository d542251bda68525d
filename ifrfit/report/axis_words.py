"""What axes say: names of quantities as symbols, and names of series that fit."""

from __future__ import annotations

from ifrfit.inference.model.entry_names import split_name
from ifrfit.report.constants_rows import constant_symbols

_SYMBOLS = {
    "beta_sticking": r"$\beta$ in sticking",
    "transition_angle_deg": "transition (deg)",
}


def symbol(name: str, longest: int = 24) -> str:
    """A constant as axes write it; its series in brackets as it is, cut where it is longer than `longest`."""
    kind, series = split_name(name)
    shown = (_SYMBOLS | constant_symbols()).get(kind, plain(kind.replace("_", " ")))
    return shown + (plain(f" [{shortened(series, longest)}]") if series else "")


def plain(text: str) -> str:
    """Text that must not be read as mathematics."""
    return text.replace("$", r"\$")


def shortened(text: str, longest: int) -> str:
    """Text cut to a length, with an ellipsis where something is missing."""
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
