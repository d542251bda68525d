from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ifrfit.physics import get_closure
from ifrfit.physics.angles import Incidence
from ifrfit.physics.effects import Contact, Fluid, Impacts

GLASS = Contact(
    density=2563.0,
    modulus=38.3e9,
    stiffness_ratio=2 * (1 - 0.222) / (2 - 0.222),
    fluid=Fluid("water", 1e-3),
).with_numbers(limiting_pressure=5.6e9, interface_energy=0.1, dissipation_time=1e-9, rolling_friction=1e-3)


def make_impacts(
    gamma: Any = 30.0,
    spin_x: Any = 0.0,
    spin_y: Any = 0.0,
    *,
    speed: Any = 1.0,
    radius: Any = 1e-3,
    closure: str = "ifr",
    e_n: Any = 0.9,
    constant: Any = -0.95,
    mu: Any = 0.1,
    chi: Any = None,
) -> Impacts:
    """Impacts from numbers that broadcast, as one-dimensional arrays; gamma in degrees."""
    numbers = [gamma, spin_x, spin_y, speed, radius, e_n, mu]
    if constant is not None:
        numbers.append(constant)
    if chi is not None:
        numbers.append(chi)
    arrays = [np.array(a, dtype=float) for a in np.broadcast_arrays(*map(np.atleast_1d, numbers))]
    gamma, spin_x, spin_y, speed, radius, e_n, mu, *rest = arrays
    return Impacts(
        Incidence.of(gamma, spin_x, spin_y, degrees=True),
        speed,
        radius,
        get_closure(closure),
        e_n,
        rest[0] if constant is not None else None,
        mu,
        rest[-1] if chi is not None else None,
    )


@pytest.fixture(scope="session")
def impacts() -> Callable[..., Impacts]:
    return make_impacts


@pytest.fixture(scope="session")
def glass() -> Contact:
    return GLASS
