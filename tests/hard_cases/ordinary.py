"""Ordinary tables that were too slow or too large: they are answered, and converge."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hard_cases.case import HardCase, put
from hard_cases.synthetic import FAN, HEADER, noise, rows, values

from ifrfit import compare, fit, rebound
from ifrfit.inference import FitResult
from ifrfit.inference.comparison import Comparison

METHODS = ("lsq", "exact")
ROUND = np.linspace(4.0, 80.0, 75)


def _raw(count: int, series: int) -> str:
    """Velocities and spins after impact in two series, each observable with a noise of its own."""
    text = HEADER
    for number in range(series):
        gamma = ROUND[number::series][:count]
        state = rebound(gamma, degrees=True, e_n=0.8, e_t=-0.85, mu=0.15)
        for place, (name, exact) in enumerate(
            (("v_x", state.v_x), ("v_n", state.v_n), ("spin_y_after", state.spin_y))
        ):
            errors = noise(gamma.size, 0.01 * (1 + place), 70 + 10 * number + place)
            text += rows(gamma, exact + errors, None, name, f"day {number + 1}")
    return text


def _angles() -> str:
    """Rebound angles without anything that knows e_n alone."""
    gamma = np.array(FAN, dtype=float)
    state = rebound(gamma, degrees=True, e_n=0.8, e_t=-0.85, mu=0.15)
    exact = np.degrees(np.arctan2(state.v_x, state.v_n))
    return HEADER + rows(FAN, exact + noise(gamma.size, 0.5, 90), None, "delta_deg")


def _pair() -> str:
    text = HEADER
    for number, name in enumerate(("A", "B")):
        text += rows(FAN, values(FAN, "beta") + noise(len(FAN), 0.02, 95 + number), None, series=name)
    return text


def _fitted(text: str, **options: Any) -> Callable[[Path, str], FitResult]:
    return lambda folder, method: fit(put(folder, text), method=method, **options)


def _settled(result: FitResult) -> None:
    assert result.facts["converged"].ok, result.facts["converged"].says


def _recovered(result: FitResult) -> None:
    _settled(result)
    for name, truth in (("e_n", 0.8), ("e_t", -0.85), ("mu", 0.15)):
        found = result.constants[name]
        assert abs(found.value - truth) < 5.0 * found.stderr, (name, found)


def _compared(found: Comparison) -> None:
    assert found.converged
    assert len(found.entries) == 5
    assert max(found.entries[name].log_evidence for name in ("ifr", "fr")) > found.entries["f"].log_evidence


CASES = (
    HardCase(
        "34 rows of two series, compared",
        "ordinary",
        "Two series of 17 values of beta without a sigma, the five closures side by side.",
        "Every closure converges, and one with tangential restitution is before closure F.",
        lambda folder: compare(put(folder, _pair()), fix={"e_n": 0.94}, loo=False),
        _compared,
    ),
    HardCase(
        "225 rows of raw velocities, closure FR",
        "ordinary",
        "Velocities and spins of 75 impacts in two series with six unknown noises, fitted by closure FR.",
        "An answer that has converged.",
        _fitted(_raw(75, 2), closure="fr", separate="noise"),
        _settled,
        METHODS,
    ),
    HardCase(
        "17 rebound angles, e_n free",
        "ordinary",
        "Rebound angles between 5 and 85 degrees alone, without a sigma, every constant free.",
        "An answer that has converged; the constants are right within five sd.",
        _fitted(_angles()),
        _recovered,
        METHODS,
    ),
)
