"""The exact posterior by deterministic quadrature."""

from ifrfit.inference.posterior.adaptive_quadrature import TOLERANCE as TOLERANCE
from ifrfit.inference.posterior.adaptive_quadrature import integrate as integrate
from ifrfit.inference.posterior.offset_mixture import integrate_over_offset as integrate_over_offset
from ifrfit.inference.posterior.offset_mixture import log_evidence as log_evidence
from ifrfit.inference.posterior.quadrature_posterior import QuadraturePosterior as QuadraturePosterior
