"""The exact posterior of a problem: deterministic quadrature, refined until no result moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares, least_squares
from ifrfit.inference.posterior import marginals as of
from ifrfit.inference.posterior.convergence import largest_error, levels_of, panel_errors, quantiles_of
from ifrfit.inference.posterior.integral_layout import IntegralLayout, make_layout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.marginal_sources import marginals_of
from ifrfit.inference.posterior.marginals import Marginal
from ifrfit.inference.posterior.parameter_marginals import series_marginal

Array = NDArray[np.float64]

TOLERANCE = 1e-4  # of a standard deviation, and of the log evidence

_ROUNDS = 30
_CHEAP = 200_000  # values of the density up to which a grid is refined as a whole, without a rehearsal
_DEAR = 1_500_000  # values of the density beyond which a round is dear
_PATIENCE, _PATIENT = 2, 8  # rounds in which the error must halve, dear ones and others
_NOTHING = 1e-7  # share of the mass, times the tolerance, that a first look may leave out: tails can be long
_HELPED = 0.7  # share of the error before that a round may leave
_LARGEST = 6_000_000  # values of the density after which no finer grid is begun
_MOST = 25_000_000  # values that would fill the memory (some 4 GB): not begun at all
_NO_END = 1e-12  # the transition's scale is not followed beyond 1 less this
_THRESHOLDS = 256  # of a distribution function, taken at once
_RESOLUTION = 0.02  # sd: from a bound to where the density is taken
_WALL = 1e-12  # mass at the end of kappa's domain above which e_n does not separate
_CLEARLY = 1e-6  # the same on a first grid, which is not refined any further then


@dataclass(frozen=True)
class QuadraturePosterior:
    """What the data and the priors say of every constant, with the error that the quadrature reached.

    Attributes
    ----------
    problem : Problem
    log_evidence : float
        Log of the integral of the normalised likelihood times the normalised prior.
    error : float
        Largest last change of a mean, a standard deviation or a quantile at 2.5, 16, 50, 84 and 97.5 %, in
        posterior standard deviations.
    error_evidence : float
        Last change of the log evidence.
    tolerance : float
    """

    problem: Problem
    log_evidence: float
    error: float
    error_evidence: float
    tolerance: float
    plan: IntegralLayout = field(repr=False)
    grid: JointDensity = field(repr=False)
    quantities: Mapping[str, Marginal] = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Free entries of theta, kappa, and free noises."""
        return tuple(self.quantities)

    @property
    def resolution(self) -> float:
        """Width, in sd, over which a density is taken."""
        return _RESOLUTION

    @property
    def n_draws(self) -> float:
        """There is no end to its draws."""
        return math.inf

    @property
    def converged(self) -> bool:
        """Whether the wanted tolerance was reached."""
        return self.error <= self.tolerance and self.error_evidence <= self.tolerance

    @cached_property
    def _moments(self) -> dict[str, tuple[float, float]]:
        return {}  # what was asked for already

    @cached_property
    def _table(self) -> dict[str, Array]:
        return {}

    def mean(self, name: str) -> float:
        """Posterior mean."""
        return self._moment(name)[0]

    def sd(self, name: str) -> float:
        """Posterior standard deviation."""
        return self._moment(name)[1]

    def _moment(self, name: str) -> tuple[float, float]:
        if name not in self._moments:
            self._moments[name] = self.quantities[name].moments(0)
        return self._moments[name]

    def quantile(self, name: str, p: ArrayLike) -> NDArray[np.float64] | float:
        """Posterior quantiles; p scalar or array, 0 to 1."""
        wanted = np.atleast_1d(np.asarray(p, dtype=float))
        if name.startswith("transition_tau["):
            found = self._transition(name[len("transition_tau[") : -1], wanted)
            return float(found[0]) if np.ndim(p) == 0 else found
        if name not in self._table and bool(np.isin(wanted, LEVELS).all()):
            self._table[name] = self._inverted(name, np.array(LEVELS))
        if bool(np.isin(wanted, LEVELS).all()):
            found = self._table[name][np.searchsorted(LEVELS, wanted)]
        else:
            found = self._inverted(name, wanted)
        return float(found[0]) if np.ndim(p) == 0 else found

    def _inverted(self, name: str, p: Array) -> Array:
        return quantiles_of(self.quantities[name], p, self._moment(name), self.tolerance)

    def cdf(self, name: str, value: ArrayLike) -> NDArray[np.float64] | float:
        """Posterior probability below a value."""
        at = np.atleast_1d(np.asarray(value, dtype=float))
        own = self.quantities[name]
        found = np.where(at <= own.low, 0.0, np.where(at >= own.high, 1.0, 0.0))
        inside = (at > own.low) & (at < own.high)
        if inside.any():
            parts = np.array_split(at[inside], 1 + at.size // _THRESHOLDS)
            found[inside] = np.clip(np.concatenate([own.cdf(part, 1)[0] for part in parts]), 0.0, 1.0)
        return float(found[0]) if np.ndim(value) == 0 else found

    def covariance(self, names: Sequence[str]) -> Array:
        """Posterior covariance of free entries of theta, (n, n)."""
        return of.covariance(self.grid, [self.quantities[name] for name in names])

    def _transition(self, series: str, p: Array) -> Array:
        """Quantiles of the tau at which sticking ends in a series."""
        block = self.problem.series.index(series) if len(self.plan.blocks) > 1 else 0
        part = self.plan.joint.series[self.plan.tangential[block]]
        c = self.plan.unknowns["c", block]
        if part.misfit.law is not None or (part.stretched and isinstance(c, FreeParameter)):
            own = series_marginal(self.grid, self.plan.tangential[block], "tau", "tau")
            share = quantiles_of(own, p, own.moments(0), self.tolerance)
            return np.asarray(part.unit * share / np.maximum(1.0 - share, _NO_END))
        b = float(part.misfit.b(c if not isinstance(c, FreeParameter) else 0.0))
        names = [name for name in self.quantities if name.startswith("kappa")]
        name = next((n for n in names if n.endswith(f"[{series}]")), names[0])
        return np.asarray(self.quantile(name, p)) / b

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """Independent draws of all constants, kappa and free noises together, from the quadrature itself."""
        from ifrfit.inference.posterior.sampling import draw

        return draw(self, n, rng)


def integrate(
    problem: Problem,
    tolerance: float = TOLERANCE,
    start: LeastSquares | None = None,
    over: Callable[[], bool] | None = None,
) -> QuadraturePosterior:
    """Integrate the posterior of a problem.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Of means, standard deviations and quantiles in posterior standard deviations, and of the log evidence.
    start : LeastSquares, optional
        The certified optimum, where it is known already.
    over : callable, optional
        Asked before and after every round: whether to be content with what was reached.

    Returns
    -------
    Posterior

    Raises
    ------
    DataError
        Where the noise is unknown and the data cannot tell it from the constants.
    UsageError
        For a domain that reaches where sticking has no meaning, or where the grid would fill the memory.
    TimeoutError
        If `over` says so before the first round.
    """
    if start is None:
        start = least_squares(problem)
    plan = make_layout(problem, start, tolerance, apart=True)
    found = _refined(plan, problem, tolerance, over)
    if found is None or (plan.apart and touches_wall(plan, found.quantities)):
        plan = make_layout(problem, start, tolerance, apart=False)
        found = _refined(plan, problem, tolerance, over)
    assert found is not None
    return found


def touches_wall(plan: IntegralLayout, quantities: Mapping[str, Marginal], mass: float = _WALL) -> bool:
    """Whether kappa reaches the end of its domain with that mass, where the bound of mu ties it to e_n."""
    for number in set(plan.tangential):
        unknown = plan.joint.series[number].mu
        if unknown is None:
            unknown = next(s.unknown for s in plan.joint.shared if s.kind == "mu")
        assert isinstance(unknown, FreeParameter)
        for name in (n for n in quantities if n.startswith("kappa")):
            if 1.0 - quantities[name].cdf(np.array([0.999 * unknown.upper]), 1)[0, 0] > mass:
                return True
    return False


def _refined(
    plan: IntegralLayout, problem: Problem, tolerance: float, over: Callable[[], bool] | None
) -> QuadraturePosterior | None:
    """Evaluate and refine until no result moves by more than the tolerance, or nothing helps any more.

    None where the plan takes e_n apart, and kappa clearly reaches the end of its domain.
    """
    allowed = tolerance
    plan.joint.scout(_NOTHING * tolerance)
    open_ended = any(series.stretched for series in plan.joint.series)
    if plan.joint.size() > _CHEAP and open_ended:
        plan.joint.rehearse(tolerance)
    if over is not None and over():
        raise TimeoutError
    if plan.joint.size() > _MOST:
        raise UsageError(
            f"The exact posterior needs a grid of {plan.joint.size():.0e} values here, which does not "
            "fit into memory. Use --method mcmc, or fix a constant."
        )
    errors: list[float] = []
    for round_ in range(_ROUNDS):
        grid = plan.joint.evaluate()
        error_evidence = grid.evidence_error()
        last = round_ == _ROUNDS - 1 or _size(grid) > _LARGEST or (over is not None and over())
        if error_evidence <= tolerance or last:
            quantities = marginals_of(plan, grid)
            if plan.apart and open_ended and touches_wall(plan, quantities, _CLEARLY):
                return None
            error = largest_error(quantities, tolerance)
            errors.append(error)
            patience = _PATIENCE if _size(grid) > _DEAR else _PATIENT
            stuck = len(errors) > patience and error > 0.5 * errors[-1 - patience]
            if last or stuck or error <= tolerance:
                break
        # where values are many, only what carries the error is refined beyond the tolerance, while that helps
        helps = len(errors) < 2 or errors[-1] <= _HELPED * errors[-2]
        allowed *= 1.0 if helps else 0.1
        found = quantities if error_evidence <= tolerance else {}
        layout = plan.joint.layout()
        allowed = _finer(plan, grid, found, tolerance, allowed, everywhere=not helps or _size(grid) <= _CHEAP)
        if plan.joint.size() > _MOST:  # content with the last grid, and its error
            plan.joint.lay_out(layout)
            quantities = marginals_of(plan, grid)
            error = largest_error(quantities, tolerance)
            break
    log_evidence = float(grid.log_z[0])
    return QuadraturePosterior(
        problem, log_evidence, error, error_evidence, tolerance, plan, grid, quantities
    )


def _finer(
    plan: IntegralLayout,
    grid: JointDensity,
    quantities: Mapping[str, Marginal],
    tolerance: float,
    allowed: float,
    *,
    everywhere: bool,
) -> float:
    """Refine for the evidence and these quantities, with as little allowed as changes anything; that much."""
    more = panel_errors(quantities, tolerance)
    changed = plan.joint.refine(grid, allowed if everywhere else tolerance, more, allowed)
    for own in quantities.values():
        if own.split is not None:
            changed |= own.split(levels_of(own, tolerance)[0])
    while not changed and allowed > 1e-15:
        allowed *= 0.1
        changed = plan.joint.refine(grid, allowed if everywhere else tolerance, more, allowed)
    return allowed


def _size(grid: JointDensity) -> int:
    return sum(max(tensor.f.size, tensor.g[0].size) for tensor in grid.tensors)
