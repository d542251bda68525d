"""Simulated impacts as observations, for tests of comparisons."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ifrfit.data.observations import Observations, Source, make_table
from ifrfit.inference.comparison import Comparison
from ifrfit.inference.result.types import Fact
from ifrfit.physics import OBSERVABLES, rebound

ANGLES = np.linspace(4.0, 84.0, 25)
FOUR = ("f", "fr", "ifr", "ifr-contact")


def not_converged(found: Comparison, name: str) -> Comparison:
    """A comparison in which the fit of one closure did not converge."""
    entry = found.entries[name]
    loose = Fact(False, "the quadrature reached 1e-2 only", {}, "rule")
    fit = replace(entry.fit, facts={**entry.fit.facts, "converged": loose})
    return replace(found, entries={**found.entries, name: replace(entry, fit=fit)})


def observations(
    closure: str = "ifr",
    gamma: Any = ANGLES,
    observables: tuple[str, ...] = ("beta",),
    *,
    sigma: float = 0.03,
    noise: float | None = None,
    seed: int = 0,
    spin_y: float = 0.0,
    spin_x: float = 0.0,
    inertia_factor: float = 0.4,
    provenance: str = "measured",
    impact_id: Any = "",
    e_n: float = 0.9,
    mu: float = 0.15,
    given: bool = True,
    **own: float,
) -> Observations:
    """Impacts of a closure; `noise` is the scatter they have, `sigma` what is said of it."""
    rng = np.random.default_rng(seed)
    gamma = np.asarray(gamma, dtype=float)
    state = rebound(
        gamma, spin_x, spin_y, e_n=e_n, mu=mu, closure=closure, degrees=True,
        inertia_factor=inertia_factor, **own,
    )  # fmt: skip
    values = [OBSERVABLES[name].value(state, np.asarray(mu)) for name in observables]
    value = np.concatenate([np.broadcast_to(v, gamma.shape) for v in values])
    value = value + (sigma if noise is None else noise) * rng.standard_normal(value.size)
    n = len(observables)
    table = make_table(
        {
            "series": "run",
            "observable": np.repeat(observables, gamma.size),
            "gamma_deg": np.tile(gamma, n),
            "spin_x": spin_x,
            "spin_y": spin_y,
            "value": value,
            "sigma": sigma if given else np.nan,
            "impact_id": np.tile(impact_id, n) if np.ndim(impact_id) else impact_id,
            "provenance": provenance,
            "source": "made.csv",
        }
    )
    return Observations(table, (Source("made.csv", "0" * 64, len(table), len(table), provenance=provenance),))
