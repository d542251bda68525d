"""The motion before an impact: speed, angle and direction, with their uncertainties."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.column_layout import Layout
from ifrfit.physics.angles import Array, sincos


@dataclass(frozen=True)
class Incoming:
    """Speed, angle and direction before; c, s: cosine and sine of the turn about z; sigmas may be NaN."""

    u: Array
    gamma_deg: Array
    tangential: Array
    c: Array
    s: Array
    sigma_u: Array
    sigma_gamma_deg: Array
    sigma_turn: Array

    def turned(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return components along and across the incoming tangential velocity.

        Without a turn a component that was not measured does not spoil the other.
        """
        straight = self.s == 0.0
        along = np.where(straight, self.c * x, self.c * x + self.s * y)
        across = np.where(straight, self.c * y, self.c * y - self.s * x)
        return along, across

    def turned_sigma(self, x: Array, y: Array, along: Array, across: Array) -> tuple[Array, Array]:
        """Return the uncertainties of turned components: those of the components and of the turn itself."""
        straight = self.s == 0.0
        c2, s2, turn2 = self.c**2, self.s**2, self.sigma_turn**2
        var_along = np.where(straight, c2 * x**2, c2 * x**2 + s2 * y**2) + zero_where_missing(
            across**2 * turn2
        )
        var_across = np.where(straight, c2 * y**2, c2 * y**2 + s2 * x**2) + zero_where_missing(
            along**2 * turn2
        )
        return np.sqrt(var_along), np.sqrt(var_across)

    def per_speed(self, value: Array, sigma: Array) -> tuple[Array, Array]:
        """Return a velocity over u, and its uncertainty with that of u."""
        ratio = value / self.u
        return ratio, np.sqrt(sigma**2 + zero_where_missing((ratio * self.sigma_u) ** 2)) / self.u


def zero_where_missing(x: Array) -> Array:
    """Return uncertainties with 0 for those that were not stated."""
    return np.where(np.isnan(x), 0.0, x)


def read_incoming(layout: Layout) -> Incoming:
    """Return the motion before from ``u_x, u_y, u_z``, or from speed and incidence angle.

    Raises
    ------
    DataError
        An impact does not approach the wall.
    """
    n = len(layout.cells)
    if not layout.has("raw:u_z"):
        gamma, u = layout.gamma(), layout.numbers("speed")
        require(layout, "speed", u, u > 0, "the speed must be positive")
        sine = sincos(gamma, degrees=True)[0]
        none = np.full(n, np.nan)
        sigma_gamma = layout.numbers("sigma_gamma")
        return Incoming(u, gamma, u * sine, np.ones(n), np.zeros(n), none, sigma_gamma, none)
    x, z = layout.numbers("raw:u_x"), layout.numbers("raw:u_z")
    y = layout.numbers("raw:u_y") if layout.has("raw:u_y") else np.zeros(n)
    require(layout, "raw:u_z", z, z > 0, z_rule(layout, "comes", "u_z"), z_remedy(layout))
    tangential = np.hypot(x, y)
    u = np.hypot(tangential, z)
    moving = tangential > 0.0
    length = np.where(moving, tangential, 1.0)
    c, s = np.where(moving, x / length, 1.0), np.where(moving, y / length, 0.0)
    given = [layout.numbers(f"sigma:raw:u_{axis}") for axis in "xyz"]
    known = ~np.isnan(given).all(axis=0)
    sx, sy, sz = (zero_where_missing(sigma) for sigma in given)
    along = np.hypot(c * sx, s * sy)
    sigma_u = np.sqrt((tangential * along) ** 2 + (z * sz) ** 2) / u
    sigma_gamma = np.degrees(np.hypot(z * along, tangential * sz) / u**2)
    turn = np.where(moving, np.hypot(s * sx, c * sy) / length, 0.0)
    return Incoming(
        u,
        np.degrees(np.arctan2(tangential, z)),
        tangential,
        c,
        s,
        np.where(known, sigma_u, np.nan),
        np.where(known, sigma_gamma, np.nan),
        np.where(known, turn, np.nan),
    )


def z_rule(layout: Layout, does: str, name: str) -> str:
    """Say which sign a normal velocity has: of a sphere that ``comes`` or ``leaves``."""
    out = layout.conventions.out_of_wall
    sign = "positive" if (does == "comes") != out else "negative"
    way = "points out of the wall by --convention z=out-of-wall" if out else "points into the wall"
    return f"z {way}, so a sphere that {does} has a {sign} {name}"


def z_remedy(layout: Layout) -> str:
    """Say what to do about a normal velocity of the wrong sign."""
    if layout.conventions.out_of_wall:
        return "Correct it."
    return "Correct it, or say --convention z=out-of-wall if z points out of the wall in this table."


def require(
    layout: Layout,
    key: str,
    values: Array,
    holds: NDArray[np.bool_],
    rule: str,
    remedy: str = "Correct it.",
) -> None:
    """Refuse the first row where a rule does not hold; what was not measured breaks none."""
    sign = layout.columns[key].sign  # that the file has
    layout.cells.refuse_first(
        ~holds & ~np.isnan(values),
        layout.header(key),
        lambda row: f"{sign * values[row]:g}, but {rule}. {remedy}",
    )
