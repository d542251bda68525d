"""Slips with a size, one number beside the constants, and what a measurement that is off by it reads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from ifrfit.inference.diagnostics.independence import is_sorted_by_values
from ifrfit.inference.diagnostics.thresholds import RANGE_OF_SPEEDS
from ifrfit.inference.model.noise import normalised
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Array, Index
from ifrfit.physics.angles import Incidence
from ifrfit.physics.inertia import BALLS, GREATEST, LEAST
from ifrfit.physics.observable import Observable
from ifrfit.physics.rebound import Reading, Rebound, rebound_with

Size = float | Array
_STEP = 1e-5  # of derivatives, in the unit of the size
_TIED = 0.8  # correlation with angle or speed from which the order of the rows is no time
_FEWEST_IMPACTS = 8  # below which no drift is looked for
_USUAL_SHARE = 0.15  # of the domain of the closure's own constant by which it may change
GRAVITY = 9.81  # m/s^2
_HEIGHT = "height", 0.5, 0.02  # m, the largest and the usual one
_FALL = "fall", 1.0, 0.05  # 2 g h/u^2, likewise
# by how many times their size velocities are off, along the wall and towards it before, along and away after;
# the smallest size and the largest, and the usual one, of the median speed
_ZEROS = {
    "zero-along": ((1.0, 0.0, 1.0, 0.0), -0.6, 0.6, 0.1),
    "zero-across": ((0.0, 1.0, 0.0, -1.0), -0.6, 0.6, 0.03),
    "fall-between": ((0.0, -1.0, 0.0, -1.0), 0.0, 0.2, 0.03),
    "zero-along-after": ((0.0, 0.0, 1.0, 0.0), -0.2, 0.2, 0.02),
    "zero-across-after": ((0.0, 0.0, 0.0, 1.0), -0.2, 0.2, 0.02),
}
_MOVING = "zero-along"  # which may make sliding of sticking, and no line then
_PLACES = ("x_before", "z_before", "x_after", "z_after")
_REBOUND = "delta_deg"  # the angle of rebound as it is read
_OF_CONTACT = ("beta", "tan_psi_after")  # its velocity after impact over one before
_PARTS = (0.25, 0.5, 0.75)  # of the table, after which e_n may have changed


Sized = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Flaw:
    """By how much a measurement is off; nothing by default. Of several, each field is a column, (m, 1).

    Attributes
    ----------
    offset : float or ndarray
        Degrees by which the true angle of incidence exceeds the given one.
    angle : float or ndarray
        Share by which angles of incidence are read too large.
    turn : float or ndarray
        Degrees by which the camera is turned against the normal of the wall: the angle it reads before
        impact is larger by so much, the one after impact smaller.
    speed : float or ndarray
        Share by which velocities after impact are read too large.
    along : float or ndarray
        Share by which components along the wall, before impact and after, are read too large beside those
        across it: pixels that are no squares, or a camera that looks at an angle.
    spin : float or ndarray
        Share by which spins, before and after, are read too large.
    constant_spin : float or ndarray
        R omega_y/u of every impact that the table does not hold.
    rolled : float or ndarray
        Share of pure rolling before impact, R omega_y = -u sin(gamma), that the table does not hold.
    spin_zero : float or ndarray
        R omega_y/u by which the true spin before every impact exceeds the given one.
    gained : float or ndarray
        Square of the speed towards the wall, over u^2, by which gravity raised it after it was read.
    lost : float or ndarray
        The same of the speed away from it, by which gravity lowered it before it was read.
    x_before, z_before, x_after, z_after : float or ndarray
        By which the velocity along the wall, and the one towards it before and away from it after, is read
        too large, over u.
    """

    offset: Size = 0.0
    angle: Size = 0.0
    turn: Size = 0.0
    speed: Size = 0.0
    along: Size = 0.0
    spin: Size = 0.0
    constant_spin: Size = 0.0
    rolled: Size = 0.0
    spin_zero: Size = 0.0
    gained: Size = 0.0
    lost: Size = 0.0
    x_before: Size = 0.0
    z_before: Size = 0.0
    x_after: Size = 0.0
    z_after: Size = 0.0

    def has(self, *names: str) -> bool:
        """Whether anything is off in one of these."""
        return any(bool(np.any(getattr(self, name))) for name in names)

    @property
    def _by_row(self) -> dict[str, Array]:
        """What differs from row to row."""
        sizes = {name: np.asarray(size) for name, size in vars(self).items()}
        return {name: x for name, x in sizes.items() if x.ndim > 0 and x.shape[-1] > 1}

    def of_rows(self, place: slice | Index) -> Flaw:
        """What is off in some of the rows, where it differs from row to row."""
        return replace(self, **{name: x[..., place] for name, x in self._by_row.items()})

    def is_same(self, first: Index, impact: Index) -> bool:
        """Whether all rows of an impact have what the first of them has."""
        return all(np.array_equal(x, x[..., first[impact]]) for x in self._by_row.values())


def readings(problem: Problem, theta: Array, flaw: Flaw) -> Array:
    """Value of each row, without noise, as a flawed measurement has it.

    Parameters
    ----------
    problem : Problem
        With angles and spins as given.
    theta : ndarray, (..., p)
    flaw : Flaw

    Returns
    -------
    ndarray, (..., n)
    """
    rows = problem.rows
    shared = rows.shared_incidence
    if shared is not None and flaw.is_same(*shared):  # several values of one impact
        first, impact = shared
        problem, flaw = replace(problem, rows=rows.take(first)), flaw.of_rows(first)
    else:
        impact = np.arange(len(rows))
    read = [
        _read(replace(problem, rows=block), theta, flaw.of_rows(place), rows.measured)
        for place, block in problem.rows.blocks
    ]
    out = np.empty((*theta.shape[:-1], len(rows)))
    for (_, at, _), values in zip(rows.by_observable, zip(*read, strict=True), strict=True):
        out[..., at] = np.concatenate(values, axis=-1)[..., impact[at]]
    return out


def flawed(problem: Problem, theta: Array, size: Array, flaw: Callable[[Array], Flaw]) -> Array:
    """Readings at theta, (m, p), with a flaw of each size, (m,): impacts of one size are worked out once."""
    each, which = np.unique(size, return_inverse=True)
    if each.size == 1:
        return readings(problem, theta, flaw(each[:, None]))
    out = np.empty((len(theta), len(problem.rows)))
    for number in range(each.size):
        at = np.flatnonzero(which == number)
        out[at] = readings(problem, theta[at], flaw(each[number : number + 1, None]))
    return out


def _read(problem: Problem, theta: Array, flaw: Flaw, observables: Sequence[Observable]) -> list[Array]:
    """Each of these observables of every row's impact, (..., n) each."""
    given, before = problem.rows.incidence, _velocity_before(problem, flaw)
    true = _true_incidence(problem, flaw, before)
    e_n, c, mu = problem.per_row(theta)
    law = problem.closure.law(problem.inertia_factor)
    k, sticks = law.impulse(true, c, mu * (1.0 + e_n))
    state = rebound_with(true, k, sticks.astype(bool), e_n, problem.inertia_factor)
    if _is_of_incidence(flaw):  # the values are those of the true impact
        return _values(observables, state, mu)
    cosine, sine = np.cos(np.radians(flaw.turn)), np.sin(np.radians(flaw.turn))
    # everything is over the incoming speed as it is read
    length = 1.0 / np.hypot(*before)
    speed, spin, stretch = (1.0 + flaw.speed) / length, (1.0 + flaw.spin) / length, 1.0 + flaw.along
    v_x = speed * stretch * (state.v_x * cosine - state.v_n * sine)
    v_n = speed * (state.v_n * cosine + state.v_x * sine)
    if np.any(flaw.lost):
        v_n = np.sqrt(np.maximum(v_n**2 - flaw.lost, 0.0))
    v_x, v_n = v_x + flaw.x_after, v_n + flaw.z_after
    v_y, spin_x, spin_y = speed * stretch * state.v_y, spin * state.spin_x, spin * state.spin_y
    with np.errstate(divide="ignore", invalid="ignore"):
        own_e_n = np.where(given.cosine == 0.0, np.nan, v_n / given.cosine)
        impulse = np.where(given.slip_x == 0.0, np.nan, (given.sine - v_x) / given.slip_x)
    parts = (v_x, v_y, v_n, spin_x, spin_y, sticks.astype(bool), impulse)
    return _values(observables, Reading(*parts, given, own_e_n, problem.inertia_factor), mu)


