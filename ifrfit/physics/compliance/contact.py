"""The normal collision that the tangential one rides on: Hertz's, elastic, in scaled variables.

Mass, normal speed and largest approach are 1, so the load is P = (5/4) d^(3/2) and the normal speed
sqrt(1 - d^(5/2)) at an approach d. What is tangential is scaled by khat/mu, and its force by 1/mu: then
the normal and the tangential problem have one kernel, and chi is the only parameter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ifrfit.physics.angles import Array

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)


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
