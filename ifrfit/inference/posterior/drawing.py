"""Independent draws from the quadrature: one conditional distribution function after the other, inverted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.joint import Grid
from ifrfit.inference.posterior.marginal import Panels
from ifrfit.inference.posterior.plan import noise_label
from ifrfit.inference.posterior.rule import partial
from ifrfit.inference.posterior.tensor import Tensor
from ifrfit.inference.posterior.unknown import Unknown

if TYPE_CHECKING:
    from ifrfit.inference.posterior.explore import Posterior

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STEPS = 32  # points to a panel at which distribution functions are tabled
_GRID = np.linspace(0.0, 1.0, _STEPS + 1)


def draw(posterior: Posterior, n: int, rng: np.random.Generator) -> dict[str, Array]:
    """Draw all quantities together; see `Posterior.draws`."""
    plan, grid = posterior.plan, posterior.grid
    outer, shared = _shared(grid, n, rng)
    parts = [_series(tensor, outer, shared, n, rng) for tensor in grid.tensors]
    found: dict[str, Array] = {}
    kappas: dict[str, Array] = {}
    names = [name for name in posterior.quantities if name.startswith("kappa")]
    for block in range(len(plan.blocks)):
        own = parts[plan.tangential[block]]
        e_n = parts[plan.normal[block]]["e_n"] if plan.apart else own["e_n"]
        mu = own["mu"] / (1.0 + e_n) if plan.apart else own["mu"]
        for kind, values in (("e_n", e_n), ("c", own["c"]), ("mu", mu)):
            unknown = plan.unknowns[kind, block]
            if isinstance(unknown, Unknown):
                found[unknown.name] = np.clip(values, unknown.lower, unknown.upper)
        if names:
            kappas[names[min(block, len(names) - 1)]] = mu * (1.0 + e_n)
    found |= kappas
    if "noise" in shared:
        found["noise"] = shared["noise"]
    for tensor, names_, own in zip(grid.tensors, plan.groups, parts, strict=True):
        for group, name in enumerate(names_):
            found[noise_label(name)] = _noise(tensor, group, own, rng)
    return {name: found[name] for name in posterior.names}


def _shared(grid: Grid, n: int, rng: np.random.Generator) -> tuple[Index, dict[str, Array]]:
    """Outer node nearest to each draw, and the shared unknowns themselves."""
    index = np.zeros(n, dtype=np.intp)
    values: dict[str, Array] = {}
    shape = grid.shape()
    density = grid.density[0].reshape(shape) if shape else None
    for number, one in enumerate(grid.joint.shared):
        assert density is not None
        rest = density
        for later in range(number + 1, len(shape)):
            w = grid.joint.shared[later].axis.weights()[0]
            rest = (rest * w.reshape([-1 if i == later else 1 for i in range(rest.ndim)])).sum(
                later, keepdims=True
            )
        rows = rest.reshape(-1, one.axis.panels.shape[0], one.axis.order + 1)
        panels = Panels.of(one.axis.low[None], one.axis.width[None], rows)
        t = _inverse(panels, index, rng.random(n))
        values[one.kind] = np.exp(t) if one.log else t
        index = index * shape[number] + _neighbour(one.axis.nodes(), t, rng)
    return index, values


def _neighbour(nodes: Array, t: Array, rng: np.random.Generator) -> Index:
    """One of the two nodes about each value, the nearer one more often."""
    right = (
        np.clip(np.searchsorted(nodes, t), 1, nodes.size - 1) if nodes.size > 1 else np.zeros(t.size, np.intp)
    )
    if nodes.size == 1:
        return np.asarray(right)
    gap = nodes[right] - nodes[right - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(gap > 0.0, (t - nodes[right - 1]) / gap, 0.0)
    return np.asarray(right - (rng.random(t.size) >= share))


def _inverse(panels: Panels, row: Index, p: Array) -> Array:
    """Where the distribution function of a row takes the share p of its total."""
    used, at = np.unique(row, return_inverse=True)
    rows = panels.cumulative.shape[0]
    used = used if rows > 1 else np.zeros(1, dtype=np.intp)
    at = at.reshape(-1) if rows > 1 else np.zeros(p.size, dtype=np.intp)
    coefficients = panels.coefficients[used]
    inside = partial(coefficients[:, :, None, :], _GRID[None, None, :])
    table = panels.cumulative[used][:, :-1, None] + inside
    low = panels.low[used if panels.low.shape[0] > 1 else np.zeros(used.size, np.intp)]
    width = panels.width[used if panels.low.shape[0] > 1 else np.zeros(used.size, np.intp)]
    places = (low[..., None] + width[..., None] * _GRID).reshape(used.size, -1)
    table = np.maximum.accumulate(table.reshape(used.size, -1), axis=1)
    table = table / np.maximum(table[:, -1:], 1e-300)
    flat = (table + 2.0 * np.arange(used.size)[:, None]).reshape(-1)
    right = np.searchsorted(flat, p + 2.0 * at, side="left")
    first = at * table.shape[1]
    right = np.clip(right - first, 1, table.shape[1] - 1)
    a, b = table[at, right - 1], table[at, right]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(b > a, np.clip((p - a) / (b - a), 0.0, 1.0), 0.5)
    left = places[at, right - 1]
    return np.asarray(left + share * (places[at, right] - left))


def _series(
    tensor: Tensor, outer: Index, shared: dict[str, Array], n: int, rng: np.random.Generator
) -> dict[str, Array]:
    """e_n, transition, closure constant and mu of one series."""
    series = tensor.series
    m = tensor.g.shape[1]
    row = outer if m > 1 else np.zeros(n, dtype=np.intp)
    found: dict[str, Array] = {}
    e_at = np.zeros(n, dtype=np.intp)
    for kind, known in (("e_n", series.e_n), ("c", series.c), ("mu", series.mu)):
        if not isinstance(known, Unknown):
            found[kind] = shared[kind] if known is None else np.full(n, float(known))
    e_ends = [e_at, e_at]
    e_share = np.zeros(n)
    if series.has_e_axis:
        assert series.e_axis is not None
        h = (tensor.g[0] * tensor.x_weight[0]).sum(axis=-1)
        rows = h.reshape(m, -1, series.e_axis.order + 1)
        panels = Panels.of(series.e_axis.low[None], series.e_axis.width[None], rows)
        found["e_n"] = _inverse(panels, row, rng.random(n))
        e_ends, e_share = _between(series.e_axis.nodes(), found["e_n"])
        e_at = np.where(rng.random(n) < e_share, e_ends[1], e_ends[0])
    x_ends, x_share = [np.zeros(n, dtype=np.intp)] * 2, np.zeros(n)
    if series.has_x_axis:
        t = _transition(tensor, row, e_ends, e_share, rng.random(n))
        assert series.x_axis is not None
        x_ends, x_share = _between(series.x_axis.nodes(), t)
        found["x"] = series.to_x(t)
    if series.has_c:
        found["c"] = _closure_constant(tensor, row, e_at, x_ends, x_share, rng.random(n))
    return _completed(tensor, found)


def _between(nodes: Array, t: Array) -> tuple[list[Index], Array]:
    """The nodes about each value, and how far it is towards the second."""
    if nodes.size == 1:
        return [np.zeros(t.size, dtype=np.intp)] * 2, np.zeros(t.size)
    right = np.clip(np.searchsorted(nodes, t), 1, nodes.size - 1)
    gap = nodes[right] - nodes[right - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(gap > 0.0, np.clip((t - nodes[right - 1]) / gap, 0.0, 1.0), 0.0)
    return [right - 1, right], share


def _transition(tensor: Tensor, row: Index, e_ends: list[Index], e_share: Array, p: Array) -> Array:
    """The transition's coordinate: quantiles at the two nodes of e_n about the draw, interpolated."""
    axis = tensor.series.x_axis
    assert axis is not None
    m, n_e, _ = tensor.g.shape[1:]
    values = tensor.g[0].reshape(m * n_e, -1, axis.order + 1)
    panels = Panels.of(axis.low[None], axis.width[None], values)
    start, span = np.zeros(m * n_e), np.ones(m * n_e)
    if tensor.limits is not None:
        total = np.maximum(panels.total, 1e-300)
        least, most = (
            panels.below(np.broadcast_to(end, (m, n_e)).reshape(-1)) / total for end in tensor.limits
        )
        start, span = least, most - least
    ends = [row * n_e + end for end in (e_ends if n_e > 1 else e_ends[:1])]
    found = [_inverse(panels, at, start[at] + p * span[at]) for at in ends]
    return np.asarray(found[0] + e_share * (found[-1] - found[0]))


