"""What an observable is: its meaning, its value after an impact, its range.

Most are ``scale(e_n) * (offset + slope * k)``: linear in the impulse factor k up to a scale that depends on
e_n alone. Inference uses that form where there is one and the rebound itself where there is none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.rebound import Rebound, rebound_of

Scale = Literal["one", "impulse", "rebound"]  # 1, 1/(1 + e_n), 1/e_n
Kind = Literal["tangential", "normal", "friction", "curved"]
Undefined = Literal["contact", "normal", "rest", "grazing"]
Numerator = Literal["velocity", "spin", "contact"]

_TAKEN = ("Tx", "Ty", "Sx", "Sy", "N")
_ROUNDING = 1e-9
# gamma in degrees, spin_x, spin_y, and what of `Observable.undefined` holds there
_EXTREME: tuple[tuple[float, float, float, tuple[Undefined, ...]], ...] = (
    (30.0, 0.0, -0.5, ("contact",)),
    (0.0, 0.2, 0.3, ("normal",)),
    (0.0, 0.0, 0.0, ("rest", "normal", "contact")),
    (90.0, 0.2, 0.3, ("grazing",)),
)


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

    @property
    def ties_e_n(self) -> bool:
        """Whether the value sees e_n together with the impulse factor."""
        if self.kind == "tangential":
            return self.scale != "one"
        return self.kind == "curved" and not self.without_e_n

    def by_form(self, i: Incidence, k: Array, e_n: Array, mu: Array, j: float) -> Array:
        """Values at impulse factors k, by the form of the observable's kind; all broadcast.

        Raises
        ------
        UsageError
            If that form is missing.
        """
        if self.kind == "tangential" and self.linear is not None:
            offset, slope = self.linear(i, j)
            return np.asarray(scale_factor(self.scale, e_n) * (offset + slope * k))
        if self.kind == "normal" and self.by_e_n is not None:
            return np.asarray(e_n * self.by_e_n(i))
        if self.kind == "curved" and self.by_impulse is not None:
            return self.by_impulse(i, k, e_n, j)
        if self.kind == "friction":
            return np.asarray(mu)
        raise UsageError(f"Observable {self.name} is {self.kind}, but lacks the form of that kind.")


def scale_factor(scale: str, e_n: Array) -> Array:
    """Factor of tangential observables that depends on e_n alone."""
    if scale == "impulse":
        return np.asarray(1.0 / (1.0 + e_n))
    if scale == "rebound":
        return np.asarray(1.0 / np.maximum(e_n, 1e-300))
    return np.asarray(1.0)


def check_observable(observable: Observable) -> None:
    """Refuse an observable that contradicts itself.

    Raises
    ------
    UsageError
        For a name that does not fit its unit, a kind without its form, a form that differs from `value` on
        impacts that stick and slide, words that are none of those documented, and a value that is infinite,
        or that is nan where `undefined` does not say so.
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
        form = observable.by_form(incidence, state.impulse_factor, state.e_n, np.asarray(mu), j)
        if not np.allclose(value, form, rtol=_ROUNDING, atol=_ROUNDING):
            raise UsageError(
                f"Observable {name}: value and the form of kind {observable.kind} differ by up to "
                f"{np.max(np.abs(value - form)):.3g}. Correct one of them."
            )
        if not np.all((observable.low <= value) & (value <= observable.high)):
            raise UsageError(f"Observable {name}: values of ordinary impacts lie outside its range.")
    _check_undefined(observable)


def _check_undefined(observable: Observable) -> None:
    """Refuse infinite values, and nan that is not announced."""
    gamma, spin_x, spin_y, reasons = zip(*_EXTREME, strict=True)
    incidence = Incidence.of(np.array(gamma), np.array(spin_x), np.array(spin_y), degrees=True)
    state = rebound_of(incidence, get_closure("fr"), 0.9, 0.4, 0.1, 0.4)
    with np.errstate(all="ignore"):
        values = np.asarray(observable.value(state, np.asarray(0.1)))
    for at, value, why in zip(gamma, values, reasons, strict=True):
        if np.isinf(value) or (np.isnan(value) and not set(why) & set(observable.undefined)):
            raise UsageError(
                f"Observable {observable.name} is {value:g} at gamma = {at:g} degrees: let it be nan there, "
                f"and say so in undefined, by {' or '.join(why)}."
            )
