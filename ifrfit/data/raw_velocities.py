"""Raw velocities before and after, turned into velocities and spins per incoming speed.

Frame of the file: z points into the wall, x along the incoming tangential velocity, y completes a
right-handed frame; spins are right-handed. If the tangential velocity is not along x, everything is rotated
about z until it is. In the paper's signs omega_x is minus the right-handed one and omega_y is the same. A
file whose z points out of the wall is first turned half round about x (see `ifrfit.data.column_roles`).

Two equal spheres of mass m and radius R, with the impulse P on the first, change their relative velocity by
2 P/m and the sum of their spins by 2 R n x P/(J m R^2), n from the first to the second: as one sphere on a
wall does under the impulse per mass 2 P/m. So the same equations read both (docs/pairs.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.angular_momentum import check_momentum
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_names import RAW
from ifrfit.data.common_errors import dimension_of
from ifrfit.data.conventions import suggest
from ifrfit.data.readings_below_zero import made_by_noise, series_of
from ifrfit.data.schema import TINY
from ifrfit.data.table_forms import Piece, impact_ids
from ifrfit.errors import DataError
from ifrfit.physics.angles import Array, sincos
from ifrfit.physics.observables import OBSERVABLES

ANGLES_AFTER = ("raw:angle_after_from_normal", "raw:angle_after_from_wall")
_LARGEST = 1e9  # m/s, rad/s or m: beyond anything that hits a wall, far from overflow when squared


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

    def turned(
        self, x: Array, y: Array, sigma_x: Array, sigma_y: Array
    ) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return components along and across the incoming tangential velocity, each with its uncertainty.

        That is the one of the components and of the turn itself. Without a turn a component that was not
        measured does not spoil the other.
        """

        def mixed(c: Array, s: Array, own: Array, other: Array) -> Array:
            return c * own + np.where(self.s == 0.0, 0.0, s * other)

        along, across = mixed(self.c, self.s, x, y), mixed(self.c, -self.s, y, x)
        c2, s2, turn2 = self.c**2, self.s**2, self.sigma_turn**2
        var_along = mixed(c2, s2, sigma_x**2, sigma_y**2) + zero_where_missing(across**2 * turn2)
        var_across = mixed(c2, s2, sigma_y**2, sigma_x**2) + zero_where_missing(along**2 * turn2)
        return (along, np.sqrt(var_along)), (across, np.sqrt(var_across))

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
    if not _has_components(layout):
        gamma, u = layout.gamma(), layout.numbers("speed")
        require(layout, "speed", u, u > 0, "the speed must be positive")
        sine = sincos(gamma, degrees=True)[0]
        none = np.full(n, np.nan)
        sigma_gamma = layout.numbers("sigma_gamma")
        sigma_u = layout.numbers("sigma:raw:speed")
        return Incoming(u, gamma, u * sine, np.ones(n), np.zeros(n), sigma_u, sigma_gamma, none)
    normal = "u_z" if layout.has("raw:u_z") else "u_n"
    x, z = layout.numbers("raw:u_x"), layout.numbers(f"raw:{normal}")
    y = layout.numbers("raw:u_y") if layout.has("raw:u_y") else np.zeros(n)
    if normal == "u_z":
        require(layout, "raw:u_z", z, z > 0, z_rule(layout, "comes", "u_z"), z_remedy(layout))
    else:
        require(layout, "raw:u_n", z, z > 0, "u_n is the magnitude of the normal velocity before")
    tangential = np.hypot(x, y)
    u = np.hypot(tangential, z)
    moving = tangential > 0.0
    length = np.where(moving, tangential, 1.0)
    c, s = np.where(moving, x / length, 1.0), np.where(moving, y / length, 0.0)
    given = [layout.numbers(f"sigma:raw:{name}") for name in ("u_x", "u_y", normal)]
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


def _has_components(layout: Layout) -> bool:
    """Tell whether the velocity before is given by its components."""
    return layout.has("raw:u_z") or layout.has("raw:u_n")


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


def is_raw(layout: Layout) -> bool:
    """Tell whether a table gives raw velocities or spin rates."""
    return any(key.startswith("raw:") for key in layout.columns)


def _refuse_common_errors(layout: Layout) -> None:
    for key, column in layout.columns.items():
        if dimension_of(key) is not None:
            raise DataError(
                f"{layout.cells.at(header=column.header)}: errors that rows have in common are those of "
                "observables, and here are velocities and spins. Give observables, in a long table."
            )


