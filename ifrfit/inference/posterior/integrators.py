"""Which integrator an exact posterior is left to: quadrature, or importance sampling where grids are large.

Section 9 of ``docs/theory/posterior.md``; why there are two: ``docs/decisions/0018-two-integrators.md``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ifrfit.errors import UsageError
from ifrfit.inference.diagnostics.thresholds import SAMPLING_ERROR
from ifrfit.inference.distributions.mixture import Mixture
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, at_fitted_offset, least_squares
from ifrfit.inference.posterior.adaptive_quadrature import (
    TOLERANCE,
    GridTooLargeError,
    integrate,
    refuse_large,
)
from ifrfit.inference.posterior.adaptive_quadrature import log_evidence as evidence_by_quadrature
from ifrfit.inference.posterior.constants_density import factorises
from ifrfit.inference.posterior.importance_posterior import TARGET, ImportancePosterior
from ifrfit.inference.posterior.integral_layout import no_grid
from ifrfit.inference.posterior.offset_mixture import integrate_over_offset
from ifrfit.inference.posterior.offset_mixture import log_evidence as evidence_over_offset
from ifrfit.inference.posterior.quadrature_posterior import QuadraturePosterior
from ifrfit.inference.posterior.transition_quadrature import TransitionPosterior, transition_posterior

if TYPE_CHECKING:
    from ifrfit.inference.posterior.importance_sampling import EvidenceByDraws

ExactPosterior = QuadraturePosterior | TransitionPosterior | ImportancePosterior | Mixture

# Values of the density that quadrature may take, each by its cost
_MOST_WORK = 5e6  # a second or so, and 0.5 GB at most
_LAST_WORK = 1e7  # where draws do not converge
_COARSELY = 1e6  # where errors of some hundredths will do, and draws are not made series by series
_OF_EVIDENCE = 5e5  # of the evidence alone, which takes few draws
_COARSER = 1e-3, 2e-3, 5e-3  # errors of a grid, in sd, that sampling would hardly beat
_OF_QUANTILES = 1e-2  # the same of quantiles, whose errors the difference of two rules exceeds by the most
_COARSE = 1e-2  # tolerance from which on quadrature has to be quicker
_OFFSETS = 40  # posteriors that a mixture over offsets of the angles takes


def exact_posterior(
    problem: Problem,
    tolerance: float = TOLERANCE,
    start: LeastSquaresFit | None = None,
    *,
    integrator: str = "automatic",
    seed: int = 0,
) -> ExactPosterior:
    """The posterior of a problem, with the error that was reached.

    By quadrature as long as its grids stay small, or end with errors of means and standard deviations below
    0.001 sd, or below 0.005 sd if they were seen to fall, and of quantiles below 0.01 sd; else by importance
    sampling, and where that does not converge either by whichever
    has the smaller error.

    Parameters
    ----------
    problem : Problem
        With or without an unknown offset of the set angles.
    tolerance : float
        Of the quadrature, see `ifrfit.inference.posterior.adaptive_quadrature.integrate`. From 0.01 on
        sampling ends at the standard error that counts as converged.
    start : LeastSquaresFit, optional
        The certified optimum, where it is known already.
    integrator : {"automatic", "quadrature", "sampling"}
    seed : int
        Of importance sampling.

    Raises
    ------
    DataError
        Where the noise is unknown and the data cannot tell it from the constants.
    UsageError
        For a domain that reaches where sticking has no meaning; by quadrature alone, where the grid would
        fill the memory, or is none (`no_grid`).
    """
    start = least_squares(problem) if start is None else start
    is_certain = not problem.free_parameters and problem.offset is None
    if integrator == "quadrature" or is_certain:
        over_offset = problem.offset is not None
        return (integrate_over_offset if over_offset else integrate)(problem, tolerance, start)
    target = SAMPLING_ERROR if tolerance >= _COARSE else TARGET
    if integrator == "sampling" or no_grid(problem):
        return sampled_posterior(problem, start, seed, target=target)
    plain = transition_posterior(problem, tolerance, start)
    if plain is not None:
        return plain
    # up to where quadrature is not slower than draws
    most_work = _COARSELY if tolerance >= _COARSE and not factorises(problem) else _MOST_WORK
    found = _grid_up_to(most_work, problem, tolerance, start)
    if found is not None and found.converged:
        return found
    sampled = sampled_posterior(problem, start, seed, target=target)
    if sampled.converged:
        return sampled
    if found is None and tolerance < _COARSE:  # rather slow than without an answer
        found = _grid_up_to(_LAST_WORK, problem, tolerance, start)
    return sampled if found is None or (not found.converged and sampled.error <= found.error) else found


def _grid_up_to(
    most_work: float, problem: Problem, tolerance: float, start: LeastSquaresFit
) -> QuadraturePosterior | Mixture | None:
    """The posterior by quadrature, with the tolerance that its errors reach; None where work is more."""
    try:
        found = _small_grid(problem, tolerance, start, most_work)
    except GridTooLargeError:
        return None
    if not found.converged:
        of_moments = max(found.error_of_moments, found.error_evidence)
        if of_moments <= (_COARSER[-1] if found.is_falling else _COARSER[0]):
            reached = max(found.error, found.error_evidence)
            if reached <= _OF_QUANTILES:
                stated = next(each for each in (*_COARSER, _OF_QUANTILES) if reached <= each)
                return replace(found, tolerance=stated)
    return found


def sampled_posterior(
    problem: Problem, start: LeastSquaresFit, seed: int = 0, *, target: float = TARGET
) -> ImportancePosterior:
    """The posterior by importance sampling; series by series where each has constants of its own.

    Parameters
    ----------
    problem : Problem
        With a free constant at least.
    start : LeastSquaresFit
    seed : int
    target : float
        Standard error, in sd, at which sampling ends.
    """
    from ifrfit.inference.posterior.factorised_sampling import sample_by_series  # a plain fit starts without
    from ifrfit.inference.posterior.importance_sampling import sample_by_importance

    sample = sample_by_series if factorises(problem) else sample_by_importance
    return sample(problem, start, seed, target=target)


def evidence_by_draws(problem: Problem, start: LeastSquaresFit) -> EvidenceByDraws:
    """Points enough for the evidence; series by series where each has constants of its own."""
    from ifrfit.inference.posterior.factorised_sampling import EvidenceBySeries  # as above
    from ifrfit.inference.posterior.importance_sampling import EvidenceByImportance

    return EvidenceBySeries(problem, start) if factorises(problem) else EvidenceByImportance(problem, start)


def log_evidence(
    problem: Problem, tolerance: float = TOLERANCE, start: LeastSquaresFit | None = None
) -> float:
    """Log of the integral of the normalised likelihood times the normalised prior, without the marginals.

    On 42 drawn tables it takes a third of the seconds of the whole posterior in the median (by grids a third,
    by draws a sixth), and differs from its log evidence by 0.014 at most.

    Parameters
    ----------
    problem : Problem
        With or without an unknown offset of the set angles.
    tolerance : float
        Of the log evidence: the last change between two rules.
    start : LeastSquaresFit, optional
        The certified optimum, where it is known already.

    Raises
    ------
    DataError, UsageError
        As `exact_posterior`; where neither integrator converges.
    """
    start = least_squares(problem) if start is None else start
    found = _evidence_by_grid(problem, tolerance, start)
    if found is not None:
        return found
    found, error = evidence_by_draws(problem, start).evidence()
    if error <= SAMPLING_ERROR:
        return found
    found = None if no_grid(problem) else _evidence_of_small_grid(problem, tolerance, start, _MOST_WORK)
    if found is None:
        raise UsageError("The log evidence did not converge: too few effective draws.")
    return found


def evidence_is_sampled(problem: Problem, tolerance: float, start: LeastSquaresFit) -> bool:
    """Whether `log_evidence` goes on to importance sampling; arguments and errors as there."""
    return _evidence_by_grid(problem, tolerance, start) is None


def _evidence_by_grid(problem: Problem, tolerance: float, start: LeastSquaresFit) -> float | None:
    """Log of the evidence by quadrature, where that is not slower than draws."""
    most_work = _MOST_WORK if factorises(problem) else _OF_EVIDENCE
    return None if no_grid(problem) else _evidence_of_small_grid(problem, tolerance, start, most_work)


def _evidence_of_small_grid(
    problem: Problem, tolerance: float, start: LeastSquaresFit, most_work: float
) -> float | None:
    """Log of the evidence by quadrature; None where the grid would be large, or does not converge."""
    try:
        if problem.offset is not None:
            _refuse_many_offsets(problem, tolerance, start, most_work)
            return evidence_over_offset(problem, tolerance, start)
        found, error = evidence_by_quadrature(problem, tolerance, start, most_work)
    except GridTooLargeError:
        return None
    return found if error <= max(_COARSER[-1], tolerance) else None


def _small_grid(
    problem: Problem, tolerance: float, start: LeastSquaresFit, most_work: float
) -> QuadraturePosterior | Mixture:
    """The posterior by quadrature.

    Raises
    ------
    GridTooLargeError
        Where its first grid would take too much work.
    """
    if problem.offset is None:
        return integrate(problem, tolerance, start, most_work=most_work)
    _refuse_many_offsets(problem, tolerance, start, most_work)
    return integrate_over_offset(problem, tolerance, start)


def _refuse_many_offsets(
    problem: Problem, tolerance: float, start: LeastSquaresFit, most_work: float
) -> None:
    """Refuse a mixture over offsets whose grids would take too much work all together."""
    at_best = at_fitted_offset(problem, start)
    refuse_large(at_best, tolerance, least_squares(at_best), most_work / _OFFSETS)
