"""Sums of squares of curved rows at very many constants: computed at few of them, a polynomial between.

At a given transition the impulse factor of every row is linear in the closure constant, so the sum of squares
of any number of rows is smooth in (e_n, c). Its polynomial by Chebyshev points is taken where it agrees with
the rows themselves at places of every kind. How often a row is computed then no longer depends on how fine
the grid is in e_n and c: fits of 40 to 1,000 rebound angles with e_n free take 2 to 8 times as long without.

Eq. (13) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]
# sums at (e_n, x, c), arrays of one shape
Direct = Callable[[Array, Array, Array], Array]

_DEGREES = (8, 12, 16, 24, 32)
_FEW = 8  # transitions at which a degree is tried before it is taken at all
_GAIN = 4  # how many places a computed one must stand for
_SPREAD, _LOWEST = 192, 64  # places at which a polynomial is checked: all over, and the likeliest
_EXACT = 1e-10  # relative error of a sum that counts
_LIKELY = 200.0  # rise of the sum, in units of its share a row, beyond which it does not count
_FAR = 1e-2  # error beyond, relative to the rise
_AT_ONCE = 100_000  # places at once: their arrays stay in the cache


def on_grid(direct: Direct, e_n: Array, x: Array, c: Array, n: int) -> Array:
    """Sums at the nodes of a grid (outer nodes, e_n, x, c), by polynomials where these are right.

    Parameters
    ----------
    direct : callable
        The sums as they are.
    e_n, x, c : ndarray, (m, n_e, n_x, n_c), broadcastable
    n : int
        Rows behind a sum.
    """
    m, n_e, n_x, n_c = shape = np.broadcast_shapes(e_n.shape, x.shape, c.shape)
    whole = np.broadcast_to(c, shape)
    if e_n.shape[2:] == (1, 1) and x.shape[1] == x.shape[3] == 1:  # else they are no grid
        along_e = np.broadcast_to(e_n, (m, n_e, 1, 1))[:, :, 0, 0]
        along_x = np.broadcast_to(x, (m, 1, n_x, 1))[:, 0, :, 0]
        if e_n.shape[0] == x.shape[0] == 1:  # outer nodes that only c knows: more of the same
            inner = np.moveaxis(whole, 0, 2).reshape(n_e, n_x, m * n_c)
            found = between(direct, along_e[0], along_x[0], inner, n)
            if found is not None:
                return np.moveaxis(found.reshape(n_e, n_x, m, n_c), 2, 0)
        else:
            parts = [between(direct, *part, n) for part in zip(along_e, along_x, whole, strict=True)]
            if all(part is not None for part in parts):
                return np.stack([part for part in parts if part is not None])
    return direct(*(np.broadcast_to(y, shape) for y in (e_n, x, whole)))


def between(direct: Direct, e_n: Array, x: Array, c: Array, n: int) -> Array | None:
    """Sums at all (e_n, x, c) from a polynomial in e_n and c at each x.

    Parameters
    ----------
    direct : callable
        The sums as they are.
    e_n : ndarray, (n_e,)
    x : ndarray, (n_x,)
    c : ndarray, (n_e, n_x, n_c)
    n : int
        Rows behind a sum.

    Returns
    -------
    ndarray, (n_e, n_x, n_c), or None
        None where no polynomial agrees with the sums, or none takes fewer of them.
    """
    few = np.unique(np.linspace(0, x.size - 1, _FEW).round().astype(np.intp))
    for degree in _DEGREES:
        size = min(degree, e_n.size), degree
        if _GAIN * size[0] * size[1] > e_n.size * c.shape[2]:
            return None
        if x.size > 2 * _FEW and _tried(direct, e_n, x[few], c[:, few], n, size) is None:
            continue
        found = _tried(direct, e_n, x, c, n, size)
        if found is not None:
            return found
    return None


def _tried(direct: Direct, e_n: Array, x: Array, c: Array, n: int, size: tuple[int, int]) -> Array | None:
    """The polynomials of a size, where they agree with the sums all over and where these are least."""
    found = _interpolated(direct, e_n, x, c, size)
    flat = found.reshape(-1)
    lowest = np.argpartition(flat, min(_LOWEST, flat.size - 1))[:_LOWEST]
    places = np.concatenate((lowest, np.linspace(0, c.size - 1, _SPREAD).astype(np.intp)))
    truth = _at(direct, e_n, x, c, places)
    return found if _agrees(flat[places], truth, n) else None


def _at(direct: Direct, e_n: Array, x: Array, c: Array, places: NDArray[np.intp]) -> Array:
    i, j, _ = np.unravel_index(places, c.shape)
    return direct(e_n[i], x[j], c.reshape(-1)[places])


def _agrees(found: Array, truth: Array, n: int) -> bool:
    """Whether sums are exact where they count, and high enough where they do not."""
    least = truth.min()
    rise = truth - least
    allowed = np.where(rise <= _LIKELY * least / n, _EXACT * truth, _FAR * rise)
    return bool((np.abs(found - truth) <= allowed).all())


def _interpolated(direct: Direct, e_n: Array, x: Array, c: Array, size: tuple[int, int]) -> Array:
    n_e, n_c = size
    ends = c.min(axis=(0, 2)), c.max(axis=(0, 2))
    low, high = float(e_n.min()), float(e_n.max())
    along_e = e_n if n_e == e_n.size else 0.5 * (low + high + (high - low) * chebyshev.chebpts1(n_e))
    unit = chebyshev.chebpts1(n_c)
    middle, half = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0])
    grid = np.broadcast_arrays(along_e[:, None, None], x[:, None], (middle[:, None] + half[:, None] * unit))
    sums = direct(*(part.reshape(-1) for part in grid)).reshape(n_e, -1)
    if n_e < e_n.size:
        to_e = chebyshev.chebvander((2.0 * e_n - low - high) / (high - low), n_e - 1)
        sums = to_e @ (_to_coefficients(n_e) @ sums)
    series = sums.reshape(e_n.size, x.size, n_c) @ _to_coefficients(n_c).T
    out = np.empty(c.shape)
    step = max(1, _AT_ONCE // (x.size * c.shape[2]))
    scale = np.where(half > 0.0, half, 1.0)
    for start in range(0, e_n.size, step):
        at = slice(start, start + step)
        u = (c[at] - middle[:, None]) / scale[:, None]
        out[at] = chebyshev.chebval(u, np.moveaxis(series[at], -1, 0)[..., None], tensor=False)
    return out


def _to_coefficients(n: int) -> Array:
    """From values at the n Chebyshev points of the first kind to the coefficients of the series, (n, n)."""
    matrix = chebyshev.chebvander(chebyshev.chebpts1(n), n - 1).T * (2.0 / n)
    matrix[0] *= 0.5
    return np.asarray(matrix)
