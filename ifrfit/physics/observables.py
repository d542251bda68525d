"""The observables there are.

A further one is a file of its own and one more entry of `OBSERVABLES`, or comes by `ifrfit.register`. The
tables of data, the methods of inference and the panel of the report all take it from here.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.observable import Observable, check_observable
from ifrfit.physics.rebound import ratio
from ifrfit.registry import Registry

# Ranges that a measurement, a digitisation or a simulation can have. They are wide on purpose: they catch
# slipped units, slipped exponents and placeholder numbers (1e300, -9999 in an angle), not bad measurements.
# RATIO: quantities over |U_t|, sin gamma or cos gamma. Where the denominator is a rounding error (1e-12 is
# refused as undefined, see ifrfit.data.validate) a ratio of ordinary velocities cannot exceed 1e12.
# FREE: velocities and spins per incoming speed. A sphere of 1 m that spins at 1e5 rad/s and drifts at
# 0.1 m/s has 1e6.
RATIO = 1e12
FREE = 1e6


def _in_all(value: float, i: Incidence) -> Array:
    """The same in all impacts: one number, however many they are."""
    return _of_shape(value, np.shape(i.sine))


@lru_cache(maxsize=64)
def _of_shape(value: float, shape: tuple[int, ...]) -> Array:
    return np.broadcast_to(value, shape)


def _tan_psi(i: Incidence, j: float) -> tuple[Array, Array]:
    tangent = ratio(i.slip_x, i.cosine)
    return tangent, -tangent / rotational_share(j)


# In the order in which they are preferred where the same impacts are given several times: measured velocities
# and spin, then centre plus spin, then what is computed from both.
OBSERVABLES: Registry[Observable] = Registry(
    "observable",
    Observable,
    (
        Observable(
            name="v_x",
            symbol=r"$v_x/u$",
            meaning="tangential velocity after",
            kind="tangential",
            value=lambda r, mu: r.v_x,
            linear=lambda i, j: (i.sine, -i.slip_x),
            low=-FREE,
            high=FREE,
            takes=frozenset({"Tx"}),
            numerator="velocity",
            panel="r.vX",
        ),
        Observable(
            name="v_y",
            symbol=r"$v_y/u$",
            meaning="lateral velocity after",
            kind="tangential",
            value=lambda r, mu: r.v_y,
            linear=lambda i, j: (_in_all(0.0, i), -i.slip_y),
            low=-FREE,
            high=FREE,
            takes=frozenset({"Ty"}),
            numerator="velocity",
            panel="r.vY",
        ),
        Observable(
            name="v_n",
            symbol=r"$v_n/u$",
            meaning="normal velocity after",
            kind="normal",
            value=lambda r, mu: r.v_n,
            by_e_n=lambda i: i.cosine,
            low=0.0,
            high=10.0,
            takes=frozenset({"N"}),
            numerator="velocity",
            panel="r.vN",
        ),
        Observable(
            name="spin_y_after",
            symbol=r"$R\Omega_y/u$",
            meaning="spin after",
            kind="tangential",
            value=lambda r, mu: r.spin_y,
            linear=lambda i, j: (i.spin_y, -i.slip_x / j),
            low=-FREE,
            high=FREE,
            takes=frozenset({"Sy"}),
            numerator="spin",
            panel="r.spinY",
        ),
        Observable(
            name="spin_x_after",
            symbol=r"$R\Omega_x/u$",
            meaning="lateral spin after",
            kind="tangential",
            value=lambda r, mu: r.spin_x,
            linear=lambda i, j: (i.spin_x, -i.slip_y / j),
            low=-FREE,
            high=FREE,
            takes=frozenset({"Sx"}),
            numerator="spin",
            panel="r.spinX",
        ),
        Observable(
            name="beta_cm",
            symbol=r"$\beta_\mathrm{CM}$",
            meaning="restitution of the centre",  # -v_x/u_x
            kind="tangential",
            value=lambda r, mu: r.beta_cm,
            linear=lambda i, j: (_in_all(-1.0, i), ratio(i.slip_x, i.sine)),
            low=-RATIO,
            high=RATIO,
            undefined=("normal",),
            takes=frozenset({"Tx"}),
            numerator="velocity",
            divided_by=lambda i: i.sine,
            panel="ratio(-r.vX, r.i.sine)",
        ),
        Observable(
            name="e_n",
            symbol=r"$e_n$",
            meaning="normal restitution",  # -v_z/u_z
            kind="normal",
            value=lambda r, mu: r.e_n + 0.0 * r.incidence.sine,
            by_e_n=lambda i: _in_all(1.0, i),
            low=0.0,
            high=10.0,
            undefined=("grazing",),
            takes=frozenset({"N"}),
            has_angle=False,
            numerator="velocity",
            divided_by=lambda i: i.cosine,
            panel="r.eN",
        ),
        Observable(
            name="beta",
            symbol=r"$\beta$",
            meaning="restitution of the contact point",  # -V_t/U_t
            kind="tangential",
            value=lambda r, mu: r.beta,
            linear=lambda i, j: (_in_all(-1.0, i), _in_all(1.0 / rotational_share(j), i)),
            low=-RATIO,
            high=RATIO,
            undefined=("contact",),
            takes=frozenset({"Tx", "Ty", "Sx", "Sy"}),
            numerator="contact",
            divided_by=lambda i: i.slip,
            panel="r.i.slip === 0 ? NaN : r.k / r.share - 1",
        ),
        Observable(
            name="tan_psi_after",
            symbol=r"$\tan\psi_\mathrm{after}$",
            meaning="contact velocity after over incoming normal velocity",
            kind="tangential",
            value=lambda r, mu: r.tan_psi_after,
            linear=_tan_psi,
            low=-RATIO,
            high=RATIO,
            undefined=("grazing",),
            takes=frozenset({"Tx", "Sy"}),
            numerator="contact",
            divided_by=lambda i: i.cosine,
            panel="ratio(r.contactX, r.i.cosine)",
        ),
        Observable(
            name="psi_after_deg",
            symbol=r"$\psi_\mathrm{after}$",
            meaning="contact angle after, over the incoming normal velocity",
            unit="deg",
            kind="curved",
            value=lambda r, mu: np.degrees(r.psi_after),
            by_impulse=lambda i, k, e_n, j: np.degrees(
                np.arctan2((1.0 - k / rotational_share(j)) * i.slip_x, i.cosine)
            ),
            without_e_n=True,
            low=-90.0,
            high=90.0,
            undefined=("grazing",),
            takes=frozenset({"Tx", "Sy"}),
            numerator="contact",
            divided_by=lambda i: i.cosine,
            panel="degrees(r.contactX, r.i.cosine)",
        ),
        Observable(
            name="tan_psi_out",
            symbol=r"$\tan\psi_\mathrm{out}$",
            meaning="contact velocity after over outgoing normal velocity",
            kind="tangential",
            value=lambda r, mu: r.tan_psi_out,
            linear=_tan_psi,
            scale="rebound",
            low=-RATIO,
            high=RATIO,
            undefined=("grazing",),
            takes=frozenset({"Tx", "Sy"}),
            with_e_n=True,
            panel="ratio(r.contactX, r.vN)",
        ),
        Observable(
            name="psi_out_deg",
            symbol=r"$\psi_\mathrm{out}$",
            meaning="contact angle after, over the outgoing normal velocity",
            unit="deg",
            kind="curved",
            value=lambda r, mu: np.degrees(r.psi_out),
            by_impulse=lambda i, k, e_n, j: np.degrees(
                np.arctan2((1.0 - k / rotational_share(j)) * i.slip_x, e_n * i.cosine)
            ),
            low=-90.0,
            high=90.0,
            undefined=("grazing",),
            takes=frozenset({"Tx", "Sy"}),
            with_e_n=True,
            panel="degrees(r.contactX, r.vN)",
        ),
        Observable(
            name="mu_app",
            symbol=r"$\mu_\mathrm{app}$",
            meaning="apparent friction",  # P_x/P_n
            kind="tangential",
            value=lambda r, mu: r.mu_app,
            linear=lambda i, j: (_in_all(0.0, i), ratio(i.slip_x, i.cosine)),
            scale="impulse",
            low=-RATIO,
            high=RATIO,
            undefined=("grazing",),
            takes=frozenset({"Tx"}),
            with_e_n=True,
            panel="ratio(r.k * r.i.slipX, (1 + r.eN) * r.i.cosine)",
        ),
        Observable(
            name="delta_deg",
            symbol=r"$\delta$",
            meaning="rebound angle of the centre",  # atan of v_x over |v_z|
            unit="deg",
            kind="curved",
            value=lambda r, mu: np.degrees(r.delta),
            by_impulse=lambda i, k, e_n, j: np.degrees(np.arctan2(i.sine - k * i.slip_x, e_n * i.cosine)),
            low=-90.0,
            high=90.0,
            undefined=("grazing",),
            takes=frozenset({"Tx"}),
            with_e_n=True,
            panel="degrees(r.vX, r.vN)",
        ),
        Observable(
            name="beta_tot",
            symbol=r"$\beta_\mathrm{tot}$",
            meaning="total restitution",  # |v|/u
            kind="curved",
            value=lambda r, mu: r.beta_tot,
            by_impulse=lambda i, k, e_n, j: np.sqrt(
                (i.sine - k * i.slip_x) ** 2 + (k * i.slip_y) ** 2 + (e_n * i.cosine) ** 2
            ),
            low=0.0,
            high=FREE,
            takes=frozenset({"Tx", "Ty"}),
            with_e_n=True,
            numerator="velocity",
            panel="Math.hypot(Math.hypot(r.vX, r.vY), r.vN)",
        ),
        Observable(
            name="lambda_deg",
            symbol=r"$\lambda$",
            meaning="lateral deviation",  # atan2(v_y, v_x)
            unit="deg",
            kind="curved",
            value=lambda r, mu: np.degrees(r.lambda_),
            by_impulse=lambda i, k, e_n, j: np.degrees(np.arctan2(-k * i.slip_y, i.sine - k * i.slip_x)),
            without_e_n=True,
            low=-180.0,
            high=180.0,
            undefined=("rest",),
            takes=frozenset({"Tx", "Ty"}),
            panel="degrees(r.vY, r.vX)",
        ),
        Observable(
            name="mu",
            symbol=r"$\mu$",
            meaning="friction, measured directly",
            kind="friction",
            value=lambda r, mu: mu + 0.0 * r.incidence.sine,
            low=0.0,
            high=100.0,
            has_angle=False,
            panel="r.mu",
        ),
    ),
    check=check_observable,
)
