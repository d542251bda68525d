"""Fewer nodes for the same integral: Gauss's rule of three nodes for many sets of weights at once.

A set of weights on some places has orthogonal polynomials. The zeros of the third one, with weights that
follow, give the same integral for each polynomial of degree five (Golub & Welsch 1969, Math. Comp. 23, 221).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def three_nodes(places: Array, weights: Array) -> tuple[Array, Array]:
    """Three nodes and their weights, (..., 3) each.

    Where all weight is on fewer places, to the last digit, three nodes lie on their mean.

    Parameters
    ----------
    places : ndarray, (n,)
    weights : ndarray, (..., n)
        Not negative.
    """
    with np.errstate(all="ignore"):
        mass = weights.sum(axis=-1)
        first = weights * places
        mean = first.sum(axis=-1) / mass
        one = places - mean[..., None]
        of_one = weights * one**2
        square = of_one.sum(axis=-1)
        b1, a1 = square / mass, (of_one * places).sum(axis=-1) / square
        two = (places - a1[..., None]) * one - b1[..., None]
        of_two = weights * two**2
        fourth = of_two.sum(axis=-1)
        b2, a2 = fourth / square, (of_two * places).sum(axis=-1) / fourth
        nodes = _eigenvalues(mean, a1, a2, b1, b2)
        one = nodes - mean[..., None]
        two = (nodes - a1[..., None]) * one - b1[..., None]
        found = mass[..., None] / (1.0 + one**2 / b1[..., None] + two**2 / (b1 * b2)[..., None])
        is_one_place = ~np.isfinite(found).all(axis=-1)
    whole = np.where(mass > 0.0, mass, 0.0)[..., None]
    nodes = np.where(is_one_place[..., None], np.where(whole > 0.0, mean[..., None], 0.0), nodes)
    return nodes, np.where(is_one_place[..., None], whole / 3.0, found)


def _eigenvalues(a0: Array, a1: Array, a2: Array, b1: Array, b2: Array) -> Array:
    """Of symmetric matrices of three rows with a on the diagonal and the root of b beside it, (..., 3)."""
    middle = (a0 + a1 + a2) / 3.0
    x, y, z = a0 - middle, a1 - middle, a2 - middle
    scale = np.sqrt((x**2 + y**2 + z**2 + 2.0 * (b1 + b2)) / 6.0)
    determinant = x * y * z - x * b2 - z * b1
    angle = np.arccos(np.clip(0.5 * determinant / scale**3, -1.0, 1.0)) / 3.0
    turns = 2.0 * math.pi / 3.0 * np.arange(3)
    return np.asarray(middle[..., None] + 2.0 * scale[..., None] * np.cos(angle[..., None] + turns))
