"""What single and double precision cost and lose on ordinary and on hard impacts, against fifty digits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.cost.impulse_balance import exact_impact, ifr
from ifrfit.cost.timing import Cost, Timing, one_thread, timed
from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array, Incidence, sincos
from ifrfit.physics.closures import get_closure
from ifrfit.physics.compiling import available
from ifrfit.physics.kernels import rebound_many
from ifrfit.physics.rebound import rebound_with

_SEED = 7
Real = NDArray[Any]
State = Mapping[str, Any]

DIGITS = 50
MANY = 200_000  # impacts a call when the time is taken
IMPACTS, QUICK_IMPACTS = 200, 40  # of each kind
SINGLE, DOUBLE, EXACT = "float32", "float64", f"{DIGITS} digits"
GIVEN = "the given impacts"
VELOCITIES = "velocities"
INERTIA = 0.4
STATE = ("v_x", "v_y", "v_n", "spin_x", "spin_y")
# an observable is a quotient or an angle of two sides, which come from velocities and spins by sums and
# products alone, as somebody would compute them who holds the state before and after
READINGS: dict[str, Literal["quotient", "angle"]] = {
    "beta": "quotient",
    "beta_cm": "quotient",
    "beta_tot": "quotient",
    "mu_app": "quotient",
    "psi_after": "angle",
    "delta": "angle",
    "lambda": "angle",
}


@dataclass(frozen=True)
class Impact:
    """Impacts before they happen.

    Attributes
    ----------
    gamma_deg, spin_x, spin_y : ndarray, (n,)
        Incidence angle in degrees; R omega/u in the paper's signs.
    """

    gamma_deg: Array
    spin_x: Array
    spin_y: Array


Draw = Callable[[np.random.Generator, int, float], tuple[Array, Array, Array]]


def _free(low: float, high: float, spin: float) -> Draw:
    """Angles in a range (degrees), with spins of this size about both axes."""
    return lambda rng, n, kappa: (
        rng.uniform(low, high, n),
        spin * rng.standard_normal(n),
        spin * rng.standard_normal(n),
    )


def _rolling_on(share: float) -> Draw:
    """Top-spin that takes all but this share of the slip."""

    def draw(rng: np.random.Generator, n: int, kappa: float) -> tuple[Array, Array, Array]:
        gamma = rng.uniform(20.0, 70.0, n)
        left = share * rng.uniform(0.5, 1.0, n) * rng.choice([-1.0, 1.0], n)
        return gamma, np.zeros(n), -np.sin(np.radians(gamma)) * (1.0 - left)

    return draw


def _transition(distance: float) -> Draw:
    """IFR without spin at its transition, tau = (5/2) kappa, to this relative distance."""

    def draw(rng: np.random.Generator, n: int, kappa: float) -> tuple[Array, Array, Array]:
        tau = 2.5 * kappa * (1.0 + distance * rng.uniform(-1.0, 1.0, n))
        return np.degrees(np.arctan(tau)), np.zeros(n), np.zeros(n)

    return draw


# names are rows of a table at the terminal: at most 24 letters
_DRAWS: dict[str, Draw] = {
    "5 to 80 deg, spins 0.3": _free(5.0, 80.0, 0.3),
    "at the transition": _transition(1e-6),
    "normal, below 0.001 deg": _free(1e-6, 1e-3, 0.0),
    "grazing, from 89 deg": _free(89.0, 89.9, 0.0),
    "grazing, from 89.999 deg": _free(89.999, 89.9999, 0.0),
    "slip cancels to 1e-3": _rolling_on(1e-3),
    "slip cancels to 1e-6": _rolling_on(1e-6),
    "spins of 1e3": _free(5.0, 80.0, 1e3),
    "spins of 1e6": _free(5.0, 80.0, 1e6),
}
HARD = tuple(_DRAWS)


def hard_impacts(name: str, count: int, kappa: float) -> Impact:
    """So many impacts of one kind, the same on every call.

    Parameters
    ----------
    name : str
        One of `HARD`.
    count : int
    kappa : float
        mu (1 + e_n), which decides where the transition lies.
    """
    return Impact(*_DRAWS[name](np.random.default_rng(_SEED), count, kappa))


def arithmetic_costs(
    *, gamma_deg: ArrayLike, spin_y: ArrayLike, e_n: float, e_t: float, mu: float, quick: bool = False
) -> list[Cost]:
    """Time an impact takes, and digits that are lost, in single and in double precision: IFR, solid spheres.

    Parameters
    ----------
    gamma_deg, spin_y : array_like
        Impacts, which broadcast; of more than 200 (quick: 40) as many are taken, evenly. Beside them the
        kinds of `ifrfit.cost.arithmetic_costs.HARD`, with the same constants.
    e_n, e_t, mu : float
    quick : bool

    Returns
    -------
    list of Cost
        Kind ``arithmetic``; setting: which impacts; quantity: ``velocities`` (and spins, over 1 + |s| with
        the spin before) or an observable, read off velocities and spins in the same precision. Error units
        ``1 + |s|``, ``1``, ``rad``. The error is the largest one over the impacts, infinite where a value
        that exists is lost. Seconds an impact: on 200,000 impacts a call with lateral spin on one thread,
        compiled where numba is there, else in numpy; of the fifty digits on the given impacts.

    Raises
    ------
    UsageError
        For constants that are no numbers.

    Notes
    -----
    A program in single precision holds its state and its constants in single precision: sine, cosine, spins,
    e_n, e_t and mu are rounded first, and that is part of the error. (An angle in single precision would lose
    more: 89.9999 degrees is known there to 8e-6 only.) The fifty digits are an impulse balance with vectors,
    `ifrfit.cost.impulse_balance`; their own row states how far they lie from seventy.
    """
    from mpmath import workdps

    if not all(math.isfinite(x) for x in (e_n, e_t, mu)):
        raise UsageError(f"e_n = {e_n}, e_t = {e_t}, mu = {mu}: give three numbers.")
    most = QUICK_IMPACTS if quick else IMPACTS
    given, constants = _given(gamma_deg, spin_y, most), {"e_n": e_n, "e_t": e_t, "mu": mu}
    kinds = {GIVEN: given} | {name: hard_impacts(name, most, mu * (1.0 + e_n)) for name in HARD}
    with workdps(DIGITS):
        exact = {name: _exact(impacts, constants) for name, impacts in kinds.items()}
        times = {name: _time(name, given, constants, quick) for name in (SINGLE, DOUBLE)}
        found = [
            Cost("arithmetic", name, kind, quantity, times[name], error, unit)
            for name in times
            for kind, impacts in kinds.items()
            for quantity, error, unit in errors(impacts, constants, np.dtype(name), exact[kind])
        ]
        time = timed(lambda: _exact(given, constants), repeats=1, enough=0.0).per(given.gamma_deg.size)
    with workdps(DIGITS + 20):
        more = _exact(given, constants)
        own = max(_off(more[name], exact[GIVEN][name]).max() for name in STATE)
    return [*found, Cost("arithmetic", EXACT, GIVEN, VELOCITIES, time, own, "1 + |s|")]


def errors(
    impacts: Impact, constants: Mapping[str, float], dtype: np.dtype[Any], exact: State
) -> list[tuple[str, float, str]]:
    """Quantity, largest error and its unit of impacts that are computed in one precision.

    Parameters
    ----------
    impacts : Impact
    constants : mapping
        e_n, e_t, mu.
    dtype : dtype
    exact : mapping
        State before and after in arrays of mpmath's numbers, inside a `workdps` that holds them.
    """
    before, after = computed(impacts, constants, dtype)
    scale = 1.0 + np.hypot(impacts.spin_x, impacts.spin_y)
    off = max(float(np.max(_off(exact[name], after[name]) / scale)) for name in STATE)
    found = [(VELOCITIES, off, "1 + |s|")]
    true = {"sine": exact["sine"], "cosine": exact["cosine"], "spin_x": exact["before_x"]}
    true["spin_y"] = exact["before_y"]
    rounded, expected = sides_of(before, after), sides_of(true, exact)
    for name, kind in READINGS.items():
        if name == "lambda" and not impacts.spin_x.any():
            continue
        read, known = rounded[name], expected[name]
        worst = _quotient(read, known) if kind == "quotient" else _angle(read, known)
        found.append((name, worst, "1" if kind == "quotient" else "rad"))
    return found


class Sides(NamedTuple):
    """Numerator and denominator, or opposite and adjacent."""

    over: Real
    under: Real


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


def computed(
    impacts: Impact, constants: Mapping[str, float], dtype: np.dtype[Any]
) -> tuple[State, dict[str, Real]]:
    """State before and after in one precision, by the package's own kernels."""
    sine, cosine = sincos(impacts.gamma_deg, degrees=True)
    columns = (sine, cosine, impacts.spin_x, impacts.spin_y)
    rounded = [np.ascontiguousarray(x).astype(dtype) for x in columns]
    before = dict(zip(("sine", "cosine", "spin_x", "spin_y"), rounded, strict=True))
    return before, _kernel(before, constants)


