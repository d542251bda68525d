"""Further toys, of kinds that the examples of the contributing guide (docs/examples) do not show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ifrfit.physics.closure import Closure, ClosureConstant, rotational_share
from ifrfit.physics.impulse_laws import Coefficients, impulse_factor
from ifrfit.physics.observable import Observable


@dataclass(frozen=True)
class Rooted:
    """k = min(share (1 + c^2), kappa/tau): not linear in its constant."""

    share: float

    def impulse(self, incidence: Any, c: Any, kappa: Any) -> Any:
        return impulse_factor(incidence, 0.0, self.bound(c), kappa)

    def slopes(self, incidence: Any, c: Any, kappa: Any) -> Any:
        _, sticks = self.impulse(incidence, c, kappa)
        with np.errstate(divide="ignore"):
            by_kappa = np.where(sticks, 0.0, 1.0 / incidence.tau)
        return np.where(sticks, self.bound_slope(c), 0.0), by_kappa

    def bound(self, c: Any) -> Any:
        return self.share * (1.0 + np.asarray(c) ** 2)

    def bound_slope(self, c: Any) -> Any:
        return 2.0 * self.share * np.asarray(c)

    def constant_at(self, bound: Any) -> Any:
        return np.sqrt(np.maximum(np.asarray(bound) / self.share - 1.0, 0.0))


BEND = Closure(
    "bend",
    "BEND",
    lambda j: Rooted(rotational_share(j)),
    "made up",
    ClosureConstant("eta", r"\eta", "root of the restitution in sticking", lambda j: (0.0, 1.0)),
)


def _lock(j: float) -> Coefficients:
    share = rotational_share(j)
    return Coefficients(0.0, share, share, -share)


# its constant takes no part in sticking, a1 + b1 = 0
LOCK = Closure(
    "lock",
    "LOCK",
    _lock,
    "made up: of the impulse that stops the contact, a part that friction does not bound",
    ClosureConstant("lock", r"\ell", "that part", lambda j: (0.0, 0.9)),
)

# curved, an angle, and without an expression for the panel
TILT = Observable(
    name="tilt_deg",
    symbol=r"$\vartheta$",
    meaning="velocity of the contact over that of the centre",
    unit="deg",
    kind="curved",
    value=lambda r, mu: np.degrees(np.arctan2(r.contact_x, 1.0 + r.v_n)),
    by_impulse=lambda i, k, e_n, j: np.degrees(
        np.arctan2((1.0 - k / rotational_share(j)) * i.slip_x, 1.0 + e_n * i.cosine)
    ),
    low=-90.0,
    high=90.0,
    takes=frozenset({"Tx", "Sy"}),
    with_e_n=True,
)

HALF_DROP = Observable(
    name="half_v_n",
    symbol=r"$v_n/2u$",
    meaning="half the normal velocity",
    kind="normal",
    value=lambda r, mu: 0.5 * r.v_n,
    by_e_n=lambda i: 0.5 * i.cosine,
    low=0.0,
    high=5.0,
    takes=frozenset({"N"}),
    numerator="velocity",
    panel="0.5 * r.vN",
)
