"""From a problem to the integral that answers it: what separates, what series share, where to begin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.constants import Constant
from ifrfit.inference.least_squares import LeastSquares
from ifrfit.inference.linear import LOWEST
from ifrfit.inference.posterior.axis import Axis
from ifrfit.inference.posterior.inner import Series
from ifrfit.inference.posterior.joint import Joint, Shared
from ifrfit.inference.posterior.misfit import Misfit, Reference
from ifrfit.inference.posterior.noise import UnknownNoise, noise_bounds
from ifrfit.inference.posterior.unknown import Unknown
from ifrfit.inference.problem import Index, Problem, RowModel
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]

_KINDS = ("e_n", "c", "mu")
_FREE_OF_E = ("lambda_deg", "psi_after_deg")  # curved observables that the impulse factor alone decides
_LADDER = np.array([1.5, 4.0, 8.0, 16.0, 40.0, 120.0, 400.0, 2e3, 1e4, 1e5])  # first panels, in sd
_KINKS_NEAR, _KINKS_FAR = 48, 12  # kinks at which panels are split from the start


@dataclass(frozen=True)
class Plan:
    """The integral, and which of its parts holds which constant.

    Attributes
    ----------
    joint : Joint
    tangential : tuple of int
        Part that holds the oblique rows of each block.
    normal : tuple of int
        Part that holds e_n of each block where it separates; empty where it does not.
    unknowns : mapping
        (kind, block) to the unknown as the user knows it.
    blocks : tuple of ndarray
        Rows of each block.
    groups : tuple of tuple of str
        Names of the unknown noises of each part.
    """

    joint: Joint
    tangential: tuple[int, ...]
    normal: tuple[int, ...]
    unknowns: Mapping[tuple[str, int], Unknown | float]
    blocks: tuple[Index, ...]
    groups: tuple[tuple[str, ...], ...]

    @property
    def apart(self) -> bool:
        """Whether e_n separates."""
        return bool(self.normal)


@dataclass(frozen=True)
class Setting:
    """What all parts need: the problem, its optimum with the local spread, and the wanted tolerance."""

    problem: Problem
    start: LeastSquares
    tolerance: float

    @cached_property
    def covariance(self) -> Array:
        """Of the local picture; loose directions as wide as the prior."""
        return self.start.local.covariance(capped=True)

    @cached_property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Of the noises' priors."""
        return noise_bounds(self.problem)

    @property
    def order(self) -> int:
        """Order of the rules on panels."""
        return next(
            (order for order, least in ((8, 1e-2), (12, 1e-3), (16, 1e-6)) if self.tolerance >= least), 32
        )

    @property
    def c_order(self) -> int:
        """Order along the closure constant, either side of its mode."""
        return next(
            (order for order, least in ((16, 1e-2), (24, 1e-3), (32, 1e-5)) if self.tolerance >= least), 64
        )

    @property
    def crowded(self) -> float:
        """Distance, in sd, below which two kinks go into one panel; refinement sees to what that leaves."""
        return next(
            (d for d, least in ((0.6, 1e-2), (0.4, 1e-3), (0.2, 1e-5)) if self.tolerance >= least), 0.02
        )

    @property
    def tail(self) -> float:
        """Fall of the log density whose mass is far below the tolerance."""
        return 6.0 - 2.0 * math.log(self.tolerance)

    def constant(self, kind: str) -> Constant:
        """The constant of a kind; closure F has a fixed one."""
        by_name = {c.name: c for c in self.problem.constants}
        own = self.problem.closure.constant
        if kind == "c":
            return by_name[own] if own else Constant("", 0.0, 0.0, fixed=0.0)
        return by_name[kind]

    def place(self, kind: str, block: int) -> int | None:
        """Entry of theta."""
        name = self.problem.closure.constant if kind == "c" else kind
        return None if name is None else int(self.problem.positions()[name][block])

    def spread(self, kind: str, block: int) -> tuple[float, float]:
        """Optimum and local sd of e_n, c, mu or kappa in a block."""
        local = self.start.local
        theta = self.start.optimum.theta
        to_theta = local.to_theta
        if kind == "kappa":
            e, mu = self.place("e_n", block), self.place("mu", block)
            assert e is not None
            assert mu is not None
            functional = (1.0 + theta[e]) * to_theta[mu] + theta[mu] * to_theta[e]
            value, prior_sd = float(theta[mu] * (1.0 + theta[e])), 1.0
        else:
            at = self.place(kind, block)
            if at is None:
                return 0.0, 0.0
            functional, value = to_theta[at], float(theta[at])
            prior_sd = self.constant(kind).prior_sd
        sd = math.sqrt(max(float(functional @ self.covariance @ functional), 0.0))
        return value, min(max(sd, 1e-9 * max(abs(value), 1.0)), prior_sd)


