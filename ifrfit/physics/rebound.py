"""What an impact does: velocities and spins after it, from one formula for all closures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array, Incidence, check_incidence, make_read_only, real_array
from ifrfit.physics.closure import Closure, rotational_share
from ifrfit.physics.closures import get_closure
from ifrfit.text import joined, number_of


def _plain(x: ArrayLike) -> Array:
    """An array as it is, a scalar as a numpy float (an array without dimension is neither)."""
    found: Array = np.asarray(x, dtype=float)[()]
    return found


def ratio(numerator: Array, denominator: Array) -> Array:
    """Quotient that is nan where the denominator vanishes: undefined, never a silent number."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return _plain(np.where(denominator == 0.0, np.nan, numerator / denominator))


def _angle(opposite: Array, adjacent: Array) -> Array:
    """Arc tangent with its quadrant (radians), nan where both sides vanish."""
    both_zero = (opposite == 0.0) & (adjacent == 0.0)
    return _plain(np.where(both_zero, np.nan, np.arctan2(opposite, adjacent)))


@dataclass(frozen=True)
class Rebound:
    """State after the impact, per incoming speed u. All arrays share one shape and are read-only.

    Attributes
    ----------
    v_x, v_y : ndarray
        Tangential velocity of the centre (x along the incoming tangential velocity).
    v_n : ndarray
        Normal speed away from the wall, e_n cos(gamma).
    spin_x, spin_y : ndarray
        R Omega/u in the paper's signs.
    sticking : ndarray of bool
        Whether the impact sticks; an impact without slip counts as sticking.
    impulse_factor : ndarray
        k: the tangential impulse per mass is -k U_t.
    incidence : Incidence
        State before.
    e_n : ndarray
    inertia_factor : float
        J = I/(m R^2).

    Examples
    --------
    >>> import ifrfit
    >>> r = ifrfit.rebound(60.0, spin_y=0.2, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
    >>> round(float(r.mu_app), 3)
    0.246
    """

    v_x: Array
    v_y: Array
    v_n: Array
    spin_x: Array
    spin_y: Array
    sticking: NDArray[np.bool_]
    impulse_factor: Array
    incidence: Incidence
    e_n: Array
    inertia_factor: float

    def __post_init__(self) -> None:
        make_read_only(self)

    @property
    def contact_x(self) -> Array:
        """Tangential velocity of the contact point along x, V_x/u; in k, so that it does not cancel."""
        return self._contact(self.incidence.slip_x)

    @property
    def contact_y(self) -> Array:
        """Tangential velocity of the contact point along y, V_y/u."""
        return self._contact(self.incidence.slip_y)

    def _contact(self, slip: Array) -> Array:
        return _plain(slip - self.impulse_factor * slip / rotational_share(self.inertia_factor))

    @property
    def beta(self) -> Array:
        """Tangential restitution of the contact point, -V_t/U_t; nan without slip (Eq. (25), signed)."""
        factor = self.impulse_factor / rotational_share(self.inertia_factor) - 1.0
        return _plain(np.where(self.incidence.slip == 0.0, np.nan, factor))

    @property
    def beta_cm(self) -> Array:
        """Tangential restitution of the centre, -v_x/u_x; nan at normal incidence (Eqs (28), (29))."""
        return ratio(-self.v_x, self.incidence.sine)

    @property
    def beta_tot(self) -> Array:
        """Speed after over speed before, of the centre."""
        return _plain(np.hypot(np.hypot(self.v_x, self.v_y), self.v_n))

    @property
    def _push(self) -> tuple[Array, Array]:
        """Minus the tangential impulse per mass."""
        k = self.impulse_factor
        return k * self.incidence.slip_x, k * self.incidence.slip_y

    @property
    def mu_app(self) -> Array:
        """Apparent friction P_x/P_n, signed; nan at grazing incidence (Eqs (30), (31))."""
        return ratio(self._push[0], (1.0 + self.e_n) * self.incidence.cosine)

    @property
    def mu_app_magnitude(self) -> Array:
        """|P_t|/|P_n|, the apparent friction of an impact with lateral spin."""
        return ratio(np.hypot(*self._push), (1.0 + self.e_n) * self.incidence.cosine)

    @property
    def delta(self) -> Array:
        """Rebound angle of the centre from the normal, radians (Eqs (32), (33) with the quadrant)."""
        return _angle(self.v_x, self.v_n)

    @property
    def lambda_(self) -> Array:
        """Lateral deviation in the plane of the wall, radians; nan if nothing moves along the wall."""
        return _angle(self.v_y, self.v_x)

    @property
    def tan_psi_after(self) -> Array:
        """V_x over the incoming normal velocity (Eqs (36), (37)); nan at grazing incidence."""
        return ratio(self.contact_x, self.incidence.cosine)

    @property
    def tan_psi_out(self) -> Array:
        """V_x over the outgoing normal velocity: the geometric angle; nan if nothing leaves the wall."""
        return ratio(self.contact_x, self.v_n)

    @property
    def psi_after(self) -> Array:
        """Angle of `tan_psi_after`, radians."""
        return _angle(self.contact_x, self.incidence.cosine)

    @property
    def psi_out(self) -> Array:
        """Angle of `tan_psi_out`, radians."""
        return _angle(self.contact_x, self.v_n)

    @property
    def energy_change(self) -> Array:
        """Change of kinetic energy, rotation included, over m u^2/2.

        Written in k so that it does not cancel at large spins (the slip energy is the only tangential
        part that an impact can change).
        """
        k = self.impulse_factor
        tangential = k * (k / rotational_share(self.inertia_factor) - 2.0) * self.incidence.slip**2
        return _plain((self.e_n**2 - 1.0) * self.incidence.cosine**2 + tangential)