def _true_incidence(problem: Problem, flaw: Flaw, before: tuple[Array, Array]) -> Incidence:
    """The impacts as they were, from what is given of them and their true velocities before."""
    given, (along, towards) = problem.rows.incidence, before
    gamma, speed = np.degrees(np.arctan2(along, towards)), np.hypot(along, towards)
    scale = 1.0 / speed / (1.0 + flaw.spin)
    spin_y = scale * given.spin_y + flaw.constant_spin + flaw.spin_zero - flaw.rolled * along / speed
    return Incidence.of(np.clip(gamma, 0.0, 90.0), scale * given.spin_x, spin_y, degrees=True)


def _velocity_before(problem: Problem, flaw: Flaw) -> tuple[Array, Array]:
    """True velocities along the wall and towards it, over the speed that was read."""
    gamma = np.radians((problem.rows.gamma_deg + flaw.offset - flaw.turn) / (1.0 + flaw.angle))
    along, towards = np.sin(gamma) / (1.0 + flaw.along), np.cos(gamma)
    if np.any(flaw.gained):
        towards = np.sqrt(np.maximum(towards**2 + flaw.gained, 0.0))
    return along - flaw.x_before, towards - flaw.z_before


def _is_of_incidence(flaw: Flaw) -> bool:
    """Whether nothing but the angle of incidence or the zero of the spin before impact is off."""
    own = ("offset", "angle", "spin_zero")
    return not flaw.has(*(name for name in vars(flaw) if name not in own))


