"""Each method as an `Estimation`: what it finds of the parameters beyond the optimum that it starts from."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.diagnostics.nested_models import sharing
from ifrfit.inference.diagnostics.optimum_facts import NO_INTEGRAL, noise_converged
from ifrfit.inference.diagnostics.thresholds import FACTS, SAMPLED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior import (
    TOLERANCE,
    ExactPosterior,
    ImportancePosterior,
    exact_posterior,
    log_evidence,
)
from ifrfit.inference.result.estimation import Estimation, Unresolved
from ifrfit.inference.result.types import Fact

if TYPE_CHECKING:
    from ifrfit.inference.mcmc import Sample

COARSE = 1e-3  # tolerance where every node costs rows: curved ones, or all beside an error model
CHAINS = "chains.npz"
_LOST, _FEWEST = (
    1.0,
    10.0,
)  # error in sd from which, and effective draws below which, an integral says nothing


def least_squares_estimation(optimum: LeastSquaresFit) -> Estimation:
    """Least squares as a method of its own: the Gaussian approximation is its distribution."""
    return Estimation("lsq", None, {"converged": noise_converged(optimum)})


def exact_estimation(
    problem: Problem,
    optimum: LeastSquaresFit,
    *,
    integrator: str = "automatic",
    seed: int = 0,
) -> Estimation:
    """The exact posterior, and whether the data want separate constants to be shared.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquaresFit
    integrator, seed
        As `ifrfit.inference.posterior.exact_posterior`.
    """
    sums_are_few = problem.error_model.is_plain and not problem.rows.has_kind("curved")
    tolerance = TOLERANCE if sums_are_few else COARSE
    posterior = exact_posterior(problem, tolerance, optimum, integrator=integrator, seed=seed)

    def of_other(other: Problem) -> float:
        found = least_squares(other, proven=False)
        try:
            return log_evidence(other, tolerance, found)
        except UsageError as error:
            raise DataError("The evidence of another question about sharing did not converge.") from error

    return posterior_estimation(problem, optimum, posterior, of_other)


def posterior_estimation(
    problem: Problem,
    optimum: LeastSquaresFit,
    posterior: ExactPosterior,
    evidence_of: Callable[[Problem], float] | None,
) -> Estimation:
    """An integrated posterior; other questions about sharing are put to `evidence_of`, if there is one."""
    diagnostics = {"converged": _integrated(posterior, noise_converged(optimum))}
    # no odds rest on an evidence of importance sampling that did not converge
    is_doubtful = isinstance(posterior, ImportancePosterior) and not posterior.converged
    shared = None
    if evidence_of is not None and not is_doubtful:
        shared = sharing(problem, posterior.log_evidence, evidence_of)
    if shared is not None:
        diagnostics["sharing"] = shared
    if posterior.error > _LOST or posterior.n_draws < _FEWEST:
        names = (*problem.parameters.free_names, *(kappa.name for kappa in problem.parameters.kappas))
        return Estimation(
            "exact", None, diagnostics, unresolved=dict.fromkeys(names, Unresolved(NO_INTEGRAL))
        )
    return Estimation("exact", posterior, diagnostics, is_posterior=True, log_evidence=posterior.log_evidence)


def _integrated(posterior: ExactPosterior, of_noise: Fact) -> Fact:
    """Whether an integral reached its tolerance, and the noise of the least squares behind it settled."""
    figures: dict[str, Any] = {
        "error": posterior.error,
        "error_evidence": posterior.error_evidence,
        "tolerance": posterior.tolerance,
    }
    if isinstance(posterior, ImportancePosterior):
        figures |= {
            "integrator": "importance sampling",
            "effective_draws": posterior.n_draws,
            "largest_weight": posterior.largest_weight,
        }
        reached = f"standard errors of up to {100.0 * posterior.error:.2g} % of an sd"
        reached = f"{reached}, {posterior.n_draws:,.0f} effective draws"
        well = f"posterior by importance sampling: {reached}"
        failed = f"importance sampling did not converge: {reached}; --method mcmc may go on from there"
    else:
        well = f"quadrature converged: no result moves by more than {posterior.tolerance:g} of its sd"
        reached = f"{posterior.error:.0e} of a standard deviation"
        failed = f"the quadrature reached {reached} only, for {posterior.tolerance:.0e} wanted"
    rule = SAMPLED if isinstance(posterior, ImportancePosterior) else FACTS["converged"]
    says = failed if not posterior.converged else well if of_noise.ok else of_noise.says
    return Fact(posterior.converged and of_noise.ok, says, figures | dict(of_noise.figures), rule)


def sample_estimation(sample: Sample, optimum: LeastSquaresFit) -> Estimation:
    """A sample of the posterior by Markov chains, see `ifrfit.inference.mcmc.sample`."""
    from importlib.metadata import version

    return Estimation(
        "mcmc",
        sample.distribution,
        {"converged": sample.converged(noise_converged(optimum))},
        is_posterior=True,
        versions={name: version(name) for name in ("emcee", "arviz-stats")},
        files={CHAINS: sample},
    )
