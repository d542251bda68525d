"""The calibration of a figure: pixels to values by clicks on its axes, and what the error of a click does.

A coordinate (of a logarithmic axis its log10) is v = a px + b py + c. Three equations that are linear in the
positions q_k of the calibration clicks fix theta = (a, b, c): C(q) theta = d. A click that is off by dq_k, at
unchanged d, moves the value at p = (px, py, 1) by

    dv = p . dtheta = -p C^-1 dC theta = -(g W)_k theta_ab . dq_k,    g = p C^-1,

where row i of W holds the weights with which equation i takes the clicks: the same dq_k for every point of
the figure, whereas a click on the point itself moves v by theta_ab . dp.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# lines are parallel, or clicks on one spot, where less than this is left of the lengths of the equations
_SINGULAR = 1e-9


class CalibrationError(ValueError):
    """Clicks that fix no axes; the text says why, for a reader who knows the file and the place."""


@dataclass(frozen=True)
class Scale:
    """How values stand along an axis.

    Attributes
    ----------
    is_log : bool
        Whether the logarithm of the value is linear in pixels.
    sign : float
        -1 for a logarithmic axis of negative values, else 1.
    """

    is_log: bool = False
    sign: float = 1.0

    def linear(self, value: float) -> float:
        """What is linear in pixels: the value, or the log10 of its magnitude."""
        return math.log10(self.sign * value) if self.is_log else value

    def values(self, linear: FloatArray) -> FloatArray:
        """The values again; infinite where a logarithm is that of no number."""
        if not self.is_log:
            return linear
        with np.errstate(over="ignore"):
            return self.sign * 10.0**linear

    def slope(self, linear: FloatArray) -> FloatArray:
        """Change of the value by that of what is linear in pixels."""
        return math.log(10.0) * self.values(linear) if self.is_log else np.ones_like(linear)


def scale_of(values: Sequence[float], *, is_log: bool) -> Scale:
    """The scale of an axis with these values at its clicks.

    Raises
    ------
    CalibrationError
        For a logarithmic axis that holds zero or both signs, or values that are all the same.
    """
    low, high = min(values), max(values)
    if low == high:
        raise CalibrationError(f"all clicks on it are said to be at {low:g}. Two different values fix an axis")
    if not is_log:
        return Scale()
    if low <= 0.0 <= high:
        raise CalibrationError(
            f"is logarithmic and goes from {low:g} to {high:g}, through zero. Correct its values, or make it "
            "linear"
        )
    return Scale(is_log=True, sign=math.copysign(1.0, low))


@dataclass(frozen=True)
class Coordinate:
    """One coordinate of a figure.

    Attributes
    ----------
    theta : (3,) float array
        a, b, c of v = a px + b py + c.
    gain : (3, n) float array
        C^-1 W: of the calibration clicks, in what a point's position makes of their errors.
    scale : Scale
    """

    theta: FloatArray
    gain: FloatArray
    scale: Scale

    def linear(self, points: FloatArray) -> FloatArray:
        """What is linear in pixels, at points of shape (m, 2)."""
        return np.asarray(points @ self.theta[:2] + self.theta[2])


def coordinate(
    clicks: FloatArray,
    weights: FloatArray,
    constants: FloatArray,
    linear_values: FloatArray,
    scale: Scale,
    fixed: FloatArray | None = None,
) -> Coordinate:
    """The coordinate that three equations fix.

    Parameters
    ----------
    clicks : (n, 2) float array
        Pixels.
    weights : (3, n) float array
        Of each equation on the positions of the clicks.
    constants : (3,) float array
        Coefficient of c in each equation.
    linear_values : (3,) float array
        Right-hand sides.
    scale : Scale
    fixed : (3, 2) float array, optional
        Added to the coefficients of a and b, where an equation is not about clicks.

    Raises
    ------
    CalibrationError
        The equations do not fix it: clicks on one spot, or on one line.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of clicks beyond all pictures nan is left, and refused
        matrix = np.column_stack([weights @ clicks + (0.0 if fixed is None else fixed), constants])
        centred = matrix - np.outer(constants, np.append(clicks.mean(axis=0), 0.0))  # far from the origin, too
        spread = np.ptp(clicks, axis=0).max() or 1.0
        scaled = centred / np.array([spread, spread, 1.0])
        size = np.linalg.norm(scaled, axis=1)
    if not np.all(size > 0.0) or not abs(np.linalg.det(scaled / size[:, None])) >= _SINGULAR:
        raise CalibrationError("its clicks lie on one spot or on one line, which fixes no axes. Calibrate anew")
    inverse = np.linalg.inv(matrix)
    return Coordinate(inverse @ linear_values, inverse @ weights, scale)


