r"""Velocities just before and after impacts, from the frames of free flight next to them.

A side of an impact is its frames on one side, at times t counted from the impact. A side of many frames is a
parabola of its own, q = q0 + v t + a t^2/2. One of few frames is a straight line
beside a given acceleration, or beside one that all such sides of a table have in common, as gravity: with r_q
and r_s what a straight line leaves of q and of s = t^2/2, weighted,

    a = sum r_s r_q / sum r_s^2,    v = L q - a L s,    cov(v_i, v_j) = delta_ij L C L^T
    + (L s)_i (L s)_j var(a),

L the slope of a straight line at t = 0. What a line leaves is independent of the line, and a of L q, so that
this is exact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ifrfit.data.tracks.track import FloatArray

MANY = 7  # frames from which a side has a curvature of its own
SMALLEST = 1e-12  # m or rad, of a standard error: positions without any scatter are rounded all the same


@dataclass(frozen=True)
class Side:
    """The frames on one side of an impact, of one coordinate.

    Attributes
    ----------
    time : (n,) float array
        Seconds from the impact.
    value : (n,) float array
        Metres.
    sigma : (n,) float array
        Standard errors; all 1 where only their ratios count.
    """

    time: FloatArray
    value: FloatArray
    sigma: FloatArray

    @property
    def curves(self) -> bool:
        """Whether it has a curvature of its own."""
        return len(self.time) >= MANY


@dataclass(frozen=True)
class SideFits:
    """The velocities of all sides of a coordinate.

    Attributes
    ----------
    velocity, position : (m,) float array
        At the impact.
    covariance : (m, m) float array
        Of the velocities, at the sigmas given.
    acceleration : (m,) float array
        m/s^2.
    residuals : sequence of (n,) float arrays
        Of each side, in sigmas.
    dof : int
        Degrees of freedom of all residuals together.
    """

    velocity: FloatArray
    position: FloatArray
    covariance: FloatArray
    acceleration: FloatArray
    residuals: Sequence[FloatArray]
    dof: int

    @property
    def scatter(self) -> float:
        """Root of chi2 over its degrees of freedom; nan without any."""
        total = sum(float(np.sum(each**2)) for each in self.residuals)
        return float(np.sqrt(total / self.dof)) if self.dof > 0 else np.nan


def fit_sides(sides: Sequence[Side], acceleration: float | None = None) -> SideFits:
    """Velocities at the impact.

    Parameters
    ----------
    sides : sequence of Side
    acceleration : float or None
        m/s^2, given for all sides; None: that of each side or of all.
    """
    short = [each.curves is False or acceleration is not None for each in sides]
    given = 0.0 if acceleration is None else acceleration
    lines = [_line(each) for each, is_line in zip(sides, short, strict=True) if is_line]
    top = sum(float(line.of_square @ line.of_value) for line in lines)
    bottom = sum(float(line.of_square @ line.of_square) for line in lines)
    fits_it = acceleration is None and bottom > 0.0
    common, variance = (top / bottom, 1.0 / bottom) if fits_it else (given, 0.0)
    found: dict[str, list[float]] = {
        name: [] for name in ("velocity", "position", "variance", "slope", "acceleration")
    }
    residuals, dof, rest = [], -int(fits_it and bool(lines)), iter(lines)
    for side, is_line in zip(sides, short, strict=True):
        if is_line:
            line = next(rest)
            row = (
                line.velocity - common * line.slope,
                line.position - common * line.offset,
                line.variance,
                line.slope,
            )
            left, count, curvature = line.of_value - common * line.of_square, 2, common
        else:
            row, curvature, left = _parabola(side)
            count = 3
        for name, value in zip(found, (*row, curvature), strict=True):
            found[name].append(value)
        residuals.append(left)
        dof += len(side.time) - count
    arrays = {name: np.array(values, dtype=float) for name, values in found.items()}
    shared = np.outer(arrays["slope"], arrays["slope"]) * variance
    return SideFits(
        arrays["velocity"],
        arrays["position"],
        np.diag(arrays["variance"]) + shared,
        arrays["acceleration"],
        residuals,
        dof,
    )


@dataclass(frozen=True)
class _Line:
    """A straight line through a side, and through t^2/2: values at 0, slopes, and what is left."""

    velocity: float
    position: float
    variance: float
    slope: float
    offset: float
    of_value: FloatArray
    of_square: FloatArray


def _line(side: Side) -> _Line:
    weight = 1.0 / side.sigma
    design = np.column_stack([np.ones_like(side.time), side.time]) * weight[:, None]
    inverse = _inverse(design)
    square = 0.5 * side.time**2 * weight
    value = side.value * weight
    of_value, of_square = (inverse @ design.T @ each for each in (value, square))
    return _Line(
        float(of_value[1]),
        float(of_value[0]),
        float(inverse[1, 1]),
        float(of_square[1]),
        float(of_square[0]),
        value - design @ of_value,
        square - design @ of_square,
    )


def _parabola(side: Side) -> tuple[tuple[float, float, float, float], float, FloatArray]:
    """Velocity, position, variance, no part of a common acceleration; curvature; what is left."""
    weight = 1.0 / side.sigma
    design = np.column_stack([np.ones_like(side.time), side.time, 0.5 * side.time**2]) * weight[:, None]
    inverse = _inverse(design)
    found = inverse @ design.T @ (side.value * weight)
    left = side.value * weight - design @ found
    return (float(found[1]), float(found[0]), float(inverse[1, 1]), 0.0), float(found[2]), left


def _inverse(design: FloatArray) -> FloatArray:
    """Of the normal equations, with columns of one size first."""
    size = np.linalg.norm(design, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    scaled = design / size
    return np.asarray(np.linalg.inv(scaled.T @ scaled) / np.outer(size, size))


def pooled_sigma(fits: Mapping[str, SideFits], floor: float) -> dict[str, float]:
    """Standard error of a position by axis: the scatter about all sides, at least the floor."""
    found = {}
    for axis, fit in fits.items():
        scatter = 0.0 if np.isnan(fit.scatter) else fit.scatter
        found[axis] = max(scatter, floor, SMALLEST)
    return found