def _values(observables: Sequence[Observable], state: Rebound, mu: Array) -> list[Array]:
    return [np.broadcast_to(each.value(state, mu), mu.shape) for each in observables]


def of_inertia(problem: Problem, theta: Array, share: Array) -> Array:
    """Value of each row with inertia factors that are larger by shares of themselves, (m, n).

    The closure's own constant keeps its place within its domain, which depends on the inertia factor.
    """
    out = np.empty((len(theta), len(problem.rows)))
    for one in np.unique(share):
        at = share == one
        other = replace(problem, inertia_factor=problem.inertia_factor * (1.0 + float(one)))
        out[at] = other.predict(_within_domain(other, theta[at], problem.inertia_factor))
    return out


def _within_domain(problem: Problem, theta: Array, before: float) -> Array:
    """Constants of another inertia factor, `before`, carried over to the domain of that of the problem."""
    name, closure = problem.closure.constant, problem.closure
    if not name or not closure.bilinear or problem.parameters[name].passive is not None:
        return theta
    (from_low, from_high), (low, high) = closure.domain(before), closure.domain(problem.inertia_factor)
    places = np.unique(problem.parameters.positions[name])
    moved = theta.copy()
    moved[:, places] = low + (theta[:, places] - from_low) * (high - low) / (from_high - from_low)
    return moved


@dataclass(frozen=True)
class Nuisance:
    """A slip of unknown size.

    Attributes
    ----------
    name : str
    values : callable
        From theta, (m, p), and sizes, (m,), to the value of each row, (m, n).
    limits : tuple of float
        Smallest and largest size that is searched.
    usual : float
        Prior standard deviation of the size: a slip of several times that is unlikely, however well it fits.
    likely : tuple of float
        Sizes that the prior is centred at, the nearest of which counts.
    constant : str
        That changes by the size in the course of the table; empty for others.
    series : str
        The one series it is in; empty where it is in all.
    share : float
        Of one hypothesis, in the correction for their number: less where several are ways of one slip.
    far : tuple of float
        Sizes that are looked at where no line shows it, and something else is amiss.
    of_rows : callable, optional
        From rows to `values` of these alone.
    """

    name: str
    values: Sized
    limits: tuple[float, float]
    usual: float
    likely: tuple[float, ...] = (0.0,)
    constant: str = ""
    series: str = ""
    share: float = 1.0
    far: tuple[float, ...] = ()
    of_rows: Callable[[Index], Sized] | None = None

    @property
    def most(self) -> float:
        """Largest size, of either sign, that is searched."""
        return max(map(abs, self.limits))

    def slope(self, theta: Array) -> Array:
        """Derivative of every row's value by the size, (n,)."""
        up, down = self.values(np.stack((theta, theta)), np.array([_STEP, -_STEP]))
        return np.asarray(np.nan_to_num((up - down) / (2.0 * _STEP)))