@dataclass(frozen=True)
class Calibration:
    """Both coordinates of a figure.

    Attributes
    ----------
    x, y : Coordinate
    """

    x: Coordinate
    y: Coordinate

    def values(self, points: FloatArray) -> FloatArray:
        """Values (m, 2) at points (m, 2) in pixels."""
        return np.column_stack([each.scale.values(each.linear(points)) for each in (self.x, self.y)])

    def reading_errors(self, points: FloatArray, pixels: float) -> FloatArray:
        """Standard errors (m, 2) of the values by the click on the point itself.

        Parameters
        ----------
        points : (m, 2) float array
        pixels : float
            Standard error of a click in each direction.
        """
        sizes = [
            pixels * np.hypot(*each.theta[:2]) * np.abs(each.scale.slope(each.linear(points)))
            for each in (self.x, self.y)
        ]
        return np.column_stack(sizes)

    def common_errors(self, points: FloatArray, pixels: float) -> FloatArray:
        """What each calibration click's standard error does to every value, shape (m, 2, 2n).

        E with ``E E^T`` the covariance of the values by the calibration, the same draw of which holds for all
        points of the figure; the last axis is click 1 in px, in py, click 2 in px, ...
        """
        found = []
        extended = np.column_stack([points, np.ones(len(points))])
        for each in (self.x, self.y):
            by_click = -(extended @ each.gain)[:, :, None] * each.theta[:2]
            slope = each.scale.slope(each.linear(points))
            found.append(pixels * slope[:, None] * by_click.reshape(len(points), -1))
        return np.stack(found, axis=1)

    def independent_common_errors(self, points: FloatArray, pixels: float) -> FloatArray:
        """The same covariance by as few independent errors as it has, shape (m, 2, r).

        Each coordinate of a point is linear in the three numbers that clicks fix of it: r is at most six, or
        four where axes do not turn. They are the same errors for any points.
        """
        return np.asarray(self.common_errors(points, pixels) @ self._directions())

    def _directions(self) -> FloatArray:
        """Orthonormal combinations of the errors of clicks, (2n, r), that move any value at all."""
        moved = np.vstack([(each.gain[:, :, None] * each.theta[:2]).reshape(3, -1) for each in (self.x, self.y)])
        size = np.linalg.norm(moved, axis=1, keepdims=True)
        _, singular, right = np.linalg.svd(moved / np.where(size > 0.0, size, 1.0), full_matrices=False)
        found = right[singular > _SINGULAR * singular[0]].T
        return np.asarray(found * np.sign(found[np.abs(found).argmax(axis=0), np.arange(found.shape[1])]))

    @property
    def digest(self) -> str:
        """A word for the clicks and what they are said to be: the same for whatever points are read with them."""
        digest = hashlib.sha256()
        for each in (self.x, self.y):
            for part in (each.theta, each.gain, np.array([each.scale.is_log, each.scale.sign])):
                digest.update(np.ascontiguousarray(part, dtype=float).tobytes())
        return digest.hexdigest()[:16]


def from_axis_clicks(
    clicks: FloatArray,
    x_values: tuple[float, float],
    y_values: tuple[float, float],
    *,
    is_log: tuple[bool, bool] = (False, False),
    rotates: bool = True,
) -> Calibration:
    """Axes from two clicks on each: x is as said at clicks 1 and 2, y at clicks 3 and 4.

    y does not change from click 1 to 2, nor x from 3 to 4, so that axes may be rotated and skewed.

    Parameters
    ----------
    clicks : (4, 2) float array
    x_values, y_values : tuple of float
    is_log : tuple of bool
    rotates : bool
        False: the axes are along the edges of the picture, whichever way they are nearer to.

    Raises
    ------
    CalibrationError
    """
    scales = (
        _named("the x axis", x_values, is_log=is_log[0]),
        _named("the y axis", y_values, is_log=is_log[1]),
    )
    at, change = np.eye(4), np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    constants = np.array([1.0, 1.0, 0.0])
    fixed: tuple[FloatArray | None, FloatArray | None] = (None, None)
    across = (change[1], change[0])
    if not rotates:
        fixed = _along_the_edges(clicks)
        across = (np.zeros(4), np.zeros(4))
    made = [
        coordinate(
            clicks,
            np.vstack([at[first : first + 2], across[i]]),
            constants,
            np.array([*map(scales[i].linear, values), 0.0]),
            scales[i],
            fixed[i],
        )
        for i, (first, values) in enumerate(((0, x_values), (2, y_values)))
    ]
    return Calibration(*made)


def _named(axis: str, values: Sequence[float], *, is_log: bool) -> Scale:
    try:
        return scale_of(values, is_log=is_log)
    except CalibrationError as error:
        raise CalibrationError(f"{axis}: {error}") from None


def _along_the_edges(clicks: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Equations that keep x from changing along one edge of the picture and y along the other."""
    along_x, along_y = clicks[1] - clicks[0], clicks[3] - clicks[2]
    upright = abs(along_x[0] * along_y[1]) > abs(along_x[1] * along_y[0])
    keeps_px, keeps_py = np.zeros((3, 2)), np.zeros((3, 2))
    keeps_px[2, 0] = keeps_py[2, 1] = 1.0
    return (keeps_py, keeps_px) if upright else (keeps_px, keeps_py)


def from_point_clicks(
    clicks: FloatArray, values: FloatArray, *, is_log: tuple[bool, bool] = (False, False)
) -> Calibration:
    """Axes from three clicks on points whose x and y are both known.

    Parameters
    ----------
    clicks : (3, 2) float array
    values : (3, 2) float array
    is_log : tuple of bool

    Raises
    ------
    CalibrationError
    """
    made = []
    for i, name in enumerate(("x", "y")):
        scale = _named(f"the {name} axis", values[:, i].tolist(), is_log=is_log[i])
        linear = np.array([scale.linear(float(value)) for value in values[:, i]])
        made.append(coordinate(clicks, np.eye(3), np.ones(3), linear, scale))
    if abs(np.linalg.det([each.theta[:2] / np.linalg.norm(each.theta[:2]) for each in made])) < _SINGULAR:
        raise CalibrationError("x and y change along the same line, which fixes no axes. Calibrate anew")
    return Calibration(*made)
