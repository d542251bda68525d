"""Tangential impulses of the closures, as the impulse balance with vectors takes them."""

from __future__ import annotations

from typing import Any

from ifrfit.cost.impulse_balance import Impulse, ifr
from ifrfit.physics import CLOSURES
from ifrfit.physics.angles import Incidence


def stop(slip: Any, mass: Any, inertia_factor: Any) -> Any:
    """Impulse that cancels the slip: centre and rotation together."""
    return mass * slip / (1 + 1 / inertia_factor)


# written from their papers; they share nothing with the package's formulas
WRITTEN: dict[str, Impulse] = {
    "f": lambda c, slip, limit, mass, j: min(stop(slip, mass, j), limit),
    "fr": lambda c, slip, limit, mass, j: min((1 + c) * stop(slip, mass, j), limit),
    "ifr": ifr,
    "ifr-contact": lambda c, slip, limit, mass, j: (
        (1 + c) * stop(slip, mass, j) + min(stop(slip, mass, j), limit)
    ),
}


def impulse_of(closure: str) -> Impulse:
    """As written above; of any other closure by its law, which leaves the balance independent."""
    diagonal = Incidence.of(45.0, degrees=True)  # where kappa/tau is kappa

    def by_law(c: Any, slip: Any, limit: Any, mass: Any, j: Any) -> Any:
        if slip == 0.0:
            return 0.0
        k, _ = CLOSURES[closure].law(j).impulse(diagonal, c, max(0.0, limit) / (mass * slip))
        return mass * slip * float(k)

    return WRITTEN.get(closure, by_law)
