"""Independent draws from the quadrature: one conditional distribution function after the other, inverted.

Eq. (12) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.posterior.closure_constant import ConditionalCoordinate
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.integral_layout import IntegralLayout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis, rule

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STEPS = 32  # points to a panel at which distribution functions are tabled, beside its nodes


def draw(
    layout: IntegralLayout, density: JointDensity, names: Sequence[str], n: int, rng: np.random.Generator
) -> dict[str, Array]:
    """Draw all quantities together, each (n,).

    Parameters
    ----------
    layout : IntegralLayout
    density : JointDensity
    names : sequence of str
        Of the quantities wanted, in the order of the result.
    n : int
    rng : numpy.random.Generator
    """
    if n == 0:
        return {name: np.empty(0) for name in names}
    outer, shared = _shared(density, n, rng)
    parts = [_series(grid, outer, shared, n, rng) for grid in density.grids]
    found: dict[str, Array] = {}
    for block in range(len(layout.blocks)):
        own = parts[block]
        e_n, mu = own["e_n"], own["mu"]
        if layout.separable:  # kappa stands in the place of mu
            e_n = parts[layout.restitution_series[block]]["e_n"]
            mu = own["mu"] / (1.0 + e_n)
        for kind, values in (("e_n", e_n), ("c", own["c"]), ("mu", mu)):
            parameter = layout.parameters[kind, block]
            if isinstance(parameter, FreeParameter):
                found[parameter.name] = np.clip(values, parameter.lower, parameter.upper)
        if layout.kappa_names[block]:
            found[layout.kappa_names[block]] = mu * (1.0 + e_n)
    if "noise" in shared:
        found["noise"] = shared["noise"]
    for grid, groups, own in zip(density.grids, layout.noise_groups, parts, strict=True):
        for group, name in enumerate(groups):
            if noise_name(name) in names:
                found[noise_name(name)] = _noise(grid, group, own, rng)
    return {name: found[name] for name in names}


def _shared(joint: JointDensity, n: int, rng: np.random.Generator) -> tuple[Index, dict[str, Array]]:
    """Outer node nearest to each draw, and the shared parameters themselves."""
    index = np.zeros(n, dtype=np.intp)
    values: dict[str, Array] = {}
    for number, one in enumerate(joint.integral.shared):
        panels = PanelCdf.of(one.axis, joint.outer_density(0, *range(number + 1)))  # given those before
        t, before = _inverted(panels, index, rng.random(n))
        values[one.kind] = np.exp(t) if one.log else t
        # one of the two nodes about each value, the nearer one more often
        share = _fraction_to_next(one.axis.nodes(), before, t)
        index = index * one.axis.nodes().size + before + (rng.random(n) < share)
    return index, values


def _inverted(panels: PanelCdf, row: Index, p: Array) -> tuple[Array, Index]:
    """Where the distribution function of a row takes the share p of its total, and the node before."""
    return InverseCdfTable.of(panels).inverse(row, p, _places(panels.axis))


def _places(axis: QuadratureAxis) -> Array:
    """The points of all panels, (1, points)."""
    return np.asarray((axis.low[:, None] + axis.width[:, None] * table_points(axis.order)).reshape(1, -1))


def _series(
    grid: DensityGrid, outer: Index, shared: dict[str, Array], n: int, rng: np.random.Generator
) -> dict[str, Array]:
    """e_n, transition, closure constant and mu of one series."""
    series = grid.series
    m = grid.g.shape[1]
    row = outer if m > 1 else np.zeros(n, dtype=np.intp)
    found: dict[str, Array] = {}
    e_at = np.zeros(n, dtype=np.intp)
    for kind, known in (("e_n", series.e_n), ("c", series.c), ("mu", series.mu)):
        if not isinstance(known, FreeParameter):
            found[kind] = shared[kind] if known is None else np.full(n, float(known))
    e_share = np.zeros(n)
    if series.e_axis is not None:
        panels = PanelCdf.of(series.e_axis, (grid.g[0] * grid.x_weight[0]).sum(axis=-1))
        found["e_n"], before = _inverted(panels, row, rng.random(n))
        if grid.g.shape[2] > 1 and (series.x_axis is not None or series.integrates_c):
            e_at, e_share = before, _fraction_to_next(series.e_axis.nodes(), before, found["e_n"])
    x_at, x_share = np.zeros(n, dtype=np.intp), np.zeros(n)
    if series.x_axis is not None:
        t, x_at = _transition(grid, series.x_axis, row, e_at, e_share, rng.random(n))
        found["x"] = series.to_x(t)
        if series.integrates_c:
            x_share = _fraction_to_next(series.x_axis.nodes(), x_at, t)
    if grid.nodes.coordinate is not None:
        e_at = e_at + (rng.random(n) < e_share)
        found["c"] = _closure_constant(grid, grid.nodes.coordinate, row, e_at, x_at, x_share, rng.random(n))
    return series.role.complete(found)


def _fraction_to_next(nodes: Array, before: Index, t: Array) -> Array:
    """How far each value is from the node before it towards the next one."""
    left = nodes[before]
    gap = nodes[before + 1] - left
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(gap > 0.0, np.clip((t - left) / gap, 0.0, 1.0), 0.0))


def _transition(
    grid: DensityGrid, axis: QuadratureAxis, row: Index, e_at: Index, e_share: Array, p: Array
) -> tuple[Array, Index]:
    """The transition's coordinate, and the node before: quantiles at the two nodes of e_n, interpolated."""
    m, n_e, _ = grid.g.shape[1:]
    panels = PanelCdf.of(axis, grid.g[0])
    start, span = np.zeros(m * n_e), np.ones(m * n_e)
    if grid.limits is not None:
        total = np.maximum(panels.total, 1e-300)
        least, most = (
            panels.below(np.broadcast_to(end, (m, n_e)).reshape(-1)) / total for end in grid.limits
        )
        start, span = least, most - least

    table, places = InverseCdfTable.of(panels), _places(axis)

    def at(which: Index) -> tuple[Array, Index]:
        share = p if grid.limits is None else np.clip(start[which] + p * span[which], 0.0, 1.0)
        return table.inverse(which, share, places)

    t, before = at(row * n_e + e_at)
    if n_e == 1:
        return t, before
    t = t + e_share * (at(row * n_e + e_at + 1)[0] - t)
    nodes = axis.nodes()
    return t, np.clip(np.searchsorted(nodes, t) - 1, 0, nodes.size - 2)