def make_plan(problem: Problem, start: LeastSquares, tolerance: float, *, apart: bool) -> Plan:
    """Lay the integral out.

    Parameters
    ----------
    problem : Problem
    start : LeastSquares
    tolerance : float
    apart : bool
        Take e_n apart where the data allow it; kappa takes the place of mu there.
    """
    setting = Setting(problem, start, tolerance)
    has_separate = any(c.separate for c in problem.constants) and len(problem.series) > 1
    if has_separate:
        blocks = tuple(np.flatnonzero(problem.rows.series == i) for i in range(len(problem.series)))
    else:
        blocks = (np.arange(problem.rows.value.size),)
    apart = apart and e_n_is_apart(setting)
    unknowns: dict[tuple[str, int], Unknown | float] = {}
    shared_kinds = []
    for kind in _KINDS:
        constant = setting.constant(kind)
        for block in range(len(blocks)):
            if constant.fixed is not None:
                unknowns[kind, block] = constant.fixed
            else:
                at = setting.place(kind, block)
                assert at is not None
                unknowns[kind, block] = Unknown.of(problem.names[at], _serious(constant, problem))
        if has_separate and constant.fixed is None and not constant.separate:
            shared_kinds.append(kind)
    _refuse_negative_bound(setting)
    return _assemble(setting, blocks, unknowns, shared_kinds, apart)


def _serious(constant: Constant, problem: Problem) -> Constant:
    """The constant; e_n where values are over the outgoing normal velocity not below what is meant seriously."""
    if constant.name == "e_n" and any(OBSERVABLES[name].scale == "rebound" for name in problem.rows.names):
        return replace(constant, lower=max(constant.lower, LOWEST))
    return constant


def _refuse_negative_bound(setting: Setting) -> None:
    """A bound of the frictional impulse below zero has no transition."""
    k = setting.problem.closure.coefficients(setting.problem.inertia_factor)
    constant = setting.constant("c")
    ends = (constant.lower, constant.upper) if constant.fixed is None else (constant.fixed, constant.fixed)
    if min(k.b0 + k.b1 * end for end in ends) < -1e-12:
        raise UsageError(
            f"The exact posterior needs {constant.name} >= {-k.b0 / k.b1:g}, where sticking has a meaning: "
            f"narrow --bounds {constant.name}, or use --method lsq."
        )


def e_n_is_apart(setting: Setting) -> bool:
    """Whether the rows see e_n and kappa, but nothing that ties the two."""
    problem = setting.problem
    e_n, mu = setting.constant("e_n"), setting.constant("mu")
    if e_n.fixed is not None or mu.fixed is not None or mu.prior is not None or mu.lower > 0.0:
        return False
    if e_n.separate and not mu.separate:
        return False
    for name in problem.rows.names:
        o = OBSERVABLES[name]
        if o.kind == "friction" or (o.kind == "tangential" and o.scale != "one"):
            return False
        if o.kind == "curved" and name not in _FREE_OF_E:
            return False
    kinds = {OBSERVABLES[name].kind for name in problem.rows.names}
    return bool(kinds & {"tangential", "curved"})


def _assemble(
    setting: Setting,
    blocks: tuple[Index, ...],
    unknowns: dict[tuple[str, int], Unknown | float],
    shared_kinds: list[str],
    apart: bool,
) -> Plan:
    series: list[Series] = []
    groups: list[tuple[str, ...]] = []
    normal: list[int] = []
    tangential: list[int] = []
    is_normal = np.array([OBSERVABLES[n].kind == "normal" for n in setting.problem.rows.names])
    direct = is_normal[setting.problem.rows.which]
    for block, rows in enumerate(blocks):
        known: dict[str, Unknown | float | None] = {kind: unknowns[kind, block] for kind in _KINDS}
        if apart:
            e_n, mu = known["e_n"], known["mu"]
            assert isinstance(e_n, Unknown)
            assert isinstance(mu, Unknown)
            kappa = Unknown(mu.name, 0.0, mu.upper * (1.0 + e_n.lower), None, mu.log_scale)
            known |= {"e_n": 0.0, "mu": kappa}
            rows = rows[~direct[rows]]
        for kind in shared_kinds:
            if not (apart and kind == "e_n"):
                known[kind] = None
        tangential.append(len(series))
        made, names = _part(setting, block, rows, known, 0)
        series.append(made)
        groups.append(names)
    if apart:
        own = setting.constant("e_n").separate and len(blocks) > 1
        for block in range(len(blocks) if own else 1):
            rows = blocks[block] if own else np.arange(direct.size)
            count = len(blocks) if setting.constant("mu").separate and not own else 1
            known = {"e_n": unknowns["e_n", block], "c": 0.0, "mu": 0.0}
            normal.append(len(series))
            made, names = _part(setting, block, rows[direct[rows]], known, count)
            series.append(made)
            groups.append(names)
        if not own:
            normal = normal * len(blocks)
    joint = Joint(_shared(setting, unknowns, shared_kinds, apart, series), series)
    return Plan(joint, tuple(tangential), tuple(normal), unknowns, blocks, tuple(groups))


