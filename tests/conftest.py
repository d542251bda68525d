"""What all tests share: impacts made by the package's own physics, as files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from ifrfit.physics import get_closure, get_observable, rebound

# at home every run looks at new examples; in CI a change is judged by the same ones each time
settings.register_profile("home", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "home")

Impacts = Callable[..., Path]


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
    """Rows of the common schema for the given angles, `noise` sd of normal noise on every value."""
    rng = np.random.default_rng(seed)
    own = get_closure(closure).constant
    extra = {own: c} if own else {}
    rows = []
    for name in observables:
        state = rebound(
            gamma, spin_x, spin_y, e_n=e_n, mu=mu, closure=closure, degrees=True,
            inertia_factor=inertia_factor, **extra,
        )  # fmt: skip
        values = get_observable(name).value(state, np.asarray(mu))
        values = values + noise * rng.standard_normal(values.shape)
        for angle, value in zip(np.atleast_1d(gamma).tolist(), np.atleast_1d(values).tolist(), strict=True):
            tail = "" if sigma is None else f"{sigma!r}"
            rows.append(f"{series},{name},{angle!r},{spin_x!r},{spin_y!r},{value!r},{tail}")
    return rows


HEADER = "series,observable,gamma_deg,spin_x,spin_y,value,sigma"


@pytest.fixture
def impacts(tmp_path: Path) -> Impacts:
    """Write impacts to a file: keyword arguments as `impacts_text`, or several dictionaries of them."""

    def write(*several: dict[str, object], name: str = "impacts.csv", **one: object) -> Path:
        rows = [HEADER]
        for part in several or (one,):
            rows += impacts_text(**part)  # type: ignore[arg-type]
        path = tmp_path / name
        path.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return path

    return write
