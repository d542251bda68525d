"""Tables of impacts made from known constants."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit import fit, rebound
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares

HEADER = "series,observable,gamma_deg,value,sigma\n"
FAN = tuple(float(g) for g in range(5, 86, 5))  # both regimes, the transition at 30.2 degrees
STEEP = tuple(float(g) for g in range(3, 28, 3))  # sticking only
GRAZING = tuple(float(g) for g in range(40, 86, 5))  # sliding only
TRUTH = {"e_n": 0.94, "e_t": -0.98, "mu": 0.12}


def values(
    gamma: Sequence[float], observable: str, closure: str = "ifr", **constants: float | None
) -> np.ndarray:
    """An observable of impacts without spin, for constants that differ from `TRUTH` as named."""
    constants = {**TRUTH, **constants}
    result = rebound(np.array(gamma), degrees=True, closure=closure, **constants)
    if observable == "e_n":
        return np.full(len(gamma), constants["e_n"])
    return np.asarray(getattr(result, observable))


def noise(n: int, sigma: float | Sequence[float], seed: int) -> np.ndarray:
    """Gaussian noise."""
    return np.random.default_rng(seed).normal(0.0, 1.0, n) * np.asarray(sigma)


def rows(
    gamma: Sequence[float],
    value: np.ndarray,
    sigma: float | Sequence[float] | None,
    observable: str = "beta",
    series: str = "run",
) -> str:
    """Lines of a long table in full precision; an empty cell where there is no sigma."""
    spread = [None] * len(gamma) if sigma is None else np.broadcast_to(sigma, len(gamma))
    return "".join(
        f"{series},{observable},{float(g)!r},{float(v)!r},{'' if s is None else repr(float(s))}\n"
        for g, v, s in zip(gamma, value, spread, strict=True)
    )


def question(folder: Path, text: str, **options: Any) -> tuple[Problem, LeastSquaresFit]:
    """The problem of a table and its optimum; e_n is fixed at its true value unless `fix` says otherwise."""
    path = folder / "impacts.csv"
    path.write_text(text)
    problem = fit(path, **{"fix": {"e_n": TRUTH["e_n"]}, "method": "lsq", **options}).problem
    return problem, least_squares(problem)


def table(
    gamma: Sequence[float] = FAN,
    *,
    sigma: float | None = None,
    seed: int | None = None,
    true_sigma: float | None = None,
    observable: str = "beta",
    **constants: float,
) -> str:
    """A whole table of one observable, with Gaussian noise if a seed is given."""
    value = values(gamma, observable, **constants)
    if seed is not None:
        value = value + noise(len(gamma), true_sigma or sigma or 0.0, seed)
    return HEADER + rows(gamma, value, sigma, observable)
