"""From a problem to the integral that answers it: what separates, what series share, where to begin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.optimize.linear_families import LOWEST
from ifrfit.inference.posterior.grid_settings import GridSettings, ladder
from ifrfit.inference.posterior.initial_panels import make_series, thinned
from ifrfit.inference.posterior.joint_grid import JointIntegral, SharedParameter
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.series_integrand import SeriesIntegrand
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]

_KINDS = ("e_n", "c", "mu")
_MOST_KINKS = 48


@dataclass(frozen=True)
class IntegralLayout:
    """The integral, and which of its parts holds which constant.

    Attributes
    ----------
    joint : JointIntegral
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

    joint: JointIntegral
    tangential: tuple[int, ...]
    normal: tuple[int, ...]
    unknowns: Mapping[tuple[str, int], FreeParameter | float]
    blocks: tuple[Index, ...]
    groups: tuple[tuple[str, ...], ...]

    @property
    def apart(self) -> bool:
        """Whether e_n separates."""
        return bool(self.normal)


def make_layout(problem: Problem, start: LeastSquares, tolerance: float, *, apart: bool) -> IntegralLayout:
    """Lay the integral out.

    Parameters
    ----------
    problem : Problem
    start : LeastSquares
    tolerance : float
    apart : bool
        Take e_n apart where the data allow it; kappa takes the place of mu there.
    """
    setting = GridSettings(problem, start, tolerance)
    has_separate = any(c.separate for c in problem.parameters) and len(problem.series) > 1
    if has_separate:
        blocks = tuple(np.flatnonzero(problem.rows.series == i) for i in range(len(problem.series)))
    else:
        blocks = (np.arange(problem.rows.value.size),)
    apart = apart and e_n_is_apart(setting)
    unknowns: dict[tuple[str, int], FreeParameter | float] = {}
    shared_kinds = []
    for kind in _KINDS:
        constant = setting.constant(kind)
        for block in range(len(blocks)):
            if constant.fixed is not None:
                unknowns[kind, block] = constant.fixed
            else:
                at = setting.place(kind, block)
                assert at is not None
                unknowns[kind, block] = _serious(
                    FreeParameter.of(problem.parameters.names[at], constant), constant, problem
                )
        if has_separate and constant.fixed is None and not constant.separate:
            shared_kinds.append(kind)
    _refuse_negative_bound(setting)
    return _assemble(setting, blocks, unknowns, shared_kinds, apart)


def _serious(unknown: FreeParameter, constant: Parameter, problem: Problem) -> FreeParameter:
    """The unknown; e_n not below what is meant seriously where values are over the outgoing velocity."""
    if constant.name == "e_n" and problem.rows.has_rebound_scale:
        return replace(unknown, lower=max(unknown.lower, LOWEST))
    return unknown


def _refuse_negative_bound(setting: GridSettings) -> None:
    """A bound of the frictional impulse below zero has no transition."""
    if not setting.problem.closure.bilinear:
        return
    k = setting.problem.closure.coefficients(setting.problem.inertia_factor)
    constant = setting.constant("c")
    ends = (constant.lower, constant.upper) if constant.fixed is None else (constant.fixed, constant.fixed)
    if min(k.b0 + k.b1 * end for end in ends) < -1e-12:
        raise UsageError(
            f"The exact posterior needs {constant.name} >= {-k.b0 / k.b1:g}, where sticking has a meaning: "
            f"narrow --bounds {constant.name}, or use --method lsq."
        )


def e_n_is_apart(setting: GridSettings) -> bool:
    """Whether the rows see e_n and kappa, but nothing that ties the two."""
    problem = setting.problem
    e_n, mu = setting.constant("e_n"), setting.constant("mu")
    if e_n.fixed is not None or mu.fixed is not None or mu.prior is not None or mu.lower > 0.0:
        return False
    if e_n.separate and not mu.separate:
        return False
    kinds = {OBSERVABLES[name].kind for name in problem.rows.names}
    return bool(kinds & {"tangential", "curved"}) and "friction" not in kinds and _sees_e_n_apart(problem)


def _sees_e_n_apart(problem: Problem) -> bool:
    """Whether no row sees e_n together with the impulse."""
    for name in problem.rows.names:
        o = OBSERVABLES[name]
        if (o.kind == "tangential" and o.scale != "one") or (o.kind == "curved" and not o.without_e_n):
            return False
    return True


