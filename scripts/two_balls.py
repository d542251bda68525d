"""Tables at random: some impacts are of another ball or wall, or all of one and their errors are odd."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import rebound

TOGETHER = (
    ("v_x", "v_n", "spin_y_after"),
    ("v_n", "beta"),
    ("beta", "e_n"),
    ("beta_cm", "e_n"),
    ("beta_cm", "spin_y_after"),
    ("delta_deg", "e_n"),
    ("beta",),
    ("e_n",),
)
_KNOW_E_N = ("v_n", "e_n", "delta_deg")
ERRORS = ("normal", "student", "rounded", "growing", "skewed", "e_n(v)")
PLACES = ("block", "end", "mixed")


@dataclass(frozen=True)
class Table:
    """A table, what made it, and how to fit it.

    Attributes
    ----------
    frames : DataFrame or dict of str to DataFrame
        One a series.
    truth : dict of str to float
        Constants of the ball that most impacts are of.
    options : dict
        Of `ifrfit.fit`.
    scene : dict
        What was drawn.
    """

    frames: pd.DataFrame | dict[str, pd.DataFrame]
    truth: dict[str, float]
    options: dict[str, Any]
    scene: dict[str, Any]


def two_balls(seed: int, number: int, errors: str = "", *, clean: bool = False) -> Table:
    """A table at random; the same for the same seed and number.

    Parameters
    ----------
    seed, number : int
    errors : str
        One of `ERRORS`; normal ones without.
    clean : bool
        Whether all impacts are of one ball.
    """
    rng = np.random.default_rng([seed, number])
    observables = TOGETHER[int(rng.integers(len(TOGETHER)))]
    n = round(10.0 * 30.0 ** rng.uniform())
    noise = 0.003 * 10.0 ** rng.uniform(0.0, 1.1)
    known, series = bool(rng.uniform() < 0.5), int(rng.choice([1, 2], p=[0.75, 0.25]))
    first = {"e_n": rng.uniform(0.6, 0.95), "e_t": rng.uniform(-0.98, -0.6), "mu": rng.uniform(0.06, 0.25)}
    differs = ("e_n", "e_t", "mu", "all")[int(rng.choice(4, p=[0.35, 0.15, 0.35, 0.15]))]
    if observables == ("e_n",):
        differs = "e_n"
    elif not set(observables) & set(_KNOW_E_N) and differs == "e_n":
        differs = "mu"
    second = dict(first)
    if differs in ("e_n", "all"):
        second["e_n"] = _moved(rng, first["e_n"], rng.uniform(0.02, 0.15), 0.3, 0.99)
    if differs in ("e_t", "all"):
        second["e_t"] = _moved(rng, first["e_t"], rng.uniform(0.05, 0.3), -1.0, -0.3)
    if differs in ("mu", "all"):
        second["mu"] = first["mu"] * float(np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.9)))
    share, place = rng.uniform(0.1, 0.5), PLACES[int(rng.integers(len(PLACES)))]
    gamma = rng.uniform(4.0, 80.0, n)
    order = ("random", "random", "rising", "repeated")[int(rng.integers(4))]
    if order == "rising":
        gamma.sort()
    elif order == "repeated":
        gamma = rng.permutation(np.resize(np.linspace(8.0, 78.0, max(n // 4, 3)), n))
    spin = rng.uniform(-0.2, 0.3, n) if rng.uniform() < 0.3 else None
    of_second = np.zeros(n, bool) if clean else _rows_of_second(rng, n, share, place)
    e_n, e_t, mu = (np.where(of_second, second[name], first[name]) for name in ("e_n", "e_t", "mu"))
    if errors == "e_n(v)":  # at one total speed the normal one goes with the angle
        e_n = e_n * np.cos(np.radians(gamma)) ** -rng.uniform(0.0, 0.03)
    columns: dict[str, NDArray[np.float64]] = {"gamma_deg": gamma}
    state = rebound(
        gamma, spin_y=0.0 if spin is None else spin, e_n=e_n, e_t=e_t, mu=mu, closure="ifr", degrees=True
    )
    if spin is not None:
        columns["spin_y"] = spin
    for name in observables:
        sigma = noise * (57.3 if OBSERVABLES[name].unit == "deg" else 1.0)
        value = OBSERVABLES[name].value(state, mu) * np.ones(n)
        columns[name] = _read(rng, value, sigma, gamma, errors)
        if known:
            columns[f"sigma_{name}"] = np.full(n, sigma)
    frame = pd.DataFrame(columns)
    frames = frame if series == 1 else {"A": frame[: n // 2], "B": frame[n // 2 :]}
    fixed = {} if set(observables) & set(_KNOW_E_N) else {"e_n": first["e_n"]}
    options = {"method": "lsq", "independent": True, "fix": fixed}
    scene = {"observables": ",".join(observables), "n": n, "noise": noise, "known": known, "series": series}
    scene |= {
        "differs": differs,
        "share": share,
        "place": place,
        "order": order,
        "errors": errors or "normal",
    }
    scene |= {"first": first, "second": second, "of_second": int(of_second.sum())}
    return Table(frames, first, options, scene)


def _moved(rng: np.random.Generator, value: float, by: float, low: float, high: float) -> float:
    """A value that differs by so much, either way, within its domain."""
    ways = [x for x in (value - by, value + by) if low <= x <= high]
    return float(ways[int(rng.integers(len(ways)))]) if ways else value - by


def _rows_of_second(rng: np.random.Generator, n: int, share: float, place: str) -> NDArray[np.bool_]:
    many, found = max(round(share * n), 1), np.zeros(n, bool)
    if place == "mixed":
        found[rng.permutation(n)[:many]] = True
    else:
        start = n - many if place == "end" else int(rng.integers(0, n - many + 1))
        found[start : start + many] = True
    return found


def _read(
    rng: np.random.Generator,
    value: NDArray[np.float64],
    sigma: float,
    gamma: NDArray[np.float64],
    errors: str,
) -> NDArray[np.float64]:
    n = value.size
    normal = rng.standard_normal(n)
    if errors == "student":
        normal = rng.standard_t(4, n) / np.sqrt(2.0)
    elif errors == "skewed":
        normal = rng.gamma(4.0, 0.5, n) - 2.0  # skewness 1
    elif errors == "growing":
        normal = normal * 0.5 / np.sin(np.radians(np.maximum(gamma, 8.0)))
    read = value + sigma * normal
    if errors == "rounded":
        step = 10.0 ** np.floor(np.log10(2.0 * sigma))
        read = np.round(read / step) * step
    return np.asarray(read)