def nuisances(problem: Problem) -> Iterator[Nuisance]:
    """Every slip of unknown size that these rows could show."""

    def read(name: str, most: float, usual: float, flaw: Callable[[Array], Flaw]) -> Nuisance:
        def of_rows(rows: Index | None = None) -> Sized:
            part = _part(problem, rows)
            return lambda theta, size: flawed(part, theta, size, flaw)

        return Nuisance(name, of_rows(), (-most, most), usual, of_rows=of_rows)

    measured = {each.numerator for each in problem.rows.observables}
    oblique = [each for each in problem.rows.observables if each.kind in OBLIQUE]
    if any(each.has_angle for each in problem.rows.observables):
        low, high = problem.offset_range
        offset = read("angle-offset", 10.0, 2.0, lambda x: Flaw(offset=x))
        yield replace(offset, limits=(max(low, -10.0), min(high, 10.0)))
        yield read("angle-scale", 0.5, 0.05, lambda x: Flaw(angle=x))
        yield read("camera-turn", 10.0, 2.0, lambda x: Flaw(turn=x))
    if _REBOUND in problem.rows.names:
        yield from _of_rebound(problem)
    if "velocity" in measured or any(not each.numerator for each in oblique):
        yield read("speed-scale", 0.5, 0.05, lambda x: Flaw(speed=x))
        if any(each.has_angle for each in oblique):
            yield read("scale-along-wall", 0.5, 0.05, lambda x: Flaw(along=x))
    if "spin" in measured or problem.rows.incidence.spin_y.any():
        yield read("spin-scale", 0.5, 0.2, lambda x: Flaw(spin=x))
        if problem.rows.incidence.spin_y.any() and oblique:
            yield read("spin-zero", 0.5, 0.05, lambda x: Flaw(spin_zero=x))
    # who knows the velocity of the contact point before impact knows its spin
    of_parts = any(not {"Tx", "Sy"} <= each.takes for each in oblique)
    if of_parts and not (problem.rows.incidence.spin_y.any() or problem.rows.incidence.spin_x.any()):
        yield read("incoming-spin", 5.0, 0.5, lambda x: Flaw(constant_spin=x))
        yield read("incoming-roll", 1.5, 0.5, lambda x: Flaw(rolled=x))
    if oblique:
        j = problem.inertia_factor
        # spins beside velocities show it by themselves; without, any law of sticking looks like one
        shown = {each.numerator == "spin" for each in oblique} == {True, False}
        yield Nuisance(
            "inertia-factor",
            partial(of_inertia, problem),
            (LEAST / j - 1.0, GREATEST / j - 1.0),
            0.3 if shown else 0.05,
            likely=(0.0, *(body / j - 1.0 for body in BALLS)),
            of_rows=lambda rows: partial(of_inertia, _part(problem, rows)),
        )
    contact = [i for i, name in enumerate(problem.rows.names) if name in _OF_CONTACT]
    on_contact = np.isin(problem.rows.which, contact)
    if on_contact.any():
        yield _scaled("contact-scale", problem, on_contact.astype(float), (-0.5, 0.5), 0.05)
    yield from _of_height(problem)
    yield from _of_zeros(problem)
    yield from _of_largest(problem)
    yield from _drifts(problem)


