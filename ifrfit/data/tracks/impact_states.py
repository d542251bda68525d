"""The state of each impact: velocities and spins just before and after it, with their covariance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.tracks.free_flight import MANY, SMALLEST, Side, SideFits, fit_sides, pooled_sigma
from ifrfit.data.tracks.impact_search import FEWEST, impact_time
from ifrfit.data.tracks.rotation_rate import FEWEST_MARKS, rotation_rate
from ifrfit.data.tracks.track import NORMAL, FloatArray, Track
from ifrfit.errors import DataError

MOST_FRAMES = 20  # on a side: farther from the impact a parabola is no longer a flight with drag
_IN_CONTACT = 3  # frames on a side that may be of the contact, and are looked at one by one
_OFF = 4.0  # standard errors, from which a frame next to the impact is none of free flight
_ROUNDS = 8
_CLOSE = 1e-6  # of the time between frames, by which the time of an impact may still move
_ROUNDED = 1.0 / math.sqrt(12.0)  # standard error of a position that is a whole number of pixels
_TIMES = ("before", "after")
_Sides = tuple[NDArray[np.intp], NDArray[np.intp]]  # numbers of frames before and after


@dataclass(frozen=True)
class ImpactState:
    """Velocities and spins at an impact, z into the wall, x as in the file, and y as makes them right-handed.

    Attributes
    ----------
    track : Track
    time : float
        Of the impact, seconds as in the file.
    frames : tuple of int
        Before and after.
    before, after : mapping of str to float
        m/s, by axis.
    covariance : (2k, 2k) float array
        Of the velocities before, in the order of the axes, and after.
    spin_before, spin_after : tuple of float
        omega_y and its standard error, rad/s; nan where it was not seen.
    """

    track: Track
    time: float
    frames: tuple[int, int]
    before: Mapping[str, float]
    after: Mapping[str, float]
    covariance: FloatArray
    spin_before: tuple[float, float]
    spin_after: tuple[float, float]


@dataclass(frozen=True)
class TrackFits:
    """What was found of all tracks of a table.

    Attributes
    ----------
    states : tuple of ImpactState
    sigma : mapping of str to float
        Standard error of a position by axis, m: the median where the file gives them.
    scatter : mapping of str to float
        About the paths, in these; nan where nothing tells.
    dof : int
        Degrees of freedom behind the scatter of one axis.
    from_file : bool
        Whether the file gives the errors of positions.
    acceleration : mapping of str to float
        That sides of few frames have in common, m/s^2; empty where there are none.
    in_contact : int
        Frames next to impacts that were left out.
    duration : float
        Median time that a side covers, s.
    """

    states: tuple[ImpactState, ...]
    sigma: Mapping[str, float]
    scatter: Mapping[str, float]
    dof: int
    from_file: bool
    acceleration: Mapping[str, float]
    in_contact: int
    duration: float


def impact_states(
    tracks: Sequence[Track],
    *,
    pixel: float | None = None,
    contact: float | None = None,
    frames: int = MOST_FRAMES,
    acceleration: float | None = None,
) -> TrackFits:
    """The states of all impacts.

    Parameters
    ----------
    tracks : sequence of Track
    pixel : float or None
        Size of a pixel in the plane of the motion, m: positions are wrong by its rounding at least.
    contact : float or None
        Duration of a contact, s: frames within half of it about the impact are left out. None: the nearest on
        either side, and those that lie off the free flights.
    frames : int
        At most so many on a side.
    acceleration : float or None
        Into the wall, m/s^2, with none along it; None: found from the tracks.

    Raises
    ------
    DataError
        With file, run and remedy.
    """
    found = [impact_time(track) for track in tracks]
    into = _into_the_wall(tracks, [sign for _, sign in found])
    at: Sequence[float] = [time for time, _ in found]
    axes = tracks[0].axes
    given = dict.fromkeys(axes, None if acceleration is None else 0.0)
    if acceleration is not None:
        given[NORMAL] = into * acceleration
    from_file = all(axis in track.sigma for track in tracks for axis in axes)
    floor = 0.0 if pixel is None else pixel * _ROUNDED
    rules = _Rules(axes, given, frames, contact, floor, from_file)
    at, rows, kept, fits = _converged(tracks, at, rules)
    for track, t in zip(tracks, at, strict=True):
        _split(track, t, rules, is_final=True)  # refuses what is too short
    sigma = _sigmas(fits, rules)
    sides = [(track, side) for track, pair in zip(tracks, kept, strict=True) for side in pair]
    short = [i for i, (_, side) in enumerate(sides) if len(side) < MANY and acceleration is None]
    return TrackFits(
        tuple(_states(tracks, at, kept, fits, sigma, axes, into)),
        {axis: _typical(tracks, axis) if from_file else sigma[axis] for axis in axes},
        {axis: fits[axis].scatter / sigma[axis] for axis in axes},
        fits[NORMAL].dof,
        from_file,
        {axis: float(fits[axis].acceleration[short[0]]) for axis in axes} if short else {},
        sum(len(side) for pair in rows for side in pair) - sum(len(side) for _, side in sides),
        float(np.median([np.ptp(track.time[side]) for track, side in sides])),
    )


@dataclass(frozen=True)
class _Rules:
    """Axes, their given accelerations, and what is said of frames, contact and errors."""

    axes: tuple[str, ...]
    acceleration: Mapping[str, float | None]
    frames: int
    contact: float | None
    floor: float
    from_file: bool


def _converged(
    tracks: Sequence[Track], at: Sequence[float], rules: _Rules
) -> tuple[Sequence[float], list[_Sides], list[_Sides], dict[str, SideFits]]:
    """Times of the impacts, the frames next to them, those of free flight, and the fits to these.

    The frames depend on the times, the times on where the fits of both sides meet.
    """
    rows = [_split(track, t, rules) for track, t in zip(tracks, at, strict=True)]
    step = float(np.median(np.diff(tracks[0].time)))
    for _ in range(_ROUNDS):
        fits = _fits(tracks, [_free(pair, rules.contact) for pair in rows], at, rules)
        sigma = _sigmas(fits, rules)
        kept = [
            pair if rules.contact is not None else _without_contact(track, t, pair, sigma, fits)
            for track, t, pair in zip(tracks, at, rows, strict=True)
        ]
        fits = _fits(tracks, kept, at, rules)
        moved = [t + shift for t, shift in zip(at, _shifts(fits[NORMAL]), strict=True)]
        rows_now = [_split(track, t, rules) for track, t in zip(tracks, moved, strict=True)]
        same = all(
            np.array_equal(np.concatenate(a), np.concatenate(b)) for a, b in zip(rows, rows_now, strict=True)
        )
        near = max(abs(a - b) for a, b in zip(at, moved, strict=True)) < _CLOSE * step
        rows, at = rows_now, moved
        if same and near:
            break
    return at, rows, kept, fits


def _into_the_wall(tracks: Sequence[Track], signs: Sequence[float]) -> float:
    """The sign of z into the wall, which all runs of a table have in common."""
    for track, sign in zip(tracks, signs, strict=True):
        if sign != signs[0]:
            raise DataError(
                f"{track.place}: meets the wall at its {'largest' if sign > 0 else 'smallest'} z, "
                f"{tracks[0].name} at "
                "the other end. Runs against different walls go into different files."
            )
    return signs[0]


def _split(track: Track, at: float, rules: _Rules, *, is_final: bool = False) -> _Sides:
    """Frames before and after an impact in the order of time, without those that may be of the contact.

    Where its duration is not given these are the nearest on either side. As long as the time of the impact is
    not final, they stay where too few frames would be left.
    """
    contact = rules.contact
    half = 0.0 if contact is None else 0.5 * contact
    before, after = np.flatnonzero(track.time < at - half), np.flatnonzero(track.time > at + half)
    if contact is None:
        before, after = (
            side if len(free) < FEWEST and not is_final else free
            for side, free in ((before, before[:-1]), (after, after[1:]))
        )
    for when, side in zip(_TIMES, (before, after), strict=True):
        if len(side) < FEWEST:
            count = f"{len(side)} {'frame' if len(side) == 1 else 'frames'} {when} the impact near {at:.6g} s"
            beside = (
                " beside the nearest, which may be of the contact" if contact is None else " out of contact"
            )
            rest = (
                "; if the contact is shorter than a frame say how long it is, as --contact 0.1ms"
                if contact is None
                else ""
            )
            raise DataError(
                f"{track.place}: has {count}{beside}, {FEWEST} are the fewest that show a velocity and its "
                f"error. Film "
                f"more of it, or leave the run out{rest}."
            )
    return before[-rules.frames :], after[: rules.frames]


def _free(pair: _Sides, contact: float | None) -> _Sides:
    """The frames of either side that are of free flight without doubt."""
    if contact is not None:
        return pair
    before, after = pair
    spare = [min(_IN_CONTACT, len(side) - FEWEST) for side in pair]
    return before[: len(before) - spare[0]], after[spare[1] :]


def _fits(
    tracks: Sequence[Track],
    rows: Sequence[_Sides],
    at: Sequence[float],
    rules: _Rules,
) -> dict[str, SideFits]:
    found = {}
    for axis in rules.axes:
        sides = []
        for track, pair, t in zip(tracks, rows, at, strict=True):
            sigma = track.sigma.get(axis, np.ones(len(track.time)))
            sides += [Side(track.time[side] - t, track.position[axis][side], sigma[side]) for side in pair]
        found[axis] = fit_sides(sides, rules.acceleration[axis])
    return found


def _sigmas(fits: Mapping[str, SideFits], rules: _Rules) -> dict[str, float]:
    """What the standard errors of the fits are to be multiplied with, by axis."""
    return dict.fromkeys(fits, 1.0) if rules.from_file else pooled_sigma(fits, rules.floor)


def _without_contact(
    track: Track,
    at: float,
    pair: _Sides,
    sigma: Mapping[str, float],
    fits: Mapping[str, SideFits],
) -> _Sides:
    """The frames of either side up to the one before the first that lies off the path of those farther out.

    That one may have been in contact for a part of its way, and lie off by less than is seen.
    """
    sides = []
    for side, step in zip(pair, (1, -1), strict=True):
        order = side[::step]  # the nearest last
        n = len(order) - min(_IN_CONTACT, len(order) - FEWEST)
        while n < len(order) and not any(
            _is_off(track, axis, order[:n], int(order[n]), at, sigma[axis], fits[axis]) for axis in fits
        ):
            n += 1
        if n < len(order) and n > FEWEST:
            n -= 1
        sides.append(order[:n][::step])
    return sides[0], sides[1]


def _is_off(
    track: Track, axis: str, rows: np.ndarray, row: int, at: float, sigma: float, fits: SideFits
) -> bool:
    """Whether a frame lies off the path that the others predict."""
    own = track.sigma.get(axis, np.ones(len(track.time))) * sigma
    curves = len(rows) >= MANY
    time = track.time - at
    value = track.position[axis] - (0.0 if curves else 0.5 * fits.acceleration[0] * time**2)
    power = np.arange(3 if curves else 2)
    scale = np.abs(time[rows]).max()
    design = (time[rows, None] / scale) ** power / own[rows, None]
    inverse = np.linalg.inv(design.T @ design)
    there = (time[row] / scale) ** power
    predicted = there @ inverse @ design.T @ (value[rows] / own[rows])
    error = math.sqrt(own[row] ** 2 + float(there @ inverse @ there))
    return abs(float(value[row] - predicted)) > _OFF * error


def _shifts(fits: SideFits) -> FloatArray:
    """From where the sides are counted to where they meet, for each impact."""
    before, after = fits.position[::2], fits.position[1::2]
    return np.asarray((before - after) / (fits.velocity[1::2] - fits.velocity[::2]))


def _typical(tracks: Sequence[Track], axis: str) -> float:
    return float(np.median(np.concatenate([track.sigma[axis] for track in tracks])))


def _states(
    tracks: Sequence[Track],
    at: Sequence[float],
    rows: Sequence[_Sides],
    fits: Mapping[str, SideFits],
    sigma: Mapping[str, float],
    axes: Sequence[str],
    into: float,
) -> list[ImpactState]:
    spins = _spins(tracks, rows, into)
    k, states = len(axes), []
    for i, (track, t, pair) in enumerate(zip(tracks, at, rows, strict=True)):
        covariance = np.zeros((2 * k, 2 * k))
        velocities: list[dict[str, float]] = [{}, {}]
        for j, axis in enumerate(axes):
            sign = into if axis != "x" else 1.0  # half a turn about x
            block = fits[axis].covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] * sigma[axis] ** 2
            covariance[np.ix_([j, k + j], [j, k + j])] = block
            for when in (0, 1):
                velocities[when][axis] = sign * float(fits[axis].velocity[2 * i + when])
        frames = (len(pair[0]), len(pair[1]))
        states.append(ImpactState(track, t, frames, velocities[0], velocities[1], covariance, *spins[i]))
    return states


def _spins(
    tracks: Sequence[Track], rows: Sequence[_Sides], into: float
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """omega_y before and after, with errors from the scatter of all marks unless the file gives them.

    An angle from x towards z, z into the wall, turns against y.
    """
    rates: list[list[tuple[float, float]]] = []
    total, dof = 0.0, 0
    for track, pair in zip(tracks, rows, strict=True):
        found = []
        for when, side in zip(_TIMES, pair, strict=True):
            seen = [] if track.angle is None else [row for row in side if not np.isnan(track.angle[row])]
            if track.angle is None or len(seen) < FEWEST_MARKS:
                found.append((math.nan, math.nan))
                continue
            place = f"{track.place}, {when} the impact"
            rate, variance, left = rotation_rate(track.time[seen], track.angle[seen], place)
            if "angle" in track.sigma:
                variance *= float(np.mean(track.sigma["angle"][seen] ** 2))
            total, dof = total + float(left @ left), dof + len(seen) - 2
            found.append((-into * rate, variance))
        rates.append(found)
    given = all("angle" in track.sigma for track in tracks)
    scale = 1.0 if given or not dof else max(total / dof, SMALLEST**2)
    return [tuple((rate, math.sqrt(variance * scale)) for rate, variance in pair) for pair in rates]  # type: ignore[misc]
