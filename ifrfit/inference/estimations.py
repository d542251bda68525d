"""Each method as an `Estimation`: what it finds of the parameters beyond the optimum that it starts from."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.diagnostics.optimum_facts import noise_converged
from ifrfit.inference.diagnostics.thresholds import FACTS, SAMPLED
from ifrfit.inference.diagnostics.wider_problems import sharing
from ifrfit.inference.distributions.mixture import Mixture
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior import (
    TOLERANCE,
    ExactPosterior,
    ImportancePosterior,
    QuadraturePosterior,
    exact_posterior,
    log_evidence,
)
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.types import Fact

if TYPE_CHECKING:
    from ifrfit.inference.mcmc import Sample

COARSE = 1e-3  # tolerance where the error model is not plain: every node costs all rows
CHAINS = "chains.npz"


def least_squares_estimation(optimum: LeastSquaresFit) -> Estimation:
    """Least squares as a method of its own: the Gaussian approximation is its distribution."""
    return Estimation("lsq", None, {"converged": noise_converged(optimum)})


def exact_estimation(
    problem: Problem,
    optimum: LeastSquaresFit,
    tolerance: float | None = None,
    *,
    integrator: str = "automatic",
    seed: int = 0,
) -> Estimation:
    """The exact posterior, and whether the data want separate constants to be shared.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquaresFit
    tolerance : float, optional
        Of the quadrature.
    integrator, seed
        As `ifrfit.inference.posterior.exact_posterior`.
    """
    if tolerance is None:
        tolerance = TOLERANCE if problem.error_model.is_plain else COARSE
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
    of_noise = noise_converged(optimum)
    if isinstance(posterior, ImportancePosterior):
        diagnostics = {"converged": _by_sampling(posterior, of_noise)}
    else:
        diagnostics = {"converged": _by_grid(posterior, of_noise)}
    shared = None
    if evidence_of is not None and not _is_doubtful(posterior):
        shared = sharing(problem, posterior.log_evidence, evidence_of)
    if shared is not None:
        diagnostics["sharing"] = shared
    return Estimation("exact", posterior, diagnostics, is_posterior=True, log_evidence=posterior.log_evidence)


def _is_doubtful(posterior: ExactPosterior) -> bool:
    """Whether the evidence is one of importance sampling that did not converge: no odds rest on it."""
    return isinstance(posterior, ImportancePosterior) and not posterior.converged


def _by_grid(posterior: QuadraturePosterior | Mixture, noise_converged: Fact) -> Fact:
    """Whether the quadrature reached its tolerance, and the noise of the least squares behind it settled."""
    figures = {
        "error": posterior.error,
        "error_evidence": posterior.error_evidence,
        "tolerance": posterior.tolerance,
    } | dict(noise_converged.figures)
    reached = f"{posterior.error:.0e} of a standard deviation"
    if posterior.converged and noise_converged.ok:
        says = f"quadrature converged: no result moves by more than {posterior.tolerance:g} of its sd"
    elif not posterior.converged:
        says = f"the quadrature reached {reached} only, for {posterior.tolerance:.0e} wanted"
    else:
        says = noise_converged.says
    return Fact(posterior.converged and noise_converged.ok, says, figures, FACTS["converged"])


def _by_sampling(posterior: ImportancePosterior, noise_converged: Fact) -> Fact:
    """Whether standard errors are small and to be believed, and the noise of the least squares settled."""
    figures = {
        "error": posterior.error,
        "error_evidence": posterior.error_evidence,
        "tolerance": posterior.tolerance,
        "integrator": "importance sampling",
        "effective_draws": posterior.n_draws,
        "largest_weight": posterior.largest_weight,
    } | dict(noise_converged.figures)
    reached = f"standard errors of up to {100.0 * posterior.error:.2g} % of an sd"
    drawn = f"{posterior.n_draws:,.0f} effective draws"
    if posterior.converged and noise_converged.ok:
        says = f"posterior by importance sampling: {reached}, {drawn}"
    elif not posterior.converged:
        says = f"importance sampling did not converge: {reached}, {drawn}; --method mcmc may go on from there"
    else:
        says = noise_converged.says
    return Fact(posterior.converged and noise_converged.ok, says, figures, SAMPLED)


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