def _closure_constant(
    tensor: Tensor, row: Index, e_at: Index, x_ends: list[Index], x_share: Array, p: Array
) -> Array:
    """The closure constant: quantiles at the two nodes of the transition about the draw, interpolated."""
    assert tensor.spread is not None
    order = tensor.series.c_order
    shape = np.broadcast_shapes(tensor.f.shape[:3], tensor.spread.mode.shape)
    row, e_at = (at if n > 1 else np.zeros_like(at) for at, n in ((row, shape[0]), (e_at, shape[1])))
    mode, size = (np.broadcast_to(y, shape).reshape(-1) for y in (tensor.spread.mode, tensor.spread.size))
    reach = np.broadcast_to(tensor.spread.reach, (*shape, 2)).reshape(-1, 2)
    values = np.broadcast_to(tensor.f, (*shape, tensor.f.shape[-1])).reshape(-1, 2, order + 1)
    ends = []
    for end in x_ends if shape[2] > 1 else [np.zeros_like(row)] * 2:
        flat = (row * shape[1] + e_at) * shape[2] + end
        used, at = np.unique(flat, return_inverse=True)
        both = values[used].copy()
        both[:, 0] = both[:, 0, ::-1]  # the left side runs away from the mode: turn it round
        # the coordinate: from -1 (left end) to 0 (mode) to 1 (right end)
        panels = Panels.of(np.array([[-1.0, 0.0]]), np.ones((1, 2)), both)
        s = _inverse(panels, at.reshape(-1), p)
        u = np.where(s < 0.0, reach[flat, 0], reach[flat, 1]) * s
        ends.append(mode[flat] + size[flat] * np.sinh(u))
    return np.asarray(ends[0] + x_share * (ends[1] - ends[0]))