def _part(
    setting: Setting, block: int, at: Index, known: Mapping[str, Unknown | float | None], n_normal: int
) -> tuple[Series, tuple[str, ...]]:
    """One part of the integral with its first panels."""
    problem, start = setting.problem, setting.start
    rows = _taken(problem.rows, at)
    optimum = {kind: setting.spread(kind, block) for kind in ("e_n", "c", "mu", "kappa")}
    held = known["e_n"] == 0.0 and setting.constant("e_n").fixed is None  # mu stands for kappa
    friction = optimum["kappa"] if held else optimum["mu"]
    reference = Reference(0.0 if held else optimum["e_n"][0], optimum["c"][0], friction[0])
    if n_normal:
        reference = Reference(optimum["e_n"][0], 0.0, 0.0)
    names: tuple[str, ...] = ()
    noise: tuple[UnknownNoise, ...] | None = None
    if problem.noise == "unknown":
        bounds = setting.bounds
        found = [(name, np.flatnonzero(np.isin(at, group))) for name, group in problem.groups().items()]
        found = [(name, group) for name, group in found if group.size]
        names = tuple(name for name, _ in found)
        groups = [group for _, group in found]
        noise = tuple(UnknownNoise(group.size, *bounds[name]) for name, group in found)
        weight = np.ones(at.size)
        sigma = np.array([start.noise[name] for name in names])
    else:
        groups = [np.arange(at.size)]
        weight = 1.0 / problem.sigma[at]
        factor = float(np.median(start.sigma[at] / problem.sigma[at])) if at.size else 1.0
        sigma = np.array([factor if problem.noise == "scaled" else 1.0])
    misfit = Misfit(rows, weight, groups, problem.closure, problem.inertia_factor, reference)
    series = Series(misfit, noise, known["e_n"], known["c"], known["mu"], sigma, n_normal)
    series.c_order, series.tail = setting.c_order, setting.tail
    if series.has_e_axis:
        assert isinstance(series.e_n, Unknown)
        center, sd = optimum["e_n"]
        edges = ladder(center, sd, series.e_n.lower, series.e_n.upper)
        series.e_axis = Axis.of(edges, setting.order)
    if series.has_x_axis:
        b = max(float(misfit.b(optimum["c"][0])), 1e-6)
        center, sd = optimum["kappa"][0] / b, max(optimum["kappa"][1] / b, 1e-12)
        series.unit = max(center, 1e-3)
        series.x_axis = Axis.of(_x_edges(series, center, sd, known, setting.crowded), setting.order)
    return series, names


def _taken(rows: RowModel, at: Index) -> RowModel:
    part = rows.take(at)
    return replace(part, series=np.zeros(at.size, dtype=np.intp))


def ladder(center: float, sd: float, lower: float, upper: float) -> Array:
    """Edges at growing distances from the centre, out to both ends."""
    steps = sd * _LADDER
    edges = np.concatenate((center - steps, [center], center + steps))
    edges = edges[(edges > lower) & (edges < upper)]
    return np.concatenate(([lower], edges, [upper]))


