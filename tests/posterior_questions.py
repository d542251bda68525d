"""What is asked of the posterior: rows, closure, constants and noise as plain numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.physics import OBSERVABLES, get_closure, rebound

Array = NDArray[np.float64]
LEVELS = (0.025, 0.16, 0.5, 0.84, 0.975)
OWN = {"ifr": "e_t", "ifr-contact": "e_t", "fr": "beta0", "f": ""}
_MU_UPPER = 2.0  # of the default prior


@dataclass(frozen=True)
class Row:
    """One observation."""

    observable: str
    gamma: float
    value: float
    sigma: float | None = 0.05
    spin_x: float = 0.0
    spin_y: float = 0.0
    series: str = "run"


@dataclass(frozen=True)
class Question:
    """A posterior to find.

    Attributes
    ----------
    noise_bounds : mapping
        Group ("series/observable"; "" for the common factor) to the ends of its log-uniform prior.
    """

    rows: tuple[Row, ...]
    closure: str = "ifr"
    inertia_factor: float = 0.4
    fix: Mapping[str, float] = field(default_factory=dict)
    prior: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    separate: tuple[str, ...] = ()
    noise: str = "known"
    noise_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def own(self) -> str:
        """Name of the closure's own constant, empty for F."""
        return OWN[self.closure]

    @property
    def series(self) -> tuple[str, ...]:
        """Series in order of appearance."""
        return tuple(dict.fromkeys(row.series for row in self.rows))

    def linear(self) -> tuple[float, float, float, float]:
        """(a0, a1, b0, b1) of a = a0 + a1 c and b = b0 + b1 c."""
        share = self.inertia_factor / (1.0 + self.inertia_factor)
        return {
            "ifr": (share, share, self.inertia_factor, 0.0),
            "ifr-contact": (share, share, share, 0.0),
            "fr": (0.0, 0.0, share, share),
            "f": (0.0, 0.0, share, 0.0),
        }[self.closure]

    def domain(self, name: str) -> tuple[float, float]:
        """Ends of a constant's prior."""
        if name in self.bounds:
            low, high = self.bounds[name]
        else:
            low, high = {
                "e_n": (0.0, 1.0),
                "mu": (0.0, math.inf),
                "e_t": (-1.0, 0.0 if self.closure == "ifr-contact" else -self.inertia_factor),
                "beta0": (-1.0, 1.0),
            }[name]
        return low, (_MU_UPPER if math.isinf(high) else high)

    def problem(self) -> Problem:
        """The same as the package wants it."""
        closure = get_closure(self.closure)
        constants = make_parameters(
            closure,
            self.inertia_factor,
            fix=self.fix,
            prior=self.prior,
            bounds=self.bounds,
            separate=self.separate,
        )
        table = make_table(
            {
                "series": [row.series for row in self.rows],
                "observable": [row.observable for row in self.rows],
                "gamma_deg": np.array([row.gamma for row in self.rows]),
                "spin_x": np.array([row.spin_x for row in self.rows]),
                "spin_y": np.array([row.spin_y for row in self.rows]),
                "value": np.array([row.value for row in self.rows]),
                "sigma": np.array([math.nan if row.sigma is None else row.sigma for row in self.rows]),
            }
        )
        problem = make_problem(
            Observations(table),
            closure,
            self.inertia_factor,
            constants,
            self.noise,
            separate_noise=bool(self.separate),
        )
        return problem.with_noise(problem.noise.with_bounds(self.noise_bounds))


def measured(
    observable: str,
    gamma: Sequence[float],
    *,
    seed: int,
    sigma: float = 0.05,
    spin_x: float = 0.0,
    spin_y: float = 0.0,
    series: str = "run",
    closure: str = "ifr",
    e_n: float = 0.9,
    c: float = -0.85,
    mu: float = 0.15,
    known: bool = True,
    inertia_factor: float = 0.4,
) -> tuple[Row, ...]:
    """Simulated rows, rounded so that they are the same on every machine."""
    own: dict[str, Any] = {OWN[closure]: c} if OWN[closure] else {}
    state = rebound(
        np.array(gamma), spin_x, spin_y, e_n=e_n, mu=mu, closure=closure, degrees=True,
        inertia_factor=inertia_factor, **own,
    )  # fmt: skip
    exact = np.broadcast_to(OBSERVABLES[observable].value(state, np.asarray(mu)), (len(gamma),))
    value = exact + sigma * np.random.default_rng(seed).standard_normal(len(gamma))
    return tuple(
        Row(observable, g, round(float(v), 4), sigma if known else None, spin_x, spin_y, series)
        for g, v in zip(gamma, value, strict=True)
    )
