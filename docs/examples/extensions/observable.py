"""An observable that is linear in the impulse: the spin that the impact adds."""

import numpy as np

from ifrfit.physics.observable import Observable

SPIN_GAINED = Observable(
    name="spin_gained",
    symbol=r"$\Delta R\Omega_y/u$",
    meaning="spin gained",
    kind="tangential",
    value=lambda r, mu: r.spin_y - r.incidence.spin_y,
    linear=lambda i, j: (np.zeros_like(i.sine), -i.slip_x / j),
    low=-1e6,
    high=1e6,
    takes=frozenset({"Sy"}),
    numerator="spin",
    panel="r.spinY - r.i.spinY",
)
