"""Rebound with tangential compliance: psi2 of psi1, and all the ways to find it but the table.

Mass, normal speed and largest approach are 1, so the load is P = (5/4) d^(3/2) and the normal speed
sqrt(1 - d^(5/2)) at an approach d. What is tangential is scaled by khat/mu, and its force by 1/mu: then
the normal and the tangential problem have one kernel, and chi is the only parameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array
from ifrfit.physics.compiling import compiled
from ifrfit.physics.compliance.law import compliance_table

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
STEPS = 4000
ANNULI = 80
_ROUNDS = 60  # in which the division into sticking and slipping annuli settles
_LOOKS = 256  # at a swing of the spring, to see where it first saturates
_HALVINGS = 50
METHODS = ("table", "memory", "annuli", "stronge")


@dataclass(frozen=True)
class Loading:
    """The collision up to its deepest point, in steps; unloading is its mirror image.

    Attributes
    ----------
    depth : ndarray, (n + 1,)
        Approach, 0 to 1.
    load : ndarray, (n + 1,)
        Normal force.
    time : ndarray, (n,)
        Duration of each step.
    speed : ndarray, (n,)
        Normal speed in the middle of each step.
    """

    depth: Array
    load: Array
    time: Array
    speed: Array


def loading(angles: Array) -> Loading:
    """Loading in steps between angles, ascending from 0 to pi/2; the approach is the sine of the angle.

    In the angle the time is smooth right up to the turning point.
    """
    depth = np.sin(angles)
    low, width = angles[:-1], np.diff(angles)
    nodes = low[:, None] + 0.5 * width[:, None] * (_POINTS + 1.0)
    time = 0.5 * width * (np.cos(nodes) / speed_at(nodes) @ _WEIGHTS)
    middle = 0.5 * (angles[:-1] + angles[1:])
    return Loading(depth, 1.25 * depth**1.5, time, speed_at(middle))


def speed_at(angle: Array) -> Array:
    """Normal speed where the approach is sin(angle); keeps its digits near the turning point."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt(-np.expm1(1.25 * np.log1p(-(np.cos(angle) ** 2)))))


