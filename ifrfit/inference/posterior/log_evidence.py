"""The evidence alone: the integral without its marginals, in a fraction of the time."""

from __future__ import annotations

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares, least_squares
from ifrfit.inference.posterior.adaptive_quadrature import TOLERANCE, touches_wall
from ifrfit.inference.posterior.integral_layout import IntegralLayout, make_layout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.marginal_sources import marginals_of

_ROUNDS = 30
_NOTHING = 1e-7  # share of the mass, times the tolerance, that a first look may leave out


def log_evidence(problem: Problem, tolerance: float = TOLERANCE, start: LeastSquares | None = None) -> float:
    """Log of the integral of the normalised likelihood times the normalised prior.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Of the log evidence: the last change between two rules.
    start : LeastSquares, optional
        The certified optimum, where it is known already.

    Raises
    ------
    DataError, UsageError
        As `integrate`.
    """
    if start is None:
        start = least_squares(problem)
    plan = make_layout(problem, start, tolerance, apart=True)
    grid = _integrated(plan, tolerance)
    if plan.apart and touches_wall(plan, marginals_of(plan, grid)):
        grid = _integrated(make_layout(problem, start, tolerance, apart=False), tolerance)
    return float(grid.log_z[0])


def _integrated(plan: IntegralLayout, tolerance: float) -> JointDensity:
    """Refine until the evidence comes to rest, or nothing helps any more."""
    allowed = tolerance
    plan.joint.scout(_NOTHING * tolerance)
    grid = plan.joint.evaluate()
    for _ in range(_ROUNDS):
        if grid.evidence_error() <= tolerance:
            break
        changed = plan.joint.refine(grid, allowed)
        while not changed and allowed > 1e-15:
            allowed *= 0.1
            changed = plan.joint.refine(grid, allowed)
        grid = plan.joint.evaluate()
    return grid
