"""What is read off the state after an impact, in numbers of any kind.

An observable is a quotient or an angle of two sides, and both sides come from velocities and spins by sums
and products alone, as somebody would compute them who holds the state before and after.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

# what its two sides make of each
READINGS: dict[str, Literal["quotient", "angle"]] = {
    "beta": "quotient",
    "beta_cm": "quotient",
    "beta_tot": "quotient",
    "mu_app": "quotient",
    "psi_after": "angle",
    "delta": "angle",
    "lambda": "angle",
}


class Sides(NamedTuple):
    """Numerator and denominator, or opposite and adjacent."""

    over: Any
    under: Any


def sides_of(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Sides]:
    """Both sides of every observable.

    Parameters
    ----------
    before : mapping
        sine, cosine of the incidence angle; spin_x, spin_y.
    after : mapping
        v_x, v_y, v_n, spin_x, spin_y. Numbers or arrays of one kind.

    Returns
    -------
    dict of str to Sides
        By name, as in the common schema; angles without their unit. lambda needs lateral spin to make sense.
    """
    sine, cosine = before["sine"], before["cosine"]
    slip_x, slip_y = sine + before["spin_y"], before["spin_x"]
    contact_x, contact_y = after["v_x"] + after["spin_y"], after["v_y"] + after["spin_x"]
    v_x, v_y, v_n = after["v_x"], after["v_y"], after["v_n"]
    return {
        "beta": Sides(
            -(contact_x * slip_x + contact_y * slip_y),
            slip_x * slip_x + slip_y * slip_y,
        ),
        "beta_cm": Sides(-v_x, sine),
        "beta_tot": Sides((v_x * v_x + v_y * v_y + v_n * v_n) ** 0.5, sine * 0 + 1),
        "mu_app": Sides(sine - v_x, cosine + v_n),
        "psi_after": Sides(contact_x, cosine),
        "delta": Sides(v_x, v_n),
        "lambda": Sides(v_y, v_x),
    }