def _kernel(before: State, constants: Mapping[str, float]) -> dict[str, Real]:
    sine, cosine, s_x, s_y = (before[name] for name in ("sine", "cosine", "spin_x", "spin_y"))
    if available():
        e_n, e_t, mu = (constants[name] for name in ("e_n", "e_t", "mu"))
        many = rebound_many(sine, cosine, s_y, s_x, e_n=e_n, e_t=e_t, mu=mu)
        return {name: np.asarray(getattr(many, name)) for name in STATE}
    real = sine.dtype.type
    rest, sprung = real(constants["e_n"]), real(constants["e_t"])
    incidence = Incidence(sine, cosine, s_x, s_y, sine + s_y, s_x)
    law = get_closure("ifr").law(INERTIA)
    k, sticks = law.impulse(incidence, sprung, real(constants["mu"]) * (real(1.0) + rest))
    found = rebound_with(incidence, k, sticks, rest, INERTIA)
    return {name: np.asarray(getattr(found, name)) for name in STATE}


def _given(gamma_deg: ArrayLike, spin_y: ArrayLike, most: int) -> Impact:
    gamma, spin = (
        np.asarray(x, dtype=float).ravel() for x in np.broadcast_arrays(np.asarray(gamma_deg), spin_y)
    )
    rows = np.linspace(0, gamma.size - 1, min(gamma.size, most)).round().astype(int)
    return Impact(gamma[rows], np.zeros(rows.size), spin[rows])