class Reading(Rebound):
    """A rebound as it is read: its parts need not obey the mechanics of one impulse."""

    @property
    def contact_x(self) -> Array:
        """Velocity of the contact point along x, from those as read."""
        return self.v_x + self.spin_y

    @property
    def contact_y(self) -> Array:
        """Velocity of the contact point along y, from those as read."""
        return self.v_y + self.spin_x

    @property
    def beta(self) -> Array:
        """Tangential restitution of the contact point, from its velocities as read."""
        before = self.incidence
        along = self.contact_x * before.slip_x + self.contact_y * before.slip_y
        return ratio(-along, before.slip**2)


def rebound_of(
    incidence: Incidence, closure: Closure, e_n: ArrayLike, c: ArrayLike, mu: ArrayLike, j: float
) -> Rebound:
    """`rebound` for callers that hold an `Incidence`; c is the closure's own constant (ignored by F)."""
    e_n = np.asarray(e_n, dtype=float)
    kappa = friction_impulse(np.asarray(mu, dtype=float), e_n)
    k, sticking = closure.law(j).impulse(incidence, np.asarray(c, dtype=float), kappa)
    return rebound_with(incidence, k, sticking, e_n, j)


def friction_impulse(mu: Array, e_n: Array) -> Array:
    """kappa = mu (1 + e_n), finite: the impulse of friction in sliding, per mass and normal speed."""
    with np.errstate(over="ignore"):
        return np.minimum(mu * (1.0 + e_n), np.finfo(float).max)


def rebound_with(
    incidence: Incidence, k: Array, sticking: NDArray[np.bool_], e_n: Array, j: float
) -> Rebound:
    """Rebound whose tangential impulse per mass is -k U_t, whatever closure gave k."""
    push_x, push_y = k * incidence.slip_x, k * incidence.slip_y
    parts = np.broadcast_arrays(
        incidence.sine - push_x,
        # 0.0 - x rather than -x: a negative zero would turn lambda from 180 into -180 degrees
        0.0 - push_y,
        e_n * incidence.cosine,
        incidence.spin_x - push_y / j,
        incidence.spin_y - push_x / j,
        sticking,
        k,
        e_n,
    )
    v_x, v_y, v_n, s_x, s_y, sticking, k, e_n = (np.array(part)[()] for part in parts)
    return Rebound(v_x, v_y, v_n, s_x, s_y, sticking, k, incidence, e_n, j)


def closure_constant(closure: Closure, given: Mapping[str, ArrayLike | None]) -> ArrayLike:
    """Pick the closure's own constant out of those given; refuse a missing or a foreign one."""
    foreign = [name for name, value in given.items() if value is not None and name != closure.constant]
    if foreign:
        raise UsageError(
            f"Closure {closure.title} has no constant {foreign[0]}: it takes {', '.join(closure.constants)}."
        )
    if closure.constant is None:
        return 0.0
    value = given.get(closure.constant)
    if value is None:
        raise UsageError(f"Closure {closure.title} needs {closure.constant}: give {closure.constant}=...")
    return value


