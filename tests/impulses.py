"""Tangential impulses of the bilinear closures, as the impulse balance with vectors takes them."""

from __future__ import annotations

from typing import Any

from ifrfit.cost.impulse_balance import Impulse, ifr
from ifrfit.physics import CLOSURES


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
    """As written above; of any other closure by its coefficients, which leaves the balance independent."""

    def by_coefficients(c: Any, slip: Any, limit: Any, mass: Any, j: Any) -> Any:
        law = CLOSURES[closure].coefficients(j)
        return mass * slip * (law.a0 + law.a1 * c) + min(mass * slip * (law.b0 + law.b1 * c), limit)

    return WRITTEN.get(closure, by_coefficients)
