"""The exact posterior by deterministic quadrature."""

from ifrfit.inference.posterior.adaptive_quadrature import TOLERANCE as TOLERANCE
from ifrfit.inference.posterior.adaptive_quadrature import QuadraturePosterior as QuadraturePosterior
from ifrfit.inference.posterior.adaptive_quadrature import integrate as integrate
from ifrfit.inference.posterior.log_evidence import log_evidence as log_evidence
