"""Builders that tests share: impacts made by the physics of the package, and a report quickly written."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.special import bdtrc

from ifrfit.data.observations import Observations
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.physics import CLOSURES, OBSERVABLES, get_closure, rebound

# the closures that the exact posterior takes in closed form, which are quick
BILINEAR = tuple(name for name, closure in CLOSURES.items() if closure.bilinear)
# the observables of the common schema; what was added later is not among them
SCHEMA = (
    "e_n",
    "beta",
    "beta_cm",
    "beta_tot",
    "mu_app",
    "delta_deg",
    "lambda_deg",
    "tan_psi_after",
    "tan_psi_out",
    "psi_after_deg",
    "psi_out_deg",
    "spin_x_after",
    "spin_y_after",
    "v_x",
    "v_y",
    "v_n",
    "mu",
)
HEADER = "series,observable,gamma_deg,spin_x,spin_y,value,sigma"


def own_constant(closure: str, share: float = 0.3, inertia_factor: float = 0.4) -> dict[str, float]:
    """The closure's own constant by name, at a share of its passive range; empty for one without."""
    entry = get_closure(closure)
    if entry.constant is None:
        return {}
    low, high = entry.domain(inertia_factor)
    return {entry.constant: min(max(low + share * (high - low), low), high)}


def impacts_text(
    gamma: object,
    observables: tuple[str, ...] = ("beta",),
    *,
    e_n: float = 0.94,
    c: float = -0.9,
    mu: float = 0.12,
    closure: str = "ifr",
    spin_x: float = 0.0,
    spin_y: float = 0.0,
    noise: float = 0.0,
    sigma: float | None = 0.05,
    series: str = "run",
    seed: int = 0,
    inertia_factor: float = 0.4,
) -> list[str]:
    """Rows of the common schema for the given angles, `noise` sd of normal noise on every value.

    The series is quoted where its name needs that.
    """
    rng = np.random.default_rng(seed)
    own = get_closure(closure).constant
    extra = {own: c} if own else {}
    if set(series) & set(',"\n'):
        series = '"' + series.replace('"', '""') + '"'
    rows = []
    for name in observables:
        state = rebound(
            gamma, spin_x, spin_y, e_n=e_n, mu=mu, closure=closure, degrees=True,
            inertia_factor=inertia_factor, **extra,
        )  # fmt: skip
        values = OBSERVABLES[name].value(state, np.asarray(mu))
        values = values + noise * rng.standard_normal(values.shape)
        for angle, value in zip(np.atleast_1d(gamma).tolist(), np.atleast_1d(values).tolist(), strict=True):
            tail = "" if sigma is None else f"{sigma!r}"
            rows.append(f"{series},{name},{angle!r},{spin_x!r},{spin_y!r},{value!r},{tail}")
    return rows


def impacts_file(path: Path, *parts: dict[str, Any]) -> Path:
    """Write a CSV of impacts, each part with the arguments of `impacts_text`; the path."""
    rows = [row for part in parts for row in impacts_text(**part)]
    path.write_text("\n".join([HEADER, *rows]) + "\n", encoding="utf-8")
    return path


def table_file(path: Path, columns: Mapping[str, Any] | pd.DataFrame, digits: str | None = None) -> Path:
    """Write a table, its numbers in full or by a format such as %.6f; the path."""
    pd.DataFrame(columns).to_csv(path, index=False, float_format=digits)
    return path


def problem_of(
    data: Observations | pd.DataFrame,
    closure: str = "ifr",
    *,
    noise: str | None = None,
    separate_noise: bool = False,
    inertia_factor: float = 0.4,
    **choices: Any,
) -> Problem:
    """The question of one closure; `choices` are those of its parameters (fix, prior, bounds, separate)."""
    data = Observations(data) if isinstance(data, pd.DataFrame) else data
    chosen = get_closure(closure)
    parameters = make_parameters(chosen, inertia_factor, **choices)
    own = bool(choices.get("separate"))
    return make_problem(data, chosen, inertia_factor, parameters, noise, separate_noise=separate_noise or own)