def _of_height(problem: Problem) -> Iterator[Nuisance]:
    """Velocities as they were above a floor: by metres, or by 2 g h/u^2 where a speed is not stated."""
    if not problem.rows.of_kind("normal", "curved").any():
        return
    speed = problem.speeds
    known = bool((speed > 0.0).all())
    unit = 2.0 * GRAVITY / speed**2 if known else np.ones(speed.size)
    kind, most, usual = _HEIGHT if known else _FALL

    def read(name: str, before: bool, after: bool) -> Nuisance:
        def of_rows(rows: Index | None = None) -> Sized:
            part, own = _part(problem, rows), unit if rows is None else unit[rows]

            def flaw(size: Array) -> Flaw:
                return Flaw(gained=before * size * own, lost=after * size * own)

            return lambda theta, size: flawed(part, theta, size, flaw)

        return Nuisance(name, of_rows(), (0.0, most), usual, share=1.0 / 3.0, of_rows=of_rows)

    yield read(kind, before=True, after=True)
    yield read(f"{kind}-before", before=True, after=False)
    yield read(f"{kind}-after", before=False, after=True)


def _of_zeros(problem: Problem) -> Iterator[Nuisance]:
    """Velocities whose zero is off: the wall moves, the tracking drifts, gravity acts between readings."""
    speed = problem.speeds
    if not (speed > 0.0).all() or float(speed.max()) < RANGE_OF_SPEEDS * float(speed.min()):
        return

    usually = float(np.median(speed))

    def of_rows(name: str, rows: Index | None = None) -> Sized:
        part, own = _part(problem, rows), speed if rows is None else speed[rows]
        return lambda theta, size: flawed(part, theta, size, lambda x: zero_of_velocities(name, x / own))

    def read(name: str) -> Nuisance:
        low, high, usual = (x * usually for x in _ZEROS[name][1:])
        far = (-usual, usual, 3.0 * usual) if name == _MOVING else ()
        share, some = 1.0 / len(_ZEROS), partial(of_rows, name)
        return Nuisance(name, some(), (low, high), usual, share=share, far=far, of_rows=some)

    for name in _ZEROS:
        yield read(name)


def zero_of_velocities(name: str, over_speed: Array) -> Flaw:
    """The flaw of a zero of velocities, by its name and its size over the speed that was read."""
    return Flaw(**{place: x * over_speed for place, x in zip(_PLACES, _ZEROS[name][0], strict=True)})


def _of_largest(problem: Problem) -> Iterator[Nuisance]:
    """A scale of the values whose largest is exactly 1, as where they were divided by it."""
    divided = np.zeros(len(problem.rows))
    for own in problem.groups().values():
        divided[own] = normalised(problem.rows.value[own])
    if divided.any():
        yield _scaled("divided-by-largest", problem, divided, (-0.5, 2.0), 0.3)


def _scaled(name: str, problem: Problem, share: Array, limits: tuple[float, float], usual: float) -> Nuisance:
    """Values of which each row has a share of the size too much, in proportion to itself."""

    def of_rows(rows: Index | None = None) -> Sized:
        part, own = _part(problem, rows), share if rows is None else share[rows]
        return lambda theta, size: np.asarray(part.predict(theta) * (1.0 + size[:, None] * own))

    return Nuisance(name, of_rows(), limits, usual, of_rows=of_rows)


def _part(problem: Problem, rows: Index | None) -> Problem:
    """What predicts some of the rows; all of them where None is given."""
    return problem if rows is None else replace(problem, rows=problem.rows.take(rows))


def _of_rebound(problem: Problem) -> Iterator[Nuisance]:
    """Zero and scale of the angle of rebound as it is read; and one scale of both angles."""
    is_rebound = problem.rows.which == problem.rows.names.index(_REBOUND)
    on_rebound = is_rebound.astype(float)

    def zero(rows: Index | None = None) -> Sized:
        part, own = _part(problem, rows), on_rebound if rows is None else on_rebound[rows]
        return lambda theta, size: np.asarray(part.predict(theta) + size[:, None] * own)

    def of_angles(rows: Index | None = None) -> Sized:
        part, own = _part(problem, rows), on_rebound if rows is None else on_rebound[rows]

        def values(theta: Array, size: Array) -> Array:
            read = flawed(part, theta, size, lambda x: Flaw(angle=x))
            return np.asarray(read * (1.0 + size[:, None] * own))

        return values

    yield Nuisance("rebound-zero", zero(), (-10.0, 10.0), 2.0, of_rows=zero)
    yield _scaled("rebound-scale", problem, on_rebound, (-0.5, 0.5), 0.05)
    yield Nuisance("angles-scale", of_angles(), (-0.5, 0.5), 0.05, of_rows=of_angles)


