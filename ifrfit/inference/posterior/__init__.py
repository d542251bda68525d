"""The exact posterior by deterministic quadrature."""

from ifrfit.inference.posterior.adaptive_quadrature import TOLERANCE as TOLERANCE
from ifrfit.inference.posterior.adaptive_quadrature import integrate as integrate
from ifrfit.inference.posterior.adaptive_quadrature import log_evidence as log_evidence
from ifrfit.inference.posterior.quadrature_posterior import QuadraturePosterior as QuadraturePosterior