def _closure_constant(
    grid: DensityGrid,
    coordinate: ConditionalCoordinate,
    row: Index,
    e_at: Index,
    x_at: Index,
    x_share: Array,
    p: Array,
) -> Array:
    """The closure constant: quantiles at the two nodes of the transition about the draw, interpolated."""
    order = grid.series.c_order
    shape = np.broadcast_shapes(grid.f.shape[:3], coordinate.mode.shape)
    row, e_at, x_at = (
        at if n > 1 else np.zeros_like(at) for at, n in zip((row, e_at, x_at), shape, strict=True)
    )
    ends = [(row * shape[1] + e_at) * shape[2] + x_at]
    if shape[2] > 1:
        ends.append(ends[0] + 1)
    used = np.flatnonzero(np.bincount(np.concatenate(ends), minlength=math.prod(shape)))
    number = np.zeros(math.prod(shape), dtype=np.intp)
    number[used] = np.arange(used.size)
    mode, size = (
        np.broadcast_to(y, shape).reshape(-1)[used, None] for y in (coordinate.mode, coordinate.size)
    )
    u_max = np.broadcast_to(coordinate.u_max, (*shape, 2)).reshape(-1, 2)[used]
    sides = np.broadcast_to(grid.f, (*shape, grid.f.shape[-1])).reshape(-1, 2, order + 1)[used]
    sides[:, 0] = sides[:, 0, ::-1]  # the left side runs away from the mode: turn it round
    # the coordinate: from -1 (left end) to 0 (mode) to 1 (right end)
    table = InverseCdfTable.of(PanelCdf.of(QuadratureAxis.of(np.array([-1.0, 0.0, 1.0]), order), sides))
    points = table_points(order)
    u = np.concatenate((u_max[:, :1] * (points - 1.0), u_max[:, 1:] * points), axis=1)
    places = mode + size * np.sinh(u)
    found = [table.inverse(number[at], p, places)[0] for at in ends]
    return np.asarray(found[0] + x_share * (found[-1] - found[0]))