def at_most(n: int, p: float, tail: float = 1e-3) -> int:
    """Most events of probability `p` among `n` that chance gives, but for a tail of 1e-3."""
    return next(k for k in range(n + 1) if bdtrc(k, n, p) < tail)


def rest_long(values: Iterable[Any], quick: int = 1) -> list[Any]:
    """Values of a parameter: the first `quick` of them in every run, the rest with ``-m long`` alone."""
    return [x if i < quick else pytest.param(x, marks=pytest.mark.long) for i, x in enumerate(values)]


def each_once(*axes: Iterable[Any]) -> list[Any]:
    """Combinations of the values of several parameters: in every run as few as show each value once.

    The others run with ``-m long`` alone.
    """
    values = [list(axis) for axis in axes]
    sizes = [len(axis) for axis in values]
    quick = {tuple(i % size for size in sizes) for i in range(max(sizes))}
    return [
        pytest.param(
            *(axis[i] for axis, i in zip(values, at, strict=True)),
            marks=() if at in quick else pytest.mark.long,
        )
        for at in itertools.product(*map(range, sizes))
    ]


def exchanged(text: str, *exchanges: tuple[str, str]) -> str:
    """A text with the first of each pair, which must be in it, replaced once by the second."""
    for old, new in exchanges:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def assert_golden(text: str, path: Path) -> None:
    """The text is the one that is kept. UPDATE_GOLDEN=1 rewrites it: read the difference first."""
    if os.environ.get("UPDATE_GOLDEN"):
        path.write_text(text, encoding="utf-8", newline="\n")
    assert text == path.read_text(encoding="utf-8")


def texts_of(figure: Any) -> list[str]:
    """What is written in a figure's axes, legends and title."""
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    found += [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return found + ([figure._suptitle.get_text()] if figure._suptitle else [])


def cut_off(figure: Any, room: float = 1.0) -> list[Any]:
    """What of a figure's axes, titles and legends reaches beyond its frame, by more than `room` pixels."""
    figure.draw_without_rendering()
    renderer, frame = figure.canvas.get_renderer(), figure.bbox
    parts = [*figure.legends, *(text for legend in figure.legends for text in legend.get_texts())]
    boxes = [part.get_window_extent(renderer) for part in (*parts, *filter(None, [figure._suptitle]))]
    boxes += [axes.get_tightbbox(renderer) for axes in figure.axes]
    return [
        box
        for box in filter(None, boxes)
        if box.x0 < frame.x0 - room
        or box.x1 > frame.x1 + room
        or box.y0 < frame.y0 - room
        or box.y1 > frame.y1 + room
    ]


def small_report() -> Any:
    """A `Report` of one paragraph and one picture, where only its files matter."""
    from ifrfit.report.page.blocks import Paragraph, Picture, Pictures, Report, Section
    from ifrfit.report.page.sections.predictive import draw_checks

    picture = Picture("checks", "Checks", "one", draw_checks({"chi2": 0.5}))
    sections = (Section("one", "One", (Paragraph("Words."), Pictures((picture,), "A caption."))),)
    return Report("small", (), ("It is.", "Nothing."), False, sections, {"ifrfit": "1"})


def jet(path, seed, *, noise, gamma, speed=3.0):
    """Velocities before and after, of impacts that were to have one speed, as a camera reads them."""
    rng = np.random.default_rng(seed)
    gamma = np.broadcast_to(gamma, 24)
    after = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.9, mu=0.12)
    slope = np.radians(gamma)
    columns = {
        "u_x_m_s": speed * np.sin(slope),
        "u_z_m_s": speed * np.cos(slope),
        "v_x_m_s": speed * after.v_x,
        "v_z_m_s": -speed * after.v_n,
    }
    noisy = {name: values + noise * rng.standard_normal(24) for name, values in columns.items()}
    return table_file(path, noisy, "%.5g")
