"""Every observable that can be measured, as one registry.

Most are ``scale(e_n) * (offset + slope * k)``: linear in the impulse factor k up to a scale that depends on
e_n alone. Inference uses that form where there is one and the rebound itself where there is none.
A further observable is one more entry of `OBSERVABLES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.closures import rotational_share
from ifrfit.physics.rebound import Rebound
from ifrfit.registry import Registry

Scale = Literal["one", "impulse", "rebound"]  # 1, 1/(1 + e_n), 1/e_n
Kind = Literal["tangential", "normal", "friction", "curved"]


@dataclass(frozen=True)
class Observable:
    """One measurable quantity.

    Attributes
    ----------
    name : str
        As in the common schema.
    symbol : str
        For axes, in matplotlib's mathtext.
    meaning : str
        In a few words.
    unit : str
        ``"deg"`` or ``""``.
    kind : {"tangential", "normal", "friction", "curved"}
        tangential: linear in k; normal: proportional to e_n; friction: mu itself; curved: none of them.
    value : callable
        From a `Rebound` and mu to the observable in its unit.
    linear : callable or None
        From `Incidence` and J to (offset, slope) of the tangential kind.
    scale : {"one", "impulse", "rebound"}
        Factor of the tangential kind: 1, 1/(1 + e_n) or 1/e_n.
    by_impulse : callable or None
        Of the curved kind: from `Incidence`, impulse factor k, e_n and J to the value, for many k at once.
    without_e_n : bool
        Of the curved kind: whether e_n enters through the impulse factor alone.
    """

    name: str
    symbol: str
    meaning: str
    unit: str
    kind: Kind
    value: Callable[[Rebound, Array], Array]
    linear: Callable[[Incidence, float], tuple[Array, Array]] | None = None
    scale: Scale = "one"
    by_impulse: Callable[[Incidence, Array, Array, float], Array] | None = None
    without_e_n: bool = False

    @property
    def has_angle(self) -> bool:
        """Whether the incidence angle enters at all."""
        return self.name not in ("e_n", "mu")


def _over(numerator: Array, denominator: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(numerator / denominator)


def _beta(i: Incidence, j: float) -> tuple[Array, Array]:
    return -np.ones_like(i.sine), np.full_like(i.sine, 1.0 / rotational_share(j))


def _beta_cm(i: Incidence, j: float) -> tuple[Array, Array]:
    return -np.ones_like(i.sine), _over(i.slip_x, i.sine)


def _tan_psi(i: Incidence, j: float) -> tuple[Array, Array]:
    tangent = _over(i.slip_x, i.cosine)
    return tangent, -tangent / rotational_share(j)


def _mu_app(i: Incidence, j: float) -> tuple[Array, Array]:
    return np.zeros_like(i.sine), _over(i.slip_x, i.cosine)


def _beta_tot(i: Incidence, k: Array, e_n: Array, j: float) -> Array:
    return np.sqrt((i.sine - k * i.slip_x) ** 2 + (k * i.slip_y) ** 2 + (e_n * i.cosine) ** 2)


def _delta(i: Incidence, k: Array, e_n: Array, j: float) -> Array:
    return np.degrees(np.arctan2(i.sine - k * i.slip_x, e_n * i.cosine))


def _lambda(i: Incidence, k: Array, e_n: Array, j: float) -> Array:
    return np.degrees(np.arctan2(-k * i.slip_y, i.sine - k * i.slip_x))


def _psi_after(i: Incidence, k: Array, e_n: Array, j: float) -> Array:
    return np.degrees(np.arctan2((1.0 - k / rotational_share(j)) * i.slip_x, i.cosine))


def _psi_out(i: Incidence, k: Array, e_n: Array, j: float) -> Array:
    return np.degrees(np.arctan2((1.0 - k / rotational_share(j)) * i.slip_x, e_n * i.cosine))


OBSERVABLES: Registry[Observable] = Registry(
    "observable",
    Observable,
    (
        Observable(
            "e_n",
            r"$e_n$",
            "normal restitution",
            "",
            "normal",
            lambda r, mu: r.e_n + 0.0 * r.incidence.sine,
        ),
        Observable(
            "beta",
            r"$\beta$",
            "restitution of the contact point",
            "",
            "tangential",
            lambda r, mu: r.beta,
            _beta,
        ),
        Observable(
            "beta_cm",
            r"$\beta_\mathrm{CM}$",
            "restitution of the centre",
            "",
            "tangential",
            lambda r, mu: r.beta_cm,
            _beta_cm,
        ),
        Observable(
            "beta_tot",
            r"$\beta_\mathrm{tot}$",
            "total restitution",
            "",
            "curved",
            lambda r, mu: r.beta_tot,
            by_impulse=_beta_tot,
        ),
        Observable(
            "mu_app",
            r"$\mu_\mathrm{app}$",
            "apparent friction",
            "",
            "tangential",
            lambda r, mu: r.mu_app,
            _mu_app,
            "impulse",
        ),
        Observable(
            "delta_deg",
            r"$\delta$",
            "rebound angle of the centre",
            "deg",
            "curved",
            lambda r, mu: np.degrees(r.delta),
            by_impulse=_delta,
        ),
        Observable(
            "lambda_deg",
            r"$\lambda$",
            "lateral deviation",
            "deg",
            "curved",
            lambda r, mu: np.degrees(r.lambda_),
            by_impulse=_lambda,
            without_e_n=True,
        ),
        Observable(
            "tan_psi_after",
            r"$\tan\psi_\mathrm{after}$",
            "contact velocity after over incoming normal velocity",
            "",
            "tangential",
            lambda r, mu: r.tan_psi_after,
            _tan_psi,
        ),
        Observable(
            "tan_psi_out",
            r"$\tan\psi_\mathrm{out}$",
            "contact velocity after over outgoing normal velocity",
            "",
            "tangential",
            lambda r, mu: r.tan_psi_out,
            _tan_psi,
            "rebound",
        ),
        Observable(
            "psi_after_deg",
            r"$\psi_\mathrm{after}$",
            "contact angle after, over the incoming normal velocity",
            "deg",
            "curved",
            lambda r, mu: np.degrees(r.psi_after),
            by_impulse=_psi_after,
            without_e_n=True,
        ),
        Observable(
            "psi_out_deg",
            r"$\psi_\mathrm{out}$",
            "contact angle after, over the outgoing normal velocity",
            "deg",
            "curved",
            lambda r, mu: np.degrees(r.psi_out),
            by_impulse=_psi_out,
        ),
        Observable(
            "spin_x_after",
            r"$R\Omega_x/u$",
            "lateral spin after",
            "",
            "tangential",
            lambda r, mu: r.spin_x,
            lambda i, j: (i.spin_x, -i.slip_y / j),
        ),
        Observable(
            "spin_y_after",
            r"$R\Omega_y/u$",
            "spin after",
            "",
            "tangential",
            lambda r, mu: r.spin_y,
            lambda i, j: (i.spin_y, -i.slip_x / j),
        ),
        Observable(
            "v_x",
            r"$v_x/u$",
            "tangential velocity after",
            "",
            "tangential",
            lambda r, mu: r.v_x,
            lambda i, j: (i.sine, -i.slip_x),
        ),
        Observable(
            "v_y",
            r"$v_y/u$",
            "lateral velocity after",
            "",
            "tangential",
            lambda r, mu: r.v_y,
            lambda i, j: (np.zeros_like(i.sine), -i.slip_y),
        ),
        Observable("v_n", r"$v_n/u$", "normal velocity after", "", "normal", lambda r, mu: r.v_n),
        Observable(
            "mu",
            r"$\mu$",
            "friction, measured directly",
            "",
            "friction",
            lambda r, mu: mu + 0.0 * r.incidence.sine,
        ),
    ),
)


def get_observable(name: str) -> Observable:
    """Look an observable up by its name in the common schema.

    Raises
    ------
    UsageError
        If there is none of that name; the message lists those there are.
    """
    return OBSERVABLES[name]