def _noise(grid: DensityGrid, group: int, own: dict[str, Array], rng: np.random.Generator) -> Array:
    """One sigma of a noise group for each draw of the other parameters."""
    squares = grid.series.squares
    q = squares.quadratics(own["e_n"], own["x"])[group]
    square = q.at(own["c"] - squares.reference.c)
    square = square + squares.curved_of(group, own["e_n"], own["x"], own["c"], own["mu"])
    return grid.series.noise_scale(group).draw(np.broadcast_to(square, own["e_n"].shape), rng)


@cache
def _grid(order: int) -> tuple[Array, Array, Index]:
    """Points of a panel, the integrals' polynomials there, and the node at or before the end of each step."""
    nodes = rule(order).nodes
    points = np.union1d(np.linspace(0.0, 1.0, _STEPS + 1), nodes)
    # the same node twice, but for rounding, makes no step
    points = points[np.concatenate(([True], np.diff(points) > 1e-12))]
    before = np.clip(np.searchsorted(nodes, points - 1e-9) - 1, 0, order - 1)
    return points, np.asarray(chebyshev.chebvander(2.0 * points - 1.0, order + 1).T, dtype=float), before


def table_points(order: int) -> Array:
    """Points of a panel at which distribution functions are tabled, on [0, 1]; its nodes are among them."""
    return _grid(order)[0]


@dataclass(frozen=True)
class InverseCdfTable:
    """Distribution functions, one a row, at the points of all panels.

    Attributes
    ----------
    below : ndarray, (rows, points)
        Ascending from 0 to 1.
    order : int
        Of the panels.
    """

    below: Array
    order: int

    @classmethod
    def of(cls, panels: PanelCdf) -> InverseCdfTable:
        """Of all rows of panels."""
        order = panels.axis.order
        below = panels.cumulative[:, :-1, None] + panels.coefficients @ _grid(order)[1]
        below = np.maximum.accumulate(below.reshape(below.shape[0], -1), axis=1)
        below = np.maximum(below, 0.0) / np.maximum(below[:, -1:], 1e-300)
        below[:, -1] = 1.0
        return cls(below, order)

    def inverse(self, row: Index, p: Array, places: Array) -> tuple[Array, Index]:
        """Where the distribution function of a row takes the value p.

        Parameters
        ----------
        row : ndarray of int, (n,)
        p : ndarray, (n,)
        places : ndarray, (rows or 1, points)
            The quantity at the points.

        Returns
        -------
        values : ndarray, (n,)
        before : ndarray of int, (n,)
            The last node before each value, counted along all panels.
        """
        rows, points = self.below.shape
        own: Index = row if rows > 1 else np.zeros(1, dtype=np.intp)
        flat = self.below.reshape(-1)
        # a guide table: for each of `points` equal cells of [0, 1], the first entry of the row in it; four
        # times as fast as a binary search for each of 100,000 values
        cell = (self.below * points).astype(np.intp) + np.arange(rows)[:, None] * (points + 1)
        count = np.bincount(cell.reshape(-1), minlength=rows * (points + 1))
        first = np.cumsum(count) - count
        right = first[own * (points + 1) + (p * points).astype(np.intp)]
        right = np.maximum(right, own * points + 1)  # a step has a point before it
        late = np.flatnonzero(flat[right] < p)
        while late.size:  # entries of the same cell before p
            right[late] += 1
            late = late[flat[right[late]] < p[late]]
        a, b = flat[right - 1], flat[right]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(b > a, np.clip((p - a) / (b - a), 0.0, 1.0), 0.5)
        point = right - own * points
        if places.shape[0] > 1:
            places, at = places.reshape(-1), right
        else:
            places, at = places[0], point
        left = places[at - 1]
        return left + share * (places[at] - left), self._nodes()[point]

    def _nodes(self) -> Index:
        """The last node before the end of each step, along all panels."""
        before = _grid(self.order)[2]
        panels = self.below.shape[1] // before.size
        return np.asarray((np.arange(panels)[:, None] * (self.order + 1) + before).reshape(-1))