def memory_ratio(psi1: Array, chi: Array, steps: int = STEPS) -> Array:
    """Scaled contact velocity after, psi2, of an elastic impact.

    Parameters
    ----------
    psi1, chi : ndarray, (n,)
        Scaled contact velocity before, 0 or more, and compliance number.
    steps : int
        Time steps of a collision; the error falls about with their square.

    Returns
    -------
    ndarray, (n,)

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101, in the limit of infinitely many annuli, the memory integral of
    Mindlin & Deresiewicz. Every approach d' that the contact went through carries a value D(d') between -1
    and 1: how far the tangential traction that came with it is towards slipping. Displacement and force are
    the integrals of D and of D P'(d') from 0 to the present approach. A step writes D at the rim of the
    contact only, so the history is a pile of runs of one value each, and a whole collision costs a number of
    operations proportional to its steps.
    """
    depth, load, time, speed = _steps(max(steps // 2, 2))
    solve = compiled(_collision)
    one = np.array(
        [solve(float(p), float(x), depth, load, time, speed) for p, x in zip(psi1, chi, strict=True)]
    )
    return one.reshape(np.shape(psi1))


@cache
def _steps(n: int) -> tuple[Array, Array, Array, Array]:
    """Depth and load at the ends of steps, their times, and the normal velocity in their middles."""
    part = loading(np.linspace(0.0, 0.5 * np.pi, n + 1))
    depth = np.concatenate((part.depth, part.depth[-2::-1]))
    load = np.concatenate((part.load, part.load[-2::-1]))
    speed = np.concatenate((part.speed, -part.speed[::-1]))
    return depth, load, np.concatenate((part.time, part.time[::-1])), speed


def _collision(  # pragma: no cover - compiled where numba is there
    psi1: float, chi: float, depth: Array, load: Array, time: Array, speed: Array
) -> float:
    """One collision. Runs of the memory lie on a pile: where each begins, and its value."""
    n = time.size
    begins = np.empty(n + 2)
    values = np.empty(n + 2)
    top = 0
    force = 0.0
    velocity = psi1
    for i in range(n):
        path = velocity * time[i]
        end = depth[i + 1]
        if end > depth[i]:
            gained = end - depth[i]
            value = path / gained
            if value > 1.0:
                value = 1.0
            elif value < -1.0:
                value = -1.0
            begins[top] = depth[i]
            values[top] = value
            top += 1
            force += value * (load[i + 1] - load[i])
            left = path - value * gained
        else:
            left = path
            last, last_load = depth[i], load[i]
            while top > 0 and begins[top - 1] >= end:
                top -= 1
                begin_load = 1.25 * begins[top] * np.sqrt(begins[top])
                left += values[top] * (last - begins[top])
                force -= values[top] * (last_load - begin_load)
                last, last_load = begins[top], begin_load
            if top > 0:
                left += values[top - 1] * (last - end)
                force -= values[top - 1] * (last_load - load[i + 1])
        if left != 0.0 and top > 0:
            sign = 1.0 if left > 0.0 else -1.0
            left = abs(left)
            last, last_load = end, load[i + 1]
            while top > 0:
                begin, room = begins[top - 1], 1.0 - sign * values[top - 1]
                if room * (last - begin) > left:
                    cut = last - left / room
                    cut_load = 1.25 * cut * np.sqrt(cut)
                    force += sign * room * (last_load - cut_load)
                    last = cut
                    break
                left -= room * (last - begin)
                begin_load = 1.25 * begin * np.sqrt(begin)
                force += sign * room * (last_load - begin_load)
                last, last_load = begin, begin_load
                top -= 1
            begins[top] = last
            values[top] = sign
            top += 1
        if i + 1 < n:
            # the share of the normal impulse that goes along the wall: exact where all of the contact slips
            velocity -= 2.0 * chi * (force / load[i + 1]) * (speed[i] - speed[i + 1])
    return velocity


def annuli_ratio(psi1: Array, chi: Array, annuli: int = ANNULI) -> Array:
    """Scaled contact velocity after, psi2, of an elastic impact.

    Parameters
    ----------
    psi1, chi : ndarray, (n,)
        Scaled contact velocity before, 0 or more, and compliance number.
    annuli : int
        The contact grows and shrinks by one annulus a step.

    Returns
    -------
    ndarray, (n,)

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101: their own scheme, a contact circle of equal annuli, each of
    which sticks or slips. It converges with the reciprocal of the number of annuli, and shares nothing with
    the memory function: the one is a check of the other.
    """
    one = [_by_annuli(float(p), float(x), annuli) for p, x in zip(psi1, chi, strict=True)]
    return np.array(one).reshape(np.shape(psi1))


@cache
def _annuli(n: int) -> tuple[Array, Array, Array, Array]:
    """Radii, displacements (i, j) and tractions (i, j) of unit distributions over circles j, their forces.

    With the effective modulus, the radius of the sphere and the largest approach 1; a unit distribution is
    sqrt(1 - r^2/a_j^2).
    """
    outer = np.arange(1, n + 1) / n
    middle = (outer - 0.5 / n)[:, None]
    inside = middle <= outer
    with np.errstate(invalid="ignore", divide="ignore"):
        within = 0.25 * np.pi / outer * (2.0 * outer**2 - middle**2)
        sine = np.minimum(outer / middle, 1.0)
        root = np.sqrt(np.maximum(middle**2 - outer**2, 0.0))
        beyond = 0.5 / outer * ((2.0 * outer**2 - middle**2) * np.arcsin(sine) + outer * root)
        traction = np.sqrt(np.maximum(1.0 - (middle / outer) ** 2, 0.0))
    force = 2.0 / 3.0 * np.pi * outer**2
    return middle[:, 0], np.where(inside, within, beyond), np.where(inside, traction, 0.0), force


def _by_annuli(psi1: float, chi: float, n: int) -> float:
    middle, displacement, traction, force = _annuli(n)
    radius = np.arange(n + 1) / n
    part = loading(np.arcsin(radius**2))
    times = np.concatenate((part.time, part.time[::-1]))
    contacts = np.concatenate((np.arange(1, n + 1), np.arange(n - 1, -1, -1)))
    mass = 16.0 / 15.0  # for which the deepest approach is 1
    unit, velocity, total = np.zeros(n), psi1, 0.0
    slips = np.zeros(n)  # of each annulus: -1, 0 or 1, the direction of its traction
    for h, k in zip(times, contacts, strict=True):
        old = displacement @ unit
        rate = chi / mass * h
        unit = np.zeros(n)
        if k:
            pressure = 2.0 / np.pi * np.sqrt(radius[k] ** 2 - middle[:k] ** 2)
            active = displacement[:k, :k], traction[:k, :k], force[:k]
            path = h * velocity - 0.5 * h * rate * total
            unit[:k], slips[:k] = _annuli_step(active, pressure, old[:k], path, 0.5 * h * rate, slips[:k])
        new = float(force @ unit)
        velocity -= rate * (total + new)
        total = new
    return velocity


def _annuli_step(
    active: tuple[Array, Array, Array], pressure: Array, old: Array, path: float, drag: float, slips: Array
) -> tuple[Array, Array]:
    """Distributions after a step, with the set of slipping annuli that is consistent with them.

    `path` less `drag` times the new force is how far the contact moves.
    """
    displacement, traction, force = active
    unit = np.zeros(pressure.size)
    for _ in range(_ROUNDS):
        sticks = slips == 0.0
        matrix = np.where(sticks[:, None], displacement + drag * force, traction)
        unit = np.linalg.solve(matrix, np.where(sticks, old + path, slips * pressure))
        shear = traction @ unit
        moved = path - drag * float(force @ unit) - (displacement @ unit - old)
        too_much = sticks & (np.abs(shear) > pressure * (1.0 + 1e-12))
        backwards = ~sticks & (moved * slips < 0.0)
        if not (too_much.any() or backwards.any()):
            break
        slips = np.where(too_much, np.sign(shear), np.where(backwards, 0.0, slips))
    return unit, slips


def stronge_ratio(psi1: Array, chi: Array, e_n: Array) -> Array:
    """Scaled contact velocity after, psi2.

    Parameters
    ----------
    psi1, chi, e_n : ndarray, (n,)
        Scaled contact velocity before (0 or more), compliance number, normal restitution.

    Returns
    -------
    ndarray, (n,)

    Notes
    -----
    Stronge (2000), Impact Mechanics, chapter 5; Stronge, James & Ravani (2001), Phil. Trans. R. Soc. A 359,
    2447: his lumped model, one tangential spring behind one Coulomb slider, from event to event. With the
    normal frequency 1 the spring swings with the frequency sqrt(2 chi) while the contact sticks, and the
    friction saturates where its stretch is the sine of the normal phase.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = 2.0 * chi * (1.0 + e_n) - np.where(e_n > 0.0, 1.0 / e_n, 0.0)
    # below 2 chi the contact sticks while it is pressed together, whatever the rebound
    gross = psi1 >= np.maximum(limit, np.maximum(2.0 * chi, 1.0))
    out = psi1 - 2.0 * chi * (1.0 + e_n)
    at = np.flatnonzero(~gross)
    if at.size:
        out[at] = _with_sticking(psi1[at], chi[at], e_n[at])
    return out


def _with_sticking(psi1: Array, chi: Array, e_n: Array) -> Array:
    frequency = np.sqrt(2.0 * chi)
    end = 0.5 * np.pi * (1.0 + e_n)
    start, velocity, stretch = _first_stick(psi1, chi, e_n)

    def swing(t: Array) -> tuple[Array, Array]:
        """Stretch and velocity of the spring at a time."""
        angle = frequency * (t - start)
        cosine, sine = np.cos(angle), np.sin(angle)
        return (
            stretch * cosine + velocity / frequency * sine,
            velocity * cosine - frequency * stretch * sine,
        )

    def excess(t: Array) -> Array:
        return np.asarray(np.abs(swing(t)[0]) - np.sin(_phase(t, e_n)))

    low, high = start, end
    found = np.zeros(start.size, dtype=bool)
    for share in np.arange(1, _LOOKS) / _LOOKS:
        t = start + share * (end - start)
        # the contact begins to stick just where the spring is saturated: rounding is no slip
        now = ~found & (excess(t) > 1e-12)
        high = np.where(now, t, high)
        low = np.where(found | now, low, t)
        found |= now
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        saturated = excess(middle) > 0.0
        low, high = np.where(saturated, low, middle), np.where(saturated, middle, high)
    stretched, velocity = swing(high)
    return np.asarray(velocity - np.sign(stretched) * 2.0 * chi * (e_n - _normal(high, e_n)))


def _first_stick(psi1: Array, chi: Array, e_n: Array) -> tuple[Array, Array, Array]:
    """When the contact first sticks, its velocity there, and the stretch of the spring."""
    slips = psi1 >= 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        early = (psi1 - 2.0 * chi) / (1.0 - 2.0 * chi)
        late = (psi1 - 2.0 * chi) * e_n / (1.0 - 2.0 * chi * e_n**2)
        while_pressing = np.arccos(np.clip(early, -1.0, 1.0))
        phase = np.arccos(np.clip(late, -1.0, 1.0))
    in_compression = psi1 <= 2.0 * chi
    time = np.where(in_compression, while_pressing, e_n * phase + 0.5 * np.pi * (1.0 - e_n))
    start = np.where(slips, time, 0.0)
    phase = _phase(start, e_n)
    velocity = psi1 - 2.0 * chi * (1.0 + _normal(start, e_n))
    return start, np.where(slips, velocity, psi1), np.where(slips, np.sin(phase), 0.0)


def _phase(t: Array, e_n: Array) -> Array:
    """Phase of the normal motion, pi/2 at the deepest point and pi at the end."""
    with np.errstate(divide="ignore", invalid="ignore"):
        later = 0.5 * np.pi + np.where(e_n > 0.0, (t - 0.5 * np.pi) / e_n, 0.0)
    return np.asarray(np.where(t <= 0.5 * np.pi, t, np.minimum(later, np.pi)))


def _normal(t: Array, e_n: Array) -> Array:
    """Normal velocity away from the wall, -1 at the beginning and e_n at the end."""
    pressing = t <= 0.5 * np.pi
    return np.asarray(-np.cos(_phase(t, e_n)) * np.where(pressing, 1.0, e_n))


def rebound_ratio(
    psi1: ArrayLike,
    chi: ArrayLike,
    *,
    method: str = "table",
    e_n: ArrayLike = 1.0,
    steps: int | None = None,
) -> Array:
    """Scaled tangential velocity of the contact point after an impact with tangential compliance.

    Parameters
    ----------
    psi1 : array_like
        khat/mu times |U_t|/U_n, where khat is the tangential over the normal stiffness. Signed: the result
        is odd in it.
    chi : array_like
        Compliance number khat (1 + 1/J)/2, see `ifrfit.physics.compliance.chi_of`.
    method : {"table", "memory", "annuli", "stronge"}
        table: the solution of Maw, Barber & Fawcett, tabulated (chi 0.65 to 3; error of psi2 below 1e-3,
        below 1e-4 for solid spheres). memory: the same by the memory function, for any chi. annuli: the same
        by a contact of concentric annuli. stronge: one spring and one slider.
    e_n : array_like
        Normal restitution. The elastic solutions are scaled, psi2 = s psi2(psi1/s) with s = (1 + e_n)/2;
        Stronge's model takes it as it is.
    steps : int, optional
        Of method memory: time steps (4000). Of method annuli: annuli (80).

    Returns
    -------
    ndarray
        psi2 = khat/mu times V_t/U_n along U_t; beta is -psi2/psi1. Of the broadcast shape; nan where an input
        is nan.

    Raises
    ------
    UsageError
        For an unknown method, a chi that the method does not cover, and steps that make no sense.

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101; Stronge, James & Ravani (2001), Phil. Trans. R. Soc. A 359,
    2447; scaling: Wu, Thornton & Li (2003), Adv. Powder Technol. 14, 435. From psi1 = s (4 chi - 1) on the
    contact slips throughout and psi2 = psi1 - 4 chi s.
    """
    if method not in METHODS:
        raise UsageError(f"There is no method '{method}'. Choose one of {', '.join(METHODS)}.")
    if steps is not None and (method not in ("memory", "annuli") or steps < 2):
        raise UsageError("steps belongs to the methods memory and annuli, and must be 2 or more.")
    signed, number, e = np.broadcast_arrays(
        np.asarray(psi1, dtype=float), np.asarray(chi, dtype=float), np.asarray(e_n, dtype=float)
    )
    if (number <= 0.0).any():
        raise UsageError(f"chi = {float(number.min()):g}: it must be positive.")
    out = np.full(signed.shape, np.nan)
    at = ~np.isnan(signed + number + e)
    size, number, e = np.abs(signed[at]), number[at], e[at]
    scale = np.ones_like(e) if method == "stronge" else 0.5 * (1.0 + e)
    scaled = size / scale
    if method == "stronge":
        found = stronge_ratio(size, number, e)
    elif method == "memory":
        found = memory_ratio(scaled, number, STEPS if steps is None else steps)
    elif method == "annuli":
        found = annuli_ratio(scaled, number, ANNULI if steps is None else steps)
    else:
        gross = scaled >= 4.0 * number - 1.0
        beta = compliance_table().beta(scaled, number)
        found = np.where(gross, scaled - 4.0 * number, -beta * np.where(gross, 0.0, scaled))
    out[at] = np.copysign(1.0, signed[at]) * scale * found
    return out[()]