def _completed(tensor: Tensor, found: dict[str, Array]) -> dict[str, Array]:
    """What follows from the rest: by the transition, mu, e_n or the closure constant."""
    series = tensor.series
    if series.role == "none":
        found["x"] = found["mu"] * (1.0 + found["e_n"]) / np.maximum(series.misfit.b(found["c"]), 1e-300)
    elif series.role == "mu":
        found["mu"] = found["x"] * series.misfit.b(found["c"]) / (1.0 + found["e_n"])
    elif series.role == "e_n":
        found["e_n"] = found["x"] * series.misfit.b(found["c"]) / found["mu"] - 1.0
    else:
        k = series.misfit.coefficients
        found["c"] = (found["mu"] * (1.0 + found["e_n"]) / found["x"] - k.b0) / k.b1
    return found


def _noise(tensor: Tensor, group: int, own: dict[str, Array], rng: np.random.Generator) -> Array:
    misfit, noise = tensor.series.misfit, tensor.series.noise
    assert noise is not None
    q = misfit.quadratics(own["e_n"], own["x"])[group]
    square = q.at(own["c"] - misfit.reference.c)
    square = square + misfit.curved(own["e_n"], own["x"], own["c"], own["mu"])[group]
    return noise[group].draw(np.broadcast_to(square, own["e_n"].shape), rng)
