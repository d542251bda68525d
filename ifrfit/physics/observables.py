"""Every observable that can be measured, as one registry: its meaning, its value after an impact, its range.

Most are ``scale(e_n) * (offset + slope * k)``: linear in the impulse factor k up to a scale that depends on
e_n alone. Inference uses that form where there is one and the rebound itself where there is none.
A further observable is one more entry of `OBSERVABLES`, here or by `ifrfit.register`. The tables of data, the
methods of inference and the panel of the report all take it from here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.closures import get_closure, rotational_share
from ifrfit.physics.rebound import Rebound, rebound_of
from ifrfit.registry import Registry

Scale = Literal["one", "impulse", "rebound"]  # 1, 1/(1 + e_n), 1/e_n
Kind = Literal["tangential", "normal", "friction", "curved"]
Undefined = Literal["contact", "normal", "rest", "grazing"]
Numerator = Literal["velocity", "spin", "contact"]

# Ranges that a measurement, a digitisation or a simulation can have. They are wide on purpose: they catch
# slipped units, slipped exponents and placeholder numbers (1e300, -9999 in an angle), not bad measurements.
# RATIO: quantities over |U_t|, sin gamma or cos gamma. Where the denominator is a rounding error (1e-12 is
# refused as undefined, see ifrfit.data.validate) a ratio of ordinary velocities cannot exceed 1e12.
# FREE: velocities and spins per incoming speed. A sphere of 1 m that spins at 1e5 rad/s and drifts at
# 0.1 m/s has 1e6.
RATIO = 1e12
FREE = 1e6

_TAKEN = ("Tx", "Ty", "Sx", "Sy", "N")
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Observable:
    """One measurable quantity.

    Attributes
    ----------
    name : str
        As in the column ``observable``; it ends with ``_deg`` where the unit is the degree.
    symbol : str
        For axes, in matplotlib's mathtext.
    meaning : str
        In a few words.
    unit : {"1", "deg"}
    kind : {"tangential", "normal", "friction", "curved"}
        tangential: linear in k; normal: proportional to e_n; friction: mu itself; curved: none of them.
    value : callable
        From a `Rebound` and mu to the observable in its unit.
    linear : callable or None
        Of the tangential kind: from `Incidence` and J to (offset, slope).
    scale : {"one", "impulse", "rebound"}
        Factor of the tangential kind: 1, 1/(1 + e_n) or 1/e_n.
    by_e_n : callable or None
        Of the normal kind: from `Incidence` to what e_n is multiplied by.
    by_impulse : callable or None
        Of the curved kind: from `Incidence`, impulse factor k, e_n and J to the value, for many k at once.
    without_e_n : bool
        Of the curved kind: whether e_n enters through the impulse factor alone.
    low, high : float
        Possible range of a value, in `unit`.
    undefined : tuple of str
        Where there is no value: ``contact`` (the contact point does not move, U_t = 0), ``normal`` (gamma =
        0), ``rest`` (gamma = 0 and no spin), ``grazing`` (gamma = 90 degrees).
    takes : frozenset of str
        Which measurements of an impact the value uses up: ``Tx``, ``Ty`` (centre velocity along the wall),
        ``Sx``, ``Sy`` (spin after), ``N`` (normal velocity after).
    with_e_n : bool
        The value is computed with the normal velocity after, although it does not use it up.
    has_angle : bool
        Whether the incidence angle enters at all; a row must give it then.
    numerator : {"velocity", "spin", "contact"} or None
        What the value, or the tangent of an angle, is computed from, divided by what is known before the
        impact: velocities of the centre, the spin, or their sum. None where its error depends on the
        constants.
    divided_by : callable or None
        From `Incidence` to that divisor; None for 1.
    panel : str or None
        The value as an expression of JavaScript in ``r``, the rebound of ``physics.js``; ``ratio`` and
        ``degrees`` are nan where undefined. None: the panel of the report leaves the observable out.
    """

    name: str
    symbol: str
    meaning: str
    unit: Literal["1", "deg"] = "1"
    kind: Kind
    value: Callable[[Rebound, Array], Array]
    linear: Callable[[Incidence, float], tuple[Array, Array]] | None = None
    scale: Scale = "one"
    by_e_n: Callable[[Incidence], Array] | None = None
    by_impulse: Callable[[Incidence, Array, Array, float], Array] | None = None
    without_e_n: bool = False
    low: float
    high: float
    undefined: tuple[Undefined, ...] = ()
    takes: frozenset[str] = frozenset()
    with_e_n: bool = False
    has_angle: bool = True
    numerator: Numerator | None = None
    divided_by: Callable[[Incidence], Array] | None = None
    panel: str | None = None

    @property
    def unit_text(self) -> str:
        """The unit as axes write it."""
        return "–" if self.unit == "1" else self.unit


def check_observable(observable: Observable) -> None:
    """Refuse an observable that contradicts itself.

    Raises
    ------
    UsageError
        For a name that does not fit its unit, a kind without its form, a form that differs from `value` on
        impacts that stick and slide, and words that are none of those documented.
    """
    name = observable.name
    if not name.isidentifier() or (observable.unit == "deg") != name.endswith("_deg"):
        raise UsageError(
            f"Observable {name}: the name must be an identifier, and end with _deg where its unit is deg, "
            "nowhere else."
        )
    if unknown := (set(observable.takes).difference(_TAKEN)):
        raise UsageError(
            f"Observable {name} takes {', '.join(sorted(unknown))}: known are {', '.join(_TAKEN)}."
        )
    if observable.panel is not None and "</" in observable.panel:
        raise UsageError(f"Observable {name}: its panel contains '</', which would end the page's script.")
    incidence = Incidence.of(np.linspace(5.0, 80.0, 16), 0.2, -0.03, degrees=True)
    for e_n, mu, j in ((0.9, 0.1, 0.4), (0.6, 0.3, 2.0 / 3.0)):
        state = rebound_of(incidence, get_closure("fr"), e_n, 0.4, mu, j)
        value = np.asarray(observable.value(state, np.asarray(mu)))
        form = _by_form(observable, state, mu)
        if form is None:
            raise UsageError(f"Observable {name} is {observable.kind}, but lacks the form of that kind.")
        if not np.allclose(value, form, rtol=_ROUNDING, atol=_ROUNDING):
            raise UsageError(
                f"Observable {name}: value and the form of kind {observable.kind} differ by up to "
                f"{np.max(np.abs(value - form)):.3g}. Correct one of them."
            )
        if not np.all((observable.low <= value) & (value <= observable.high)):
            raise UsageError(f"Observable {name}: values of ordinary impacts lie outside its range.")


def _by_form(observable: Observable, state: Rebound, mu: float) -> Array | None:
    """Values by the form of the observable's kind; None where that is missing."""
    i, e_n, j = state.incidence, state.e_n, state.inertia_factor
    if observable.kind == "tangential" and observable.linear is not None:
        offset, slope = observable.linear(i, j)
        over = {"one": np.ones_like(e_n), "impulse": 1.0 + e_n, "rebound": e_n}[observable.scale]
        return np.asarray((offset + slope * state.impulse_factor) / over)
    if observable.kind == "normal" and observable.by_e_n is not None:
        return np.asarray(e_n * observable.by_e_n(i))
    if observable.kind == "curved" and observable.by_impulse is not None:
        return observable.by_impulse(i, state.impulse_factor, e_n, j)
    return np.full(e_n.shape, mu) if observable.kind == "friction" else None


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
            linear=lambda i, j: (np.zeros_like(i.sine), -i.slip_y),
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
            linear=_beta_cm,
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
            by_e_n=lambda i: np.ones_like(i.cosine),
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
            linear=_beta,
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
            by_impulse=_psi_after,
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
            by_impulse=_psi_out,
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
            linear=_mu_app,
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
            by_impulse=_delta,
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
            by_impulse=_beta_tot,
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
            by_impulse=_lambda,
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


def get_observable(name: str) -> Observable:
    """Look an observable up by its name in the common schema.

    Raises
    ------
    UsageError
        If there is none of that name; the message lists those there are.
    """
    return OBSERVABLES[name]
