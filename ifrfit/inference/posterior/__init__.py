"""The exact posterior: by deterministic quadrature, and by importance sampling where that takes too much."""

from ifrfit.inference.posterior.adaptive_quadrature import TOLERANCE as TOLERANCE
from ifrfit.inference.posterior.adaptive_quadrature import integrate as integrate
from ifrfit.inference.posterior.importance_posterior import ImportancePosterior as ImportancePosterior
from ifrfit.inference.posterior.integrators import ExactPosterior as ExactPosterior
from ifrfit.inference.posterior.integrators import exact_posterior as exact_posterior
from ifrfit.inference.posterior.integrators import log_evidence as log_evidence
from ifrfit.inference.posterior.offset_mixture import integrate_over_offset as integrate_over_offset
from ifrfit.inference.posterior.quadrature_posterior import QuadraturePosterior as QuadraturePosterior
