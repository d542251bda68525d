"""From a problem to its integral: what separates, what series share, and the panels to begin with."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.model.apply_error_model import tied_to_e_n
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior.grid_settings import GridSettings, ladder
from ifrfit.inference.posterior.initial_panels import Known, make_series, thinned
from ifrfit.inference.posterior.joint_grid import JointIntegral, SharedParameter
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.series_integral import SeriesIntegral

Array = NDArray[np.float64]

_KINDS = ("e_n", "c", "mu")
_MOST_KINKS = 48


@dataclass(frozen=True)
class IntegralLayout:
    """The integral, and which of its series holds which parameter.

    Attributes
    ----------
    integral : JointIntegral
        A series integral for each block, and behind these those of a separated e_n.
    restitution_series : tuple of int
        For each block, the number of the one that holds e_n, where that is separated; empty where it is not.
    parameters : mapping
        (kind, block) to the parameter as the problem has it, or its fixed value.
    blocks : tuple of ndarray
        Rows of each block: of each series of the data where a parameter is separate, else all rows.
    kappa_names : tuple of str
        Name of kappa in each block; empty where it is known.
    noise_groups : tuple of tuple of str
        Names of the unknown noises of each series integral.
    """

    integral: JointIntegral
    restitution_series: tuple[int, ...]
    parameters: Mapping[tuple[str, int], FreeParameter | float]
    blocks: tuple[Index, ...]
    kappa_names: tuple[str, ...]
    noise_groups: tuple[tuple[str, ...], ...]

    @property
    def separable(self) -> bool:
        """Whether e_n has an integral of its own, and kappa takes the place of mu in the others."""
        return bool(self.restitution_series)


def no_grid(problem: Problem) -> str:
    """Why quadrature does not take a problem on, which importance sampling does; empty where it does."""
    if problem.common is not None:
        return (
            "Rows have errors in common (columns common1 and so on), which the quadrature does not take on. "
            "Leave --integrator out."
        )
    shaped = [f"{one.name}={one.shape}" for one in problem.parameters if one.shape is not None]
    if shaped:
        return (
            f"--prior {shaped[0]} is of a law that the quadrature does not take on. Leave --integrator out."
        )
    tied = tied_to_e_n(problem, problem.error_model)
    if tied:
        return (
            f"--angle-errors {problem.error_model.angles} with {', '.join(tied)}: the true angle ties e_n to "
            "the tangential constants, which the quadrature does not take on. Leave --integrator out, or fix "
            "e_n."
        )
    has_separate = any(c.separate for c in problem.parameters) and len(problem.series) > 1
    if has_separate and problem.noise.has_unknown and not problem.noise.separate:
        return (
            "With constants of each series the quadrature wants unknown noises of each series, too. Leave "
            "--integrator out."
        )
    return ""


def make_layout(
    problem: Problem, start: LeastSquaresFit, tolerance: float, *, separate_e_n: bool
) -> IntegralLayout:
    """Lay the integral out.

    Parameters
    ----------
    problem : Problem
    start : LeastSquaresFit
    tolerance : float
    separate_e_n : bool
        Whether to give e_n an integral of its own where the rows allow it (`e_n_is_separable`). That is exact
        where kappa does not reach the end of its domain, and takes a dimension off the grid.
    """
    settings = GridSettings(problem, start, tolerance)
    has_separate = any(c.separate for c in problem.parameters) and len(problem.series) > 1
    reason = no_grid(problem)
    if reason:
        raise UsageError(reason)
    if has_separate:
        blocks = tuple(np.flatnonzero(problem.rows.series == i) for i in range(len(problem.series)))
    else:
        blocks = (np.arange(problem.rows.value.size),)
    parameters: dict[tuple[str, int], FreeParameter | float] = {}
    shared_kinds = []
    for kind in _KINDS:
        constant = settings.parameter(kind)
        for block in range(len(blocks)):
            parameters[kind, block] = _block_parameter(settings, kind, block)
        if has_separate and constant.fixed is None and not constant.separate:
            shared_kinds.append(kind)
    _refuse_negative_bound(settings)
    is_normal = problem.rows.of_kind("normal")
    separated = separate_e_n and e_n_is_separable(settings)
    # a common factor of the noise is integrated in closed form where one series has all rows, and e_n has no
    # rows of its own or meets kappa in a row or, where b depends on c, in the domain of mu
    e_n_is_fixed = settings.parameter("e_n").fixed is not None
    tied = not separated and (
        e_n_is_fixed or any(o.ties_e_n for o in problem.rows.observables) or _bound_varies(settings)
    )
    holds_all_rows = len(blocks) == 1 and (tied or not is_normal.any()) and problem.error_model.is_plain
    if separated:
        shared_kinds = [kind for kind in shared_kinds if kind != "e_n"]
    made = []
    for block, rows in enumerate(blocks):
        known: Known = {kind: parameters[kind, block] for kind in _KINDS}
        if separated:  # kappa and c alone
            known |= {"e_n": 0.0, "mu": _kappa(parameters, block)}
            rows = rows[~is_normal[rows]]
        known |= dict.fromkeys(shared_kinds)
        made.append(make_series(settings, block, rows, known, holds_all_rows=holds_all_rows))
    restitution: tuple[int, ...] = ()
    if separated:
        own = settings.parameter("e_n").separate and len(blocks) > 1
        for block, rows in enumerate(blocks if own else (np.arange(is_normal.size),)):
            count = len(blocks) if settings.parameter("mu").separate and not own else 1
            known = {"e_n": parameters["e_n", block], "c": 0.0, "mu": 0.0}
            made.append(make_series(settings, block, rows[is_normal[rows]], known, friction_count=count))
        restitution = tuple(len(blocks) + (block if own else 0) for block in range(len(blocks)))
    series = [one for one, _ in made]
    shared = _shared_noise(settings, series)
    for kind in shared_kinds:
        is_kappa = separated and kind == "mu"
        parameter = _kappa(parameters, 0) if is_kappa else parameters[kind, 0]
        if isinstance(parameter, FreeParameter):
            places = settings.spreads("kappa" if is_kappa else kind, 0)
            shared.append(_shared_parameter(settings, kind, parameter, places, series))
    return IntegralLayout(
        JointIntegral(shared, series),
        restitution,
        parameters,
        blocks,
        tuple(kappa.name for kappa in problem.parameters.kappas[: len(blocks)]),
        tuple(names for _, names in made),
    )


def _block_parameter(settings: GridSettings, kind: str, block: int) -> FreeParameter | float:
    """A parameter of a block: its fixed value, or its domain and prior."""
    constant, at = settings.parameter(kind), settings.place(kind, block)
    if at is not None:
        constant = settings.problem.parameters.entries[at]  # single entries may be fixed
    if constant.fixed is not None or at is None:
        return constant.fixed or 0.0
    free = FreeParameter.of(settings.problem.parameters.names[at], constant)
    if kind != "e_n":
        return free
    return replace(free, lower=max(free.lower, settings.problem.rows.lowest_e_n))


def _refuse_negative_bound(settings: GridSettings) -> None:
    """A bound of the frictional impulse below zero has no transition."""
    if not settings.problem.closure.bilinear:
        return
    k = settings.problem.closure.coefficients(settings.problem.inertia_factor)
    constant = settings.parameter("c")
    if min(k.b0 + k.b1 * end for end in constant.ends) < -1e-12:
        side = ">=" if k.b1 > 0.0 else "<="
        raise UsageError(
            f"The exact posterior needs {constant.name} {side} {-k.b0 / k.b1:g}, where sticking has a "
            f"meaning: narrow --bounds {constant.name}, or use --method lsq."
        )


def e_n_is_separable(settings: GridSettings) -> bool:
    """Whether the rows see e_n and kappa, but nothing that ties the two: eq. (8) holds.

    Measured on 13 fits to the default tolerance, the whole integral takes 1.2 to 1.6 times as long as the
    separated one for a single series whose b does not depend on c, 4 times with a common factor of the noise,
    5 to 10 times under closure FR, 30 under MAW, 30 to 90 for several series with their own mu.
    """
    problem = settings.problem
    e_n, mu = settings.parameter("e_n"), settings.parameter("mu")
    places, entries = problem.parameters.positions, problem.parameters.entries
    if any(entries[place].fixed is not None for name in ("e_n", "mu") for place in places[name]):
        return False
    if mu.prior is not None or mu.lower > 0.0 or (e_n.separate and not mu.separate):
        return False
    if not problem.has_oblique or problem.rows.has_kind("friction"):
        return False
    return not (any(o.ties_e_n for o in problem.rows.observables) or _noise_is_closed_with_e_n(settings))


def _noise_is_closed_with_e_n(settings: GridSettings) -> bool:
    """Whether one integral over all parameters has a common factor of the noise in closed form, eq. (5).

    Where b depends on c and e_n has rows of its own, separating it would leave that factor as an outer axis,
    on which the grids of kappa and c differ: 200 times as long on 50 rows of beta and e_n, and not converged.
    """
    problem = settings.problem
    one_block = len(problem.series) == 1 or not any(c.separate for c in problem.parameters)
    one_factor = problem.noise.is_scaled and problem.error_model.is_plain and one_block
    return one_factor and _bound_varies(settings) and bool(problem.rows.of_kind("normal").any())


def _bound_varies(settings: GridSettings) -> bool:
    """Whether b depends on the closure constant."""
    closure = settings.problem.closure
    return closure.bilinear and closure.coefficients(settings.problem.inertia_factor).b1 != 0.0


def _kappa(parameters: Mapping[tuple[str, int], FreeParameter | float], block: int) -> FreeParameter | float:
    """kappa in the place of mu: its domain is what mu allows at every e_n."""
    e_n, mu = parameters["e_n", block], parameters["mu", block]
    if not isinstance(e_n, FreeParameter) or not isinstance(mu, FreeParameter):
        return mu
    return FreeParameter(mu.name, 0.0, mu.upper * (1.0 + e_n.lower), None, mu.log_scale)


def _shared_noise(settings: GridSettings, series: Sequence[SeriesIntegral]) -> list[SharedParameter]:
    """A common factor of the noise, where no series integrates it in closed form."""
    problem = settings.problem
    if not problem.noise.is_scaled or any(one.noise for one in series):
        return []
    low, high = settings.bounds[""]
    factor = float(np.median(settings.start.sigma / problem.noise.sigma))
    relative = 1.0 / math.sqrt(2.0 * max(problem.rows.value.size - 3, 1))
    parameter = FreeParameter("noise", low, high, None, -math.log(math.log(high / low)))
    edges = ladder([(math.log(factor), relative)], math.log(low), math.log(high))
    return [SharedParameter("noise", parameter, QuadratureAxis.of(edges, settings.order), log=True)]


def _shared_parameter(
    settings: GridSettings,
    kind: str,
    parameter: FreeParameter,
    places: Sequence[tuple[float, float]],
    series: Sequence[SeriesIntegral],
) -> SharedParameter:
    """A parameter that series share, on panels about its modes, and about kinks where these stand still."""
    edges = ladder(places, parameter.lower, parameter.upper)
    e_n = series[0].e_n
    kinks_stand_still = not any(one.is_unbounded for one in series)
    if kind == "mu" and kinks_stand_still and e_n is not None and not isinstance(e_n, FreeParameter):
        kinks = np.unique(np.concatenate([one.squares.kinks for one in series]))
        kinks = kinks * series[0].squares.coefficients.b0 / (1.0 + e_n)
        near = kinks[np.any([np.abs(kinks - center) <= 8.0 * sd for center, sd in places], axis=0)]
        edges = np.concatenate((edges, thinned(near, _MOST_KINKS)))
    return SharedParameter(kind, parameter, QuadratureAxis.of(edges, settings.order))