def _x_edges(
    series: Series, center: float, sd: float, known: Mapping[str, Unknown | float | None], crowded: float
) -> Array:
    """First edges of the transition: a ladder about the optimum, and the kinks of the data."""
    ends = []
    for end in ("lower", "upper"):
        e, c, mu = (
            getattr(u, end) if isinstance(u, Unknown) else u for u in (known["e_n"], known["c"], known["mu"])
        )
        ends.append(
            (float(end == "upper") if e is None else e, c, 2.0 * (end == "upper") if mu is None else mu)
        )
    if series.role == "c":  # x = mu (1 + e_n)/b(c)
        (e_low, c_low, mu_low), (e_high, c_high, mu_high) = ends
        with np.errstate(divide="ignore"):
            span = [
                np.divide(mu * (1.0 + e), series.misfit.b(c))
                for e, c, mu in ((e_low, c_high, mu_low), (e_high, c_low, mu_high))
            ]
        low, high = (float(series.to_t(np.asarray(end))) for end in span)
    elif series.stretched:
        low, high = 0.0, 1.0 - 1e-12
    else:
        b = float(series.misfit.b(0.0))
        (e_low, _, mu_low), (e_high, _, mu_high) = ends
        low = mu_low * (1.0 + e_low) / b if known["mu"] is not None and known["e_n"] is not None else 0.0
        high = mu_high * (1.0 + e_high) / b
        if known["mu"] is None or known["e_n"] is None:
            high = max(high, 8.0 * (center + sd))
    kinks = series.misfit.kinks
    near = np.abs(kinks - center) <= 10.0 * sd
    kept = np.concatenate((_thinned(kinks[near], _KINKS_NEAR), _thinned(kinks[~near], _KINKS_FAR)))
    c_ends, prior = (-np.inf, np.inf), None
    if isinstance(known["c"], Unknown):
        c_ends, prior = (known["c"].lower, known["c"].upper), known["c"].prior
    places = [(center, sd), *series.misfit.local_minima(series.sigma, c_ends, prior, 4.0 * series.tail)]
    # a minimum that is next to another one is on its ladder already
    places = [p for i, p in enumerate(places) if not any(_next_to(p, q) for q in places[:i])]
    reach = np.concatenate([x + np.concatenate((-s * _LADDER, [0.0], s * _LADDER)) for x, s in places])
    edges = series.to_t(np.concatenate((kept, reach[reach > 0.0])))
    edges = np.unique(edges[(edges > low) & (edges < high)])
    # panels much narrower than the spread are no use, and the first and last kink are where regimes end
    width = crowded * min(s for _, s in places)
    scale = float(np.diff(series.to_t(np.array([max(center - 0.5 * width, 0.0), center + 0.5 * width])))[0])
    if edges.size:
        close = np.concatenate(([False], np.diff(edges) < scale))
        edges = edges[~close]
    return np.concatenate(([low], edges, [high]))


def _next_to(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two places are within a spread of each other, and alike in spread."""
    return abs(one[0] - other[0]) <= min(one[1], other[1]) and 0.2 < one[1] / other[1] < 5.0


def _thinned(kinks: Array, most: int) -> Array:
    if kinks.size <= most:
        return kinks
    return kinks[np.unique(np.linspace(0, kinks.size - 1, most).astype(int))]


def _shared(
    setting: Setting,
    unknowns: Mapping[tuple[str, int], Unknown | float],
    shared_kinds: list[str],
    apart: bool,
    series: list[Series],
) -> list[Shared]:
    """Unknowns outside the series: what these share, and a common factor of the noise."""
    found = []
    problem = setting.problem
    if problem.noise == "scaled":
        low, high = setting.bounds[""]
        factor = float(np.median(setting.start.sigma / problem.sigma))
        relative = 1.0 / math.sqrt(2.0 * max(problem.rows.value.size - 3, 1))
        unknown = Unknown("noise", low, high, None, -math.log(math.log(high / low)))
        edges = ladder(math.log(factor), relative, math.log(low), math.log(high))
        found.append(Shared("noise", unknown, Axis.of(edges, setting.order), log=True))
    for kind in shared_kinds:
        if apart and kind == "e_n":
            continue
        unknown_ = unknowns[kind, 0]
        assert isinstance(unknown_, Unknown)
        center, sd = setting.spread(kind, 0)
        if apart and kind == "mu":
            part = series[0].mu
            center, sd = setting.spread("kappa", 0)
            e_n = unknowns["e_n", 0]
            assert isinstance(e_n, Unknown)
            del part
            upper = unknown_.upper * (1.0 + e_n.lower)
            unknown_ = Unknown(unknown_.name, 0.0, upper, None, unknown_.log_scale)
        edges = ladder(center, sd, unknown_.lower, unknown_.upper)
        if kind == "mu" and series[0].e_n is not None and not isinstance(series[0].e_n, Unknown):
            kinks = np.unique(np.concatenate([s.misfit.kinks for s in series]))
            if not series[0].stretched:
                kinks = kinks * float(series[0].misfit.b(0.0)) / (1.0 + series[0].e_n)
                near = kinks[np.abs(kinks - center) <= 8.0 * sd]
                edges = np.concatenate((edges, _thinned(near, _KINKS_NEAR)))
        found.append(Shared(kind, unknown_, Axis.of(edges, setting.order)))
    return found
