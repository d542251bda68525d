"""Maw, Barber & Fawcett's solution as a table: the restitution beta by scaled velocity and compliance.

Below psi1 = 1 the contact begins by sticking, from 4 chi - 1 on it slips throughout, and at both the
solution has a kink in its curvature. So the table has one range of nodes from 0 to 1 and one from 1 to
4 chi - 1. Along the velocity it is a cubic spline, along chi the cubic with the slopes of central
differences; both have continuous slopes, which a search by derivatives needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array
from ifrfit.physics.compiling import compiled

Index = NDArray[np.intp]

_SLACK = 1e-5  # beyond the ends of chi, for differences taken there


@dataclass(frozen=True)
class Table:
    """Cubics of beta in every interval of the scaled velocity, at nodes of chi.

    Attributes
    ----------
    chi : ndarray, (m,)
        Nodes, evenly spaced.
    nodes : ndarray, (m + 2, intervals, 4)
        Coefficients of beta in powers of the place inside an interval, 0 to 1; one row more at either end.
    first : int
        Intervals between 0 and 1; the rest lies between 1 and 4 chi - 1.
    """

    chi: Array
    nodes: Array
    first: int

    def cubics(self, chi: float) -> Array:
        """Coefficients of all intervals at one chi, (intervals, 4)."""
        i, u = self._place(np.array([chi]))
        return np.asarray(np.tensordot(_weights(u)[:, 0], self.nodes[i[0] : i[0] + 4], axes=1))

    def _place(self, chi: Array) -> tuple[Index, Array]:
        """Interval of chi, and the place in it."""
        low, high = float(self.chi[0]), float(self.chi[-1])
        outside = (chi < low - _SLACK) | (chi > high + _SLACK)
        if outside.any():
            raise UsageError(
                f"chi = {float(chi[outside].flat[0]):g}: the table of closure MAW reaches from {low:g} to "
                f"{high:g}. A solid sphere of the wall's material has 1.167 to 1.75."
            )
        x = (chi - low) / (self.chi[1] - self.chi[0])
        i = np.clip(np.nan_to_num(x), 0.0, self.chi.size - 2.0).astype(np.intp)
        return i, x - i

    def beta(self, psi1: Array, chi: Array) -> Array:
        """Restitution below gross slip; nan from 4 chi - 1 on, where it is 4 chi/psi1 - 1."""
        return self._evaluated(psi1, chi, slopes=False)[0]

    def beta_of_many(self, psi1: Array, chi: Array) -> Array:
        """`beta` by a compiled loop, equal but for rounding; plain Python where numba is missing."""
        shape = np.broadcast_shapes(psi1.shape, chi.shape)
        columns = shape[-1] if chi.ndim == len(shape) and chi.shape[-1] == 1 else 1
        rows = np.broadcast_to(chi, (*shape[:-1], 1) if columns > 1 else shape).reshape(-1)
        i, v = self._place(rows)
        flat = np.broadcast_to(psi1, shape).reshape(-1, columns)
        out = np.empty(flat.shape)
        compiled(_evaluate)(flat, rows, i, _weights(v), self.nodes, self.first, out)
        return out.reshape(shape)

    def slopes(self, psi1: Array, chi: Array) -> tuple[Array, Array, Array]:
        """beta, and its derivatives by psi1 and by chi; nan in gross slip."""
        beta, by_psi1, by_chi = self._evaluated(psi1, chi, slopes=True)
        return beta, by_psi1, by_chi

    def _evaluated(self, psi1: Array, chi: Array, *, slopes: bool) -> tuple[Array, ...]:
        if chi.size > 1 and (chi == chi.flat[0]).all():
            chi = chi.reshape(-1)[:1]
        row, v = self._place(chi)
        gross = 4.0 * chi - 1.0
        inside = psi1 < gross
        sticks_first = psi1 < 1.0
        second = self.nodes.shape[1] - self.first
        with np.errstate(invalid="ignore", over="ignore"):
            x = np.where(sticks_first, psi1 * self.first, self.first + (psi1 - 1.0) / (gross - 1.0) * second)
        x = np.where(inside, x, 0.0)
        i = np.minimum(x.astype(np.intp), self.nodes.shape[1] - 1)
        u = x - i
        c = self._cells(row, i, _weights(v))
        beta = np.where(inside, _horner(c, u), np.nan)
        if not slopes:
            return (beta,)
        along = _horner(c[..., 1:] * np.array([1.0, 2.0, 3.0]), u)
        per_psi1 = np.where(sticks_first, self.first, second / (gross - 1.0))
        by_chi = _horner(self._cells(row, i, _weight_slopes(v)), u) / (self.chi[1] - self.chi[0])
        # the nodes between 1 and 4 chi - 1 move with chi
        moved = np.where(sticks_first, 0.0, (x - self.first) * 4.0 / (gross - 1.0))
        nothing = np.where(inside, 0.0, np.nan)
        return beta, along * per_psi1 + nothing, by_chi - along * moved + nothing

    def _cells(self, row: Index, i: Index, weights: Array) -> Array:
        """Cubics of interval i, (..., 4): weights (4, ...) times those at the nodes of chi from `row` on."""
        n = self.nodes.shape[1]
        if row.size * n <= 2 * i.size:  # few chi: all their intervals first
            whole: Array = sum(w[..., None, None] * self.nodes[row + k] for k, w in enumerate(weights))
            flat = whole.reshape(-1, 4)
            return np.asarray(flat[np.arange(row.size).reshape(row.shape) * n + i])
        intervals, at = self.nodes.reshape(-1, 4), row * n + i
        total: Array = intervals.take(at, axis=0) * weights[0, ..., None]
        for k in range(1, 4):
            total += intervals.take(at + k * n, axis=0) * weights[k, ..., None]
        return total


def _evaluate(  # pragma: no cover - compiled where numba is there
    psi1: Array, chi: Array, row: Index, weights: Array, nodes: Array, first: int, out: Array
) -> None:
    """Table at psi1, (n, m), of chi, (n,)."""
    intervals = nodes.shape[1]
    for j in range(psi1.shape[0]):
        gross = 4.0 * chi[j] - 1.0
        for k in range(psi1.shape[1]):
            x = psi1[j, k]
            if not x < gross:
                out[j, k] = np.nan
                continue
            x = x * first if x < 1.0 else first + (x - 1.0) / (gross - 1.0) * (intervals - first)
            i = min(int(x), intervals - 1)
            u = x - i
            total = 0.0
            for node in range(4):
                c = nodes[row[j] + node, i]
                total += weights[node, j] * (c[0] + u * (c[1] + u * (c[2] + u * c[3])))
            out[j, k] = total


def _horner(c: Array, u: Array) -> Array:
    """Polynomial with coefficients along the last axis, lowest first."""
    total = c[..., -1]
    for k in range(c.shape[-1] - 2, -1, -1):
        total = c[..., k] + u * total
    return np.asarray(total)


def _weights(v: Array) -> Array:
    """Weights (4, ...) of the neighbours: a cubic with the slopes of their central differences."""
    return 0.5 * np.stack(
        (v * (v * (2.0 - v) - 1.0), 2.0 + v * v * (3.0 * v - 5.0), v * (1.0 + v * (4.0 - 3.0 * v)),
         v * v * (v - 1.0))
    )  # fmt: skip


def _weight_slopes(v: Array) -> Array:
    """Derivatives of `_weights`."""
    return 0.5 * np.stack(
        (v * (4.0 - 3.0 * v) - 1.0, v * (9.0 * v - 10.0), 1.0 + v * (8.0 - 9.0 * v), v * (3.0 * v - 2.0))
    )


@cache
def compliance_table() -> Table:
    """The table that comes with the package: the cubics through the values of table.csv beside it."""
    path = files("ifrfit.physics.compliance") / "splines.npz"
    with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
        chi, nodes, first = kept["chi"], np.ascontiguousarray(kept["nodes"]), int(kept["first"])
    chi.flags.writeable = nodes.flags.writeable = False
    return Table(chi, nodes, first)
