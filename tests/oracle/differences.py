"""Differences between two results, each with its path, within tolerances that say what they rest on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

TOLERANCE = 1e-9

# Entries whose numbers are statistics: log likelihoods, chi2, probabilities, correlations, last changes of a
# quadrature in units of a standard deviation. Their natural scale is 1, however small the number itself.
_OF_SCALE_ONE = ("fit", "facts", "correlation", "effort", "loo", "psi_plane", "effects")

# Numbers that rounding moves by more than 1e-9, found by changing the last bit of every measured value: they
# moved by up to a tenth of these tolerances.
_LOOSER = {
    # score tests: differences of chi2 along derivatives that are themselves differences over steps of 1e-6
    ".effects.figures.tests.": 1e-6,
    # falls of -2 log likelihood where steps go along differences over 1e-7, and end where one is worth 1e-3
    ".slips.figures.tests.": 1e-6,
    # R-hat normalises ranks, and two draws that tie but for rounding change places
    ".converged.figures.rhat_max": 1e-4,
    ".rhat": 1e-4,
}


def differences(
    found: Any, expected: Any, path: str = "", scale: float = 0.0, tolerance: float = TOLERANCE
) -> Iterator[str]:
    """What differs, one line each.

    Numbers agree if they differ by at most `tolerance` times the larger one, or times the natural scale: the
    standard deviation of an estimate (`stderr`), the largest number of a list, 1 for statistics. Everything
    else is equal or differs.

    Parameters
    ----------
    found, expected : str, int, float, bool, None, list or dict
    path : str
        Where they stand.
    scale : float
        Natural scale of the numbers there; 0: they are compared relative to themselves alone.
    tolerance : float

    Yields
    ------
    str
    """
    if isinstance(expected, dict) and isinstance(found, dict):
        yield from _of_dicts(found, expected, path, scale, tolerance)
    elif isinstance(expected, list) and isinstance(found, list):
        if len(found) != len(expected):
            yield f"{path}: {len(found)} entries, not {len(expected)}"
            return
        own = max(scale, _largest(expected))
        for i, (one, other) in enumerate(zip(found, expected, strict=True)):
            yield from differences(one, other, f"{path}[{i}]", own, tolerance)
    elif _is_float(found) and _is_float(expected):
        allowed = max([tolerance, *(looser for part, looser in _LOOSER.items() if part in path)])
        if abs(found - expected) > allowed * max(abs(found), abs(expected), scale):
            yield f"{path}: {found!r}, not {expected!r} (differs by {abs(found - expected):.2g})"
    elif type(found) is not type(expected) or found != expected:
        yield f"{path}: {found!r}, not {expected!r}"


def _of_dicts(
    found: dict[str, Any], expected: dict[str, Any], path: str, scale: float, tolerance: float
) -> Iterator[str]:
    for key in sorted(expected.keys() - found.keys()):
        yield f"{_below(path, key)}: is missing"
    for key in sorted(found.keys() - expected.keys()):
        yield f"{_below(path, key)}: is new"
    sd = next((expected[key] for key in ("stderr", "sd") if _is_float(expected.get(key))), 0.0)
    for key in sorted(expected.keys() & found.keys()):
        own = 1.0 if key in _OF_SCALE_ONE else sd or scale
        yield from differences(found[key], expected[key], _below(path, key), own, tolerance)


def _below(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _is_float(value: object) -> bool:
    """Whether it is a number that may be rounded; counts and truth values are compared exactly."""
    return isinstance(value, float) and math.isfinite(value)


def _largest(values: Sequence[Any]) -> float:
    return max((abs(value) for value in values if _is_float(value)), default=0.0)