def read_raw(layout: Layout, inertia_factor: float) -> list[Piece]:
    """Return the measured velocities and spins after each impact, per incoming speed.

    Quantities computed from both (beta and the like) are left out: they would count the impact twice. The
    check of angular momentum (v_t - J R Omega is conserved whatever the closure) is added to the layout.

    Parameters
    ----------
    layout : Layout
    inertia_factor : float
        J = I/(m R^2), for the check of angular momentum only.

    Raises
    ------
    DataError
        Columns are missing or do not go together, or an impact does not approach or does not leave the wall.
    """
    _check_columns(layout)
    _check_magnitudes(layout)
    _refuse_common_errors(layout)
    rows = np.arange(len(layout.cells))
    incoming = read_incoming(layout)
    radius = _radius(layout)
    before = _spins(layout, incoming, radius, "")
    after = _spins(layout, incoming, radius, "_after")
    common: dict[str, Any] = {
        "gamma_deg": incoming.gamma_deg,
        "sigma_gamma_deg": incoming.sigma_gamma_deg,
        "speed_m_s": incoming.u,
        "impact_id": impact_ids(layout),
        "n_repeats": np.ones(len(rows), dtype=np.int64),
    }
    for axis in "xy":
        value, sigma, _ = before.get(axis, (np.zeros(len(rows)), np.full(len(rows), np.nan), ""))
        common |= {f"spin_{axis}": value, f"sigma_spin_{axis}": sigma}
    results = _velocities(layout, incoming)
    results |= {f"spin_{axis}_after": after[axis] for axis in "yx" if axis in after}
    pieces = []
    for name in (o for o in OBSERVABLES if o in results):
        value, sigma, header = results[name]
        columns = {
            **common,
            "observable": np.full(len(rows), name, dtype=object),
            "value": value,
            "sigma": sigma,
        }
        headers = {**_headers(layout), "value": header, "sigma": f"sigma_{header}"}
        pieces.append(Piece(columns, rows, headers))
    if not pieces:
        raise DataError(
            f"{layout.cells.file}: no velocity after the impact. Add v_x_m_s and v_z_m_s, or "
            "omega_y_after_rad_s."
        )
    _check_momentum(layout, common, results, incoming, inertia_factor, spinning=bool(before))
    return pieces


def _check_momentum(
    layout: Layout,
    before: dict[str, Any],
    results: dict[str, tuple[Array, Array, str]],
    incoming: Incoming,
    inertia_factor: float,
    *,
    spinning: bool,
) -> None:
    """Check angular momentum and note an assumed spin before, where spin after was measured."""
    if "spin_y_after" not in results:
        return
    values = {name: value for name, (value, _, _) in results.items()}
    tangential, of_pair = incoming.tangential / incoming.u, layout.conventions.of_pair
    check = check_momentum(layout.cells, before, values, tangential, inertia_factor, of_pair=of_pair)
    layout.momentum.extend([check] if check else [])
    if not spinning:
        layout.notes.append(f"{layout.cells.name}: no spin before the impact is given; it was taken as 0.")


def _angle_header(layout: Layout) -> str:
    return layout.header(
        "gamma", layout.header("tan_gamma", layout.header("raw:u_x", layout.header("raw:u_n")))
    )


def _headers(layout: Layout) -> dict[str, str]:
    """Return the column that each column of the schema comes from, for messages."""
    angle = _angle_header(layout)
    headers = {"gamma_deg": angle, "speed_m_s": layout.header("speed", angle)}
    for axis in "xy":
        for kind in ("", "sigma_"):
            key = f"{kind and 'sigma:'}raw:omega_{axis}"
            headers[f"{kind}spin_{axis}"] = layout.header(key, f"{kind}omega_{axis}")
    return headers


def _check_columns(layout: Layout) -> None:
    cells = layout.cells
    derived = ("spin_", "sd:", *(f"sigma:{name}" for name in OBSERVABLES))
    for key, column in layout.columns.items():
        if key in RAW:
            raise DataError(
                f"{cells.at(header=column.header)}: no unit. Among raw velocities it needs one, for example "
                f"{key}_m_s, or say {suggest(f'unit:{column.header}=m/s')}."
            )
        if key in OBSERVABLES or key.startswith(derived) or key in ("value", "observable", "sigma", "sd"):
            raise DataError(
                f"{cells.at(header=column.header)}: does not go with raw velocities such as "
                f"{next(c.header for k, c in layout.columns.items() if k.startswith('raw:'))}. Keep the "
                "velocities and spins in one file, what was computed from them in another; beside what was "
                "computed a spin before impact is spin_y = R omega_y/u."
            )
    angled = layout.has_gamma
    if not _has_components(layout) and not (angled and layout.has("speed")):
        raise DataError(
            f"{cells.file}: the incoming velocity is missing. Add u_x_m_s and u_z_m_s (z points into the "
            "wall), or speed_m_s and gamma_deg."
        )
    for when, names in (("before", ("u_z", "u_n")), ("after", ("v_z", "v_n"))):
        if all(layout.has(f"raw:{name}") for name in names):
            raise DataError(
                f"{cells.file}: the normal velocity {when} is given twice, as {' and '.join(names)}. "
                f"Remove one."
            )
    normal = "u_z" if layout.has("raw:u_z") else "u_n"
    if _has_components(layout) and not layout.has("raw:u_x"):
        raise DataError(
            f"{cells.file}: there is {normal} but no u_x. Add u_x_m_s; it is 0 for a normal impact."
        )
    if _has_components(layout) and angled:
        raise DataError(
            f"{cells.file}: the incidence is given twice, by {_angle_header(layout)} and by "
            f"{layout.header('raw:u_x')}, {layout.header(f'raw:{normal}')}. Remove one."
        )
    _check_polar(layout)


