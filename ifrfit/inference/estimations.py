"""Each method as an `Estimation`: what it finds of the parameters beyond the optimum that it starts from."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ifrfit.inference.diagnostics.collect import noise_converged
from ifrfit.inference.diagnostics.pooling import sharing
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.distributions.mixture import Mixture
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior import TOLERANCE, QuadraturePosterior, integrate, integrate_over_offset
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
    problem: Problem, optimum: LeastSquaresFit, tolerance: float | None = None
) -> Estimation:
    """The posterior by quadrature, and whether the data want separate constants to be shared."""
    if tolerance is None:
        tolerance = TOLERANCE if problem.error_model.is_plain else COARSE
    if problem.offset is not None:
        mixture = integrate_over_offset(problem, tolerance, optimum)
        return posterior_estimation(problem, optimum, mixture, integrate_over_offset)
    posterior = integrate(problem, start=optimum, tolerance=tolerance)
    return posterior_estimation(problem, optimum, posterior, integrate)


def posterior_estimation(
    problem: Problem,
    optimum: LeastSquaresFit,
    posterior: QuadraturePosterior | Mixture,
    integrate: Callable[[Problem], QuadraturePosterior | Mixture] | None,
) -> Estimation:
    """An integrated posterior; other questions about sharing are put to `integrate`, if there is one."""
    diagnostics = {"converged": _quadrature_converged(posterior, noise_converged(optimum))}
    shared = None if integrate is None else sharing(problem, posterior.log_evidence, integrate)
    if shared is not None:
        diagnostics["sharing"] = shared
    return Estimation("exact", posterior, diagnostics, is_posterior=True, log_evidence=posterior.log_evidence)


def _quadrature_converged(posterior: QuadraturePosterior | Mixture, noise_converged: Fact) -> Fact:
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