def _drifts(problem: Problem) -> Iterator[Nuisance]:
    """Constants that change in the course of the table: e_n from some row on, all along each series.

    Only where the rows are not in the order of angle or speed, nor sorted by their values.
    """
    if int(problem.rows.impacts.max()) < _FEWEST_IMPACTS - 1 or is_in_order(problem):
        return
    along = _place_in_table(problem)

    last: dict[bytes, tuple[Array, Array]] = {}

    def linearised(theta: Array) -> tuple[Array, Array]:
        """Values, (n,), and their derivatives, (n, p): the drifts are all asked for at the same place."""
        if theta.tobytes() not in last:
            last.clear()
            last[theta.tobytes()] = problem.predict(theta), problem.jacobian(theta)
        return last[theta.tobytes()]

    def drifting(name: str, constant: str, shape: Array, usual: float) -> Nuisance:
        place = problem.parameters.positions[constant][problem.rows.series]
        row = np.arange(shape.size)

        def values(theta: Array, size: Array) -> Array:
            out = np.empty((len(theta), shape.size))
            for number, each in enumerate(theta):
                value, slopes = linearised(each)
                out[number] = value + size[number] * shape * slopes[row, place]
            return out

        return Nuisance(name, values, (-0.5, 0.5), usual, constant=constant)

    if problem.rows.of_kind("normal", "curved").any():
        for part in _PARTS:
            yield drifting("restitution-drift", "e_n", np.where(along < part - 0.5, -0.5, 0.5), 0.1)
        yield drifting("restitution-drift", "e_n", along, 0.1)
    if problem.rows.is_oblique.any():
        yield drifting("friction-drift", "mu", along, 0.1)
        if problem.closure.own is not None:
            low, high = problem.closure.domain(problem.inertia_factor)
            usual = _USUAL_SHARE * min(high - low, 2.0)
            yield drifting("sticking-drift", problem.closure.own.name, along, usual)


def _place_in_table(problem: Problem) -> Array:
    """Where each row stands among those of its series and observable, from -0.5 to 0.5, (n,)."""
    along = np.zeros(len(problem.rows))
    for own in problem.groups().values():
        _, place = np.unique(problem.rows.impacts[own], return_inverse=True)
        if place.max() > 0:
            along[own] = place / place.max() - 0.5
    return along


def is_in_order(problem: Problem) -> bool:
    """Whether the order of a table is one of angle, speed or values, and not that of its readings."""
    return _is_ordered(problem, _place_in_table(problem)) or is_sorted_by_values(problem)


def _is_ordered(problem: Problem, along: Array) -> bool:
    """Whether angle or speed rise or fall with the place in the table, in any observable."""
    table = problem.observations.table
    for column in ("gamma_deg", "speed_m_s"):
        x = table[column].to_numpy(dtype=float)
        for which in range(len(problem.rows.names)):
            known = np.isfinite(x) & (problem.rows.which == which)
            varies = known.any() and float(np.ptp(x[known])) > 0.0 and float(np.ptp(along[known])) > 0.0
            if varies and abs(np.corrcoef(x[known], along[known])[0, 1]) > _TIED:
                return True
    return False


def of_series(problem: Problem, nuisance: Nuisance, number: int) -> Nuisance:
    """The slip in one series alone, for one with `of_rows`."""
    assert nuisance.of_rows is not None
    of_rows = nuisance.of_rows

    def in_series(rows: Index | None = None) -> Sized:
        part = _part(problem, rows)
        own = np.flatnonzero(part.rows.series == number)
        flawed_rows = of_rows(own if rows is None else rows[own])

        def values(theta: Array, size: Array) -> Array:
            out = part.predict(theta)
            out[..., own] = flawed_rows(theta, size)
            return out

        return values

    whole = cache(in_series)  # made where a size of it is fitted: most are only tested
    return replace(
        nuisance,
        values=lambda theta, size: whole()(theta, size),
        series=problem.series[number],
        of_rows=in_series,
    )
