"""When in a track the impact is: z turns round at once, not smoothly as at the top of a flight."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.tracks.track import NORMAL, FloatArray, Track
from ifrfit.errors import DataError

FEWEST = 3  # frames on either side that show a velocity and its error
_LEAST = 2  # frames on either side that make a line: a kink there is seen, and refused
_WINDOW = 5  # frames on either side in which a kink is looked for
_IN_CONTACT = 3  # frames on either side that may lie off the flights
_SUDDEN = 0.5  # of the change of velocity: what a smooth turn of the same window does not explain
_SMALL = 0.2  # of the largest normal velocity: a change that is less is scatter at the top of a flight
_CHANCE = 5e-5  # that scatter alone makes a change as large
_EXACT = 1e-9  # of a change: its least error
_SHORT = 10  # frames of a track whose scatter so few windows show that the change counts in standard errors
_SIGNIFICANT = 5.0  # of these


def impact_time(track: Track) -> tuple[float, float]:
    """The time of the impact, and the sign of z into the wall.

    About each gap between two frames a parabola that changes its value and its slope there is fitted to the
    frames next to it; the change of slope is that of velocity which is sudden.

    Raises
    ------
    DataError
        There is no impact, several, or one with fewer frames on a side than show a velocity.
    """
    time, z = track.time, track.position[NORMAL]
    fastest = float(np.abs((z[2:] - z[:-2]) / (time[2:] - time[:-2])).max()) if len(z) > 2 else 0.0
    best = _separate(time, z, 0, fastest, _SIGNIFICANT if len(z) < _SHORT else None)
    if not best:
        raise DataError(f"{track.place}: {_why_none(time, z)}")
    if len(best) > 1:
        at = " and ".join(f"{each.time:.6g} s (line {track.lines[each.gap - 1]})" for each in best[:2])
        raise DataError(
            f"{track.place}: hits {len(best)} times, near {at}. A run is one impact: give each a number of "
            f"its own in "
            "the column run."
        )
    for when, count in (("before", best[0].gap), ("after", len(z) - best[0].gap)):
        if count < FEWEST:
            raise DataError(f"{track.place}: {_too_few(best[0].time, when)}")
    return best[0].time, -float(np.sign(best[0].change))


def _too_few(time: float, when: str) -> str:
    return (
        f"z turns round near {time:.6g} s, with fewer than {FEWEST} frames {when}; {FEWEST} on either side "
        f"are the "
        "fewest that show velocities and their errors. Film more of it, or leave the run out."
    )


@dataclass(frozen=True)
class _Kink:
    """A sudden turn: the frame after it, its time, the change of velocity, and this over what counts."""

    gap: int
    time: float
    change: float
    clarity: float


def _separate(
    time: FloatArray, z: FloatArray, first: int, fastest: float, errors: float | None
) -> list[_Kink]:
    """The kinks of a track, in the order of time: the best of all, and those of the flights beside it.

    Parameters
    ----------
    time, z : (n,) float array
    first : int
        Number of their first frame in the track.
    fastest : float
        Normal velocity of the track, m/s.
    errors : float or None
        Standard errors that a change of velocity must have; None: by Student's t.
    """
    found = _kinks(time, z, fastest, errors)
    if not found:
        return []
    best = max(found, key=lambda kink: kink.clarity)
    ends, begins = max(best.gap - _IN_CONTACT, 0), best.gap + _IN_CONTACT
    return [
        *_separate(time[:ends], z[:ends], first, fastest, errors),
        replace(best, gap=best.gap + first),
        *_separate(time[begins:], z[begins:], first + begins, fastest, errors),
    ]


def _kinks(time: FloatArray, z: FloatArray, fastest: float, errors: float | None) -> list[_Kink]:
    """Of each gap that is one."""
    found: list[_Kink] = []
    for gap in range(_LEAST, len(z) - _LEAST + 1):
        for passed in range(_IN_CONTACT + 1):
            before = np.arange(max(gap - passed - _WINDOW, 0), gap - passed)
            after = np.arange(gap + passed, min(gap + passed + _WINDOW, len(z)))
            if min(len(before), len(after)) < _LEAST or len(before) + len(after) < _LEAST + FEWEST + 1:
                break
            kink = _kink(gap, time, z, (before, after), fastest, errors)
            if kink is not None:
                found.append(kink)
                break
    return found


def _kink(
    gap: int,
    time: FloatArray,
    z: FloatArray,
    sides: tuple[NDArray[np.intp], NDArray[np.intp]],
    fastest: float,
    errors: float | None,
) -> _Kink | None:
    """The kink between frames before and after; None where it is no sudden turn."""
    from scipy import special  # commands that read no tracks start without it

    before, after = sides
    rows = np.concatenate([before, after])
    middle = 0.5 * float(time[gap - 1] + time[gap])
    scale = float(np.abs(time[rows] - middle).max())
    s, behind = (time[rows] - middle) / scale, np.repeat([0.0, 1.0], [len(before), len(after)])
    design = np.column_stack([np.ones_like(s), s, s**2, behind, behind * s])
    inverse = np.linalg.pinv(design.T @ design)
    coefficients = inverse @ design.T @ z[rows]
    left, dof = float(np.sum((z[rows] - design @ coefficients) ** 2)), len(s) - 5
    comes, change = float(coefficients[1] / scale), float(coefficients[4] / scale)
    error = float(np.sqrt(left / dof * inverse[4, 4]) / scale)
    errors = float(special.stdtrit(dof, 1.0 - _CHANCE)) if errors is None else errors
    enough = max(_SUDDEN * (abs(comes) + abs(comes + change)), _SMALL * fastest, errors * error)
    if comes * (comes + change) >= 0.0 or abs(change) <= enough:
        return None
    meet = float(np.clip(-coefficients[3] / coefficients[4], s[len(before) - 1], s[len(before)]))
    return _Kink(gap, middle + scale * meet, change, abs(change) / max(errors * error, _EXACT * abs(change)))


def _why_none(time: FloatArray, z: FloatArray) -> str:
    """Why no impact was found, in a sentence."""
    n = len(z)
    if n < 2 * FEWEST:
        frames = "1 frame" if n == 1 else f"{n} frames"
        return (
            f"has {frames}; {FEWEST} before the impact and {FEWEST} after it are the fewest that show "
            f"velocities and "
            "their errors. Film more of it, or leave the run out."
        )
    for turn in (int(np.argmin(z)), int(np.argmax(z))):
        for when, left in (("before", turn), ("after", n - 1 - turn)):
            if 0 < left < FEWEST:
                return _too_few(float(time[turn]), when)
    return (
        "shows no impact: z, the coordinate normal to the wall, turns round nowhere at once. Check which "
        "column is z."
    )
