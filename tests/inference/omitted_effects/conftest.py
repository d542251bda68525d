"""Impacts whose maker the fit does not know, by the simulation's own composition of effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from ifrfit.data import Observations, Source
from ifrfit.data.observations import make_table
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.compliance import rebound_ratio
from ifrfit.physics.effects import Contact, Impacts, Outcome, compose
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import Rebound, rebound_with

# glass on glass; what belongs to an effect is added where it acts
GLASS = {"density": 2563.0, "modulus": 38.3e9, "stiffness_ratio": 0.875}
STRENGTH = {
    "compliance": {},
    "viscoelastic": {"dissipation_time": 8e-7},
    "plasticity": {"limiting_pressure": 0.5e9},
    "adhesion": {"interface_energy": 0.2},
    "rolling": {"rolling_friction": 0.01},
}
VELOCITIES = ("v_x", "v_n", "spin_y_after")
Make = Callable[..., Observations]


def impacts_of(n: int, rng: np.random.Generator, spins: bool, diameter: float, constants: dict) -> Impacts:
    gamma = rng.uniform(3.0, 80.0, n)
    spin = np.resize([0.0, 0.3, -0.15], n) if spins else np.zeros(n)
    speed = np.exp(rng.uniform(np.log(0.1), np.log(5.0), n))
    one = np.ones(n)
    own = {"e_n": 0.9, "e_t": -0.95, "mu": 0.15} | constants
    return Impacts(
        Incidence.of(gamma, 0.0, spin, degrees=True),
        speed,
        0.5 * diameter * one,
        get_closure("ifr"),
        own["e_n"] * one,
        own["e_t"] * one,
        own["mu"] * one,
    )


def by_memory(impacts: Impacts, chi: float) -> Rebound:
    """Maw, Barber & Fawcett by their integral, without the table that the fit takes."""
    kappa = impacts.mu * (1.0 + impacts.e_n)
    scaled = 2.0 * chi / 1.75 * impacts.incidence.tau / kappa
    k = 2.0 / 7.0 * (1.0 - rebound_ratio(scaled, chi, method="memory") / scaled)
    return rebound_with(impacts.incidence, k, np.zeros(k.size, dtype=bool), impacts.e_n, 0.4)


def observed(
    state: Outcome | Rebound, impacts: Impacts, names: Sequence[str], noise: float, known: bool, rng
) -> Observations:
    n = impacts.speed.size
    values, sigmas = [], []
    for name in names:
        sigma = noise * (57.3 if name.endswith("_deg") else 1.0)
        exact = np.broadcast_to(OBSERVABLES[name].value(state, impacts.mu), n)
        values.append(exact + sigma * rng.standard_normal(n))
        sigmas.append(np.full(n, sigma if known else np.nan))
    m = len(names)
    gamma = np.degrees(np.arctan2(impacts.incidence.sine, impacts.incidence.cosine))
    columns = {
        "series": "run",
        "observable": np.repeat(names, n),
        "gamma_deg": np.tile(gamma, m),
        "spin_y": np.tile(impacts.incidence.spin_y, m),
        "speed_m_s": np.tile(impacts.speed, m),
        "value": np.concatenate(values),
        "sigma": np.concatenate(sigmas),
        "impact_id": np.tile(np.arange(n).astype(str), m),
        "provenance": "simulated",
        "source": "blind",
    }
    source = Source("blind", "0" * 64, n * m, n * m, {}, "simulated", "")
    return Observations(make_table(columns), (source,), ())


@pytest.fixture(scope="session")
def make() -> Make:
    """Observations with one effect: "" none, any of `STRENGTH`, or "memory"."""

    def one(
        effect: str,
        seed: int,
        observables: Sequence[str] = VELOCITIES,
        *,
        n: int = 60,
        noise: float = 0.02,
        known: bool = True,
        spins: bool = True,
        diameter: float = 5e-3,
        chi: float = 1.5,
        contact: dict | None = None,
        **constants: float,
    ) -> Observations:
        rng = np.random.default_rng([seed, 7])
        impacts = impacts_of(n, rng, spins, diameter, constants)
        if effect == "memory":
            state: Outcome | Rebound = by_memory(impacts, chi)
        else:
            body = Contact(**(GLASS | (contact or {}))).with_numbers(**STRENGTH.get(effect, {}))
            state = compose(body, impacts, (effect,) if effect else ())
        return observed(state, impacts, observables, noise, known, rng)

    return one