def _exact(impacts: Impact, constants: Mapping[str, float]) -> dict[str, Real]:
    """State before and after, in mpmath's numbers."""
    from mpmath import mpf

    numbers = {"constant": constants["e_t"], "e_n": constants["e_n"], "mu": constants["mu"]}
    columns = (impacts.gamma_deg, impacts.spin_x, impacts.spin_y)
    one = [exact_impact(*row, law=ifr, **numbers) for row in zip(*(x.tolist() for x in columns), strict=True)]
    found = {name: np.array([state[name] for state in one], dtype=object) for name in one[0]}
    for name, spins in (("before_x", impacts.spin_x), ("before_y", impacts.spin_y)):
        found[name] = np.array([mpf(x) for x in spins.tolist()], dtype=object)
    return found


def _off(exact: Real, found: Real) -> NDArray[np.float64]:
    """Absolute differences; infinite where nothing was found."""
    gaps = [abs(one - two) for one, two in zip(exact.tolist(), found.tolist(), strict=True)]
    return np.array([float(gap) if gap == gap else math.inf for gap in gaps])


def _quotient(read: Any, known: Any) -> float:
    there = known.under != 0
    with np.errstate(divide="ignore", invalid="ignore"):
        found = read.over / read.under
    gaps = _off(known.over[there] / known.under[there], found[there])
    return float(np.max(gaps, initial=0.0))


def _angle(read: Any, known: Any) -> float:
    """Radians, the short way round."""
    from mpmath import atan2

    there = (known.over != 0) | (known.under != 0)
    exact = [atan2(y, x) for y, x in zip(known.over[there], known.under[there], strict=True)]
    gaps = _off(np.array(exact, dtype=object), np.arctan2(read.over, read.under)[there])
    return float(np.max(np.minimum(gaps, np.abs(2.0 * math.pi - gaps)), initial=0.0))


def _time(name: str, given: Impact, constants: Mapping[str, float], quick: bool) -> Timing:
    rows = np.resize(np.arange(given.gamma_deg.size), MANY)
    wide = Impact(given.gamma_deg[rows], given.spin_x[rows], given.spin_y[rows])
    before, _ = computed(wide, constants, np.dtype(name))
    repeats, enough = (3, 0.01) if quick else (5, 0.05)
    with one_thread():
        return timed(lambda: _kernel(before, constants), repeats=repeats, enough=enough).per(MANY)
