"""How fast a ball turns, from the angle of a mark: unwrapped, or refused where it may be aliased."""

from __future__ import annotations

import numpy as np

from ifrfit.data.tracks.track import FloatArray
from ifrfit.errors import DataError

FEWEST_MARKS = 3
_CLEAR = 0.8  # of half a turn from frame to frame: beyond, a wrong direction is as likely
_RATES = 64  # tried for each frame
_RIVAL = 0.9  # of the best agreement, from which another rate is as good


def rotation_rate(time: FloatArray, angle: FloatArray, place: str) -> tuple[float, float, FloatArray]:
    """Rate of turning, its variance for marks of standard error 1, and what is left of the angles.

    The rate is looked for where the marks, turned back by it, agree best: between half a turn from frame to
    frame in one direction and in the other. Faster turning cannot be told from slower, which the caller says.

    Parameters
    ----------
    time : (n,) float array
        Seconds.
    angle : (n,) float array
        Radians, wrapped or not.
    place : str
        For messages.

    Raises
    ------
    DataError
        The ball turns by nearly half a turn from frame to frame, or marks agree with several rates.
    """
    step = float(np.diff(time).min())
    rates = np.linspace(-np.pi, np.pi, 2 * _RATES * len(time) + 1) / step
    agreement = np.abs(np.exp(1j * (angle[:, None] - time[:, None] * rates)).mean(axis=0))
    best = int(np.argmax(agreement))
    width = 2.0 * np.pi / float(np.ptp(time))  # of the peak of one rate
    far = np.abs(rates - rates[best]) > width
    turn = abs(float(rates[best])) * step
    if turn > _CLEAR * np.pi:
        raise DataError(
            f"{place}: the mark turns by {np.degrees(turn):.0f} degrees from frame to frame, beyond "
            f"{np.degrees(_CLEAR * np.pi):.0f} of which its direction cannot be told. Film faster, or "
            f"leave the "
            "angles out."
        )
    if far.any() and float(agreement[far].max()) > _RIVAL * float(agreement[best]):
        raise DataError(
            f"{place}: the marks agree with several rates of turning, {rates[best]:.3g} and "
            f"{rates[np.flatnonzero(far)[np.argmax(agreement[far])]]:.3g} rad/s. Take more frames, or "
            f"leave the angles "
            "out."
        )
    turned = angle - rates[best] * time
    turned = turned - np.angle(np.exp(1j * turned).mean())
    residual = np.angle(np.exp(1j * turned))
    centred = time - time.mean()
    size = float(centred @ centred)
    slope = float(centred @ residual) / size
    return float(rates[best]) + slope, 1.0 / size, residual - residual.mean() - slope * centred