def _check_polar(layout: Layout) -> None:
    """Refuse a speed after without its angle, the reverse, both beside components, and topspin beside u_y."""
    cells = layout.cells
    angles = [key for key in ANGLES_AFTER if layout.has(key)]
    components = [key for key in ("raw:v_x", "raw:v_y", "raw:v_z", "raw:v_n") if layout.has(key)]
    if len(angles) > 1:
        raise DataError(
            f"{cells.file}: the angle after is given twice, from the wall and from its normal. Remove one."
        )
    for there, missing, name in (
        (layout.has("raw:speed_after"), not angles, "angle after, such as angle_out_from_normal_deg"),
        (bool(angles), not layout.has("raw:speed_after"), "speed after, such as v_out_m_s"),
    ):
        if there and missing:
            given = layout.header("raw:speed_after" if not angles else angles[0])
            raise DataError(
                f"{cells.at(header=given)}: has no {name}, and neither says a velocity without the other. "
                f"Add it; "
                "a rebound angle alone is the column delta_deg."
            )
    if angles and components:
        raise DataError(
            f"{cells.file}: the velocity after is given twice, by {layout.header('raw:speed_after')} and by "
            f"{layout.header(components[0])}. Remove one."
        )
    if "spin" in layout.conventions.choices and _has_components(layout):
        x = layout.numbers("raw:u_x")
        rule = "topspin and backspin are about the way the ball goes, which is along x here"
        require(layout, "raw:u_x", x, x >= 0, rule, "Turn x round, or give omega_y.")
        if layout.has("raw:u_y"):
            raise DataError(
                f"{cells.at(header=layout.header('raw:u_y'))}: with a motion across x a spin without an "
                f"axis is no "
                "component. Give omega_x and omega_y."
            )


def _check_magnitudes(layout: Layout) -> None:
    """Refuse what no instrument gives before it is squared and divided."""
    for key in layout.columns:
        if "raw:" in key:
            values = layout.numbers(key)
            size = np.abs(values)
            possible = (size == 0) | ((size >= TINY) & (size <= _LARGEST))
            require(layout, key, values, possible, f"a measurement is 0 or between {TINY:g} and {_LARGEST:g}")
            if key.startswith("sigma:"):
                require(layout, key, values, values >= 0, "a standard uncertainty is positive")


def _radius(layout: Layout) -> tuple[Array, Array] | None:
    """Return radius and its uncertainty, None if no spin rate needs it."""
    rates = [column for key, column in layout.columns.items() if key.startswith("raw:omega_")]
    if layout.has("raw:radius") and layout.has("raw:diameter"):
        raise DataError(f"{layout.cells.file}: radius and diameter are both given. Remove one.")
    key, factor = ("raw:diameter", 0.5) if layout.has("raw:diameter") else ("raw:radius", 1.0)
    if not layout.has(key):
        if rates:
            raise DataError(
                f"{layout.cells.at(header=rates[0].header)}: a spin rate needs the size of the sphere. Add a "
                "column radius_m, radius_mm or diameter_mm."
            )
        return None
    radius = layout.numbers(key) * factor
    require(layout, key, radius, (radius > 1e-9) & (radius < 1e3), "a sphere has between 1e-9 and 1e3 m")
    if layout.has(f"sigma:{key}"):
        layout.notes.append(
            f"{layout.cells.name}: the uncertainty of the size ({layout.header(f'sigma:{key}')}) is common "
            "to all impacts, but enters each spin as if it were independent."
        )
    return radius, layout.numbers(f"sigma:{key}") * factor


