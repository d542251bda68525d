"""Whether the quadrature reached its tolerance, as a fact."""

from __future__ import annotations

from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.posterior.quadrature_posterior import QuadraturePosterior
from ifrfit.inference.result.types import Fact


def quadrature_convergence(posterior: QuadraturePosterior, noise_converged: Fact) -> Fact:
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
