"""The integral over one series to begin with: its rows, its noise, and its first panels.

These are laid about the modes that least squares knows, about the kinks of the data, and about minima between
kinks: section 5 of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.row_likelihood import RowLaw
from ifrfit.inference.model.rows import Index
from ifrfit.inference.posterior.grid_settings import LADDER, GridSettings, distinct_places, ladder
from ifrfit.inference.posterior.noise_scale import KnownScale, NoiseScale, Scale
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.series_integral import ClosureConstantFree, SeriesIntegral
from ifrfit.inference.posterior.sum_of_squares import PAIRS, Reference, SumOfSquares
from ifrfit.physics.observable import scale_factor

Array = NDArray[np.float64]

Known = dict[str, FreeParameter | float | None]  # e_n, c and mu as `SeriesIntegral` takes them

_KINKS_NEAR, _KINKS_FAR = 48, 12  # kinks at which panels are split from the start
_MOST_MINIMA = 8


def make_series(
    settings: GridSettings,
    block: int,
    at: Index,
    known: Known,
    *,
    friction_count: int = 0,
    holds_all_rows: bool = False,
) -> tuple[SeriesIntegral, tuple[str, ...]]:
    """Lay the integral over the parameters of one series out.

    Parameters
    ----------
    settings : GridSettings
    block : int
    at : ndarray of int
        Its rows.
    known : mapping
        e_n, c and mu: a parameter of this integral, a fixed value, or None for one that is shared.
    friction_count : int
        How many mu are restated as kappa with this e_n, in the integral of a separated e_n.
    holds_all_rows : bool
        Whether there is no other series integral, so that a common factor of the noise is integrated here.

    Returns
    -------
    SeriesIntegral
    names : tuple of str
        Of the noises integrated inside, "" for a common factor.
    """
    problem = settings.problem
    rows = problem.rows.take(at)
    is_kappa = known["e_n"] == 0.0 and settings.parameter("e_n").fixed is None  # in the place of mu
    optimum = {kind: settings.optimum(kind, block) for kind in ("e_n", "c", "mu", "kappa")}
    reference = Reference(optimum["e_n"], optimum["c"], optimum["mu"])
    if is_kappa:
        reference = Reference(0.0, optimum["c"], optimum["kappa"])
    elif friction_count:
        reference = Reference(optimum["e_n"], 0.0, 0.0)
    names, groups, noise, weight, sigma = _noise(settings, at, holds_all_rows)
    squares = SumOfSquares(rows, weight, groups, problem.closure, problem.inertia_factor, reference)
    plain = problem.error_model.is_plain or at.size == 0
    row_law = None if plain else RowLaw.of(problem, at, settings.start.optimum.theta)
    e_n, c, mu = (known[kind] for kind in ("e_n", "c", "mu"))
    series = SeriesIntegral(squares, noise, e_n, c, mu, sigma, friction_count, row_law=row_law)
    series.c_order, series.tail = settings.c_order, settings.tail
    series.c_places = tuple(one.optimum("c", block) for one in settings.at_modes[1:])
    if series.is_unbounded and not squares.is_quadratic:
        # the density of c given curved rows is uneven where the bound of mu runs with c
        series.c_order += 2 * (settings.c_order // 4)
    if series.integrates_e_n and isinstance(e_n, FreeParameter):
        edges = ladder(settings.spreads("e_n", block), e_n.lower, e_n.upper)
        series.e_axis = QuadratureAxis.of(edges, settings.order)
    if series.role.has_axis:
        modes = [_transition(squares, one, block) for one in settings.at_modes]
        series.unit = max(modes[0][0], 1e-3)
        edges = _x_edges(series, modes, known, settings.kink_distance)
        series.x_axis = QuadratureAxis.of(edges, settings.order)
    return series, names


def _transition(squares: SumOfSquares, settings: GridSettings, block: int) -> tuple[float, float]:
    """The transition x = kappa/b(c) at an optimum, with its local standard deviation."""
    b = max(float(squares.b(settings.optimum("c", block))), 1e-6)
    kappa, sd = settings.spread("kappa", block)
    return kappa / b, max(sd / b, 1e-12)


def _noise(
    settings: GridSettings, at: Index, holds_all_rows: bool
) -> tuple[tuple[str, ...], list[Index], tuple[Scale, ...] | None, Array, Array]:
    """Names, rows and laws of the noises integrated inside, weights of the rows, and likely sigmas.

    Rows of known sigma beside them are a group without a name, behind the others.
    """
    problem, start = settings.problem, settings.start
    if problem.noise.has_unknown:
        place = np.full(problem.rows.value.size, -1)
        place[at] = np.arange(at.size)
        of_rows = [(name, place[group]) for name, group in settings.groups.items()]
        of_rows = [(name, group[group >= 0]) for name, group in of_rows if (group >= 0).any()]
        names = tuple(name for name, _ in of_rows)
        count = problem.noise.count
        noise: list[Scale] = [NoiseScale(count(at[group]), *settings.bounds[name]) for name, group in of_rows]
        groups = [group for _, group in of_rows]
        likely = [problem.noise.per_measurement(start.sigma, settings.groups[n]) for n in names]
        known = np.flatnonzero(problem.noise.is_given[at])
        if known.size and not names:
            return (), [known], None, 1.0 / problem.noise.base[at], np.ones(1)
        if known.size:
            noise, groups, likely = [*noise, KnownScale(known.size)], [*groups, known], [*likely, 1.0]
        return names, groups, tuple(noise), 1.0 / problem.noise.base[at], np.array(likely)
    everything = [np.arange(at.size)]
    factor = np.array(
        [float(np.median(start.sigma / problem.noise.sigma)) if problem.noise.is_scaled else 1.0]
    )
    if not problem.error_model.is_plain:  # the sums only say where to look
        return (), everything, None, factor[0] / start.sigma[at], np.ones(1)
    weight = 1.0 / problem.noise.sigma[at]
    if problem.noise.is_known:
        return (), everything, None, weight, np.ones(1)
    if holds_all_rows:
        return ("",), everything, (NoiseScale(problem.noise.count(at), *settings.bounds[""]),), weight, factor
    return (), everything, None, weight, np.ones(1)  # the factor is shared


def _x_edges(
    series: SeriesIntegral, modes: Sequence[tuple[float, float]], known: Known, kink_distance: float
) -> Array:
    """First edges of the transition: ladders about the modes, and the kinks of the data.

    Parameters
    ----------
    series : SeriesIntegral
    modes : sequence of (float, float)
        The transition at each known mode with its local standard deviation, the best first.
    known : mapping
        As `make_series`.
    kink_distance : float
        In sd, below which two kinks go into one panel.
    """
    center, sd = modes[0]
    # a shared parameter may be anywhere that the default domain allows
    e_low, e_high = _ends(known["e_n"], 0.0, 1.0)
    c_low, c_high = _ends(known["c"], 0.0, 0.0)
    mu_low, mu_high = _ends(known["mu"], 0.0, 2.0)
    if isinstance(series.role, ClosureConstantFree):  # x = mu (1 + e_n)/b(c)
        b_low, b_high = sorted((float(series.squares.b(c_low)), float(series.squares.b(c_high))))
        with np.errstate(divide="ignore"):
            span = [
                np.divide(mu * (1.0 + e), b)
                for e, b, mu in ((e_low, b_high, mu_low), (e_high, b_low, mu_high))
            ]
        low, high = (float(series.to_t(np.asarray(end))) for end in span)
    elif series.is_unbounded:
        low, high = 0.0, 1.0 - 1e-12
    else:
        b = float(series.squares.b(0.0))
        low = mu_low * (1.0 + e_low) / b if known["mu"] is not None and known["e_n"] is not None else 0.0
        high = mu_high * (1.0 + e_high) / b
        if known["mu"] is None or known["e_n"] is None:
            high = max(high, 8.0 * (center + sd))
    kinks = series.squares.kinks
    near = np.abs(kinks - center) <= 10.0 * sd
    kept = np.concatenate((thinned(kinks[near], _KINKS_NEAR), thinned(kinks[~near], _KINKS_FAR)))
    c_ends, prior = (-np.inf, np.inf), None
    if isinstance(known["c"], FreeParameter):
        c_ends, prior = (known["c"].lower, known["c"].upper), known["c"].prior
    # a minimum that is next to another one is on its ladder already
    places = distinct_places(
        [*modes, *local_minima(series.squares, series.sigma, c_ends, prior, 4.0 * series.tail)]
    )
    reach = np.concatenate([x + np.concatenate((-s * LADDER, [0.0], s * LADDER)) for x, s in places])
    edges = series.to_t(np.concatenate((kept, reach[reach > 0.0])))
    edges = np.unique(edges[(edges > low) & (edges < high)])
    # panels much narrower than the spread are no use, and the first and last kink are where regimes end
    width = kink_distance * min(s for _, s in places)
    scale = float(np.diff(series.to_t(np.array([max(center - 0.5 * width, 0.0), center + 0.5 * width])))[0])
    if edges.size:
        close = np.concatenate(([False], np.diff(edges) < scale))
        edges = edges[~close]
    return np.concatenate(([low], edges, [high]))


def _ends(known: FreeParameter | float | None, lower: float, upper: float) -> tuple[float, float]:
    if known is None:
        return lower, upper
    return (known.lower, known.upper) if isinstance(known, FreeParameter) else (known, known)


def thinned(kinks: Array, most: int) -> Array:
    """At most so many of the kinks, evenly by rank: refinement splits panels where others matter.

    With all of them the first grids of 7 of 43 drawn tables were too large, which take 0.4 s at most as it
    is; others took up to 1.9 times as long, for the same results to 1e-5 sd.
    """
    if kinks.size <= most:
        return kinks
    return np.asarray(kinks[np.arange(most) * (kinks.size - 1) // (most - 1)])


def local_minima(
    squares: SumOfSquares,
    sigma: Array,
    c_ends: tuple[float, float],
    c_prior: tuple[float, float] | None,
    threshold: float,
) -> list[tuple[float, float]]:
    """Transitions about which the sum of squares has a minimum between two kinks, with their spread.

    Taken at the reference's e_n. Minima whose sum of squares exceeds the least by `threshold` are left out.
    """
    kinks = squares.kinks
    edges = np.concatenate(([0.0], kinks, [np.inf]))
    if kinks.size == 0 or not any(squares.sums):
        return []
    middle = np.concatenate((0.5 * (edges[:-2] + edges[1:-1]), [2.0 * kinks[-1]]))
    total = np.zeros((len(PAIRS), middle.size))
    for s, group in zip(sigma, squares.sums, strict=True):
        for part in group:
            factor = float(scale_factor(part.scale, np.asarray(squares.reference.e_n)))
            powers = np.array([1.0, 0, factor, factor, 0, 0, 0, factor**2, factor**2, factor**2])
            at = np.searchsorted(part.tau, middle, side="right")
            total += powers[:, None] * part.products[:, at] / s**2
    rr, _, rp, rq, _, _, _, pp, pq, qq = total
    if c_prior is not None:
        off = c_prior[0] - squares.reference.c
        rr, rp, pp = (
            rr + (off / c_prior[1]) ** 2,
            rp + off / c_prior[1] ** 2,
            pp + 1.0 / c_prior[1] ** 2,
        )
    k, ref = squares.coefficients, squares.reference
    with np.errstate(divide="ignore", invalid="ignore"):
        free = (qq * rp - pq * rq) / (qq * pp - pq * pq)
        free = np.where(np.isfinite(free), free, np.where(pp > 0.0, rp / pp, 0.0))
        d = np.clip(free, c_ends[0] - ref.c, c_ends[1] - ref.c)
        shift = (rq - pq * d) / qq
        square = rr - 2.0 * (rp * d + rq * shift) + pp * d * d + 2.0 * pq * d * shift + qq * shift * shift
        b = k.b0 + k.b1 * (ref.c + d)
        x = (ref.mu * (1.0 + ref.e_n) + shift) / b
        spread = np.sqrt(pp / (qq * pp - pq * pq)) / b
    good = np.isfinite(x) & np.isfinite(spread) & (x >= edges[:-1]) & (x <= edges[1:])
    if not good.any():
        return []
    good &= square <= square[good].min() + threshold
    order = np.flatnonzero(good)[np.argsort(square[good])][:_MOST_MINIMA]
    return [(float(x[i]), float(spread[i])) for i in order]