def rebound(
    gamma: ArrayLike,
    spin_x: ArrayLike = 0.0,
    spin_y: ArrayLike = 0.0,
    *,
    e_n: ArrayLike,
    e_t: ArrayLike | None = None,
    beta0: ArrayLike | None = None,
    mu: ArrayLike,
    chi: ArrayLike | None = None,
    closure: str = "ifr",
    inertia_factor: float | str = 0.4,
    degrees: bool = False,
    **constants: ArrayLike,
) -> Rebound:
    """Rebound of a sphere from a rough, massive wall, per incoming speed u.

    Parameters
    ----------
    gamma : array_like
        Incidence angle from the normal, 0 to pi/2 in radians, or 0 to 90 degrees if `degrees`.
    spin_x, spin_y : array_like
        R omega_x/u and R omega_y/u before, in the paper's signs: positive spin_y is back-spin, spin_x is
        minus the right-handed one.
    e_n, mu : array_like
        Normal restitution and friction, not negative. Like e_t and beta0, e_n may lie outside its passive
        domain, where an impact gains energy.
    e_t : array_like, optional
        Tangential restitution of IFR and IFR-contact.
    beta0 : array_like, optional
        Sticking restitution of FR.
    chi : array_like, optional
        Compliance number of closure maw, 7 (1 - nu)/(2 (2 - nu)) for a solid sphere of the wall's material.
    closure : str
        Name of the closure, see `ifrfit.physics.closures`.
    inertia_factor : float or str
        J = I/(m R^2): 2/5 solid sphere, 2/3 thin shell, 1/2 disc on its edge; also as "2/3".
    degrees : bool
        Take gamma in degrees; exact at 0, 30, 60 and 90.
    **constants : array_like
        Of a closure that was registered: its own constant by its name.

    Returns
    -------
    Rebound
        Arrays of the broadcast shape. What is undefined is nan.

    Raises
    ------
    UsageError
        For an unknown closure, constants that do not belong to it, and what is no number, outside its range,
        or of shapes that do not go together.

    Notes
    -----
    Doménech-Carbó (2023), Eqs (14)-(37), as one formula: k = a + min(b, kappa U_n/|U_t|), with
    kappa = mu (1 + e_n); the tangential impulse per mass is -k U_t. Closure maw takes k from the solution of
    Maw, Barber & Fawcett (1976) instead, see `ifrfit.physics.compliance`.

    Examples
    --------
    >>> import ifrfit
    >>> r = ifrfit.rebound([20.0, 60.0], e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
    >>> r.beta.round(3)
    array([ 0.7  , -0.124])
    >>> r.sticking
    array([ True, False])
    """
    chosen = get_closure(closure)
    c = closure_constant(chosen, {"e_t": e_t, "beta0": beta0, "chi": chi, **constants})
    numbers = {"gamma": gamma, "spin_x": spin_x, "spin_y": spin_y, "e_n": e_n, "mu": mu}
    if chosen.constant is not None:
        numbers[chosen.constant] = c
    arrays = {name: real_array(name, value) for name, value in numbers.items()}
    _check_ranges(arrays, degrees=degrees)
    incidence = Incidence.of(arrays["gamma"], arrays["spin_x"], arrays["spin_y"], degrees=degrees)
    c = arrays.get(chosen.constant or "", np.zeros(()))
    return rebound_of(incidence, chosen, arrays["e_n"], c, arrays["mu"], _inertia_factor(inertia_factor))


def _check_ranges(arrays: Mapping[str, Array], *, degrees: bool) -> None:
    """Refuse values for which there is no impact; nan stays nan, and a law knows the limits of its own."""
    check_incidence(arrays["gamma"], degrees=degrees)
    for name in ("e_n", "mu"):
        if (arrays[name] < 0.0).any():
            raise UsageError(f"{name} is {np.nanmin(arrays[name]):.9g}: it must be 0 or more.")
    shapes = {name: array.shape for name, array in arrays.items() if array.ndim}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        shown = joined([f"{name} {shape}" for name, shape in shapes.items()])
        raise UsageError(
            f"The shapes of {shown} do not go together. Give arrays as long as one another, or single "
            "numbers."
        ) from None


def _inertia_factor(given: object) -> float:
    if np.ndim(given) > 0:  # type: ignore[arg-type]
        raise UsageError("inertia_factor is an array: it must be one number, so call once for each body.")
    j = number_of(given)
    if j is None or not 0.0 < j < math.inf:
        raise UsageError(f"inertia_factor is {given!r:.60}: it must be positive (2/5 for a solid sphere).")
    return j