def _assemble(
    setting: GridSettings,
    blocks: tuple[Index, ...],
    unknowns: dict[tuple[str, int], FreeParameter | float],
    shared_kinds: list[str],
    apart: bool,
) -> IntegralLayout:
    series: list[SeriesIntegrand] = []
    groups: list[tuple[str, ...]] = []
    normal: list[int] = []
    tangential: list[int] = []
    is_normal = np.array([OBSERVABLES[n].kind == "normal" for n in setting.problem.rows.names])
    direct = is_normal[setting.problem.rows.which]
    # a common factor of the noise is integrated inside where one part has all rows, or e_n and c meet, be it
    # under a tilted bound in the domain of mu
    tied = setting.constant("e_n").fixed is not None or not _sees_e_n_apart(setting.problem)
    closure = setting.problem.closure
    tied = tied or (closure.bilinear and closure.coefficients(setting.problem.inertia_factor).b1 != 0.0)
    whole = (
        len(blocks) == 1
        and (not direct.any() or (not apart and tied))
        and setting.problem.error_model.is_plain
    )
    for block, rows in enumerate(blocks):
        known: dict[str, FreeParameter | float | None] = {kind: unknowns[kind, block] for kind in _KINDS}
        if apart:
            e_n, mu = known["e_n"], known["mu"]
            assert isinstance(e_n, FreeParameter)
            assert isinstance(mu, FreeParameter)
            kappa = FreeParameter(mu.name, 0.0, mu.upper * (1.0 + e_n.lower), None, mu.log_scale)
            known |= {"e_n": 0.0, "mu": kappa}
            rows = rows[~direct[rows]]
        for kind in shared_kinds:
            if not (apart and kind == "e_n"):
                known[kind] = None
        tangential.append(len(series))
        made, names = make_series(setting, block, rows, known, whole=whole)
        series.append(made)
        groups.append(names)
    if apart:
        own = setting.constant("e_n").separate and len(blocks) > 1
        for block in range(len(blocks) if own else 1):
            rows = blocks[block] if own else np.arange(direct.size)
            count = len(blocks) if setting.constant("mu").separate and not own else 1
            known = {"e_n": unknowns["e_n", block], "c": 0.0, "mu": 0.0}
            normal.append(len(series))
            made, names = make_series(setting, block, rows[direct[rows]], known, count)
            series.append(made)
            groups.append(names)
        if not own:
            normal = normal * len(blocks)
    joint = JointIntegral(_shared(setting, unknowns, shared_kinds, apart, series), series)
    return IntegralLayout(joint, tuple(tangential), tuple(normal), unknowns, blocks, tuple(groups))


def _shared(
    setting: GridSettings,
    unknowns: Mapping[tuple[str, int], FreeParameter | float],
    shared_kinds: list[str],
    apart: bool,
    series: list[SeriesIntegrand],
) -> list[SharedParameter]:
    """Unknowns outside the series: what these share, and a common factor of the noise."""
    found = []
    problem = setting.problem
    if problem.noise.is_scaled and not any(one.noise for one in series):
        low, high = setting.bounds[""]
        factor = float(np.median(setting.start.sigma / problem.noise.sigma))
        relative = 1.0 / math.sqrt(2.0 * max(problem.rows.value.size - 3, 1))
        unknown = FreeParameter("noise", low, high, None, -math.log(math.log(high / low)))
        edges = ladder(math.log(factor), relative, math.log(low), math.log(high))
        found.append(SharedParameter("noise", unknown, QuadratureAxis.of(edges, setting.order), log=True))
    for kind in shared_kinds:
        if apart and kind == "e_n":
            continue
        unknown_ = unknowns[kind, 0]
        assert isinstance(unknown_, FreeParameter)
        center, sd = setting.spread(kind, 0)
        if apart and kind == "mu":
            part = series[0].mu
            center, sd = setting.spread("kappa", 0)
            e_n = unknowns["e_n", 0]
            assert isinstance(e_n, FreeParameter)
            del part
            upper = unknown_.upper * (1.0 + e_n.lower)
            unknown_ = FreeParameter(unknown_.name, 0.0, upper, None, unknown_.log_scale)
        edges = ladder(center, sd, unknown_.lower, unknown_.upper)
        if kind == "mu" and series[0].e_n is not None and not isinstance(series[0].e_n, FreeParameter):
            kinks = np.unique(np.concatenate([s.misfit.kinks for s in series]))
            if not any(one.stretched for one in series):
                kinks = kinks * float(series[0].misfit.b(0.0)) / (1.0 + series[0].e_n)
                near = kinks[np.abs(kinks - center) <= 8.0 * sd]
                edges = np.concatenate((edges, thinned(near, _MOST_KINKS)))
        found.append(SharedParameter(kind, unknown_, QuadratureAxis.of(edges, setting.order)))
    return found