def _components(
    layout: Layout, incoming: Incoming, keys: Sequence[str], missing: float = np.nan
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return a vector along and across the incoming tangential velocity, each with its uncertainty."""
    x, y = (layout.numbers(k) if layout.has(k) else np.full(len(layout.cells), missing) for k in keys)
    return incoming.turned(x, y, *(layout.numbers(f"sigma:{k}") for k in keys))


def _spins(
    layout: Layout, incoming: Incoming, radius: tuple[Array, Array] | None, when: str
) -> dict[str, tuple[Array, Array, str]]:
    """Return R omega/u in the paper's signs, its uncertainty and the header, by axis that is given."""
    keys = {axis: f"raw:omega_{axis}{when}" for axis in "xy"}
    given = [axis for axis in "xy" if layout.has(keys[axis])]
    if radius is None or not given:
        return {}
    # Before the impact an axis without a column has no spin; after it, it was not measured.
    rates = _components(layout, incoming, list(keys.values()), np.nan if when else 0.0)
    result = {}
    for axis, sign, (rate, sigma) in zip("xy", (-1.0, 1.0), rates, strict=True):
        if axis not in given and not np.any(incoming.s != 0.0):
            continue
        size, sigma_size = radius
        spread = np.sqrt((size * sigma) ** 2 + zero_where_missing((rate * sigma_size) ** 2))
        value, uncertainty = incoming.per_speed(sign * size * rate, spread)
        result[axis] = (value, uncertainty, layout.header(keys[axis], layout.header(keys[given[0]])))
    return result


def _of_polar(layout: Layout, incoming: Incoming) -> dict[str, tuple[Array, Array, str]]:
    """Return v_x and v_n over u of a speed after and its angle, with uncertainty and header.

    The angle is that of the way it leaves, positive towards where it came along the wall; one that flies back
    has a negative angle from the normal, and one above 90 degrees from the wall.
    """
    key = next(each for each in ANGLES_AFTER if layout.has(each))
    speed, angle = layout.numbers("raw:speed_after"), layout.numbers(key)
    require(layout, "raw:speed_after", speed, speed >= 0, "a speed is positive")
    from_wall = key.endswith("wall")
    low, high = (0.0, 180.0) if from_wall else (-90.0, 90.0)
    rule = f"a ball that leaves has {low:g} to {high:g} degrees from the {'wall' if from_wall else 'normal'}"
    layout.cells.refuse_first(
        ((angle < low) | (angle > high)) & ~np.isnan(angle),
        layout.header(key),
        lambda row: f"{angle[row]:g} degrees, but {rule}. Correct it.",
    )
    angle = 90.0 - angle if from_wall else angle
    sine, cosine = sincos(angle, degrees=True)
    of_speed, of_angle = (
        layout.numbers("sigma:raw:speed_after"),
        np.radians(layout.numbers("sigma:raw:angle_after")),
    )
    known = ~(np.isnan(of_speed) & np.isnan(of_angle))
    of_speed, of_angle = zero_where_missing(of_speed), zero_where_missing(of_angle) * speed
    header = layout.header("raw:speed_after")
    result = {}
    for name, along, across in (("v_x", sine, cosine), ("v_n", cosine, sine)):
        sigma = np.where(known, np.hypot(along * of_speed, across * of_angle), np.nan)
        result[name] = (*incoming.per_speed(along * speed, sigma), header)
    if known.any():
        layout.notes.append(
            f"{layout.cells.name}: v_x and v_n are of one speed and one angle after, and their errors "
            f"correlated; "
            "each has its own in full, the correlation is not kept."
        )
    return result


def _velocities(layout: Layout, incoming: Incoming) -> dict[str, tuple[Array, Array, str]]:
    """Return v_x, v_y and v_n over u, with uncertainty and header, as far as they were measured."""
    if layout.has("raw:speed_after"):
        return _of_polar(layout, incoming)
    result: dict[str, tuple[Array, Array, str]] = {}
    keys = ["raw:v_x", "raw:v_y"]
    for key, component in zip(keys, _components(layout, incoming, keys), strict=True):
        if layout.has(key):
            result[key.removeprefix("raw:")] = (*incoming.per_speed(*component), layout.header(key))
    key, sign = ("raw:v_z", -1.0) if layout.has("raw:v_z") else ("raw:v_n", 1.0)
    if layout.has(key):
        normal = layout.numbers(key)
        rule, remedy = "v_n is the magnitude of the normal velocity after", "Correct it."
        if sign < 0.0:
            rule, remedy = z_rule(layout, "leaves", "v_z"), z_remedy(layout)
        speed = incoming.per_speed(sign * normal, layout.numbers(f"sigma:{key}"))
        leaves = sign * normal >= 0
        if not leaves.all():
            of = OBSERVABLES["v_n"]
            leaves = leaves | made_by_noise(of, speed[0], incoming.gamma_deg, speed[1], series_of(layout))
        require(layout, key, normal, leaves, rule, remedy)
        result["v_n"] = (*speed, layout.header(key))
    return result
